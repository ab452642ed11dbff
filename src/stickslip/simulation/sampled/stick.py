"""The motion while every element sticks, exact, and the moment at which the first one breaks away.

J dv/dt = u - F_0 - K (theta - theta_0) - D v with constant u: a damped oscillation about where the springs balance u.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation.exact.flow import Linear, flow, free_motion, linear
from stickslip.simulation.sampled.bracket import Bracket, bracket, narrowed, where_next
from stickslip.simulation.sampled.modes import (
    break_away,
    breaks_at,
    floor_below,
    heaviest,
    keeps_below,
    sign,
)
from stickslip.simulation.sampled.rates import spring_of
from stickslip.simulation.sampled.stretch import Stretch

PHASE = 1.25
"""rad of the oscillation between two looks at the loads: less than a quarter, so that between them the velocity has one
extreme at most, and its slope bounds it there."""
ROOT_STEPS = 60
EARLY = 1.0 - 1e-12
"""Of the time of a turn, so that rounding does not place it behind."""
FINEST = 1e-6
"""Of the sample time: what a load may be above the curve for without being seen."""


class Swing(NamedTuple):
    """The free motion of a stuck axis, about where the springs balance the torque."""

    lin: Linear
    goal: float
    """where that is: displacement since the forces were written down, rad"""
    off: float
    """at the start, rad from there"""
    velocity: float
    """at the start, rad/s"""


class Moment(NamedTuple):
    """One time of it: s, rad from the goal, rad/s."""

    time: float
    off: float
    velocity: float


@kernel(exact=False, inline=True)
def after(swing: Swing, t: float) -> Moment:
    """The motion t after its start."""
    off, v = free_motion(flow(swing.lin, t), swing.off, swing.velocity)
    return Moment(t, off, v)


@kernel(exact=False, inline=True)
def acceleration_at(lin: Linear, m: Moment) -> float:
    """rad/s²."""
    return -lin.square * m.off - 2.0 * lin.decay * m.velocity


@kernel(exact=False)
def stick(axis: Any, z: Any, left: float) -> float:
    """Move with sticking springs for `left` s or until one breaks away; returns the time taken."""
    lin = linear(axis.inertia, axis.damped, z.spring)
    goal = (z.torque - z.held) * lin.compliance
    swing = Swing(lin, goal, z.moved - goal, z.velocity)
    z.goal = goal
    taken, direction = left, 0.0
    if not cannot_break(axis, swing):
        if at_rest(axis, z, swing):
            z.velocity = z.acceleration = 0.0
            return left
        taken, direction = first_break(axis, swing, left)
        end = after(swing, taken)
    elif left == axis.sample_time:
        off, v = free_motion(axis.flow, swing.off, swing.velocity)
        end = Moment(left, off, v)
    else:
        end = after(swing, left)
    z.moved, z.velocity = goal + end.off, end.velocity
    z.acceleration = acceleration_at(lin, end)
    if direction != 0.0:
        break_away(axis, z, direction)
    return taken


@kernel(exact=False, inline=True)
def cannot_break(axis: Any, swing: Swing) -> bool:
    """Whether the amplitude of the oscillation keeps every load below its share of the curve."""
    lin, off = swing.lin, swing.off
    if lin.discriminant <= 0.0:
        return False
    speed = swing.velocity + lin.decay * off
    reach = math.sqrt(off * off + speed * speed / lin.discriminant)
    level = floor_below(axis, reach * math.sqrt(lin.square))
    for i in range(axis.count):
        spring = spring_of(axis, i)
        k = spring.stiffness
        if abs(spring.force + k * swing.goal) + k * reach >= spring.share * level:
            return False
    return True


@kernel(exact=False, inline=True)
def at_rest(axis: Any, z: Any, swing: Swing) -> bool:
    """Whether what motion there is changes no load by more than loads are told apart.

    Else rounding lets an element at its limit go, and stops the axis at once: without end.
    """
    least = axis.near / z.spring
    return swing.lin.square * swing.off * swing.off + swing.velocity * swing.velocity <= (
        swing.lin.square * least * least
    )


@kernel(exact=False, inline=True)
def excess(axis: Any, moved: float, v: float, direction: float) -> float:
    """How far the heaviest load lies above the curve, N·m; at rest nothing breaks away."""
    load = heaviest(axis, moved, direction)
    if direction == 0.0:
        return -1.0
    if load < axis.lowest:
        return load - axis.lowest
    return load - breaks_at(axis, v)


@kernel(exact=False)
def excess_after(axis: Any, swing: Swing, t: float, way: float) -> float:
    """`excess` after t, in the direction `way`."""
    then = after(swing, t)
    return excess(axis, swing.goal + then.off, then.velocity, way)


@kernel(exact=False)
def first_break(axis: Any, swing: Swing, left: float) -> tuple[float, float]:
    """When the first element breaks away, and in which direction; the whole time and 0 if none does."""
    lin = swing.lin
    count = math.ceil(math.sqrt(lin.square) * left / PHASE) + 1
    pace = left / count
    m = flow(lin, pace)
    here = Moment(0.0, swing.off, swing.velocity)
    way = sign(here.velocity) if here.velocity != 0.0 else sign(-here.off)
    if excess(axis, swing.goal + here.off, here.velocity, way) >= 0.0:
        return 0.0, way
    for i in range(count):
        off, v = free_motion(m, here.off, here.velocity)
        ahead = Moment(pace * (i + 1), off, v)
        if v * way < 0.0:
            # The loads peak where the axis turns: look there, from the side it comes from.
            top = after(swing, turning_time(swing, here.time, ahead.time, way))
            b = meeting(axis, swing, here, top, way)
            if b.high > 0.0:
                return bracketed(axis, swing, b, way), way
            way, here = -way, top
            if excess(axis, swing.goal + here.off, 0.0, way) >= 0.0:
                # A bristle that has been bent further.
                return here.time, way
        b = meeting(axis, swing, here, ahead, way)
        if b.high > 0.0:
            return bracketed(axis, swing, b, way), way
        here = ahead
    return left, 0.0


@kernel(exact=False)
def meeting(axis: Any, swing: Swing, begin: Moment, end: Moment, way: float) -> Bracket:
    """A piece of the time between begin and end at whose end the heaviest load is above the curve; ends in 0 if none.

    Halved until nothing can happen in it: just before the axis turns, the curve may dip under the load and rise again.
    """
    lin, goal = swing.lin, swing.goal
    here, ahead, d = begin, end, end.time - begin.time
    load0, level0 = heaviest(axis, goal + here.off, way), 0.0
    while here.time < end.time:
        load1 = heaviest(axis, goal + ahead.off, way)
        most, level1 = max(load0, load1), 0.0
        if most >= axis.lowest:
            level0 = level0 if level0 > 0.0 else breaks_at(axis, here.velocity)
            level1 = breaks_at(axis, ahead.velocity)
            if load1 >= level1:
                return bracket(here.time, here.time + d, load0 - level0, load1 - level1)
        piece = Stretch(
            d, ahead.off - here.off, here.velocity, acceleration_at(lin, here), ahead.velocity,
            acceleration_at(lin, ahead),
        )  # fmt: skip
        below = most < axis.lowest or keeps_below(axis, most, piece, way, level0, level1)
        if below or d <= FINEST * axis.sample_time:
            here, load0, level0 = Moment(here.time + d, ahead.off, ahead.velocity), load1, level1
            d *= 2.0
        else:
            d *= 0.5
        d = min(d, end.time - here.time)
        if d > 0.0:
            ahead = after(swing, here.time + d)
    return bracket(0.0, 0.0, 0.0, 0.0)


@kernel(exact=False)
def turning_time(swing: Swing, low: float, high: float, way: float) -> float:
    """The time between low and high at which the motion turns, from the side on which it still moves `way`."""
    lin = swing.lin
    if lin.discriminant > 0.0:
        # Every turn lies half a period after the one before.
        first = math.atan2(
            swing.velocity * lin.frequency, lin.square * swing.off + lin.decay * swing.velocity
        )
        turns = math.ceil((low * lin.frequency - first) / math.pi)
        t = (first + turns * math.pi) / lin.frequency
        return min(max(t * EARLY, low), high)
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high or high - low < 1e-9 * high:
            break
        if after(swing, middle).velocity * way > 0.0:
            low = middle
        else:
            high = middle
    return low


@kernel(exact=False)
def bracketed(axis: Any, swing: Swing, b: Bracket, way: float) -> float:
    """The time within a bracket at which the heaviest load meets the curve; not before it."""
    for i in range(ROOT_STEPS):
        if b.excess <= axis.near or b.high - b.low <= 1e-14 * axis.sample_time:
            break
        t = where_next(b, axis.near, i)
        b = narrowed(b, t, excess_after(axis, swing, t, way))
    return b.high
