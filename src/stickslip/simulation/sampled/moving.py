"""What a contact that jumps at rest takes of an axis that moves: the torque of sliding, not what it holds at rest."""

from __future__ import annotations

from stickslip.jit import call_holding, call_step, kernel
from stickslip.simulation.recorded_input.contact import Plant

TINY = 1e-300
"""rad/s, beside rest."""


@kernel(inline=True)
def withheld(c: Plant, side: float) -> float:
    """The torque against slow sliding, N·m: more would stop an axis that its momentum carries on.

    A step's equation has both for solutions, rest and the motion that goes on; short steps lead to this one.
    In a band about rest (Karnopp's) the law says by itself what holds.
    """
    if c.band > 0.0:
        return call_holding(c.holding, side, c.base, c.parameters, c.surroundings)
    for i in range(c.states):
        c.trial[i] = c.base[i]
    return side * call_step(c.step, side * TINY, side * TINY, 0.0, c.trial, c.parameters, c.surroundings)
