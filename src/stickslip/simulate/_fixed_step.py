"""One implicit step of an axis with friction, for any law through its ``step`` alone.

The end velocity solves J (v1 - v0) / h = mean over the step of (T_m - T_f). Two means are used:

* the trapezoid (A-stable, second order) where the step resolves the contact, with the step cut where the
  velocity passes through zero (Hairer, Norsett and Wanner 1993, II.6: integration with stopping at a
  discontinuity);
* Alexander's two-stage SDIRK (L-stable, second order; Alexander 1977, SIAM J. Numer. Anal. 14) where it does
  not: there the trapezoid would ring without damping. Each stage is a step of backward Euler, over which the law
  sees a constant velocity.

A law whose torque jumps at zero velocity is continued across zero by its one-sided value while a step is
solved, so that the crossing can be located. At v = 0 the axis rests while neither one-sided net torque drives
it away; a feedback compensator that jumps there takes its part of that interval (Filippov's sliding mode).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import call_holding, call_profile, call_step, kernel, pointer
from stickslip.simulate._case import (
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    GAIN,
    INERTIA,
    KD,
    KI,
    KP,
    KR,
    SAMPLE_TIME,
    SOURCE,
    TORQUE_LIMIT,
)

# ---- the state at one time: these entries, then the plant's state, then the compensator's -------------------------
(
    POSITION, VELOCITY, INTEGRAL, FILTERED, FILTER_RATE, POSITION_D, VELOCITY_D, LINEAR, HELP, MOTOR, FRICTION, SIDE,
    LEAVING, HEAD,
) = range(14)  # fmt: skip
# SIDE is the direction of motion, or at rest the one from which the axis came; LEAVING the one in which it is
# about to go (0: none); HELP includes the gain.

STEP, HOLDING = 0, 6  # places in a Side's addresses
GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
VELOCITY_ROUNDING = 1e-14  # rad/s, relative above 1 rad/s
NUDGE = 1e-11  # s, by which one-sided values of the reference lie inside the step
FINE = 0.1  # of the sliding curve's velocity scale, by which the velocity near rest may change in a step
APPROACH, LANDING, GROWTH = 0.9, 1e-3, 4.0  # of a step: how a steep compensator's zero is approached, and left


class Loop(NamedTuple):
    """What a step reads besides the state: the case, and scratch arrays."""

    numbers: Any
    plant: Any
    plant_parameters: Any
    helper: Any
    helper_parameters: Any
    profile: int
    reference_parameters: Any
    plant_states: int
    damped: bool
    steep: bool
    fine: float
    surroundings: Any
    motion: Any
    ahead: Any
    middle: Any
    base: Any


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


# ---- torques ------------------------------------------------------------------------------------------------------


@kernel()
def step_plant(loop: Loop, z: Any, v0: float, v1: float, h: float) -> float:
    """Advance the plant's law inside the state `z`; returns its torque, N·m."""
    loop.surroundings[0] = z[POSITION]
    return call_step(
        loop.plant[STEP], v0, v1, h, pointer(z, HEAD), pointer(loop.plant_parameters, 0), pointer(loop.surroundings, 0)
    )


@kernel()
def step_helper(loop: Loop, z: Any, v0: float, v1: float, h: float) -> float:
    """Advance the compensator's law inside the state `z`; returns gain times torque, N·m."""
    loop.surroundings[0] = z[POSITION]
    return loop.numbers[GAIN] * call_step(
        loop.helper[STEP], v0, v1, h, pointer(z, HEAD + loop.plant_states), pointer(loop.helper_parameters, 0),
        pointer(loop.surroundings, 0),
    )  # fmt: skip


@kernel()
def helper_jumps(loop: Loop) -> bool:
    """Whether the compensating torque jumps where the axis passes through rest."""
    n = loop.numbers
    return n[SOURCE] == FROM_MEASUREMENT and n[FILTER] == 0.0 and n[SAMPLE_TIME] == 0.0 and loop.helper[HOLDING] != 0


@kernel()
def plant_holds(loop: Loop, z: Any, side: float) -> float:
    """Friction torque of a law that jumps at zero, at rest on one side of it, N·m."""
    return side * call_holding(
        loop.plant[HOLDING], side, pointer(z, HEAD), pointer(loop.plant_parameters, 0), pointer(loop.surroundings, 0)
    )


@kernel()
def helper_holds(loop: Loop, z: Any, side: float) -> float:
    """Compensating torque of a law that jumps at zero, at rest on one side of it, N·m."""
    return loop.numbers[GAIN] * side * call_holding(
        loop.helper[HOLDING], side, pointer(z, HEAD + loop.plant_states), pointer(loop.helper_parameters, 0),
        pointer(loop.surroundings, 0),
    )  # fmt: skip


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
    """Motor torque of a controller that acts in continuous time; a sampled one holds its output."""
    if loop.numbers[SAMPLE_TIME] == 0.0:
        z[LINEAR] = linear_torque(loop.numbers, z)
        z[MOTOR] = limited(loop.numbers, z[LINEAR] + z[HELP])


@kernel()
def low_pass(n: Any, a: Any, b: Any, v0: float, v1: float, h: float, w: float) -> None:
    """Second-order Butterworth y'' = f² (v - y) - sqrt(2) f y', from state a to b; w is the weight of the end."""
    f = n[FILTER]
    slope = f * f * (v0 - a[FILTERED]) - math.sqrt(2.0) * f * a[FILTER_RATE]
    y = a[FILTERED] + h * (1.0 - w) * a[FILTER_RATE]
    rate = a[FILTER_RATE] + h * (1.0 - w) * slope
    wh = w * h
    b[FILTER_RATE] = (rate + wh * f * f * (v1 - y)) / (1.0 + wh * f * (math.sqrt(2.0) + wh * f))
    b[FILTERED] = y + wh * b[FILTER_RATE]


@kernel()
def look_ahead(loop: Loop, a: Any, t: float, h: float) -> None:
    """Write into `loop.ahead` what depends on time alone at t + h: reference and feedforward, from state a."""
    n, ahead, motion = loop.numbers, loop.ahead, loop.motion
    copy(a, ahead)
    at = pointer(motion, 0)
    parameters = pointer(loop.reference_parameters, 0)
    call_profile(loop.profile, t + min(NUDGE, 0.5 * h), parameters, at)
    v0 = motion[1]
    call_profile(loop.profile, t + h - min(NUDGE, 0.5 * h), parameters, at)
    v1 = motion[1]
    call_profile(loop.profile, t + h, parameters, at)
    ahead[POSITION_D] = motion[0]
    ahead[VELOCITY_D] = v1
    if n[SOURCE] == FROM_REFERENCE and n[SAMPLE_TIME] == 0.0:
        if n[FILTER] > 0.0:
            low_pass(n, a, ahead, v0, v1, h, 0.5)
            v0, v1 = a[FILTERED], ahead[FILTERED]
        ahead[HELP] = step_helper(loop, ahead, v0, v1, h)


@kernel()
def restart(loop: Loop, z: Any, t: float) -> None:
    """Torques of the state at t, seen from just after it: at the begin, and where the reference has a kink."""
    n, motion = loop.numbers, loop.motion
    call_profile(loop.profile, t + NUDGE, pointer(loop.reference_parameters, 0), pointer(motion, 0))
    z[POSITION_D], z[VELOCITY_D] = motion[0] - NUDGE * motion[1], motion[1]
    if n[SAMPLE_TIME] == 0.0 and n[SOURCE] != 0.0:
        v = z[VELOCITY_D] if n[SOURCE] == FROM_REFERENCE else z[VELOCITY]
        if n[FILTER] > 0.0:
            v = z[FILTERED]
        if n[SOURCE] == FROM_REFERENCE or z[VELOCITY] != 0.0:
            z[HELP] = step_helper(loop, z, v, v, 0.0)
    set_motor(loop, z)


# ---- one implicit stage -------------------------------------------------------------------------------------------


@kernel()
def close(loop: Loop, a: Any, b: Any, h: float, v1: float, side: float, w: float) -> float:
    """Complete the state b at the end of a step from a for the end velocity v1; returns the net torque there.

    w = 1/2: trapezoid, the laws see the velocity run from a's to v1; w = 1: backward Euler, they see v1.
    A law that jumps at zero keeps its value on `side` beyond it (side 0: its own declared value).
    """
    n, ahead = loop.numbers, loop.ahead
    copy(a, b)
    v0 = a[VELOCITY] if w < 1.0 else v1
    b[VELOCITY], b[LEAVING] = v1, 0.0
    b[POSITION] = a[POSITION] + h * ((1.0 - w) * a[VELOCITY] + w * v1)
    b[POSITION_D], b[VELOCITY_D] = ahead[POSITION_D], ahead[VELOCITY_D]
    error0, error1 = a[POSITION_D] - a[POSITION], b[POSITION_D] - b[POSITION]
    b[INTEGRAL] = a[INTEGRAL] + h * ((1.0 - w) * error0 + w * error1)
    over = v1 * side <= 0.0 and side != 0.0
    b[FRICTION] = step_plant(loop, b, v0, v1, h)
    if over and loop.plant[HOLDING] != 0:
        b[FRICTION] = plant_holds(loop, b, side)
    if n[SAMPLE_TIME] == 0.0:
        if n[SOURCE] == FROM_REFERENCE:
            for i in range(HEAD + loop.plant_states, b.size):
                b[i] = ahead[i]
            b[HELP], b[FILTERED], b[FILTER_RATE] = ahead[HELP], ahead[FILTERED], ahead[FILTER_RATE]
        elif n[SOURCE] == FROM_MEASUREMENT:
            y0, y1 = v0, v1
            if n[FILTER] > 0.0:
                low_pass(n, a, b, v0, v1, h, w)
                y1 = b[FILTERED]
                y0 = a[FILTERED] if w < 1.0 else y1
            b[HELP] = step_helper(loop, b, y0, y1, h)
            if over and helper_jumps(loop):
                b[HELP] = helper_holds(loop, b, side)
    set_motor(loop, b)
    return b[MOTOR] - b[FRICTION]


@kernel()
def guess(a: float, fa: float, b: float, fb: float, count: int) -> float:
    """A point between a and b, where f changes sign: the secant's, every fourth time the middle."""
    x = a - fa * (b - a) / (fb - fa)
    if count % 4 == 3 or not min(a, b) < x < max(a, b):
        x = 0.5 * (a + b)
    return x


@kernel()
def solve(loop: Loop, a: Any, b: Any, h: float, side: float, w: float) -> bool:
    """Find the end velocity of a stage from a, and complete b; False if there is none.

    Of several solutions the first one is taken in the direction in which the net torque at the present
    velocity drives: the others lie beyond a repelling one (negative slope of the torque against the velocity).
    """
    inertia, v = loop.numbers[INERTIA], a[VELOCITY]
    known = inertia * v + h * (1.0 - w) * (a[MOTOR] - a[FRICTION])
    enough = inertia * VELOCITY_ROUNDING
    low = v
    f_low = inertia * low - known - h * w * close(loop, a, b, h, low, side, w)
    if abs(f_low) <= enough * max(1.0, abs(low)):
        return True
    stride = -f_low / inertia
    high, f_high = low, f_low
    for _ in range(60):
        high = low + stride
        f_high = inertia * high - known - h * w * close(loop, a, b, h, high, side, w)
        if not math.isfinite(f_high):
            return False
        if f_high * f_low <= 0.0:
            break
        low, f_low = high, f_high
        stride *= 2.0
    if f_high * f_low > 0.0:
        return False
    for i in range(200):
        if abs(f_high) <= enough * max(1.0, abs(high)):
            return True
        x = guess(low, f_low, high, f_high, i)
        f = inertia * x - known - h * w * close(loop, a, b, h, x, side, w)
        # Illinois: the end that stays halves its weight, so that both ends approach the root.
        if f * f_high < 0.0:
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = x, f
        if abs(high - low) <= VELOCITY_ROUNDING * max(1e-3, abs(high)):
            return True
    return False


# ---- one step -----------------------------------------------------------------------------------------------------


@kernel()
def damped_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> bool:
    """Alexander's SDIRK of order 2: two stages of backward Euler, L-stable."""
    middle, base = loop.middle, loop.base
    part, rest = GAMMA * h, (1.0 - GAMMA) * h
    look_ahead(loop, a, t, part)
    if not solve(loop, a, middle, part, 0.0, 1.0):
        return False
    # The second stage starts from a, moved on for `rest` with the slopes of the first.
    copy(a, base)
    ratio = rest / part
    for i in (POSITION, VELOCITY, INTEGRAL, FILTERED, FILTER_RATE):
        base[i] = a[i] + ratio * (middle[i] - a[i])
    step_plant(loop, base, middle[VELOCITY], middle[VELOCITY], rest)
    if loop.numbers[SOURCE] == FROM_MEASUREMENT and loop.numbers[SAMPLE_TIME] == 0.0:
        v = middle[FILTERED] if loop.numbers[FILTER] > 0.0 else middle[VELOCITY]
        step_helper(loop, base, v, v, rest)
    look_ahead(loop, a, t, h)
    done = solve(loop, base, b, part, 0.0, 1.0)
    b[SIDE] = sign(b[VELOCITY])
    return done


@kernel()
def drive(loop: Loop, z: Any, side: float) -> float:
    """Net torque at rest, seen from one side of zero velocity, N·m."""
    friction, motor = z[FRICTION], z[MOTOR]
    if loop.plant[HOLDING] != 0:
        friction = plant_holds(loop, z, side)
    if helper_jumps(loop):
        motor = limited(loop.numbers, z[LINEAR] + helper_holds(loop, z, side))
    return motor - friction


@kernel()
def departure(loop: Loop, z: Any) -> float:
    """The direction in which an axis at rest leaves; 0 if it stays.

    Where both sides repel, it goes on in the direction of its arrival, or from rest with the net torque.
    """
    up, down = drive(loop, z, 1.0), -drive(loop, z, -1.0)
    if up > 0.0 and down > 0.0:
        free = z[MOTOR] if loop.plant[HOLDING] != 0 else z[MOTOR] - z[FRICTION]
        return -z[SIDE] if z[SIDE] != 0.0 else sign(free)
    if up > 0.0:
        return 1.0
    return -1.0 if down > 0.0 else 0.0


@kernel()
def leave(loop: Loop, z: Any, side: float) -> None:
    """Let the axis leave rest towards `side`: the torques are those on that side of zero velocity."""
    z[LEAVING] = side
    if loop.plant[HOLDING] != 0:
        z[FRICTION] = plant_holds(loop, z, side)
    if helper_jumps(loop):
        z[HELP] = helper_holds(loop, z, side)
        set_motor(loop, z)


@kernel()
def rest_for(loop: Loop, a: Any, b: Any, t: float, h: float) -> None:
    """Stay at rest from a to b: a plant that holds gives the torque that balances the motor's."""
    look_ahead(loop, a, t, h)
    close(loop, a, b, h, 0.0, 0.0, 0.5)
    b[SIDE] = 0.0
    if loop.plant[HOLDING] != 0:
        b[FRICTION] = b[MOTOR]


@kernel()
def rest_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> float:
    """Rest over h, or until the torque breaks the contact away; returns the time taken (b holds the end)."""
    if loop.plant[HOLDING] != 0:
        a[FRICTION] = a[MOTOR]
    rest_for(loop, a, b, t, h)
    side = departure(loop, b)
    if side == 0.0:
        return h
    low, high = 0.0, h
    f_low, f_high = side * drive(loop, a, side), side * drive(loop, b, side)
    if f_low >= 0.0:  # both sides repel from the begin: only the direction was open
        copy(a, b)
        leave(loop, b, side)
        return 0.0
    for i in range(60):
        x = guess(low, f_low, high, f_high, i)
        rest_for(loop, a, b, t, x)
        f = side * drive(loop, b, side)
        if f < 0.0:
            low, f_low, f_high = x, f, 0.5 * f_high
        else:
            high, f_high, f_low = x, f, 0.5 * f_low
        if abs(f) <= 1e-14 or high - low <= 1e-13 * h:
            break
    leave(loop, b, side)
    return x


@kernel()
def near_rest(loop: Loop, v0: float, v1: float) -> float:
    """Factor by which a step shrinks so that the velocity near rest changes by little of the curve's scale.

    A sticking element breaks away where s(v) falls to its load, and s falls within that scale.
    """
    scale, change = loop.fine, abs(v1 - v0)
    if change <= FINE * scale or min(abs(v0), abs(v1)) > 3.0 * scale:
        return 1.0
    return 0.9 * FINE * scale / change


@kernel()
def moving_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> tuple[float, bool]:
    """A step of the trapezoid, cut where the velocity passes through zero; time taken (< 0: no solution), cut."""
    side = sign(a[VELOCITY]) if a[VELOCITY] != 0.0 else a[LEAVING]
    jumping = side if loop.plant[HOLDING] != 0 or helper_jumps(loop) else 0.0
    look_ahead(loop, a, t, h)
    if not solve(loop, a, b, h, jumping, 0.5):
        return -1.0, False
    for _ in range(10):
        shorter = h * near_rest(loop, a[VELOCITY], b[VELOCITY])
        if shorter == h:
            break
        h = shorter
        look_ahead(loop, a, t, h)
        if not solve(loop, a, b, h, jumping, 0.5):
            return -1.0, False
    if side == 0.0 or b[VELOCITY] * side > 0.0:
        b[SIDE] = sign(b[VELOCITY])
        return h, False
    if a[VELOCITY] == 0.0:  # it grazed: the drive to `side` fell again within the step
        rest_for(loop, a, b, t, h)
        return h, False
    low, high, f_low, f_high = 0.0, h, side * a[VELOCITY], side * b[VELOCITY]
    x = h
    for i in range(60):
        x = guess(low, f_low, high, f_high, i)
        look_ahead(loop, a, t, x)
        if not solve(loop, a, b, x, jumping, 0.5):
            return -1.0, False
        f = side * b[VELOCITY]
        if f > 0.0:
            low, f_low, f_high = x, f, 0.5 * f_high
        else:
            high, f_high, f_low = x, f, 0.5 * f_low
        if abs(f) <= VELOCITY_ROUNDING or high - low <= 1e-13 * h:
            break
    if loop.steep and x > LANDING * h:
        x *= APPROACH
        look_ahead(loop, a, t, x)
        solved = solve(loop, a, b, x, jumping, 0.5)
        b[SIDE] = side
        return (x, False) if solved and side * b[VELOCITY] > 0.0 else (-1.0, False)
    look_ahead(loop, a, t, x)
    close(loop, a, b, x, 0.0, jumping, 0.5)
    b[SIDE] = side
    return x, True


@kernel()
def advance(loop: Loop, a: Any, b: Any, t: float, h: float, cap: float) -> tuple[float, bool]:
    """One step from a to b, at most h long (in motion at most cap); time taken (< 0: no solution), ended by an event.
    """
    if loop.damped:
        return (h, False) if damped_step(loop, a, b, t, h) else (-1.0, False)
    if a[VELOCITY] == 0.0 and a[LEAVING] == 0.0 and (loop.plant[HOLDING] != 0 or helper_jumps(loop)):
        side = departure(loop, a)
        if side == 0.0:
            taken = rest_step(loop, a, b, t, h)
            return taken, b[LEAVING] != 0.0
        leave(loop, a, side)
    return moving_step(loop, a, b, t, min(h, cap))
