"""The closed loop as a hybrid system, for any law with a ``rate``: its rates, its events, its switches.

State vector: position, velocity, integral of the error, two of the velocity filter, then the plant law's state
and the compensator law's. What only switches beside the laws' own modes is remembered in ``side``:

======================  ======================================================================================
``MOTION``              a plant law that holds at rest (Coulomb): 0 held, +1 or -1 sliding in that direction
``SIGN``                the sign of the velocity that laws without guards see; their kink lies at v = 0
``FILTERED_SIGN``       the same for a compensator behind a filter
``REFERENCE_SIGN``      the sign of the reference velocity between two of its zeros
``SATURATED``           0, or the sign of the torque while it is limited
======================  ======================================================================================

A velocity that a step's end puts on the wrong side of a zero is handed to a law that jumps there as the limit
from the remembered side, so that no rounding error decides a sign.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import (
    call_guards,
    call_holding,
    call_profile,
    call_rate,
    call_step,
    call_switch,
    kernel,
    pointer,
)
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
    NUMBERS,
    PLANT_BAND,
    PLANT_SCALE,
    SOURCE,
    TORQUE_LIMIT,
    Case,
    surroundings,
)

# ---- where things lie -------------------------------------------------------------------------------------------
# The state vector; the laws' states follow.
POSITION, VELOCITY, INTEGRAL, FILTER_1, FILTER_2, LAWS = range(6)
# The workspace w: Case.numbers, then what is remembered, the reference, the torques (the demand is the motor
# torque before its limit), the time for which the reference was taken, the velocity that everyone sees (0 while the
# axis is held), the surroundings,
# and the parameters of plant, compensator and reference.
(
    MOTION, SIGN, FILTERED_SIGN, REFERENCE_SIGN, SATURATED, THETA_D, OMEGA_D, ALPHA_D, MOTOR_TORQUE,
    FRICTION_TORQUE, COMPENSATION_TORQUE, DEMAND, REFERENCE_TIME, SEEN_VELOCITY, SURROUNDINGS,
) = range(NUMBERS, NUMBERS + 15)  # fmt: skip
TIME = SURROUNDINGS + 3
PLANT_PARAMETERS = SURROUNDINGS + 5
# The integers a: addresses of the profile and of each law's functions, sizes and places, then which state
# entries are modes.
PROFILE, PLANT, COMPENSATOR = 0, 1, 8
STEP, RATE, GUARDS, SWITCH, HOLDING = 0, 1, 2, 3, 6
PLANT_SIZE, LAWS_SIZE, COMPENSATOR_PARAMETERS, PROFILE_PARAMETERS, MODES = range(15, 20)
# Events beside the laws' modes, after them in the array of event values.
KINK, FILTER_KINK, RELEASE, LIMIT, EXTRA = range(5)
TINY = 1e-300
ROOT_2 = math.sqrt(2.0)


def arrays_of(case: Case) -> tuple[Any, Any]:
    """Integers a and workspace w of a case, laid out as above."""
    plant, compensator = case.plant, case.compensator
    place = PLANT_PARAMETERS + plant.parameters.size
    sizes = [
        plant.state.size,
        plant.state.size + compensator.state.size,
        place,
        place + compensator.parameters.size,
    ]
    integers = [
        case.profile,
        *plant.addresses,
        *compensator.addresses,
        *sizes,
        *plant.modes,
        *compensator.modes,
    ]
    remembered = np.zeros(SURROUNDINGS - NUMBERS)
    remembered[REFERENCE_TIME - NUMBERS] = math.nan
    workspace = np.concatenate(
        [
            case.numbers,
            remembered,
            surroundings(case.numbers),
            plant.parameters,
            compensator.parameters,
            case.reference_parameters,
        ]
    )
    return np.array(integers, dtype=np.int64), workspace


@kernel()
def refer(a: Any, w: Any, t: float) -> None:
    """Take the reference at t, unless it is the one at hand: stages and events often share a time."""
    if t != w[REFERENCE_TIME]:
        call_profile(a[PROFILE], t, pointer(w, a[PROFILE_PARAMETERS]), pointer(w, THETA_D))
        w[REFERENCE_TIME] = t


@kernel()
def one_sided(v: float, side: float) -> float:
    """The velocity, or its limit at zero from the remembered side."""
    if side > 0.0:
        return v if v > 0.0 else TINY
    if side < 0.0:
        return v if v < 0.0 else -TINY
    return 0.0


@kernel()
def compensator_velocity(a: Any, w: Any, y: Any) -> float:
    """The velocity that the compensator's law sees; needs the reference to be up to date."""
    filtered = w[FILTER] > 0.0
    jumps = a[COMPENSATOR + HOLDING] != 0
    if w[SOURCE] == FROM_REFERENCE:
        if filtered:
            return one_sided(y[FILTER_1], w[FILTERED_SIGN]) if jumps else y[FILTER_1]
        return one_sided(w[OMEGA_D], w[REFERENCE_SIGN])
    if filtered:
        return one_sided(y[FILTER_1], w[FILTERED_SIGN]) if jumps else y[FILTER_1]
    v = 0.0 if is_held(a, w) else y[VELOCITY]
    return one_sided(v, w[SIGN]) if jumps else v


@kernel()
def is_held(a: Any, w: Any) -> bool:
    """Whether the plant's law holds the axis at rest."""
    return a[PLANT + HOLDING] != 0 and w[MOTION] == 0.0


@kernel()
def plant_holds(a: Any, w: Any, y: Any, direction: float) -> float:
    """Largest torque that the plant's law withstands at rest, N·m."""
    return call_holding(
        a[PLANT + HOLDING],
        direction,
        pointer(y, LAWS),
        pointer(w, PLANT_PARAMETERS),
        pointer(w, SURROUNDINGS),
    )


@kernel()
def rates(a: Any, w: Any, t: float, y: Any, k: Any, row: int) -> None:
    """Write the time derivative of y into row `row` of k, and the torques; thesis eqs. 3.1, 3.3, 3.11."""
    n = y.shape[0]
    compensator = LAWS + a[PLANT_SIZE]
    refer(a, w, t)
    w[SURROUNDINGS], w[TIME] = y[POSITION], t
    v = 0.0 if is_held(a, w) else y[VELOCITY]
    w[SEEN_VELOCITY] = v
    compensation = 0.0
    if w[SOURCE] != NO_COMPENSATOR:
        seen = compensator_velocity(a, w, y)
        compensation = w[GAIN] * call_rate(
            a[COMPENSATOR + RATE],
            seen,
            pointer(y, compensator),
            pointer(w, a[COMPENSATOR_PARAMETERS]),
            pointer(w, SURROUNDINGS),
            pointer(k, row * n + compensator),
        )
        if w[FILTER] > 0.0:
            corner = w[FILTER]
            raw = w[OMEGA_D] if w[SOURCE] == FROM_REFERENCE else v
            k[row, FILTER_1] = y[FILTER_2]
            k[row, FILTER_2] = corner * corner * (raw - y[FILTER_1]) - ROOT_2 * corner * y[FILTER_2]
    error = w[THETA_D] - y[POSITION]
    demand = w[KP] * error + w[KR] * w[OMEGA_D] - w[KD] * v + w[KI] * y[INTEGRAL] + compensation
    motor = min(max(demand, -w[TORQUE_LIMIT]), w[TORQUE_LIMIT])
    if is_held(a, w):
        friction = motor
        if w[PLANT_BAND] > 0.0:
            friction = math.copysign(min(abs(motor), plant_holds(a, w, y, np.sign(motor))), motor)
        k[row, POSITION] = 0.0
        k[row, VELOCITY] = (motor - friction) / w[INERTIA]
    else:
        seen = v
        if a[PLANT + HOLDING] != 0:
            # A stage beyond the end of the motion sees the law as it is before.
            seen = w[MOTION] * max(w[MOTION] * one_sided(v, w[MOTION]), w[PLANT_BAND])
        friction = call_rate(
            a[PLANT + RATE],
            seen,
            pointer(y, LAWS),
            pointer(w, PLANT_PARAMETERS),
            pointer(w, SURROUNDINGS),
            pointer(k, row * n + LAWS),
        )
        k[row, POSITION] = v
        k[row, VELOCITY] = (motor - friction) / w[INERTIA]
    k[row, INTEGRAL] = error
    w[MOTOR_TORQUE] = motor
    w[FRICTION_TORQUE] = friction
    w[COMPENSATION_TORQUE] = compensation
    w[DEMAND] = demand


@kernel()
def held_limit(a: Any, w: Any, y: Any, direction: float) -> float:
    """Net torque that the axis at rest withstands, N·m: a feedback that jumps with the velocity reduces it."""
    limit = plant_holds(a, w, y, direction)
    if w[SOURCE] == FROM_MEASUREMENT and w[FILTER] == 0.0 and a[COMPENSATOR + HOLDING] != 0:
        place = LAWS + a[PLANT_SIZE]
        # What it adds once the axis moves, which may be less than it would withstand at rest.
        limit -= (
            w[GAIN]
            * direction
            * call_step(
                a[COMPENSATOR + STEP],
                direction * TINY,
                direction * TINY,
                0.0,
                pointer(y, place),
                pointer(w, a[COMPENSATOR_PARAMETERS]),
                pointer(w, SURROUNDINGS),
            )
        )
    return limit


@kernel()
def events(a: Any, w: Any, t: float, y: Any, k: Any, row: int, g: Any) -> float:
    """Write every event's value into g (an event is due when its value is not negative); return the largest.

    Row `row` of k is scratch: the torque is needed where the axis is held or limited.
    """
    laws = a[LAWS_SIZE]
    for i in range(laws + EXTRA):
        g[i] = -1.0
    v = y[VELOCITY]
    w[SURROUNDINGS], w[TIME] = y[POSITION], t
    if w[TORQUE_LIMIT] < np.inf or a[PLANT + HOLDING] != 0:
        rates(a, w, t, y, k, row)
        if is_held(a, w):
            if w[PLANT_BAND] > 0.0:
                gathered = abs(v) - w[PLANT_BAND]
                g[laws + RELEASE] = gathered if gathered != 0.0 else -TINY
            else:
                g[laws + RELEASE] = abs(w[MOTOR_TORQUE]) - held_limit(a, w, y, np.sign(w[MOTOR_TORQUE]))
        # At exactly the limit the mode is still the remembered one.
        beyond = (
            abs(w[DEMAND]) - w[TORQUE_LIMIT]
            if w[SATURATED] == 0.0
            else w[TORQUE_LIMIT] - w[SATURATED] * w[DEMAND]
        )
        if w[TORQUE_LIMIT] < np.inf:
            g[laws + LIMIT] = beyond if beyond != 0.0 else -TINY
    if a[PLANT + GUARDS] != 0:
        call_guards(
            a[PLANT + GUARDS],
            v,
            pointer(y, LAWS),
            pointer(w, PLANT_PARAMETERS),
            pointer(w, SURROUNDINGS),
            pointer(g, 0),
        )
    if w[SOURCE] != NO_COMPENSATOR and a[COMPENSATOR + GUARDS] != 0:
        if w[SOURCE] == FROM_REFERENCE:
            refer(a, w, t)
        call_guards(
            a[COMPENSATOR + GUARDS],
            compensator_velocity(a, w, y),
            pointer(y, LAWS + a[PLANT_SIZE]),
            pointer(w, a[COMPENSATOR_PARAMETERS]),
            pointer(w, SURROUNDINGS),
            pointer(g, a[PLANT_SIZE]),
        )
    kinked = a[PLANT + GUARDS] == 0 or (
        w[SOURCE] == FROM_MEASUREMENT and w[FILTER] == 0.0 and a[COMPENSATOR + GUARDS] == 0
    )
    if kinked and w[SIGN] != 0.0 and not is_held(a, w):
        # At exactly zero the side is still the remembered one.
        below = w[PLANT_BAND] - w[SIGN] * v
        g[laws + KINK] = below if below != 0.0 else -TINY
    if w[FILTERED_SIGN] != 0.0:
        g[laws + FILTER_KINK] = -w[FILTERED_SIGN] * y[FILTER_1] if y[FILTER_1] != 0.0 else -TINY
    largest = -1e9
    for i in range(laws + EXTRA):
        if (i >= laws or a[MODES + i] != 0) and g[i] > largest:
            largest = g[i]
    return largest


@kernel()
def switch(a: Any, w: Any, t: float, y: Any, k: Any, row: int, g: Any) -> None:
    """Change every mode whose event is due."""
    laws = a[LAWS_SIZE]
    for i in range(laws):
        if a[MODES + i] == 0:
            g[i] = -1.0
    if a[PLANT + GUARDS] != 0:
        call_switch(
            a[PLANT + SWITCH],
            y[VELOCITY],
            pointer(y, LAWS),
            pointer(w, PLANT_PARAMETERS),
            pointer(w, SURROUNDINGS),
            pointer(g, 0),
        )
    if w[SOURCE] != NO_COMPENSATOR and a[COMPENSATOR + GUARDS] != 0:
        if w[SOURCE] == FROM_REFERENCE:
            refer(a, w, t)
        call_switch(
            a[COMPENSATOR + SWITCH],
            compensator_velocity(a, w, y),
            pointer(y, LAWS + a[PLANT_SIZE]),
            pointer(w, a[COMPENSATOR_PARAMETERS]),
            pointer(w, SURROUNDINGS),
            pointer(g, a[PLANT_SIZE]),
        )
    if g[laws + FILTER_KINK] >= 0.0:
        w[FILTERED_SIGN] = -w[FILTERED_SIGN]
    if g[laws + LIMIT] >= 0.0:
        w[SATURATED] = np.sign(w[DEMAND]) if w[SATURATED] == 0.0 else 0.0
    if g[laws + KINK] >= 0.0:
        reverse(a, w, t, y, k, row)
    elif g[laws + RELEASE] >= 0.0:
        rates(a, w, t, y, k, row)
        w[MOTION] = np.sign(w[MOTOR_TORQUE]) if w[PLANT_BAND] == 0.0 else np.sign(y[VELOCITY])
        w[SIGN] = w[MOTION]


@kernel()
def reverse(a: Any, w: Any, t: float, y: Any, k: Any, row: int) -> None:
    """The velocity has reached zero: go on in the other direction, or be held there."""
    onward = -w[SIGN]
    if a[PLANT + HOLDING] != 0:
        # The applied torque is what is left without the jumps of plant and feedback at zero velocity.
        w[MOTION] = 0.0
        w[SIGN] = 0.0
        if w[PLANT_BAND] > 0.0:
            return  # at rest to everyone; the velocity goes on as the momentum that is gathered
        y[VELOCITY] = 0.0
        rates(a, w, t, y, k, row)
        applied = w[MOTOR_TORQUE]
        limit = held_limit(a, w, y, np.sign(applied))
        if abs(applied) <= limit:
            return
        if limit > 0.0:
            onward = np.sign(applied)
        w[MOTION] = onward
    w[SIGN] = onward


@kernel()
def begin_side(a: Any, w: Any, t: float, soon: float, y: Any, k: Any, row: int) -> None:
    """Set the remembered signs for a stretch that starts at t; `soon` lies inside it.

    At rest the direction is that of the applied torque just after t.
    """
    refer(a, w, soon)
    w[REFERENCE_SIGN] = np.sign(w[OMEGA_D])
    if w[FILTER] > 0.0 and w[FILTERED_SIGN] == 0.0:
        ahead = w[OMEGA_D] if w[SOURCE] == FROM_REFERENCE else y[VELOCITY]
        w[FILTERED_SIGN] = np.sign(y[FILTER_1]) if y[FILTER_1] != 0.0 else np.sign(ahead)
    if w[SIGN] == 0.0:
        if abs(y[VELOCITY]) > w[PLANT_BAND]:
            w[SIGN] = np.sign(y[VELOCITY])
            w[MOTION] = w[SIGN]
        elif not is_held(a, w):
            refer(a, w, t + 1e-9)
            # Only the reference pushes an axis at rest whose laws are at rest too.
            push = w[KP] * (w[THETA_D] - y[POSITION]) + w[KR] * w[OMEGA_D]
            w[SIGN] = np.sign(push)


@kernel()
def scale_near_rest(w: Any) -> float:
    """Velocity over which a law in the loop changes much, rad/s; 0 for none."""
    scale = w[PLANT_SCALE]
    if w[SOURCE] == FROM_MEASUREMENT and w[COMPENSATOR_SCALE] > 0.0:
        scale = min(scale, w[COMPENSATOR_SCALE]) if scale > 0.0 else w[COMPENSATOR_SCALE]
    return scale


@kernel()
def calm_step(w: Any, y: Any, acceleration: float) -> float:
    """Longest step that changes a velocity near rest by little of its scale, at the present acceleration."""
    scale = scale_near_rest(w)
    if scale > 0.0 and abs(y[VELOCITY]) < 3.0 * scale and acceleration != 0.0:
        return 0.09 * scale / abs(acceleration)
    return np.inf


@kernel()
def small_enough(w: Any, before: Any, after: Any) -> float:
    """Factor by which a step must shrink so that the velocity near rest changes by little of its scale.

    A sticking element's limit depends on s(v), which the error control does not see.
    """
    change = abs(after[VELOCITY] - before[VELOCITY])
    scale = scale_near_rest(w)
    near = min(abs(after[VELOCITY]), abs(before[VELOCITY]))
    if scale > 0.0 and near < 3.0 * scale and change > 0.1 * scale:
        return 0.09 * scale / change
    return 1.0
