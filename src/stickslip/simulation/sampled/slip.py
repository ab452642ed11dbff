"""A step in which something slips, cut where the axis turns or the next element breaks away.

The step is of order 8 under error control (`stickslip.simulation.sampled.order_eight`). What ends it is found on the
quintic through both of its ends and then located on real steps from the same start.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.sampled.modes import break_away, heaviest, sign, stays_below, turn
from stickslip.simulation.sampled.order_eight import attempt
from stickslip.simulation.sampled.rates import BENDS, FOLLOWS, Slip, curve_at, rates, slip_of

__all__ = ["slip", "within"]

SHORTEST = 1e-13
"""Of the sample time: a step that must be shorter does not exist."""
UNSEEN = 0.1
"""Of the tolerance of a step: what a bristle may move on beyond its turn without the turn being located."""
LOOKS = 4
"""Pieces of a step in which loads of sticking elements are first compared with the curve."""
FINEST = 1e-6
"""Of the sample time: what a load may be above the curve for without being seen."""
ROOT_STEPS = 60
ARRIVED = 1e-14
"""rad/s, relative above 1 rad/s: a velocity at its goal."""
Trial = tuple[float, float, float, float, float]


@kernel(exact=False)
def slip(axis: Any, z: Any, springs: Any, parameters: Any, left: float) -> float:
    """Take one step of at most `left` s; returns the time taken."""
    if left == axis.sample_time and z.direction * z.velocity > axis.far and glides(axis, z):
        return left
    m = slip_of(axis, z, parameters)
    way, edge, v0 = z.direction, axis.layer, z.velocity
    a0, _, _ = rates(m, 0.0, v0, z.slipping)
    if way * v0 <= edge and way * a0 <= 0.0:
        if way == 0.0 and a0 == 0.0:
            z.acceleration = 0.0
            return left
        turn(axis, z, springs, parameters)
        return 0.0
    h = min(left, z.next)
    if z.spring > 0.0:
        h = min(h, math.sqrt(axis.inertia / z.spring))
    h = min(h, axis.longest)
    while True:
        h, trial = accepted(axis, z, m, h)
        h, trial, turns, breaks = ended(axis, z, springs, parameters, m, a0, h, trial)
        if trial[4] <= axis.local or z.failed:
            break
        # Cut where the axis turns, the step meets the curve's peak there, which the whole one had jumped over unseen.
        h = z.next = shorter(axis, z, h, trial[4])
    z.moved, z.velocity, z.slipping = z.moved + trial[0], trial[1], trial[2]
    z.relaxed += trial[3]
    z.acceleration, _, _ = rates(m, trial[0], trial[1], trial[2])
    if breaks:
        break_away(axis, z, springs, parameters, way)
    elif turns:
        turn(axis, z, springs, parameters)
    elif axis.kind == BENDS and way * trial[1] < edge:
        z.direction = sign(trial[1])
    return h


@kernel(exact=False)
def ended(
    axis: Any, z: Any, springs: Any, parameters: Any, m: Slip, a0: float, h: float, trial: Trial
) -> tuple[float, Trial, bool, bool]:
    """Cut an accepted step where something ends; whether the axis turns there, and whether an element breaks away."""
    way, edge, v0 = z.direction, axis.layer, z.velocity
    near = axis.local / axis.sample_time
    a1, _, _ = rates(m, trial[0], trial[1], trial[2])
    turns = breaks = False
    if way * trial[1] < edge:
        if axis.kind != BENDS or 2.0 * abs(trial[1]) * h > UNSEEN * axis.local:
            h, trial = arrival(m, v0, z.slipping, a0, h, trial, a1, way, edge, near)
            turns = True
    elif way * a0 < 0.0 < way * a1:
        low = lowest_at(v0, a0, trial[1], a1, h, way)
        if way * hermite(v0, a0, trial[1], a1, h, low) < edge + 0.1 * abs(v0 - trial[1]):
            h, trial = low, attempt(m, v0, z.slipping, low)
            if way * trial[1] < edge:
                a1, _, _ = rates(m, trial[0], trial[1], trial[2])
                h, trial = arrival(m, v0, z.slipping, a0, h, trial, a1, way, edge, near)
                turns = True
    if z.spring > 0.0:
        h, trial, breaks = next_break(axis, z, springs, parameters, m, a0, h, trial)
        turns = turns and not breaks and way * trial[1] < edge + 1e-9
    return h, trial, turns, breaks


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
def accepted(axis: Any, z: Any, m: Slip, h: float) -> tuple[float, Trial]:
    """The first step of at most h that keeps the tolerance; `z.next` is the length that the next one may have."""
    cut = h < z.next
    trial = attempt(m, z.velocity, z.slipping, h)
    while not trial[4] <= axis.local:
        cut = False
        h = shorter(axis, z, h, trial[4])
        if z.failed:
            break
        trial = attempt(m, z.velocity, z.slipping, h)
    grown = 4.0
    if trial[4] > 1e-5 * axis.local:
        grown = 0.9 * eighth_root(axis.local / trial[4])
    # A step that the end of the sample has cut says nothing against a longer one.
    z.next = max(z.next, h * grown) if cut else h * grown
    return h, trial


@kernel(exact=False)
def shorter(axis: Any, z: Any, h: float, error: float) -> float:
    """How long a step may be that was wrong by `error` with h."""
    z.rejected += 1
    h *= max(0.1, 0.9 * eighth_root(axis.local / error)) if error < math.inf else 0.1
    if h < SHORTEST * axis.sample_time:
        z.failed = 1
    return h


@kernel(exact=False, inline=True)
def eighth_root(x: float) -> float:
    """x^(1/8)."""
    return math.sqrt(math.sqrt(math.sqrt(x)))


@kernel(exact=False, inline=True)
def hermite(v0: float, a0: float, v1: float, a1: float, h: float, t: float) -> float:
    """The cubic through velocities and accelerations of both ends, rad/s."""
    x = t / h
    y = 1.0 - x
    return y * y * (1.0 + 2.0 * x) * v0 + x * x * (3.0 - 2.0 * x) * v1 + x * y * h * (y * a0 - x * a1)


@kernel(exact=False)
def lowest_at(v0: float, a0: float, v1: float, a1: float, h: float, way: float) -> float:
    """Where the cubic is nearest to turning: its slope changes sign once between slopes of opposite signs."""
    low, high = 0.0, h
    for _ in range(30):
        t = 0.5 * (low + high)
        d = 1e-4 * h
        slope = hermite(v0, a0, v1, a1, h, t + d) - hermite(v0, a0, v1, a1, h, t - d)
        if way * slope < 0.0:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@kernel(exact=False)
def arrival(
    m: Slip,
    v0: float,
    s0: float,
    a0: float,
    h: float,
    trial: Trial,
    a1: float,
    way: float,
    edge: float,
    near: float,
) -> tuple[float, Trial]:
    """The step within h that ends where the velocity has fallen to `edge`: Newton's rule on real steps, bracketed."""
    low, high = 0.0, h
    # A start from where it now arrives: the motion first goes out, so that the cubic's later root is meant.
    for _ in range(40):
        t = 0.5 * (low + high)
        if way * hermite(v0, a0, trial[1], a1, h, t) > edge:
            low = t
        else:
            high = t
    t, low, high = 0.5 * (low + high), 0.0, h
    enough = max(ARRIVED * max(1.0, abs(v0)), 1e-3 * near)
    for i in range(ROOT_STEPS):
        trial = attempt(m, v0, s0, t)
        gap = way * trial[1] - edge
        if abs(gap) <= enough or high - low <= 1e-15 * h:
            break
        if gap > 0.0:
            low = t
        else:
            high = t
        a, _, _ = rates(m, trial[0], trial[1], trial[2])
        t -= gap / (way * a) if a != 0.0 else 0.0
        if i > 20 or not low < t < high:
            t = 0.5 * (low + high)
    return t, trial


@kernel(exact=False, inline=True)
def within(
    d: float, v0: float, a0: float, v1: float, a1: float, h: float, t: float
) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration after t of a step of h: the quintic of what both ends say."""
    x = t / h
    p, q = d - h * (v0 + 0.5 * h * a0), h * (v1 - v0 - h * a0)
    r = h * h * (a1 - a0)
    c3 = 10.0 * p - 4.0 * q + 0.5 * r
    c4 = -15.0 * p + 7.0 * q - r
    c5 = 6.0 * p - 3.0 * q + 0.5 * r
    moved = t * (v0 + 0.5 * t * a0) + x * x * x * (c3 + x * (c4 + x * c5))
    v = v0 + t * a0 + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / h
    return moved, v, a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)) / (h * h)


@kernel(exact=False)
def next_break(
    axis: Any, z: Any, springs: Any, parameters: Any, m: Slip, a0: float, h: float, trial: Trial
) -> tuple[float, Trial, bool]:
    """Cut the step where the next element breaks away; whether one does."""
    way, v0 = z.direction, z.velocity
    start = heaviest(axis, springs, z.moved, way)
    end = heaviest(axis, springs, z.moved + trial[0], way)
    if max(start, end) < axis.lowest:
        return h, trial, False
    if way * v0 > 0.0 and start >= curve_at(axis.curve, axis.breakaway, parameters, v0):
        return 0.0, (0.0, v0, z.slipping, 0.0, 0.0), True
    a1, _, _ = rates(m, trial[0], trial[1], trial[2])
    t, d = 0.0, h / LOOKS
    load0, w0, b0 = start, v0, a0
    while t < h:
        d = min(d, h - t)
        moved, w1, b1 = within(trial[0], v0, a0, trial[1], a1, h, t + d)
        load1 = heaviest(axis, springs, z.moved + moved, way)
        if load1 >= axis.lowest and load1 >= curve_at(axis.curve, axis.breakaway, parameters, w1):
            return located(axis, z, springs, parameters, m, a0, a1, h, trial, t, t + d)
        below = stays_below(axis, parameters, max(load0, load1), w0, w1, b0, b1, d, way)
        if below or d <= FINEST * axis.sample_time:
            t, load0, w0, b0 = t + d, load1, w1, b1
            d *= 2.0
        else:
            d *= 0.5
    return h, trial, False


@kernel(exact=False)
def looked(
    axis: Any, z: Any, springs: Any, parameters: Any, a0: float, a1: float, h: float, trial: Trial, t: float
) -> float:
    """How far the heaviest load lies above the curve t into a step, by its quintic, N·m."""
    moved, v, _ = within(trial[0], z.velocity, a0, trial[1], a1, h, t)
    load = heaviest(axis, springs, z.moved + moved, z.direction)
    return load - curve_at(axis.curve, axis.breakaway, parameters, v)


@kernel(exact=False)
def located(
    axis: Any, z: Any, springs: Any, parameters: Any, m: Slip, a0: float, a1: float, h: float, whole: Trial,
    low: float, high: float,
) -> tuple[float, Trial, bool]:  # fmt: skip
    """The step between low and high at whose end the heaviest load meets the curve, and whether it does.

    The place is found on the quintic of the whole step (Illinois' rule), then corrected on real steps.
    """
    v0, s0, way = z.velocity, z.slipping, z.direction
    f_low = min(looked(axis, z, springs, parameters, a0, a1, h, whole, low), 0.0)
    f_high = max(looked(axis, z, springs, parameters, a0, a1, h, whole, high), 0.0)
    begin, end = low, high
    t, slope = high, 0.0
    for i in range(ROOT_STEPS):
        if f_high <= axis.near or high - low <= 1e-12 * h:
            break
        slope = (f_high - f_low) / (high - low)
        t = high - f_high / slope
        if i > 10 or not low < t < high:
            t = 0.5 * (low + high)
        f = looked(axis, z, springs, parameters, a0, a1, h, whole, t)
        if f >= 0.0:
            high, f_high, f_low = t, f, 0.5 * f_low
        else:
            low, f_low, f_high = t, f, 0.5 * f_high
    d = 1e-3 * (end - begin)
    slope = looked(axis, z, springs, parameters, a0, a1, h, whole, t + d)
    slope = (slope - looked(axis, z, springs, parameters, a0, a1, h, whole, t - d)) / (2.0 * d)
    trial = attempt(m, v0, s0, t)
    for _ in range(ROOT_STEPS):
        f = heaviest(axis, springs, z.moved + trial[0], way)
        f -= curve_at(axis.curve, axis.breakaway, parameters, trial[1])
        if abs(f) <= axis.near:
            return t, trial, True
        t = min(max(t - f / slope, 0.0), h) if slope > 0.0 else end
        trial = attempt(m, v0, s0, t)
        if slope <= 0.0 or t == 0.0 or t == h:
            break
    # The quintic has seen more than there is, or the crossing is another one: go on from there.
    f = heaviest(axis, springs, z.moved + trial[0], way)
    return t, trial, f >= curve_at(axis.curve, axis.breakaway, parameters, trial[1])
