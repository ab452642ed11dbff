"""The closed loop as a hybrid system, for any law with a ``rate``: its rates, and what each law sees.

State vector: position, velocity, integral of the error, two of the velocity filter, then the plant law's state
and the compensator law's. What only switches beside the laws' own modes is remembered:

======================  ======================================================================================
``motion``              a plant law that holds at rest (Coulomb): 0 held, +1 or -1 sliding in that direction
``sign``                the sign of the velocity that laws without guards see; their kink lies at v = 0
``filtered_sign``       the same for a compensator behind a filter
``reference_sign``      the sign of the reference velocity between two of its zeros
``saturated``           0, or the sign of the torque while it is limited
======================  ======================================================================================

A velocity that a step's end puts on the wrong side of a zero is handed to a law that jumps there as the limit
from the remembered side, so that no rounding error decides a sign.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import call_holding, call_profile, call_rate, kernel, pointer
from stickslip.simulation.adaptive.layout import HEAD, Loop, named
from stickslip.simulation.case_arrays import (
    COMPENSATOR_SCALE,
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    INERTIA,
    KD,
    KI,
    KP,
    KR,
    NO_COMPENSATOR,
    PLANT_BAND,
    PLANT_SCALE,
    SOURCE,
    TORQUE_LIMIT,
)

TINY = 1e-300
ROOT_2 = math.sqrt(2.0)


@kernel()
def refer(loop: Loop, t: float) -> None:
    """Take the reference at t, unless it is the one at hand: stages and events often share a time."""
    if t != loop.now.reference_time:
        call_profile(loop.case.profile, t, loop.reference, pointer(loop.now.reference, 0))
        loop.now.reference_time = t


@kernel()
def one_sided(v: float, side: float) -> float:
    """The velocity, or its limit at zero from the remembered side."""
    if side > 0.0:
        return v if v > 0.0 else TINY
    if side < 0.0:
        return v if v < 0.0 else -TINY
    return 0.0


@kernel()
def compensator_velocity(loop: Loop, y: Any) -> float:
    """The velocity that the compensator's law sees; needs the reference to be up to date."""
    n, now, state = loop.numbers, loop.now, named(y)
    filtered = n[FILTER] > 0.0
    jumps = loop.case.compensator.holding != 0
    if n[SOURCE] == FROM_REFERENCE:
        if filtered:
            return one_sided(state.filtered, now.filtered_sign) if jumps else state.filtered
        return one_sided(now.reference.velocity, now.reference_sign)
    if filtered:
        return one_sided(state.filtered, now.filtered_sign) if jumps else state.filtered
    v = 0.0 if is_held(loop) else state.velocity
    return one_sided(v, now.sign) if jumps else v


@kernel()
def is_held(loop: Loop) -> bool:
    """Whether the plant's law holds the axis at rest."""
    return loop.case.plant.holding != 0 and loop.now.motion == 0.0


@kernel()
def plant_holds(loop: Loop, y: Any, direction: float) -> float:
    """Largest torque that the plant's law withstands at rest, N·m."""
    around = pointer(loop.now.around, 0)
    return call_holding(loop.case.plant.holding, direction, pointer(y, HEAD), loop.plant, around)


@kernel()
def rates(loop: Loop, t: float, y: Any, out: Any) -> None:
    """Write the time derivative of y into `out`, and the torques; thesis eqs. 3.1, 3.3, 3.11."""
    n, now, state, rate = loop.numbers, loop.now, named(y), named(out)
    refer(loop, t)
    now.around.position, now.around.time = state.position, t
    v = 0.0 if is_held(loop) else state.velocity
    now.seen_velocity = v
    compensation = 0.0
    if n[SOURCE] != NO_COMPENSATOR:
        compensation = compensate(loop, v, y, out)
    error = now.reference.position - state.position
    demand = (
        n[KP] * error + n[KR] * now.reference.velocity - n[KD] * v + n[KI] * state.integral + compensation
    )
    motor = min(max(demand, -n[TORQUE_LIMIT]), n[TORQUE_LIMIT])
    if is_held(loop):
        friction = motor
        if n[PLANT_BAND] > 0.0:
            friction = math.copysign(min(abs(motor), plant_holds(loop, y, np.sign(motor))), motor)
        rate.position = 0.0
        rate.velocity = (motor - friction) / n[INERTIA]
    else:
        seen = v
        if loop.case.plant.holding != 0:
            # A stage beyond the end of the motion sees the law as it is before.
            seen = now.motion * max(now.motion * one_sided(v, now.motion), n[PLANT_BAND])
        around = pointer(now.around, 0)
        friction = call_rate(
            loop.case.plant.rate, seen, pointer(y, HEAD), loop.plant, around, pointer(out, HEAD)
        )
        rate.position = v
        rate.velocity = (motor - friction) / n[INERTIA]
    rate.integral = error
    now.motor_torque = motor
    now.friction_torque = friction
    now.compensation_torque = compensation
    now.demand = demand


@kernel()
def compensate(loop: Loop, v: float, y: Any, out: Any) -> float:
    """The compensator's torque, N·m; rates of its law and its filter go to `out`. `v` is the velocity seen."""
    n, now, state, rate = loop.numbers, loop.now, named(y), named(out)
    place, around = HEAD + loop.case.plant_states, pointer(now.around, 0)
    seen = compensator_velocity(loop, y)
    torque = n[GAIN] * call_rate(
        loop.case.compensator.rate, seen, pointer(y, place), loop.compensator, around, pointer(out, place)
    )
    if n[FILTER] > 0.0:
        corner = n[FILTER]
        raw = now.reference.velocity if n[SOURCE] == FROM_REFERENCE else v
        rate.filtered = state.filter_rate
        rate.filter_rate = corner * corner * (raw - state.filtered) - ROOT_2 * corner * state.filter_rate
    return torque


# ---- near rest --------------------------------------------------------------------------------------------------


@kernel()
def scale_near_rest(n: Any) -> float:
    """Velocity over which a law in the loop changes much, rad/s; 0 for none."""
    scale = n[PLANT_SCALE]
    if n[SOURCE] == FROM_MEASUREMENT and n[COMPENSATOR_SCALE] > 0.0:
        scale = min(scale, n[COMPENSATOR_SCALE]) if scale > 0.0 else n[COMPENSATOR_SCALE]
    return scale


@kernel()
def calm_step(loop: Loop) -> float:
    """Longest step that changes a velocity near rest by little of its scale, at the present acceleration."""
    scale, acceleration = scale_near_rest(loop.numbers), named(loop.rates).velocity
    if scale > 0.0 and abs(named(loop.y).velocity) < 3.0 * scale and acceleration != 0.0:
        return 0.09 * scale / abs(acceleration)
    return np.inf


@kernel()
def small_enough(loop: Loop) -> float:
    """Factor by which a step must shrink so that the velocity near rest changes by little of its scale.

    A sticking element's limit depends on s(v), which the error control does not see.
    """
    scale, before, after = scale_near_rest(loop.numbers), named(loop.y).velocity, named(loop.end).velocity
    change = abs(after - before)
    near = min(abs(after), abs(before))
    if scale > 0.0 and near < 3.0 * scale and change > 0.1 * scale:
        return 0.09 * scale / change
    return 1.0
