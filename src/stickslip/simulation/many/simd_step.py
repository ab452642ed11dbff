"""One step of many closed loops side by side: the trapezoid for laws made of springs that slip along one curve.

J dv/dt = T_m - T_f with linear control, friction as in `stickslip.spec.Elements` and `Bristle`: what the laws' `modes`
say, and their own sliding curves. The velocity is linear over a step; sticking elements and bristles enter implicitly,
the curve by its value extrapolated to the middle of the step, so that a step needs no iteration, one value of each
curve and no branch: the compiler runs it on 4 or 8 cases at once. A step inside which an element breaks away or the
motion reverses is cut there and finished by itself (`finish`).

This text is specialised by `many.simd_source`: sizes, numbers and curves are those of `many.simd_names`. ``z`` holds
the cases, row after row of `LANES` numbers; ``now`` is the reference over this step. What a step would end with lies in
``z`` too, `AHEAD` rows behind the state: with all of it in one array the compiler sees what does not overlap.
"""

from __future__ import annotations

from typing import Any

from stickslip.jit import select
from stickslip.simulation.many.simd_names import (
    ELEMENTS,
    FIRST_1,
    KIND_0,
    KIND_1,
    LANES,
    RIGID_0,
    RIGID_1,
    attraction,
    curve,
    gain,
    inertia,
    kd,
    ki,
    kp,
    kr,
    lag,
    rigid,
    share,
    stiffness,
    viscous,
)

RELAXES, FOLLOWS, BENDS = 0, 1, 2

# ---- rows of z: the state ------------------------------------------------------------------------------------
POSITION, VELOCITY, INTEGRAL, CURVE_0, CURVE_1, BRISTLE_0, BRISTLE_1, FORCE = range(8)
AHEAD = FORCE + ELEMENTS
# ---- what only whole steps and events change: the direction in which elements slip, by how much |v| and the curves
# rose over the last step, the stiffness of what sticks (the compensator's with its weight), how many elements slip ----
DIRECTION, SPEED_RISE, RISE_0, RISE_1, STUCK, SLIPPING, EVENT, UNRESOLVED = range(2 * AHEAD, 2 * AHEAD + 8)
SLIPS = 2 * AHEAD + 8
# ---- what is measured, since the begin of the part of the run ----
SUMS = SLIPS + ELEMENTS
(
    ERROR_2, ERROR_PEAK, ERROR_SUM, ERROR_LOW, ERROR_HIGH, RATE_2, SPEED_PEAK, MOTOR_2, MOTOR_PEAK, RESIDUAL_2, WORK,
    LOSS, NUMBERS,
) = range(SUMS, SUMS + 13)  # fmt: skip
# From NUMBERS on: what varies from case to case.

# ---- entries of `now`: the reference at begin and end of the step, its feedforward in the mean, at end and begin ----
GOAL_BEGIN, GOAL_END, RATE_BEGIN, RATE_END, FED_MEAN, FED_END, FED_BEGIN = range(7)
# ---- entries of what `over_step` tells of a law: part that is left of a force that slips, N·m by which it is pulled,
# N·m/rad of a bristle, mean torque without what sticks, N·m, and the bristle's lag in steps ----
KEEP, PULL, BEND, HELD, LAGS = range(5)
MOST_EVENTS = 16  # in a step
SHORTEST = 1e-6  # part of a step that is not worth another one
FAR = 1e300


# ---- a step in which no mode changes -----------------------------------------------------------------------------


def trial(z: Any, lane: int, c: Any, h: float, part: float, now: Any) -> bool:
    """Step over the last `part` of a step of h as if no mode changed, into the rows ahead; returns whether one does."""
    dt = part * h
    v0 = z[VELOCITY * LANES + lane]
    x0 = z[POSITION * LANES + lane]
    sigma = z[DIRECTION * LANES + lane]
    # T_f = held + stuck d/2 + damping d/h in the mean over the step, with the displacement d.
    first = over_step(z, lane, c, 0, dt, part)
    second = (0.0, 0.0, 0.0, 0.0, 0.0)
    held = first[HELD]
    stuck = z[STUCK * LANES + lane]
    damping = viscous(c, z, lane, 0)
    if KIND_0 == BENDS:
        stuck += (1.0 + 2.0 * first[LAGS]) * first[BEND]
    if KIND_1 >= 0:
        weight = gain(c, z, lane)
        second = over_step(z, lane, c, 1, dt, part)
        damping -= weight * viscous(c, z, lane, 1)
        if KIND_1 == BENDS:
            stuck -= weight * (1.0 + 2.0 * second[LAGS]) * second[BEND]
        held -= weight * second[HELD]
    # ---- the end velocity, from a linear equation ----
    goal = now[GOAL_END] - 0.5 * part * (now[GOAL_END] - now[GOAL_BEGIN])
    goal_rate = now[RATE_END] - 0.5 * part * (now[RATE_END] - now[RATE_BEGIN])
    integral = z[INTEGRAL * LANES + lane]
    drive = kp(c, z, lane) * (goal - x0) + kr(c, z, lane) * goal_rate - held
    drive += ki(c, z, lane) * (integral + 0.5 * dt * (goal - x0)) + gain(c, z, lane) * now[FED_MEAN]
    slope = 0.25 * dt * (kp(c, z, lane) + stuck + 0.5 * dt * ki(c, z, lane)) + 0.5 * (
        kd(c, z, lane) + damping
    )
    mass = inertia(c, z, lane) / dt
    v1 = ((mass - slope) * v0 + drive) / (mass + slope)
    d = 0.5 * dt * (v0 + v1)
    z[(AHEAD + POSITION) * LANES + lane] = x0 + d
    z[(AHEAD + VELOCITY) * LANES + lane] = v1
    z[(AHEAD + INTEGRAL) * LANES + lane] = integral + dt * (goal - x0 - 0.5 * d)
    gap = reached(z, lane, c, v1, d, first, second)
    turns = (
        sigma * v1 < 0.0 if RIGID_0 or RIGID_1 else (z[SLIPPING * LANES + lane] > 0.0) & (sigma * v1 <= 0.0)
    )
    return (gap <= 0.0) | turns


def over_step(z: Any, lane: int, c: Any, which: int, dt: float, part: float) -> Any:
    """What law `which` does over the last `part` of a step, for `dt`, in which no mode changes: `KEEP` and so on."""
    kind = KIND_0 if which == 0 else KIND_1
    sigma = z[DIRECTION * LANES + lane]
    rise = z[(RISE_0 if which == 0 else RISE_1) * LANES + lane]
    s = z[(CURVE_0 if which == 0 else CURVE_1) * LANES + lane] + 0.5 * part * rise
    given = give(z, lane, c, which, kind, dt, part)
    inverse = 1.0 / (s + given)
    keep = (s - given) * inverse if kind != FOLLOWS else -1.0
    pull = 2.0 * sigma * s * (given * inverse if kind != FOLLOWS else 1.0)
    held = 0.0
    for i in range(ELEMENTS):
        if (i < FIRST_1) == (which == 0):
            held += held_by(z, lane, c, i, keep, pull)
    if RIGID_0 if which == 0 else RIGID_1:
        held += rigid(c, z, lane, which) * sigma * s
    bend = 0.0
    lags = 0.0
    if kind == BENDS:
        bend = attraction(c, z, lane, which) * s * inverse
        lags = lag(c, z, lane, which) / dt
        bristle = z[(BRISTLE_0 if which == 0 else BRISTLE_1) * LANES + lane]
        held += (0.5 * (1.0 + keep) + lags * (keep - 1.0)) * bristle
    return (keep, pull, bend, held, lags)


def reached(z: Any, lane: int, c: Any, v1: float, d: float, first: Any, second: Any) -> float:
    """Curves, bristles and forces at the end velocity into the rows ahead; torque to the next break-away, N·m."""
    side = select(v1 >= 0.0, 1.0, -1.0)
    end0 = curve(v1, c, z, lane, 0)
    z[(AHEAD + CURVE_0) * LANES + lane] = end0
    if KIND_0 == BENDS:
        z[(AHEAD + BRISTLE_0) * LANES + lane] = first[KEEP] * z[BRISTLE_0 * LANES + lane] + first[BEND] * d
    gap = FAR
    for i in range(FIRST_1):
        left = gap_ahead(z, lane, c, i, first, end0, side, d)
        gap = select(left < gap, left, gap)
    if KIND_1 >= 0:
        end1 = curve(v1, c, z, lane, 1)
        z[(AHEAD + CURVE_1) * LANES + lane] = end1
        if KIND_1 == BENDS:
            z[(AHEAD + BRISTLE_1) * LANES + lane] = (
                second[KEEP] * z[BRISTLE_1 * LANES + lane] + second[BEND] * d
            )
        for i in range(FIRST_1, ELEMENTS):
            left = gap_ahead(z, lane, c, i, second, end1, side, d)
            gap = select(left < gap, left, gap)
    return gap


def give(z: Any, lane: int, c: Any, which: int, kind: int, dt: float, part: float) -> float:
    """How fast a force of law `which` yields to its curve s, as a part of s in half a step, N·m."""
    half = 0.5 * dt * attraction(c, z, lane, which)
    if kind == BENDS:
        speed = abs(z[VELOCITY * LANES + lane]) + 0.5 * part * z[SPEED_RISE * LANES + lane]
        return half * select(speed > 0.0, speed, 0.0)
    return half


def held_by(z: Any, lane: int, c: Any, i: int, keep: float, pull: float) -> float:
    """Mean torque of element i over the step, without what it takes up while it sticks, N·m."""
    force = z[(FORCE + i) * LANES + lane]
    slides = 0.5 * (1.0 + keep) * force + share(c, z, lane, i) * (0.5 * pull)
    return select(z[(SLIPS + i) * LANES + lane] > 0.0, slides, force)


def gap_ahead(z: Any, lane: int, c: Any, i: int, law: Any, s: float, side: float, d: float) -> float:
    """Torque by which element i misses its break-away at the end of the step, N·m; writes its force there."""
    force = z[(FORCE + i) * LANES + lane]
    level = share(c, z, lane, i) * s
    kind = KIND_0 if i < FIRST_1 else KIND_1
    slides = law[KEEP] * force + share(c, z, lane, i) * law[PULL] if kind != FOLLOWS else side * level
    sticks = force + stiffness(c, z, lane, i) * d
    slips = z[(SLIPS + i) * LANES + lane] > 0.0
    z[(AHEAD + FORCE + i) * LANES + lane] = select(slips, slides, sticks)
    return select(slips, FAR, level - side * sticks)


def accept(z: Any, lane: int, part: float) -> None:
    """Go to the end of a step over the last `part`: the state and the rows ahead change places."""
    speed = abs(z[VELOCITY * LANES + lane])
    z[SPEED_RISE * LANES + lane] = (abs(z[(AHEAD + VELOCITY) * LANES + lane]) - speed) / part
    swap(z, lane, POSITION)
    swap(z, lane, VELOCITY)
    swap(z, lane, INTEGRAL)
    z[RISE_0 * LANES + lane] = swap(z, lane, CURVE_0) / part
    if KIND_0 == BENDS:
        swap(z, lane, BRISTLE_0)
    if KIND_1 >= 0:
        z[RISE_1 * LANES + lane] = swap(z, lane, CURVE_1) / part
    if KIND_1 == BENDS:
        swap(z, lane, BRISTLE_1)
    for i in range(ELEMENTS):
        swap(z, lane, FORCE + i)


def swap(z: Any, lane: int, row: int) -> float:
    """Exchange a row of the state with the one ahead; returns by how much it rises."""
    before = z[row * LANES + lane]
    after = z[(AHEAD + row) * LANES + lane]
    z[row * LANES + lane] = after
    z[(AHEAD + row) * LANES + lane] = before
    return after - before


# ---- a step with events ----------------------------------------------------------------------------------------


def finish(z: Any, lane: int, c: Any, h: float, now: Any) -> None:
    """Do a step again whose trial had events: from one to the next, the velocity linear in between."""
    start, end = AHEAD, 0  # the trial was accepted, so that state and trial have changed places
    part = 1.0
    for _ in range(MOST_EVENTS):
        side = 1.0 if z[(end + VELOCITY) * LANES + lane] >= 0.0 else -1.0
        x, which = first_event(z, lane, c, start, end, side)
        rest = (1.0 - x) * part
        if rest < SHORTEST:
            x, rest = 1.0, 0.0
        go_to(z, lane, h, part, x, now, start, end)
        switch(z, lane, c, which, side)
        if rest == 0.0:
            return
        part = rest
        if not trial(z, lane, c, h, part, now):
            accept(z, lane, part)
            return
        start, end = 0, AHEAD
    accept(z, lane, part)
    z[UNRESOLVED * LANES + lane] += 1.0


def first_event(z: Any, lane: int, c: Any, start: int, end: int, side: float) -> tuple[float, int]:
    """Fraction of the trial at which its first event happens, and the element that breaks away (ELEMENTS: reversal).

    The trial goes from the rows `start` on to the rows `end` on.
    """
    v0 = z[(start + VELOCITY) * LANES + lane]
    v1 = z[(end + VELOCITY) * LANES + lane]
    found = FAR
    which = ELEMENTS
    for i in range(ELEMENTS):
        curve_row = CURVE_0 if i < FIRST_1 else CURVE_1
        last = gap_of(z, lane, c, i, side, end + FORCE + i, end + curve_row)
        if (z[(SLIPS + i) * LANES + lane] == 0.0) & (last <= 0.0):
            first = gap_of(z, lane, c, i, side, start + FORCE + i, start + curve_row)
            x = first / (first - last) if first > 0.0 else 0.0
            if x < found:
                found = x
                which = i
    turns = RIGID_0 or RIGID_1 or z[SLIPPING * LANES + lane] > 0.0
    if turns and z[DIRECTION * LANES + lane] * v1 <= 0.0:
        x = v0 / (v0 - v1) if v0 * v1 < 0.0 else 0.0
        if x <= found:
            found = x
            which = ELEMENTS
    return found if found < 1.0 else 1.0, which


def gap_of(z: Any, lane: int, c: Any, i: int, side: float, row: int, curve_row: int) -> float:
    """How far element i is from breaking away towards `side`, N·m."""
    return share(c, z, lane, i) * z[curve_row * LANES + lane] - side * z[row * LANES + lane]


def go_to(z: Any, lane: int, h: float, part: float, x: float, now: Any, start: int, end: int) -> None:
    """Bring the state to fraction x of a trial over the last `part`."""
    v0 = z[(start + VELOCITY) * LANES + lane]
    v1 = z[(end + VELOCITY) * LANES + lane]
    v = v0 + x * (v1 - v0)
    dt = x * part * h
    goal = now[GOAL_END] - part * (1.0 - 0.5 * x) * (now[GOAL_END] - now[GOAL_BEGIN])
    position = z[(start + POSITION) * LANES + lane]
    integral = z[(start + INTEGRAL) * LANES + lane]
    z[INTEGRAL * LANES + lane] = integral + dt * (goal - position - 0.25 * dt * (v0 + v))
    z[POSITION * LANES + lane] = position + 0.5 * dt * (v0 + v)
    z[VELOCITY * LANES + lane] = v
    z[SPEED_RISE * LANES + lane] = (abs(v1) - abs(v0)) / part
    z[RISE_0 * LANES + lane] = between(z, lane, CURVE_0, x, start, end) / part
    if KIND_0 == BENDS:
        between(z, lane, BRISTLE_0, x, start, end)
    if KIND_1 >= 0:
        z[RISE_1 * LANES + lane] = between(z, lane, CURVE_1, x, start, end) / part
    if KIND_1 == BENDS:
        between(z, lane, BRISTLE_1, x, start, end)
    for i in range(ELEMENTS):
        between(z, lane, FORCE + i, x, start, end)


def between(z: Any, lane: int, row: int, x: float, start: int, end: int) -> float:
    """Bring a row of the state to fraction x of a trial; returns the whole way."""
    first = z[(start + row) * LANES + lane]
    way = z[(end + row) * LANES + lane] - first
    z[row * LANES + lane] = first + x * way
    return way


def switch(z: Any, lane: int, c: Any, which: int, side: float) -> None:
    """Let element `which` slip towards `side`; ELEMENTS: the motion reverses, and every element sticks."""
    z[DIRECTION * LANES + lane] = side
    if which == ELEMENTS:
        z[VELOCITY * LANES + lane] = 0.0
        z[SPEED_RISE * LANES + lane] = abs(z[SPEED_RISE * LANES + lane])
        stick(z, lane, c)
        return
    z[(SLIPS + which) * LANES + lane] = 1.0
    z[SLIPPING * LANES + lane] += 1.0
    z[STUCK * LANES + lane] -= weighted(z, lane, c, which)


def stick(z: Any, lane: int, c: Any) -> None:
    """Let every element stick."""
    z[SLIPPING * LANES + lane] = 0.0
    stuck = 0.0
    for i in range(ELEMENTS):
        z[(SLIPS + i) * LANES + lane] = 0.0
        stuck += weighted(z, lane, c, i)
    z[STUCK * LANES + lane] = stuck


def weighted(z: Any, lane: int, c: Any, i: int) -> float:
    """Stiffness that element i adds to the loop, N·m/rad."""
    k = stiffness(c, z, lane, i)
    return k if i < FIRST_1 else -gain(c, z, lane) * k
