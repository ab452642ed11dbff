"""One implicit step of an axis under a torque, for any law: the text of the engines that take it and of the FMI export.

The axis obeys M dv/dt = T - loss v - T_position - F, with F from any law through its ``step``. Each step is
Alexander's SDIRK of order 2 (Alexander 1977, SIAM J. Numer. Anal. 14): two stages of backward Euler over which
the law sees a constant velocity. It is L-stable, so that a contact stiffer than the step resolves comes to rest
instead of ringing, and a fit may try any stiffness. A law whose torque jumps at zero velocity holds the axis
while the impulse of the stage lies within what it withstands.

The functions below are of the scalar subset. What they call of the contact (`recorded_input.contact`) is theirs who run
them: addresses of a compiled law here, the printed law in C (`stickslip.exports.fmu_axis`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from stickslip.jit import compiled_kernels
from stickslip.simulation.recorded_input import contact
from stickslip.simulation.recorded_input.contact import NUMBERS, go_on, keep, outer, start, tried, withheld
from stickslip.simulation.root import MOST, ROOT, begin, begin_beyond, improve
from stickslip.subset import Layout

GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
REST = 1.0 - GAMMA
ROUNDING = 1e-11
"""Of the velocity, above `LEAST` rad/s, to which it is solved."""
LEAST = 1e-2
MOTION = Layout(("position", "velocity", "middle"))
"""The axis's motion; middle is the velocity of the step's first stage."""
MOVING = np.dtype([(name, np.float64) for name in MOTION.scalars])
"""The same as a record."""
LAYOUTS = {"n": NUMBERS, "a": MOTION, "r": ROOT, "first": ROOT, "second": ROOT}


def stage(c: Any, n: Any, r: Any, q0: float, v0: float, torque: float, h: float, factor: float) -> float:
    """The velocity after a stage of backward Euler from q0, v0 and where the contact starts; its search has begun."""
    if n.holds > 0.0:
        guess = r.x  # as it was given: powers, which begin at rest, are not looked for where the torque jumps
        impulse = n.inertia * v0 + h * (torque - outer(n, q0))
        side = 1.0 if impulse > 0.0 else -1.0
        held = h * factor * withheld(c, side)
        if abs(impulse) <= held:
            tried(c, 0.0, h)
            return 0.0
        # What is left of the equation jumps at rest: on this side of it lies the root.
        free = (impulse - side * held) / n.inertia
        begin_beyond(r, 0.0, side * held - impulse, guess if guess * side > 0.0 else free)
    for _ in range(MOST):
        v = r.x
        applied = torque - n.loss * v - outer(n, q0 + h * v) - factor * tried(c, v, h)
        if improve(r, n.inertia * (v - v0) - h * applied) == 0.0:
            break
    return r.x


def step_on(
    c: Any, n: Any, a: Any, first: Any, second: Any, torque: float, rate: float, h: float, factor: float
) -> None:
    """Move the axis on by h under a torque that runs from `torque` at `rate`; `factor` scales friction."""
    part = GAMMA * h
    rest = REST * h
    q = a.position
    v = a.velocity
    start(c)
    begin(first, v)
    middle = stage(c, n, first, q, v, torque + rate * part, part, factor)
    # The second stage starts from the begin, moved on for `rest` with the slopes of the first.
    tried(c, middle, rest)
    go_on(c)
    base = q + rest * middle
    moved = v + rest / part * (middle - v)
    begin(second, middle + (middle - v))
    end = stage(c, n, second, base, moved, torque + rate * h, part, factor)
    keep(c)
    a.middle = middle
    a.position = base + part * end
    a.velocity = end


def compiled(given: Mapping[str, str]) -> Any:
    """`step_on` for kernels, with what it calls of the contact from these modules; other structures are addresses."""
    return compiled_kernels("step", {"step_on": step_on}, LAYOUTS, given).step_on


two_stages: Any = compiled(dict.fromkeys(contact.GIVEN, contact.__name__))
"""`step_on` with the contact of a record."""
