"""What a fixed step reads and writes: the state at one time, the torques on it, what depends on time alone.

A law is advanced by its ``step`` inside the state, so a trial step works on a copy. Filters are second-order
Butterworth low-passes, advanced by the same means as the axis.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

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

# ---- the state at one time: these entries, then the plant's state, then the compensator's -----------------
(
    POSITION, VELOCITY, INTEGRAL, FILTERED, FILTER_RATE, POSITION_D, VELOCITY_D, LINEAR, COMPENSATING, MOTOR,
    FRICTION, SIDE, LEAVING, GATHERED, HEAD,
) = range(15)  # fmt: skip
# SIDE is the direction of motion, or at rest the one from which the axis came; LEAVING the one in which it is
# about to go (0: none); COMPENSATING includes the gain. GATHERED is, at rest in a band of velocities (Karnopp), the
# momentum gathered there over the inertia, rad/s.

STEP, HOLDING = 0, 6  # places in `Side.addresses`
TIME = 3  # place in the surroundings
TINY = 1e-300
NUDGE = 1e-11  # s, by which one-sided values of the reference lie inside the step


class Loop(NamedTuple):
    """What a step reads besides the state: the case, and scratch arrays."""

    numbers: Any
    plant: Any
    plant_parameters: Any
    compensator: Any
    compensator_parameters: Any
    profile: int
    reference_parameters: Any
    plant_states: int
    damped: bool
    steep: bool
    resolved: float
    travel: float
    fine: float
    surroundings: Any
    motion: Any
    ahead: Any
    middle: Any
    base: Any
    nodes: Any
    searches: Any


@kernel()
def copy(source: Any, target: Any) -> None:
    """Copy a state."""
    for i in range(source.size):
        target[i] = source[i]


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
    loop.surroundings[0] = z[POSITION]
    return call_step(
        loop.plant[STEP],
        v0,
        v1,
        h,
        pointer(z, HEAD),
        pointer(loop.plant_parameters, 0),
        pointer(loop.surroundings, 0),
    )


@kernel()
def step_compensator(loop: Loop, z: Any, v0: float, v1: float, h: float) -> float:
    """Advance the compensator's law inside the state `z`; returns gain times torque, N·m."""
    loop.surroundings[0] = z[POSITION]
    state = pointer(z, HEAD + loop.plant_states)
    p, u = pointer(loop.compensator_parameters, 0), pointer(loop.surroundings, 0)
    return loop.numbers[GAIN] * call_step(loop.compensator[STEP], v0, v1, h, state, p, u)


@kernel()
def compensator_jumps(loop: Loop) -> bool:
    """Whether the compensating torque jumps where the axis passes through rest."""
    n = loop.numbers
    return n[SOURCE] == FROM_MEASUREMENT and n[FILTER] == 0.0 and loop.compensator[HOLDING] != 0


@kernel()
def plant_holds(loop: Loop, z: Any, side: float) -> float:
    """Friction torque of a law that jumps at zero, at rest on one side of it, N·m."""
    return side * call_holding(
        loop.plant[HOLDING],
        side,
        pointer(z, HEAD),
        pointer(loop.plant_parameters, 0),
        pointer(loop.surroundings, 0),
    )


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
    error = z[POSITION_D] - z[POSITION]
    return n[KP] * error + n[KR] * z[VELOCITY_D] - n[KD] * z[VELOCITY] + n[KI] * z[INTEGRAL]


@kernel()
def limited(n: Any, torque: float) -> float:
    """The torque within the motor's limit, N·m."""
    return min(max(torque, -n[TORQUE_LIMIT]), n[TORQUE_LIMIT])


@kernel()
def set_motor(loop: Loop, z: Any) -> None:
    """Motor torque of the controller."""
    z[LINEAR] = linear_torque(loop.numbers, z)
    z[MOTOR] = limited(loop.numbers, z[LINEAR] + z[COMPENSATING])


@kernel()
def low_pass(n: Any, a: Any, b: Any, v0: float, v1: float, h: float, w: float) -> None:
    """Second-order Butterworth y'' = f² (v - y) - sqrt(2) f y', from a to b; w is the weight of the end."""
    f = n[FILTER]
    slope = f * f * (v0 - a[FILTERED]) - math.sqrt(2.0) * f * a[FILTER_RATE]
    y = a[FILTERED] + h * (1.0 - w) * a[FILTER_RATE]
    rate = a[FILTER_RATE] + h * (1.0 - w) * slope
    wh = w * h
    b[FILTER_RATE] = (rate + wh * f * f * (v1 - y)) / (1.0 + wh * f * (math.sqrt(2.0) + wh * f))
    b[FILTERED] = y + wh * b[FILTER_RATE]


@kernel()
def look_ahead(loop: Loop, a: Any, t: float, h: float) -> None:
    """Write into `loop.ahead` what depends on time alone at t + h: reference and feedforward."""
    n, ahead, motion = loop.numbers, loop.ahead, loop.motion
    copy(a, ahead)
    at = pointer(motion, 0)
    parameters = pointer(loop.reference_parameters, 0)
    call_profile(loop.profile, t + min(NUDGE, 0.5 * h), parameters, at)
    v0 = motion[1]
    call_profile(loop.profile, t + h - min(NUDGE, 0.5 * h), parameters, at)
    v1 = motion[1]
    call_profile(loop.profile, t + h, parameters, at)
    loop.surroundings[TIME] = t + h
    ahead[POSITION_D] = motion[0]
    ahead[VELOCITY_D] = v1
    if n[SOURCE] == FROM_REFERENCE:
        if n[FILTER] > 0.0:
            low_pass(n, a, ahead, v0, v1, h, 0.5)
            v0, v1 = a[FILTERED], ahead[FILTERED]
        ahead[COMPENSATING] = step_compensator(loop, ahead, v0, v1, h)


@kernel()
def restart(loop: Loop, z: Any, t: float) -> None:
    """Torques at t, seen from just after it: at the begin, and where the reference has a kink."""
    n, motion = loop.numbers, loop.motion
    loop.surroundings[TIME] = t
    call_profile(loop.profile, t + NUDGE, pointer(loop.reference_parameters, 0), pointer(motion, 0))
    z[POSITION_D], z[VELOCITY_D] = motion[0] - NUDGE * motion[1], motion[1]
    if n[SOURCE] != 0.0:
        v = z[VELOCITY_D] if n[SOURCE] == FROM_REFERENCE else z[VELOCITY]
        if n[FILTER] > 0.0:
            v = z[FILTERED]
        if n[SOURCE] == FROM_REFERENCE or z[VELOCITY] != 0.0:
            z[COMPENSATING] = step_compensator(loop, z, v, v, 0.0)
    set_motor(loop, z)
