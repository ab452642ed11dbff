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

from stickslip.jit import call_guards, call_holding, call_profile, call_rate, call_switch, kernel, pointer
from stickslip.simulate._case import (
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
    PLANT_SCALE,
    SOURCE,
    TORQUE_LIMIT,
    Case,
)

MOTION, SIGN, FILTERED_SIGN, REFERENCE_SIGN, SATURATED, SIDES = range(6)
POSITION, VELOCITY, INTEGRAL, FILTER_1, FILTER_2, LAWS = range(6)
# Events beside the laws' modes, after them in the array of event values.
KINK, FILTER_KINK, RELEASE, LIMIT, EXTRA = range(5)
# Offsets of the addresses: the profile, then step, rate, guards, switch, steady, sliding, holding of each law.
PROFILE, PLANT, COMPENSATOR = 0, 1, 8
RATE, GUARDS, SWITCH, HOLDING = 1, 2, 3, 6
MOTOR_TORQUE, FRICTION_TORQUE, COMPENSATION_TORQUE, DEMAND = range(4)
TINY = 1e-300
ROOT_2 = math.sqrt(2.0)


def arrays_of(case: Case) -> tuple[Any, ...]:
    """What the kernels below call `loop`: addresses, sizes, numbers, parameters, scratch."""
    addresses = np.concatenate([[case.profile], case.plant.addresses, case.compensator.addresses])
    sizes = np.array([case.plant.state.size, case.compensator.state.size], dtype=np.int64)
    modes = np.concatenate([case.plant.modes, case.compensator.modes])
    surroundings = np.array([0.0, 1.0, 20.0])
    return (
        addresses,
        sizes,
        modes,
        case.numbers,
        case.plant.parameters,
        case.compensator.parameters,
        case.reference_parameters,
        surroundings,
        np.zeros(SIDES),
        np.zeros(3),  # reference: position, velocity, acceleration
        np.zeros(4),  # torques: motor, friction, compensation, demand before the limit
    )


@kernel()
def one_sided(v: float, side: float) -> float:
    """The velocity, or its limit at zero from the remembered side."""
    if side > 0.0:
        return v if v > 0.0 else TINY
    if side < 0.0:
        return v if v < 0.0 else -TINY
    return 0.0


@kernel()
def compensator_velocity(loop: Any, y: Any) -> float:
    """The velocity that the compensator's law sees; needs the reference to be up to date."""
    addresses, _, _, numbers, _, _, _, _, side, reference, _ = loop
    filtered = numbers[FILTER] > 0.0
    jumps = addresses[COMPENSATOR + HOLDING] != 0
    if numbers[SOURCE] == FROM_REFERENCE:
        if filtered:
            return one_sided(y[FILTER_1], side[FILTERED_SIGN]) if jumps else y[FILTER_1]
        return one_sided(reference[1], side[REFERENCE_SIGN])
    if filtered:
        return one_sided(y[FILTER_1], side[FILTERED_SIGN]) if jumps else y[FILTER_1]
    return one_sided(y[VELOCITY], side[SIGN]) if jumps else y[VELOCITY]


@kernel()
def is_held(loop: Any) -> bool:
    """Whether the plant's law holds the axis at rest."""
    addresses, side = loop[0], loop[8]
    return addresses[PLANT + HOLDING] != 0 and side[MOTION] == 0.0


@kernel()
def rates(loop: Any, t: float, y: Any, k: Any, row: int) -> None:
    """Write the time derivative of y into row `row` of k, and the torques; thesis eqs. 3.1, 3.3, 3.11."""
    addresses, sizes, _, numbers, pp, pc, pr, u, side, reference, torque = loop
    n = y.shape[0]
    compensator = LAWS + sizes[0]
    call_profile(addresses[PROFILE], t, pointer(pr, 0), pointer(reference, 0))
    u[0] = y[POSITION]
    v = y[VELOCITY]
    helped = 0.0
    if numbers[SOURCE] != NO_COMPENSATOR:
        seen = compensator_velocity(loop, y)
        helped = numbers[GAIN] * call_rate(
            addresses[COMPENSATOR + RATE],
            seen,
            pointer(y, compensator),
            pointer(pc, 0),
            pointer(u, 0),
            pointer(k, row * n + compensator),
        )
        if numbers[FILTER] > 0.0:
            w = numbers[FILTER]
            raw = reference[1] if numbers[SOURCE] == FROM_REFERENCE else v
            k[row, FILTER_1] = y[FILTER_2]
            k[row, FILTER_2] = w * w * (raw - y[FILTER_1]) - ROOT_2 * w * y[FILTER_2]
    error = reference[0] - y[POSITION]
    demand = numbers[KP] * error + numbers[KR] * reference[1] - numbers[KD] * v + numbers[KI] * y[INTEGRAL] + helped
    motor = min(max(demand, -numbers[TORQUE_LIMIT]), numbers[TORQUE_LIMIT])
    if is_held(loop):
        friction = motor
        k[row, POSITION] = 0.0
        k[row, VELOCITY] = 0.0
    else:
        seen = one_sided(v, side[MOTION]) if addresses[PLANT + HOLDING] != 0 else v
        friction = call_rate(
            addresses[PLANT + RATE],
            seen,
            pointer(y, LAWS),
            pointer(pp, 0),
            pointer(u, 0),
            pointer(k, row * n + LAWS),
        )
        k[row, POSITION] = v
        k[row, VELOCITY] = (motor - friction) / numbers[INERTIA]
    k[row, INTEGRAL] = error
    torque[MOTOR_TORQUE] = motor
    torque[FRICTION_TORQUE] = friction
    torque[COMPENSATION_TORQUE] = helped
    torque[DEMAND] = demand


@kernel()
def held_limit(loop: Any, y: Any, direction: float) -> float:
    """Net torque that the axis at rest withstands, N·m: a feedback that jumps with the velocity reduces it."""
    addresses, sizes, _, numbers, pp, pc, _, u, _, _, _ = loop
    limit = call_holding(addresses[PLANT + HOLDING], direction, pointer(y, LAWS), pointer(pp, 0), pointer(u, 0))
    if (
        numbers[SOURCE] == FROM_MEASUREMENT
        and numbers[FILTER] == 0.0
        and addresses[COMPENSATOR + HOLDING] != 0
    ):
        place = LAWS + sizes[0]
        limit -= numbers[GAIN] * call_holding(
            addresses[COMPENSATOR + HOLDING], direction, pointer(y, place), pointer(pc, 0), pointer(u, 0)
        )
    return limit


@kernel()
def events(loop: Any, t: float, y: Any, k: Any, row: int, g: Any) -> float:
    """Write every event's value into g (an event is due when its value is not negative); return the largest.

    Row `row` of k is scratch: the torque is needed where the axis is held or limited.
    """
    addresses, sizes, modes, numbers, pp, pc, pr, u, side, reference, torque = loop
    laws = sizes[0] + sizes[1]
    for i in range(laws + EXTRA):
        g[i] = -1.0
    v = y[VELOCITY]
    u[0] = y[POSITION]
    if numbers[TORQUE_LIMIT] < np.inf or addresses[PLANT + HOLDING] != 0:
        rates(loop, t, y, k, row)
        if is_held(loop):
            g[laws + RELEASE] = abs(torque[MOTOR_TORQUE]) - held_limit(loop, y, np.sign(torque[MOTOR_TORQUE]))
        if side[SATURATED] == 0.0:
            g[laws + LIMIT] = abs(torque[DEMAND]) - numbers[TORQUE_LIMIT]
        else:
            g[laws + LIMIT] = numbers[TORQUE_LIMIT] - side[SATURATED] * torque[DEMAND]
        if numbers[TORQUE_LIMIT] == np.inf:
            g[laws + LIMIT] = -1.0
    if addresses[PLANT + GUARDS] != 0:
        call_guards(addresses[PLANT + GUARDS], v, pointer(y, LAWS), pointer(pp, 0), pointer(u, 0), pointer(g, 0))
    if numbers[SOURCE] != NO_COMPENSATOR and addresses[COMPENSATOR + GUARDS] != 0:
        if numbers[SOURCE] == FROM_REFERENCE:
            call_profile(addresses[PROFILE], t, pointer(pr, 0), pointer(reference, 0))
        call_guards(
            addresses[COMPENSATOR + GUARDS],
            compensator_velocity(loop, y),
            pointer(y, LAWS + sizes[0]),
            pointer(pc, 0),
            pointer(u, 0),
            pointer(g, sizes[0]),
        )
    kinked = addresses[PLANT + GUARDS] == 0 or (
        numbers[SOURCE] == FROM_MEASUREMENT and numbers[FILTER] == 0.0 and addresses[COMPENSATOR + GUARDS] == 0
    )
    if kinked and side[SIGN] != 0.0 and not is_held(loop):
        g[laws + KINK] = -side[SIGN] * v
    if side[FILTERED_SIGN] != 0.0:
        g[laws + FILTER_KINK] = -side[FILTERED_SIGN] * y[FILTER_1]
    largest = -1e9
    for i in range(laws + EXTRA):
        if (i >= laws or modes[i]) and g[i] > largest:
            largest = g[i]
    return largest


@kernel()
def switch(loop: Any, t: float, y: Any, k: Any, row: int, g: Any) -> None:
    """Change every mode whose event is due."""
    addresses, sizes, modes, numbers, pp, pc, pr, u, side, reference, torque = loop
    laws = sizes[0] + sizes[1]
    for i in range(laws):
        if not modes[i]:
            g[i] = -1.0
    if addresses[PLANT + GUARDS] != 0:
        call_switch(
            addresses[PLANT + SWITCH], y[VELOCITY], pointer(y, LAWS), pointer(pp, 0), pointer(u, 0), pointer(g, 0)
        )
    if numbers[SOURCE] != NO_COMPENSATOR and addresses[COMPENSATOR + GUARDS] != 0:
        if numbers[SOURCE] == FROM_REFERENCE:
            call_profile(addresses[PROFILE], t, pointer(pr, 0), pointer(reference, 0))
        call_switch(
            addresses[COMPENSATOR + SWITCH],
            compensator_velocity(loop, y),
            pointer(y, LAWS + sizes[0]),
            pointer(pc, 0),
            pointer(u, 0),
            pointer(g, sizes[0]),
        )
    if g[laws + FILTER_KINK] >= 0.0:
        side[FILTERED_SIGN] = -side[FILTERED_SIGN]
    if g[laws + LIMIT] >= 0.0:
        side[SATURATED] = np.sign(torque[DEMAND]) if side[SATURATED] == 0.0 else 0.0
    if g[laws + KINK] >= 0.0:
        reverse(loop, t, y, k, row)
    elif g[laws + RELEASE] >= 0.0:
        rates(loop, t, y, k, row)
        side[MOTION] = np.sign(torque[MOTOR_TORQUE])
        side[SIGN] = side[MOTION]


@kernel()
def reverse(loop: Any, t: float, y: Any, k: Any, row: int) -> None:
    """The velocity has reached zero: go on in the other direction, or be held there."""
    addresses, side, torque = loop[0], loop[8], loop[10]
    onward = -side[SIGN]
    if addresses[PLANT + HOLDING] != 0:
        # The applied torque is what is left without the jumps of plant and feedback at zero velocity.
        y[VELOCITY] = 0.0
        side[MOTION] = 0.0
        side[SIGN] = 0.0
        rates(loop, t, y, k, row)
        applied = torque[MOTOR_TORQUE]
        limit = held_limit(loop, y, np.sign(applied))
        if abs(applied) <= limit:
            return
        if limit > 0.0:
            onward = np.sign(applied)
        side[MOTION] = onward
    side[SIGN] = onward


@kernel()
def begin_side(loop: Any, t: float, soon: float, y: Any, k: Any, row: int) -> None:
    """Set the remembered signs for a stretch that starts at t; `soon` lies inside it.

    At rest the direction is that of the applied torque just after t.
    """
    addresses, _, _, numbers, _, _, pr, _, side, reference, torque = loop
    call_profile(addresses[PROFILE], soon, pointer(pr, 0), pointer(reference, 0))
    side[REFERENCE_SIGN] = np.sign(reference[1])
    if numbers[FILTER] > 0.0 and side[FILTERED_SIGN] == 0.0:
        ahead = reference[1] if numbers[SOURCE] == FROM_REFERENCE else y[VELOCITY]
        side[FILTERED_SIGN] = np.sign(y[FILTER_1]) if y[FILTER_1] != 0.0 else np.sign(ahead)
    if side[SIGN] == 0.0:
        if y[VELOCITY] != 0.0:
            side[SIGN] = np.sign(y[VELOCITY])
            side[MOTION] = side[SIGN]
        elif not is_held(loop):
            call_profile(addresses[PROFILE], t + 1e-9, pointer(pr, 0), pointer(reference, 0))
            # Only the reference pushes an axis at rest whose laws are at rest too.
            push = numbers[KP] * (reference[0] - y[POSITION]) + numbers[KR] * reference[1]
            side[SIGN] = np.sign(push)


@kernel()
def small_enough(loop: Any, before: Any, after: Any) -> float:
    """Factor by which a step must shrink so that the velocity near rest changes by little of its scale.

    A sticking element's limit depends on s(v), which the error control does not see.
    """
    numbers = loop[3]
    change = abs(after[VELOCITY] - before[VELOCITY])
    scale = numbers[PLANT_SCALE]
    if numbers[SOURCE] == FROM_MEASUREMENT and numbers[COMPENSATOR_SCALE] > 0.0:
        scale = min(scale, numbers[COMPENSATOR_SCALE]) if scale > 0.0 else numbers[COMPENSATOR_SCALE]
    near = min(abs(after[VELOCITY]), abs(before[VELOCITY]))
    if scale > 0.0 and near < 3.0 * scale and change > 0.1 * scale:
        return 0.09 * scale / change
    return 1.0
