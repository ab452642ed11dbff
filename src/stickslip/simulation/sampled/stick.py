"""The motion while every element sticks, exact, and the moment at which the first one breaks away.

J dv/dt = u - F_0 - K (theta - theta_0) - D v with constant u: a damped oscillation about where the springs balance u.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.exact.flow import Linear, flow, free_motion, linear
from stickslip.simulation.sampled.modes import break_away, floor_below, heaviest, sign, stays_below
from stickslip.simulation.sampled.rates import curve_at

__all__ = ["stick"]

PHASE = 0.5
"""rad of the oscillation between two looks at the loads."""
ROOT_STEPS = 60
FINEST = 1e-6
"""Of the sample time: what a load may be above the curve for without being seen."""


@kernel(exact=False)
def stick(axis: Any, z: Any, springs: Any, parameters: Any, left: float) -> float:
    """Move with sticking springs for `left` s or until one breaks away; returns the time taken."""
    lin = linear(axis.inertia, axis.viscous, z.spring)
    goal = (z.torque - z.held) * lin.compliance
    off, v = z.moved - goal, z.velocity
    z.goal = goal
    if cannot_break(axis, springs, lin, goal, off, v):
        if left == axis.sample_time:
            off, v = axis.flow[0] * off + axis.flow[1] * v, axis.flow[2] * off + axis.flow[3] * v
        else:
            off, v = free_motion(flow(lin, left), off, v)
        taken, direction = left, 0.0
    else:
        taken, direction = first_break(axis, springs, parameters, lin, goal, off, v, left)
        off, v = free_motion(flow(lin, taken), off, v)
    z.moved, z.velocity = goal + off, v
    z.acceleration = -lin.square * off - 2.0 * lin.decay * v
    if direction != 0.0:
        break_away(axis, z, springs, parameters, direction)
    return taken


@kernel(exact=False, inline=True)
def cannot_break(axis: Any, springs: Any, lin: Linear, goal: float, off: float, v: float) -> bool:
    """Whether the amplitude of the oscillation keeps every load below its share of the curve."""
    if lin.discriminant <= 0.0:
        return False
    swing = v + lin.decay * off
    reach = math.sqrt(off * off + swing * swing / lin.discriminant)
    level = floor_below(axis, reach * math.sqrt(lin.square))
    for i in range(springs.shape[0]):
        k = springs[i].stiffness
        if abs(springs[i].force + k * goal) + k * reach >= springs[i].share * level:
            return False
    return True


@kernel(exact=False, inline=True)
def excess(axis: Any, springs: Any, parameters: Any, moved: float, v: float, direction: float) -> float:
    """How far the heaviest load lies above the curve, N·m; at rest nothing breaks away."""
    load = heaviest(axis, springs, moved, direction)
    if direction == 0.0:
        return -1.0
    if load < axis.lowest:
        return load - axis.lowest
    return load - curve_at(axis.curve, axis.breakaway, parameters, v)


@kernel(exact=False)
def excess_after(
    axis: Any,
    springs: Any,
    parameters: Any,
    lin: Linear,
    goal: float,
    off: float,
    v: float,
    t: float,
    way: float,
) -> float:
    """`excess` after t of the free motion, in the direction `way`."""
    off, v = free_motion(flow(lin, t), off, v)
    return excess(axis, springs, parameters, goal + off, v, way)


@kernel(exact=False)
def first_break(
    axis: Any, springs: Any, parameters: Any, lin: Linear, goal: float, off: float, v: float, left: float
) -> tuple[float, float]:
    """When the first element breaks away, and in which direction; the whole time and 0 if none does."""
    count = math.ceil(math.sqrt(lin.square) * left / PHASE) + 1
    pace = left / count
    m = flow(lin, pace)
    e, w = off, v
    way = sign(w) if w != 0.0 else sign(-e)
    if excess(axis, springs, parameters, goal + e, w, way) >= 0.0:
        return 0.0, way
    for i in range(count):
        next_e, next_w = free_motion(m, e, w)
        begin, end = pace * i, pace * (i + 1)
        if next_w * way < 0.0:
            # The loads peak where the axis turns: look there, from the side it comes from.
            top = turning_time(lin, off, v, begin, end, way)
            top_e, top_w = free_motion(flow(lin, top), off, v)
            low, high = meeting(
                axis, springs, parameters, lin, goal, off, v, begin, top, e, w, top_e, top_w, way
            )
            if high > 0.0:
                return bracketed(axis, springs, parameters, lin, goal, off, v, low, high, way), way
            way, begin, e, w = -way, top, top_e, top_w
        low, high = meeting(
            axis, springs, parameters, lin, goal, off, v, begin, end, e, w, next_e, next_w, way
        )
        if high > 0.0:
            return bracketed(axis, springs, parameters, lin, goal, off, v, low, high, way), way
        e, w = next_e, next_w
    return left, 0.0


@kernel(exact=False)
def meeting(
    axis: Any, springs: Any, parameters: Any, lin: Linear, goal: float, off: float, v: float,
    begin: float, end: float, e0: float, w0: float, e1: float, w1: float, way: float,
) -> tuple[float, float]:  # fmt: skip
    """A piece of the time between begin and end at whose end the heaviest load is above the curve; ends in 0 if none.

    Halved until nothing can happen in it: just before the axis turns, the curve may dip under the load and rise again.
    """
    t, d = begin, end - begin
    load0 = heaviest(axis, springs, goal + e0, way)
    while t < end:
        load1 = heaviest(axis, springs, goal + e1, way)
        if load1 >= axis.lowest and load1 >= curve_at(axis.curve, axis.breakaway, parameters, w1):
            return t, t + d
        a0 = -lin.square * e0 - 2.0 * lin.decay * w0
        a1 = -lin.square * e1 - 2.0 * lin.decay * w1
        below = stays_below(axis, parameters, max(load0, load1), w0, w1, a0, a1, d, way)
        if below or d <= FINEST * axis.sample_time:
            t, e0, w0, load0 = t + d, e1, w1, load1
            d *= 2.0
        else:
            d *= 0.5
        d = min(d, end - t)
        if d > 0.0:
            e1, w1 = free_motion(flow(lin, t + d), off, v)
    return 0.0, 0.0


@kernel(exact=False)
def turning_time(lin: Linear, off: float, v: float, low: float, high: float, way: float) -> float:
    """The time between low and high at which the free motion turns, from the side on which it still moves `way`."""
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high or high - low < 1e-9 * high:
            break
        e, w = free_motion(flow(lin, middle), off, v)
        slope = -lin.square * e - 2.0 * lin.decay * w
        guess = middle - w / slope if slope != 0.0 else middle
        if w * way > 0.0:
            low = middle
        else:
            high = middle
        if low < guess < high:
            _, w = free_motion(flow(lin, guess), off, v)
            if w * way > 0.0:
                low = guess
            else:
                high = guess
    return low


@kernel(exact=False)
def bracketed(
    axis: Any, springs: Any, parameters: Any, lin: Linear, goal: float, off: float, v: float,
    low: float, high: float, way: float,
) -> float:  # fmt: skip
    """The time between low and high at which the heaviest load meets the curve (Illinois' rule); not before it."""
    f_low = min(excess_after(axis, springs, parameters, lin, goal, off, v, low, way), 0.0)
    f_high = excess_after(axis, springs, parameters, lin, goal, off, v, high, way)
    for i in range(ROOT_STEPS):
        if f_high <= axis.near or high - low <= 1e-14 * axis.sample_time:
            break
        t = high - f_high * (high - low) / (f_high - f_low)
        if i > 10 or not low < t < high:
            t = 0.5 * (low + high)
        f = excess_after(axis, springs, parameters, lin, goal, off, v, t, way)
        if f >= 0.0:
            high, f_high, f_low = t, f, 0.5 * f_low
        else:
            low, f_low, f_high = t, f, 0.5 * f_high
    return high
