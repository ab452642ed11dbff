"""A step in which something slips, cut where the axis turns or the next element breaks away.

The step is of order 8 under error control (`stickslip.simulation.sampled.order_eight`). It is no longer than until a
turn is expected, and an end that lies near the turn is led to it (`at_velocity`); any other end is found on the quintic
through both ends of the step and then located on real steps from the same start.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation.sampled.bracket import Bracket, bracket, narrowed, where_next
from stickslip.simulation.sampled.modes import break_away, heaviest, keeps_below, sign, turn
from stickslip.simulation.sampled.order_eight import attempt
from stickslip.simulation.sampled.rates import (
    BENDS,
    FOLLOWS,
    Slip,
    Start,
    Trial,
    curve_at,
    never_sticks,
    rates,
    rates_on,
    slip_of,
    start_of,
)
from stickslip.simulation.sampled.stretch import Stretch, lowest, velocity_in, within

SHORTEST = 1e-13
"""Of the sample time: a step that must be shorter does not exist."""
UNSEEN = 0.1
"""Of the tolerance of a step: what a bristle may move on beyond its turn without the turn being located."""
FINEST = 1e-6
"""Of the sample time: what a load may be above the curve for without being seen."""
ROOT_STEPS = 60
SOON = 1e-3
"""Of a step: a turn expected sooner is looked for inside it."""
NEARBY = 0.1
"""Of a step: what its end may lie beside where it is to end without a step of its own."""


class End(NamedTuple):
    """How a step ends."""

    trial: Trial
    acceleration: float
    """rad/s²; before what ends it"""
    turns: bool
    """whether the axis turns there"""
    breaks: bool
    """whether an element breaks away"""
    level: float
    """the curve there, N·m; 0 where it was not called there"""


@kernel(exact=False)
def slip(axis: Any, z: Any, left: float) -> float:
    """Take one step of at most `left` s; returns the time taken."""
    if left == axis.sample_time and z.direction * z.velocity > axis.far and glides(axis, z):
        return left
    m = slip_of(axis, z)
    start = start_of(m, z)
    way, edge = z.direction, axis.layer
    if way * start.velocity <= edge and way * start.acceleration <= 0.0:
        if way == 0.0 and start.acceleration == 0.0:
            z.acceleration = 0.0
            return left
        turn(axis, z)
        return 0.0
    h = min(left, z.next)
    if z.spring > 0.0:
        h = min(h, math.sqrt(axis.inertia / z.spring))
    h = min(h, axis.longest)
    expected = turning_expected(m, start, edge)
    if expected > SOON * h:
        h = min(h, expected)
    while True:
        end = ended(axis, z, m, start, accepted(axis, z, m, start, h), left)
        trial = end.trial
        if trial.error <= axis.local or z.failed:
            break
        # Cut where the axis turns, the step meets the curve's peak there, which the whole one had jumped over unseen.
        h = z.next = shorter(axis, z, trial)
    z.moved, z.velocity, z.slipping = z.moved + trial.moved, trial.velocity, trial.slipping
    z.relaxed += trial.relaxed
    z.acceleration = end.acceleration
    z.level, z.level_at = end.level, trial.velocity
    if end.breaks:
        break_away(axis, z, way)
    elif end.turns:
        turn(axis, z)
    elif never_sticks(axis) and way * trial.velocity < edge:
        z.direction = sign(trial.velocity)
    return trial.time


@kernel(exact=False, inline=True)
def turning_expected(m: Slip, start: Start, edge: float) -> float:
    """When the velocity should have fallen to the edge, s; infinite where nothing says so.

    As an oscillation about the edge on its way there; by its bend where it still rises.
    """
    way = m.direction
    gap, a = way * start.velocity - edge, way * start.acceleration
    jerk = -way * m.mobility * (m.spring * start.velocity + start.building + m.viscous * start.acceleration)
    if jerk >= 0.0:
        return gap / -a if a < 0.0 else math.inf
    if a >= 0.0:
        return (a + math.sqrt(max(a * a - 2.0 * jerk * gap, 0.0))) / -jerk
    frequency = math.sqrt(-jerk / gap)
    return math.atan2(gap * frequency, -a) / frequency


@kernel(exact=False, inline=True)
def acceleration_after(m: Slip, trial: Trial) -> float:
    """At the end of a step, rad/s²."""
    a, _, _ = rates(m, trial.moved, trial.velocity, trial.slipping)
    return a


@kernel(exact=False, inline=True)
def stretch_of(m: Slip, start: Start, trial: Trial) -> tuple[Stretch, float]:
    """What both ends of a step say of the motion inside it, and the curve at its end, N·m."""
    level = curve_at(m, trial.velocity)
    a1, _, _ = rates_on(m, trial.moved, trial.velocity, trial.slipping, level)
    return Stretch(trial.time, trial.moved, start.velocity, start.acceleration, trial.velocity, a1), level


@kernel(exact=False)
def ended(axis: Any, z: Any, m: Slip, start: Start, trial: Trial, left: float) -> End:
    """Cut an accepted step where something ends, or lead it on to the turn that lies just ahead."""
    way, edge = z.direction, axis.layer
    whole, level = stretch_of(m, start, trial)
    turns = breaks = False
    gap, braking = way * trial.velocity - edge, -way * whole.a1
    if gap < 0.0:
        if not never_sticks(axis) or 2.0 * abs(trial.velocity) * trial.time > UNSEEN * axis.local:
            trial, turns = arrival(axis, m, start, whole, trial), True
    elif 0.0 < gap <= NEARBY * trial.time * braking and gap < braking * (left - trial.time):
        there = at_velocity(m, trial, way * edge, axis.sample_time)
        if there.error <= axis.local and there.time <= left:
            trial, turns = there, True
    elif way * start.acceleration < 0.0 < -braking:
        low = lowest(whole, way)
        if way * velocity_in(whole, low) < edge + 0.1 * abs(start.velocity - trial.velocity):
            trial = attempt(m, start, low)
            whole, level = stretch_of(m, start, trial)
            if way * trial.velocity < edge:
                trial, turns = arrival(axis, m, start, whole, trial), True
    if z.spring > 0.0:
        if turns:
            whole, level = stretch_of(m, start, trial)
        trial, breaks, level = next_break(axis, z, m, start, whole, trial, level)
        turns = turns and not breaks and way * trial.velocity < edge + 1e-9
    elif turns:
        level = 0.0
    return End(trial, whole.a1, turns, breaks, level)


@kernel(exact=False)
def glides(axis: Any, z: Any) -> bool:
    """Slide through a whole sample on the level part of the curve, if the axis does: there the motion is linear."""
    if z.spring > 0.0 or (axis.kind == BENDS and abs(z.slipping - z.direction * axis.level) > axis.settled):
        return False
    pull = z.direction if axis.kind == BENDS else z.share * z.direction
    force = axis.level * pull if axis.kind == FOLLOWS else z.slipping
    g = axis.glide
    v = g[1, 0] * z.velocity + g[1, 1] * force + g[1, 2] * z.torque + g[1, 3] * pull
    after = g[2, 1] * force + g[2, 3] * pull
    a0 = z.torque - force - axis.viscous * z.velocity
    a1 = z.torque - after - axis.viscous * v
    # Between its ends the velocity has at most one extreme.
    if z.direction * v <= axis.far or z.direction * a0 < 0.0 < z.direction * a1:
        return False
    z.moved += g[0, 0] * z.velocity + g[0, 1] * force + g[0, 2] * z.torque + g[0, 3] * pull
    z.velocity, z.slipping = v, after
    z.relaxed += axis.attraction * axis.sample_time / axis.level
    z.acceleration = a1 / axis.inertia
    return True


@kernel(exact=False)
def accepted(axis: Any, z: Any, m: Slip, start: Start, h: float) -> Trial:
    """The first step of at most h that keeps the tolerance; `z.next` is the length that the next one may have."""
    cut = h < z.next
    trial = attempt(m, start, h)
    while not trial.error <= axis.local:
        cut = False
        h = shorter(axis, z, trial)
        if z.failed:
            break
        trial = attempt(m, start, h)
    grown = 4.0
    if trial.error > 1e-5 * axis.local:
        grown = 0.9 * eighth_root(axis.local / trial.error)
    # A step that the end of the sample has cut says nothing against a longer one.
    z.next = max(z.next, h * grown) if cut else h * grown
    return trial


@kernel(exact=False)
def shorter(axis: Any, z: Any, trial: Trial) -> float:
    """How long a step may be in place of one that is wrong by too much."""
    z.rejected += 1
    part = max(0.1, 0.9 * eighth_root(axis.local / trial.error)) if trial.error < math.inf else 0.1
    h = trial.time * part
    if h < SHORTEST * axis.sample_time:
        z.failed = 1
    return h


@kernel(exact=False, inline=True)
def eighth_root(x: float) -> float:
    """x^(1/8)."""
    return math.sqrt(math.sqrt(math.sqrt(x)))


@kernel(exact=False)
def arrival(axis: Any, m: Slip, start: Start, whole: Stretch, trial: Trial) -> Trial:
    """The step from `start` that ends where the velocity has fallen to the edge, in place of one that went on."""
    way, edge, h = m.direction, axis.layer, whole.time
    low, high, a = 0.0, h, whole.a1
    for i in range(ROOT_STEPS):
        gap = way * trial.velocity - edge
        if gap == 0.0 or high - low <= 1e-15 * h:
            break
        ahead = -gap / (way * a) if a != 0.0 else math.inf
        if way * a < 0.0 and abs(ahead) <= NEARBY * trial.time:
            there = at_velocity(m, trial, way * edge, axis.sample_time)
            if there.error <= axis.local:
                return there
        if gap > 0.0:
            low = trial.time
        else:
            high = trial.time
        t = met(whole, way, edge) if i == 0 else trial.time + ahead
        if i > 20 or not low < t < high:
            t = 0.5 * (low + high)
        trial = attempt(m, start, t)
        a = acceleration_after(m, trial)
    return trial


@kernel(exact=False)
def met(whole: Stretch, way: float, edge: float) -> float:
    """Where the cubic of velocities meets the edge last, to a thousandth of the stretch."""
    low, high = 0.0, whole.time
    # A start from the edge itself: the motion first goes out, so that the later of two roots is meant.
    for _ in range(10):
        t = 0.5 * (low + high)
        if way * velocity_in(whole, t) > edge:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@kernel(exact=False)
def at_velocity(m: Slip, trial: Trial, goal: float, span: float) -> Trial:
    """Lead the end of a step to a velocity nearby, which becomes the independent variable (``henon1982``).

    Runge and Kutta's step of order 4. Its error is taken for that of a step of order 2, over the `span` (s) in which an
    error of velocity is one of position.
    """
    v0, d0, s0 = trial.velocity, trial.moved, trial.slipping
    dv = goal - v0
    half = 0.5 * dv
    a, g, q = rates(m, d0, v0, s0)
    t1, d1, s1, q1 = 1.0 / a, v0 / a, g / a, q / a
    v = v0 + half
    a, g, q = rates(m, d0 + half * d1, v, s0 + half * s1)
    t2, d2, s2, q2 = 1.0 / a, v / a, g / a, q / a
    a, g, q = rates(m, d0 + half * d2, v, s0 + half * s2)
    t3, d3, s3, q3 = 1.0 / a, v / a, g / a, q / a
    a, g, q = rates(m, d0 + dv * d3, goal, s0 + dv * s3)
    t4, d4, s4, q4 = 1.0 / a, goal / a, g / a, q / a
    sixth = dv / 6.0
    time = trial.time + sixth * (t1 + 2.0 * (t2 + t3) + t4)
    error = abs(dv * (t2 - t3) * a) * span
    return Trial(
        time, d0 + sixth * (d1 + 2.0 * (d2 + d3) + d4), goal, s0 + sixth * (s1 + 2.0 * (s2 + s3) + s4),
        trial.relaxed + sixth * (q1 + 2.0 * (q2 + q3) + q4), max(error, trial.error),
    )  # fmt: skip


@kernel(exact=False)
def next_break(
    axis: Any, z: Any, m: Slip, start: Start, whole: Stretch, trial: Trial, level: float
) -> tuple[Trial, bool, float]:  # fmt: skip
    """Cut the step where the next element breaks away; whether one does, and the curve there (`level` at its end)."""
    way, v0 = z.direction, start.velocity
    load0, last = heaviest(axis, z.moved, way), heaviest(axis, z.moved + trial.moved, way)
    if max(load0, last) < axis.lowest:
        return trial, False, level
    if way * v0 > 0.0 and load0 >= start.level:
        return Trial(0.0, 0.0, v0, z.slipping, 0.0, 0.0), True, start.level
    h = whole.time
    t, d = 0.0, h
    w0, b0, before, level0 = v0, start.acceleration, 0.0, start.level
    while t < h:
        d = min(d, h - t)
        moved, w1, b1, load1, level1 = whole.moved, whole.v1, whole.a1, last, level
        if t + d < h:
            moved, w1, b1 = within(whole, t + d)
            load1, level1 = heaviest(axis, z.moved + moved, way), curve_at(axis, w1)
        most = max(load0, load1)
        if load1 >= level1:
            b = bracket(t, t + d, load0 - level0, load1 - level1)
            return located(axis, z, m, start, whole, b)
        piece = Stretch(d, moved - before, w0, b0, w1, b1)
        below = most < axis.lowest or keeps_below(axis, most, piece, way, level0, level1)
        if below or d <= FINEST * axis.sample_time:
            t, load0, w0, b0, before, level0 = t + d, load1, w1, b1, moved, level1
            d *= 2.0
        else:
            d *= 0.5
    return trial, False, level


@kernel(exact=False)
def looked(axis: Any, z: Any, whole: Stretch, t: float) -> float:
    """How far the heaviest load lies above the curve t into a step, by its quintic, N·m."""
    moved, v, _ = within(whole, t)
    return heaviest(axis, z.moved + moved, z.direction) - curve_at(axis, v)


@kernel(exact=False)
def over(axis: Any, z: Any, trial: Trial) -> tuple[float, float]:
    """How far the heaviest load lies above the curve at the end of a real step, and the curve there, N·m."""
    level = curve_at(axis, trial.velocity)
    return heaviest(axis, z.moved + trial.moved, z.direction) - level, level


@kernel(exact=False)
def located(
    axis: Any, z: Any, m: Slip, start: Start, whole: Stretch, b: Bracket
) -> tuple[Trial, bool, float]:  # fmt: skip
    """The step within a bracket at whose end the heaviest load meets the curve, whether it does, and the curve.

    The place is found on the quintic of the whole step, then corrected on real steps.
    """
    h, late, d = whole.time, b.high, 1e-3 * (b.high - b.low)
    for i in range(ROOT_STEPS):
        if b.excess <= axis.near or b.high - b.low <= 1e-12 * h:
            break
        t = where_next(b, axis.near, i)
        b = narrowed(b, t, looked(axis, z, whole, t))
    t = b.high
    trial = attempt(m, start, t)
    f, level = over(axis, z, trial)
    if abs(f) <= axis.near:
        return trial, True, level
    slope = (looked(axis, z, whole, t + d) - looked(axis, z, whole, t - d)) / (2.0 * d)
    for _ in range(ROOT_STEPS):
        t = min(max(t - f / slope, 0.0), h) if slope > 0.0 else late
        trial = attempt(m, start, t)
        f, level = over(axis, z, trial)
        if slope <= 0.0 or t == 0.0 or t == h:
            break
        if abs(f) <= axis.near:
            return trial, True, level
    # The quintic has seen more than there is, or the crossing is another one: go on from there.
    return trial, f >= 0.0, level
