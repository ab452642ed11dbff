"""Steps made wrong on purpose: what a run shows that it is sensitive to (`stickslip.simulation.accuracy`)."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import PERTURBATION
from stickslip.simulation.exact.state import (
    ELEMENT_SIZE,
    ELEMENTS,
    FORCE,
    POSITION,
    SLIPS,
    STIFFNESS,
    VELOCITY,
)

LASTING, LEAST = 1e-4, 1e-3
"""A step that is shorter than this (s) is perturbed by as much less, but by no less than this share."""


@kernel(exact=False)
def perturbation(
    parameters: Any, plan: Any, elements: Any, loop: Any, h: float, tol: float, switched: bool
) -> None:  # fmt: skip
    """Move the axis after a step of h by PERTURBATION times what the step may be wrong by; springs that stick follow.

    Always along the motion, or always against it: such errors add up, and in a limit cycle shift its phase.
    """
    distance = parameters[PERTURBATION] * tol * min(1.0, LEAST + h / LASTING)
    if loop[VELOCITY] < 0.0:
        distance = -distance
    loop[POSITION] += distance
    if not switched:
        return
    # After a switch the springs are set up anew from the elements' forces.
    for i in range(int(plan[ELEMENTS])):
        if elements[i * ELEMENT_SIZE + SLIPS] == 0.0:
            elements[i * ELEMENT_SIZE + FORCE] += elements[i * ELEMENT_SIZE + STIFFNESS] * distance
