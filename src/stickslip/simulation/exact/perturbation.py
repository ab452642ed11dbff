"""Steps made wrong on purpose: what a run shows that it is sensitive to (`stickslip.simulation.accuracy`)."""

from __future__ import annotations

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import PERTURBATION
from stickslip.simulation.exact.state import Loop, element_of

LASTING, LEAST = 1e-4, 1e-3
"""A step that is shorter than this (s) is perturbed by as much less, but by no less than this share."""


@kernel(exact=False)
def perturbation(loop: Loop, h: float, tol: float, switched: bool) -> None:
    """Move the axis after a step of h by PERTURBATION times what the step may be wrong by; springs that stick follow.

    Always along the motion, or always against it: such errors add up, and in a limit cycle shift its phase.
    """
    now = loop.now
    distance = loop.parameters[PERTURBATION] * tol * min(1.0, LEAST + h / LASTING)
    if now.velocity < 0.0:
        distance = -distance
    now.position += distance
    if not switched:
        return
    # After a switch the springs are set up anew from the elements' forces.
    for i in range(loop.plan.elements):
        e = element_of(loop, i)
        if e.slips == 0:
            e.force += e.stiffness * distance
