"""One implicit step of an axis with friction, for any law through its ``step`` alone.

The end velocity solves J (v1 - v0) / h = mean over the step of (T_m - T_f). Two means are used:

* the trapezoid (A-stable, second order) where the step resolves the contact, with the step cut where the
  velocity passes through zero (Hairer, Norsett and Wanner 1993, II.6: integration with stopping at a
  discontinuity);
* Alexander's two-stage SDIRK (L-stable, second order; Alexander 1977, SIAM J. Numer. Anal. 14) where it
  does not: there the trapezoid would ring without damping. Each stage is a step of backward Euler, over which
  the law sees a constant velocity.

A law whose torque jumps at zero velocity is continued across zero by its one-sided value while a step is
solved, so that the crossing can be located. At v = 0 the axis rests while neither one-sided net torque drives
it away; a feedback compensator that jumps there takes its part of that interval (Filippov's sliding mode).
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel, pointer
from stickslip.simulation.case_arrays import (
    FILTER,
    FROM_MEASUREMENT,
    FROM_REFERENCE,
    INERTIA,
    PLANT_BAND,
    SOURCE,
)
from stickslip.simulation.fixed.layout import HEAD, Loop
from stickslip.simulation.fixed.loop import (
    compensator_jumps,
    compensator_slides,
    copy,
    limited,
    look_ahead,
    low_pass,
    plant_holds,
    plant_slides,
    set_motor,
    sign,
    step_compensator,
    step_plant,
)
from stickslip.simulation.root import MOST, SOLVED
from stickslip.simulation.root import compiled as root

GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
begin, begin_beyond, improve = root.begin, root.begin_beyond, root.improve
FINE = 0.1  # of the sliding curve's velocity scale, by which the velocity near rest may change in a step
APPROACH = 0.9  # of the time to the zero of a steep compensator's velocity, in which it is approached
UNSEEN = 0.003  # of the travel up to break-away, which a damped step near rest may hide
LANDING, GROWTH = 1e-3, 4.0  # of a step: the first one after that zero, and the growth of those that follow


# ---- one implicit stage -----------------------------------------------------------------------------------


@kernel()
def close(loop: Loop, a: Any, b: Any, h: float, v1: float, side: float, w: float) -> float:
    """Complete the state b at the end of a step from a for the end velocity v1; returns the net torque there.

    w = 1/2: trapezoid, the laws see the velocity run from a's to v1; w = 1: backward Euler, they see v1.
    A law that jumps at zero keeps its value on `side` beyond it (side 0: its own declared value).
    """
    n, ahead = loop.numbers, loop.ahead
    copy(loop, a, b)
    v0 = a.velocity if w < 1.0 else v1
    b.velocity, b.leaving = v1, 0.0
    b.position = a.position + h * ((1.0 - w) * a.velocity + w * v1)
    b.reference, b.reference_rate = ahead.reference, ahead.reference_rate
    error0, error1 = a.reference - a.position, b.reference - b.position
    b.integral = a.integral + h * ((1.0 - w) * error0 + w * error1)
    over = v1 * side <= n[PLANT_BAND] and side != 0.0
    b.friction = step_plant(loop, b, v0, v1, h)
    if over and loop.case.plant.holding != 0:
        b.friction = plant_slides(loop, b, side)
    if n[SOURCE] == FROM_REFERENCE:
        old, new = pointer(ahead, 0), pointer(b, 0)
        for i in range(HEAD + loop.case.plant_states, loop.case.size):
            new[i] = old[i]
        b.compensating, b.filtered, b.filter_rate = (
            ahead.compensating,
            ahead.filtered,
            ahead.filter_rate,
        )
    elif n[SOURCE] == FROM_MEASUREMENT:
        y0, y1 = v0, v1
        if n[FILTER] > 0.0:
            low_pass(n, a, b, v0, v1, h, w)
            y1 = b.filtered
            y0 = a.filtered if w < 1.0 else y1
        b.compensating = step_compensator(loop, b, y0, y1, h)
        if over and compensator_jumps(loop):
            b.compensating = compensator_slides(loop, b, side)
    set_motor(loop, b)
    return b.motor - b.friction


@kernel()
def solve(loop: Loop, a: Any, b: Any, h: float, side: float, w: float) -> bool:
    """Find the end velocity of a stage from a, and complete b; False if there is none.

    Of several solutions the first one is taken in the direction in which the net torque at the present
    velocity drives: the others lie beyond a repelling one, where the torque falls steeply with the velocity.
    """
    inertia, v, search = loop.numbers[INERTIA], a.velocity, loop.search
    r = pointer(search, 0)
    known = inertia * v + h * (1.0 - w) * (a.motor - a.friction)
    begin(r, v)
    for _ in range(MOST):
        f = inertia * search.x - known - h * w * close(loop, a, b, h, search.x, side, w)
        if improve(r, f) == 0.0:
            return math.isfinite(f)
    return False


@kernel()
def look_for(loop: Loop, f_low: float, h: float, f_high: float) -> None:
    """Begin to look for the time within a step at which an event happens: from f_low at its begin to f_high at h."""
    begin_beyond(pointer(loop.crossing, 0), 0.0, f_low, h)
    improve(pointer(loop.crossing, 0), f_high)


# ---- one step ---------------------------------------------------------------------------------------------


@kernel()
def damped_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> bool:
    """Alexander's SDIRK of order 2: two stages of backward Euler, L-stable."""
    middle, base = loop.middle, loop.base
    part, rest = GAMMA * h, (1.0 - GAMMA) * h
    look_ahead(loop, a, t, part)
    if not solve(loop, a, middle, part, 0.0, 1.0):
        return False
    # The second stage starts from a, moved on for `rest` with the slopes of the first.
    copy(loop, a, base)
    ratio = rest / part
    base.position = a.position + ratio * (middle.position - a.position)
    base.velocity = a.velocity + ratio * (middle.velocity - a.velocity)
    base.integral = a.integral + ratio * (middle.integral - a.integral)
    base.filtered = a.filtered + ratio * (middle.filtered - a.filtered)
    base.filter_rate = a.filter_rate + ratio * (middle.filter_rate - a.filter_rate)
    step_plant(loop, base, middle.velocity, middle.velocity, rest)
    if loop.numbers[SOURCE] == FROM_MEASUREMENT:
        v = middle.filtered if loop.numbers[FILTER] > 0.0 else middle.velocity
        step_compensator(loop, base, v, v, rest)
    look_ahead(loop, a, t, h)
    done = solve(loop, base, b, part, 0.0, 1.0)
    b.side = sign(b.velocity)
    return done


@kernel()
def drive(loop: Loop, z: Any, side: float) -> float:
    """Net torque at rest, seen from one side of zero velocity, N·m."""
    friction, motor = z.friction, z.motor
    if loop.case.plant.holding != 0:
        friction = plant_holds(loop, z, side)
    if compensator_jumps(loop):
        motor = limited(loop.numbers, z.linear + compensator_slides(loop, z, side))
    return motor - friction


@kernel()
def departure(loop: Loop, z: Any) -> float:
    """The direction in which an axis at rest leaves; 0 if it stays.

    Where both sides repel, it goes on in the direction of its arrival, or from rest with the net torque.
    """
    up, down = drive(loop, z, 1.0), -drive(loop, z, -1.0)
    if up > 0.0 and down > 0.0:
        free = z.motor if loop.case.plant.holding != 0 else z.motor - z.friction
        return -z.side if z.side != 0.0 else sign(free)
    if up > 0.0:
        return 1.0
    return -1.0 if down > 0.0 else 0.0


@kernel()
def leave(loop: Loop, z: Any, side: float) -> None:
    """Let the axis leave rest towards `side`: the torques are those on that side of zero velocity."""
    z.leaving = side
    if loop.case.plant.holding != 0:
        z.friction = plant_slides(loop, z, side)
    if compensator_jumps(loop):
        z.compensating = compensator_slides(loop, z, side)
        set_motor(loop, z)


@kernel()
def rest_for(loop: Loop, a: Any, b: Any, t: float, h: float) -> None:
    """Stay at rest from a to b: a plant that holds gives the torque that balances the motor's."""
    look_ahead(loop, a, t, h)
    close(loop, a, b, h, 0.0, 0.0, 0.5)
    b.side = 0.0
    if loop.case.plant.holding != 0:
        b.friction = b.motor


@kernel()
def rest_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> float:
    """Rest over h, or until the torque breaks the contact away; returns the time taken (b holds the end)."""
    if loop.case.plant.holding != 0:
        a.friction = a.motor
    rest_for(loop, a, b, t, h)
    side = departure(loop, b)
    if side == 0.0:
        return h
    before, after = side * drive(loop, a, side), side * drive(loop, b, side)
    if before >= 0.0:  # both sides repel from the begin: only the direction was open
        copy(loop, a, b)
        leave(loop, b, side)
        return 0.0
    r = loop.crossing
    look_for(loop, before, h, after)
    for _ in range(MOST):
        if r.phase == SOLVED:
            break
        rest_for(loop, a, b, t, r.x)
        improve(pointer(r, 0), side * drive(loop, b, side))
    leave(loop, b, side)
    return r.x


@kernel()
def unbalanced(loop: Loop, z: Any) -> float:
    """What the motor's torque exceeds the holding torque by, N·m; sets the friction torque of a contact at rest."""
    direction = sign(z.motor)
    z.friction = direction * min(abs(z.motor), direction * plant_holds(loop, z, direction))
    return z.motor - z.friction


@kernel()
def gather(loop: Loop, a: Any, b: Any, t: float, h: float, before: float) -> float:
    """Rest in the band from a to b while the momentum gathers; how far its velocity lies above the band, rad/s."""
    rest_for(loop, a, b, t, h)
    push = 0.5 * h * (before + unbalanced(loop, b))
    b.gathered = a.gathered + push / loop.numbers[INERTIA]
    return abs(b.gathered) - loop.numbers[PLANT_BAND]


@kernel()
def band_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> tuple[float, bool]:
    """Rest in the band over h, or until the gathered momentum leaves it; the time taken, and whether it left."""
    before = unbalanced(loop, a)
    after = gather(loop, a, b, t, h, before)
    if after <= 0.0:
        return h, False
    r = loop.crossing
    look_for(loop, min(abs(a.gathered) - loop.numbers[PLANT_BAND], 0.0), h, after)
    for _ in range(MOST):
        if r.phase == SOLVED:
            break
        improve(pointer(r, 0), gather(loop, a, b, t, r.x, before))
    side = sign(b.gathered)
    b.velocity, b.gathered = side * loop.numbers[PLANT_BAND], 0.0
    set_motor(loop, b)
    leave(loop, b, side)
    return r.x, True


@kernel()
def enter_band(loop: Loop, b: Any, side: float) -> None:
    """Come to rest in the band, at its edge; the velocity goes on as gathered momentum."""
    b.velocity, b.gathered, b.leaving = 0.0, side * loop.numbers[PLANT_BAND], 0.0
    set_motor(loop, b)
    unbalanced(loop, b)


@kernel()
def near_rest(loop: Loop, v0: float, v1: float) -> float:
    """Factor by which a step shrinks so that the velocity near rest changes by little of the curve's scale.

    A sticking element breaks away where s(v) falls to its load, and s falls within that scale.
    """
    scale, change = loop.case.fine, abs(v1 - v0)
    if change <= FINE * scale or min(abs(v0), abs(v1)) > 3.0 * scale:
        return 1.0
    return 0.9 * FINE * scale / change


@kernel()
def moving_step(loop: Loop, a: Any, b: Any, t: float, h: float) -> tuple[float, bool]:
    """A step of the trapezoid, cut at a reversal; returns the time taken (< 0: no solution) and whether."""
    side = sign(a.velocity) if a.velocity != 0.0 else a.leaving
    jumping = side if loop.case.plant.holding != 0 or compensator_jumps(loop) else 0.0
    look_ahead(loop, a, t, h)
    if not solve(loop, a, b, h, jumping, 0.5):
        return -1.0, False
    for _ in range(10):
        shorter = h * near_rest(loop, a.velocity, b.velocity)
        if shorter == h:
            break
        h = shorter
        look_ahead(loop, a, t, h)
        if not solve(loop, a, b, h, jumping, 0.5):
            return -1.0, False
    band = loop.numbers[PLANT_BAND]
    if side == 0.0 or b.velocity * side > band:
        b.side = sign(b.velocity)
        return h, False
    if a.velocity * side <= band:  # it grazed: the drive to `side` fell again within the step
        rest_for(loop, a, b, t, h if band == 0.0 else 0.0)
        if band > 0.0:
            enter_band(loop, b, side)
        return (h, False) if band == 0.0 else (0.0, True)
    r = loop.crossing
    look_for(loop, side * a.velocity - band, h, side * b.velocity - band)
    for _ in range(MOST):
        if r.phase == SOLVED:
            break
        look_ahead(loop, a, t, r.x)
        if not solve(loop, a, b, r.x, jumping, 0.5):
            return -1.0, False
        improve(pointer(r, 0), side * b.velocity - band)
    x = r.x
    if loop.case.steep != 0 and x > LANDING * h:
        x *= APPROACH
        look_ahead(loop, a, t, x)
        solved = solve(loop, a, b, x, jumping, 0.5)
        b.side = side
        return (x, False) if solved and side * b.velocity > 0.0 else (-1.0, False)
    look_ahead(loop, a, t, x)
    close(loop, a, b, x, side * band, jumping, 0.5)
    b.side = side
    if band > 0.0:
        enter_band(loop, b, side)
    return x, True


@kernel()
def loses_motion(loop: Loop, a: Any, b: Any, h: float) -> bool:
    """Whether a damped step from a to b near rest hides a motion that a bristle would remember.

    The stages' velocities differ by what the step does not resolve; a contact that slides farther than its
    travel up to break-away remembers nothing of it.
    """
    v0, v1 = a.velocity, b.velocity
    slides = v0 * v1 > 0.0 and min(abs(v0), abs(v1)) * h > loop.case.travel
    return not slides and GAMMA * h * abs(v1 - loop.middle.velocity) > UNSEEN * loop.case.travel


@kernel()
def advance(loop: Loop, a: Any, b: Any, t: float, h: float, cap: float) -> tuple[float, bool]:
    """One step from a to b, at most h long, in motion at most `cap`.

    Returns the time taken (< 0: no solution) and whether an event ended the step.
    """
    if loop.case.damped != 0:
        done = damped_step(loop, a, b, t, h)
        if done and h > loop.case.resolved and loses_motion(loop, a, b, h):
            h = loop.case.resolved
            done = damped_step(loop, a, b, t, h)
        return (h, False) if done else (-1.0, False)
    if loop.numbers[PLANT_BAND] > 0.0 and a.velocity == 0.0:
        return band_step(loop, a, b, t, h)
    if a.velocity == 0.0 and a.leaving == 0.0 and (loop.case.plant.holding != 0 or compensator_jumps(loop)):
        side = departure(loop, a)
        if side == 0.0:
            taken = rest_step(loop, a, b, t, h)
            return taken, b.leaving != 0.0
        leave(loop, a, side)
    return moving_step(loop, a, b, t, min(h, cap))
