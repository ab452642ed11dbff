"""The events of the hybrid loop, and what switches at them."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.jit import call_guards, call_step, call_switch, kernel, pointer
from stickslip.simulation.adaptive.hybrid import (
    TINY,
    compensator_velocity,
    is_held,
    plant_holds,
    rates,
    refer,
)
from stickslip.simulation.adaptive.layout import EVENTS, HEAD, SCRATCH, Loop, due_in, named
from stickslip.simulation.case_arrays import (
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    KP,
    KR,
    NO_COMPENSATOR,
    PLANT_BAND,
    SOURCE,
    TORQUE_LIMIT,
)

EXTRA = len(EVENTS.names or ())


@kernel()
def torques(loop: Loop, t: float, y: Any) -> None:
    """The torques at a state; its rates are not kept."""
    rates(loop, t, y, pointer(loop.rates, SCRATCH * loop.case.states))


@kernel()
def held_limit(loop: Loop, y: Any, direction: float) -> float:
    """Net torque that the axis at rest withstands, N·m: a feedback that jumps with the velocity reduces it."""
    n, compensator = loop.numbers, loop.case.compensator
    limit = plant_holds(loop, y, direction)
    if n[SOURCE] == FROM_MEASUREMENT and n[FILTER] == 0.0 and compensator.holding != 0:
        v, z = direction * TINY, pointer(y, HEAD + loop.case.plant_states)
        torque = call_step(compensator.step, v, v, 0.0, z, loop.compensator, pointer(loop.now.around, 0))
        # What it adds once the axis moves, which may be less than it would withstand at rest.
        limit -= n[GAIN] * direction * torque
    return limit


# ---- events -----------------------------------------------------------------------------------------------------


@kernel()
def events(loop: Loop, t: float, y: Any) -> float:
    """Write every event's value into ``due`` (an event is due when its value is not negative); return the largest.

    The torque is needed where the axis is held or limited.
    """
    n, now, case, state, extra = loop.numbers, loop.now, loop.case, named(y), due_in(loop)
    laws = case.law_states
    for i in range(laws + EXTRA):
        loop.due[i] = -1.0
    v = state.velocity
    now.around.position, now.around.time = state.position, t
    if n[TORQUE_LIMIT] < np.inf or case.plant.holding != 0:
        torques(loop, t, y)
        if is_held(loop):
            if n[PLANT_BAND] > 0.0:
                gathered = abs(v) - n[PLANT_BAND]
                extra.release = gathered if gathered != 0.0 else -TINY
            else:
                extra.release = abs(now.motor_torque) - held_limit(loop, y, np.sign(now.motor_torque))
        # At exactly the limit the mode is still the remembered one.
        beyond = (
            abs(now.demand) - n[TORQUE_LIMIT]
            if now.saturated == 0.0
            else n[TORQUE_LIMIT] - now.saturated * now.demand
        )
        if n[TORQUE_LIMIT] < np.inf:
            extra.limit = beyond if beyond != 0.0 else -TINY
    guard(loop, t, y)
    kinked = case.plant.guards == 0 or (
        n[SOURCE] == FROM_MEASUREMENT and n[FILTER] == 0.0 and case.compensator.guards == 0
    )
    if kinked and now.sign != 0.0 and not is_held(loop):
        # At exactly zero the side is still the remembered one.
        below = n[PLANT_BAND] - now.sign * v
        extra.kink = below if below != 0.0 else -TINY
    if now.filtered_sign != 0.0:
        extra.filter_kink = -now.filtered_sign * state.filtered if state.filtered != 0.0 else -TINY
    largest = -1e9
    for i in range(laws + EXTRA):
        if (i >= laws or loop.modes[i] != 0.0) and loop.due[i] > largest:
            largest = loop.due[i]
    return largest


@kernel()
def guard(loop: Loop, t: float, y: Any) -> None:
    """Write the event values of the laws' modes into ``due``."""
    case, around = loop.case, pointer(loop.now.around, 0)
    if case.plant.guards != 0:
        v = named(y).velocity
        call_guards(case.plant.guards, v, pointer(y, HEAD), loop.plant, around, loop.due)
    if loop.numbers[SOURCE] != NO_COMPENSATOR and case.compensator.guards != 0:
        if loop.numbers[SOURCE] == FROM_REFERENCE:
            refer(loop, t)
        z, due = pointer(y, HEAD + case.plant_states), pointer(loop.due, case.plant_states)
        v = compensator_velocity(loop, y)
        call_guards(case.compensator.guards, v, z, loop.compensator, around, due)


# ---- switches ---------------------------------------------------------------------------------------------------


@kernel()
def switch(loop: Loop, t: float, y: Any) -> None:
    """Change every mode whose event is due."""
    now, case, extra = loop.now, loop.case, due_in(loop)
    around = pointer(now.around, 0)
    for i in range(case.law_states):
        if loop.modes[i] == 0.0:
            loop.due[i] = -1.0
    if case.plant.guards != 0:
        v = named(y).velocity
        call_switch(case.plant.switch, v, pointer(y, HEAD), loop.plant, around, loop.due)
    if loop.numbers[SOURCE] != NO_COMPENSATOR and case.compensator.guards != 0:
        if loop.numbers[SOURCE] == FROM_REFERENCE:
            refer(loop, t)
        z, due = pointer(y, HEAD + case.plant_states), pointer(loop.due, case.plant_states)
        v = compensator_velocity(loop, y)
        call_switch(case.compensator.switch, v, z, loop.compensator, around, due)
    if extra.filter_kink >= 0.0:
        now.filtered_sign = -now.filtered_sign
    if extra.limit >= 0.0:
        now.saturated = np.sign(now.demand) if now.saturated == 0.0 else 0.0
    if extra.kink >= 0.0:
        reverse(loop, t, y)
    elif extra.release >= 0.0:
        torques(loop, t, y)
        now.motion = (
            np.sign(now.motor_torque) if loop.numbers[PLANT_BAND] == 0.0 else np.sign(named(y).velocity)
        )
        now.sign = now.motion


@kernel()
def reverse(loop: Loop, t: float, y: Any) -> None:
    """The velocity has reached zero: go on in the other direction, or be held there."""
    now = loop.now
    onward = -now.sign
    if loop.case.plant.holding != 0:
        # The applied torque is what is left without the jumps of plant and feedback at zero velocity.
        now.motion = 0.0
        now.sign = 0.0
        if loop.numbers[PLANT_BAND] > 0.0:
            return  # at rest to everyone; the velocity goes on as the momentum that is gathered
        named(y).velocity = 0.0
        torques(loop, t, y)
        applied = now.motor_torque
        limit = held_limit(loop, y, np.sign(applied))
        if abs(applied) <= limit:
            return
        if limit > 0.0:
            onward = np.sign(applied)
        now.motion = onward
    now.sign = onward


@kernel()
def begin_side(loop: Loop, t: float, soon: float, y: Any) -> None:
    """Set the remembered signs for an interval that starts at t; `soon` lies inside it.

    At rest the direction is that of the applied torque just after t.
    """
    n, now, state = loop.numbers, loop.now, named(y)
    refer(loop, soon)
    now.reference_sign = np.sign(now.reference.velocity)
    if n[FILTER] > 0.0 and now.filtered_sign == 0.0:
        ahead = now.reference.velocity if n[SOURCE] == FROM_REFERENCE else state.velocity
        now.filtered_sign = np.sign(state.filtered) if state.filtered != 0.0 else np.sign(ahead)
    if now.sign == 0.0:
        if abs(state.velocity) > n[PLANT_BAND]:
            now.sign = np.sign(state.velocity)
            now.motion = now.sign
        elif not is_held(loop):
            refer(loop, t + 1e-9)
            # Only the reference pushes an axis at rest whose laws are at rest too.
            push = n[KP] * (now.reference.position - state.position) + n[KR] * now.reference.velocity
            now.sign = np.sign(push)
