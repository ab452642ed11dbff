"""The torques on an axis at one time, and what depends on time alone.

A law is advanced by its ``step`` inside the state, so a step that is tried works on a copy. Filters are second-order
Butterworth low-passes, advanced by the same means as the axis.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import call_holding, call_profile, call_step, kernel, pointer
from stickslip.simulation.case_arrays import (
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    KD,
    KI,
    KP,
    KR,
    PLANT_BAND,
    SOURCE,
    TORQUE_LIMIT,
)
from stickslip.simulation.fixed.layout import HEAD, Loop

TINY = 1e-300
NUDGE = 1e-11  # s, by which one-sided values of the reference lie inside the step


@kernel()
def copy(loop: Loop, source: Any, target: Any) -> None:
    """Copy a state with those of its laws."""
    old, new = pointer(source, 0), pointer(target, 0)
    for i in range(loop.case.size):
        new[i] = old[i]


@kernel()
def sign(x: float) -> float:
    """+1, -1, or 0."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return 0.0


# ---- torques ----------------------------------------------------------------------------------------------


@kernel()
def step_plant(loop: Loop, z: Any, v0: float, v1: float, h: float) -> float:
    """Advance the plant's law inside the state `z`; returns its torque, N·m."""
    around = loop.now.around
    around.position = z.position
    return call_step(loop.case.plant.step, v0, v1, h, pointer(z, HEAD), loop.plant, pointer(around, 0))


@kernel()
def step_compensator(loop: Loop, z: Any, v0: float, v1: float, h: float) -> float:
    """Advance the compensator's law inside the state `z`; returns gain times torque, N·m."""
    around, case = loop.now.around, loop.case
    around.position = z.position
    state = pointer(z, HEAD + case.plant_states)
    return loop.numbers[GAIN] * call_step(
        case.compensator.step, v0, v1, h, state, loop.compensator, pointer(around, 0)
    )


@kernel()
def compensator_jumps(loop: Loop) -> bool:
    """Whether the compensating torque jumps where the axis passes through rest."""
    n = loop.numbers
    return n[SOURCE] == FROM_MEASUREMENT and n[FILTER] == 0.0 and loop.case.compensator.holding != 0


@kernel()
def plant_holds(loop: Loop, z: Any, side: float) -> float:
    """Friction torque of a law that jumps at zero, at rest on one side of it, N·m."""
    around = pointer(loop.now.around, 0)
    return side * call_holding(loop.case.plant.holding, side, pointer(z, HEAD), loop.plant, around)


@kernel()
def plant_slides(loop: Loop, z: Any, side: float) -> float:
    """Friction torque of a law that jumps at zero as it sets off to one side, N·m."""
    v = side * max(loop.numbers[PLANT_BAND], TINY)
    return step_plant(loop, z, v, v, 0.0)


@kernel()
def compensator_slides(loop: Loop, z: Any, side: float) -> float:
    """Compensating torque of a law that jumps at zero, on one side of it, N·m."""
    return step_compensator(loop, z, side * TINY, side * TINY, 0.0)


@kernel()
def linear_torque(n: Any, z: Any) -> float:
    """Torque of the linear controller, N·m; thesis eqs. 3.4, 3.5 and 3.11."""
    error = z.reference - z.position
    return n[KP] * error + n[KR] * z.reference_rate - n[KD] * z.velocity + n[KI] * z.integral


@kernel()
def limited(n: Any, torque: float) -> float:
    """The torque within the motor's limit, N·m."""
    return min(max(torque, -n[TORQUE_LIMIT]), n[TORQUE_LIMIT])


@kernel()
def set_motor(loop: Loop, z: Any) -> None:
    """Motor torque of the controller."""
    z.linear = linear_torque(loop.numbers, z)
    z.motor = limited(loop.numbers, z.linear + z.compensating)


@kernel()
def low_pass(n: Any, a: Any, b: Any, v0: float, v1: float, h: float, w: float) -> None:
    """Second-order Butterworth y'' = f² (v - y) - sqrt(2) f y', from a to b; w is the weight of the end."""
    f = n[FILTER]
    slope = f * f * (v0 - a.filtered) - math.sqrt(2.0) * f * a.filter_rate
    y = a.filtered + h * (1.0 - w) * a.filter_rate
    rate = a.filter_rate + h * (1.0 - w) * slope
    wh = w * h
    b.filter_rate = (rate + wh * f * f * (v1 - y)) / (1.0 + wh * f * (math.sqrt(2.0) + wh * f))
    b.filtered = y + wh * b.filter_rate


@kernel()
def refer(loop: Loop, t: float) -> None:
    """Ask for the reference at t."""
    call_profile(loop.case.profile, t, loop.reference, pointer(loop.now.reference, 0))


@kernel()
def look_ahead(loop: Loop, a: Any, t: float, h: float) -> None:
    """Write into `loop.ahead` what depends on time alone at t + h: reference and feedforward."""
    n, ahead, asked = loop.numbers, loop.ahead, loop.now.reference
    copy(loop, a, ahead)
    refer(loop, t + min(NUDGE, 0.5 * h))
    v0 = asked.velocity
    refer(loop, t + h - min(NUDGE, 0.5 * h))
    v1 = asked.velocity
    refer(loop, t + h)
    loop.now.around.time = t + h
    ahead.reference = asked.position
    ahead.reference_rate = v1
    if n[SOURCE] == FROM_REFERENCE:
        if n[FILTER] > 0.0:
            low_pass(n, a, ahead, v0, v1, h, 0.5)
            v0, v1 = a.filtered, ahead.filtered
        ahead.compensating = step_compensator(loop, ahead, v0, v1, h)


@kernel()
def restart(loop: Loop, z: Any, t: float) -> None:
    """Torques at t, seen from just after it: at the begin, and where the reference has a kink."""
    n, asked = loop.numbers, loop.now.reference
    loop.now.around.time = t
    refer(loop, t + NUDGE)
    z.reference, z.reference_rate = asked.position - NUDGE * asked.velocity, asked.velocity
    if n[SOURCE] != 0.0:
        v = z.reference_rate if n[SOURCE] == FROM_REFERENCE else z.velocity
        if n[FILTER] > 0.0:
            v = z.filtered
        if n[SOURCE] == FROM_REFERENCE or z.velocity != 0.0:
            z.compensating = step_compensator(loop, z, v, v, 0.0)
    set_motor(loop, z)
