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
from stickslip.simulation.sampled.rates import BENDS, FOLLOWS, Slip, Trial, curve_at, rates, slip_of
from stickslip.simulation.sampled.stretch import Stretch, lowest, velocity_in, within

__all__ = ["slip"]

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


@kernel(exact=False)
def slip(axis: Any, z: Any, left: float) -> float:
    """Take one step of at most `left` s; returns the time taken."""
    if left == axis.sample_time and z.direction * z.velocity > axis.far and glides(axis, z):
        return left
    m = slip_of(axis, z)
    way, edge, v0 = z.direction, axis.layer, z.velocity
    a0, _, _ = rates(m, 0.0, v0, z.slipping)
    if way * v0 <= edge and way * a0 <= 0.0:
        if way == 0.0 and a0 == 0.0:
            z.acceleration = 0.0
            return left
        turn(axis, z)
        return 0.0
    h = min(left, z.next)
    if z.spring > 0.0:
        h = min(h, math.sqrt(axis.inertia / z.spring))
    h = min(h, axis.longest)
    while True:
        trial, turns, breaks = ended(axis, z, m, a0, accepted(axis, z, m, h))
        if trial.error <= axis.local or z.failed:
            break
        # Cut where the axis turns, the step meets the curve's peak there, which the whole one had jumped over unseen.
        h = z.next = shorter(axis, z, trial)
    z.moved, z.velocity, z.slipping = z.moved + trial.moved, trial.velocity, trial.slipping
    z.relaxed += trial.relaxed
    z.acceleration = acceleration_after(m, trial)
    if breaks:
        break_away(axis, z, way)
    elif turns:
        turn(axis, z)
    elif axis.kind == BENDS and way * trial.velocity < edge:
        z.direction = sign(trial.velocity)
    return trial.time


@kernel(exact=False, inline=True)
def acceleration_after(m: Slip, trial: Trial) -> float:
    """At the end of a step, rad/s²."""
    a, _, _ = rates(m, trial.moved, trial.velocity, trial.slipping)
    return a


@kernel(exact=False, inline=True)
def stretch_of(z: Any, m: Slip, a0: float, trial: Trial) -> Stretch:
    """What both ends of a step say of the motion inside it."""
    return Stretch(trial.time, trial.moved, z.velocity, a0, trial.velocity, acceleration_after(m, trial))


@kernel(exact=False)
def ended(axis: Any, z: Any, m: Slip, a0: float, trial: Trial) -> tuple[Trial, bool, bool]:
    """Cut an accepted step where something ends; whether the axis turns there, and whether an element breaks away."""
    way, edge = z.direction, axis.layer
    whole = stretch_of(z, m, a0, trial)
    turns = breaks = False
    if way * trial.velocity < edge:
        if axis.kind != BENDS or 2.0 * abs(trial.velocity) * trial.time > UNSEEN * axis.local:
            trial = arrival(axis, z, m, whole)
            turns = True
    elif way * a0 < 0.0 < way * whole.a1:
        low = lowest(whole, way)
        if way * velocity_in(whole, low) < edge + 0.1 * abs(z.velocity - trial.velocity):
            trial = attempt(m, z.velocity, z.slipping, low)
            if way * trial.velocity < edge:
                trial = arrival(axis, z, m, stretch_of(z, m, a0, trial))
                turns = True
    if z.spring > 0.0:
        trial, breaks = next_break(axis, z, m, a0, trial)
        turns = turns and not breaks and way * trial.velocity < edge + 1e-9
    return trial, turns, breaks


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
def accepted(axis: Any, z: Any, m: Slip, h: float) -> Trial:
    """The first step of at most h that keeps the tolerance; `z.next` is the length that the next one may have."""
    cut = h < z.next
    trial = attempt(m, z.velocity, z.slipping, h)
    while not trial.error <= axis.local:
        cut = False
        h = shorter(axis, z, trial)
        if z.failed:
            break
        trial = attempt(m, z.velocity, z.slipping, h)
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
def arrival(axis: Any, z: Any, m: Slip, whole: Stretch) -> Trial:
    """The step inside one that ends where the velocity has fallen to the edge: Newton's rule on real steps."""
    way, edge, h = z.direction, axis.layer, whole.time
    low, high = 0.0, h
    # A start from where it now arrives: the motion first goes out, so that the cubic's later root is meant.
    for _ in range(40):
        t = 0.5 * (low + high)
        if way * velocity_in(whole, t) > edge:
            low = t
        else:
            high = t
    t, low, high = 0.5 * (low + high), 0.0, h
    enough = max(ARRIVED * max(1.0, abs(whole.v0)), 1e-3 * (axis.local / axis.sample_time))
    trial = attempt(m, whole.v0, z.slipping, t)
    for i in range(ROOT_STEPS):
        gap = way * trial.velocity - edge
        if abs(gap) <= enough or high - low <= 1e-15 * h:
            break
        if gap > 0.0:
            low = t
        else:
            high = t
        a = acceleration_after(m, trial)
        t -= gap / (way * a) if a != 0.0 else 0.0
        if i > 20 or not low < t < high:
            t = 0.5 * (low + high)
        trial = attempt(m, whole.v0, z.slipping, t)
    return trial


@kernel(exact=False)
def next_break(axis: Any, z: Any, m: Slip, a0: float, trial: Trial) -> tuple[Trial, bool]:
    """Cut the step where the next element breaks away; whether one does."""
    way, v0 = z.direction, z.velocity
    load0 = heaviest(axis, z.moved, way)
    if max(load0, heaviest(axis, z.moved + trial.moved, way)) < axis.lowest:
        return trial, False
    if way * v0 > 0.0 and load0 >= curve_at(axis, v0):
        return Trial(0.0, 0.0, v0, z.slipping, 0.0, 0.0), True
    whole = stretch_of(z, m, a0, trial)
    h = whole.time
    t, d = 0.0, h / LOOKS
    w0, b0, before = v0, a0, 0.0
    while t < h:
        d = min(d, h - t)
        moved, w1, b1 = within(whole, t + d)
        load1 = heaviest(axis, z.moved + moved, way)
        if load1 >= axis.lowest and load1 >= curve_at(axis, w1):
            return located(axis, z, m, whole, t, t + d)
        piece = Stretch(d, moved - before, w0, b0, w1, b1)
        if stays_below(axis, max(load0, load1), piece, way) or d <= FINEST * axis.sample_time:
            t, load0, w0, b0, before = t + d, load1, w1, b1, moved
            d *= 2.0
        else:
            d *= 0.5
    return trial, False


@kernel(exact=False)
def looked(axis: Any, z: Any, whole: Stretch, t: float) -> float:
    """How far the heaviest load lies above the curve t into a step, by its quintic, N·m."""
    moved, v, _ = within(whole, t)
    return heaviest(axis, z.moved + moved, z.direction) - curve_at(axis, v)


@kernel(exact=False)
def over(axis: Any, z: Any, trial: Trial) -> float:
    """How far the heaviest load lies above the curve at the end of a real step, N·m."""
    return heaviest(axis, z.moved + trial.moved, z.direction) - curve_at(axis, trial.velocity)


@kernel(exact=False)
def located(axis: Any, z: Any, m: Slip, whole: Stretch, low: float, high: float) -> tuple[Trial, bool]:
    """The step between low and high at whose end the heaviest load meets the curve, and whether it does.

    The place is found on the quintic of the whole step (Illinois' rule), then corrected on real steps.
    """
    h = whole.time
    f_low = min(looked(axis, z, whole, low), 0.0)
    f_high = max(looked(axis, z, whole, high), 0.0)
    begin, end = low, high
    t = high
    for i in range(ROOT_STEPS):
        if f_high <= axis.near or high - low <= 1e-12 * h:
            break
        slope = (f_high - f_low) / (high - low)
        t = high - f_high / slope
        if i > 10 or not low < t < high:
            t = 0.5 * (low + high)
        f = looked(axis, z, whole, t)
        if f >= 0.0:
            high, f_high, f_low = t, f, 0.5 * f_low
        else:
            low, f_low, f_high = t, f, 0.5 * f_high
    d = 1e-3 * (end - begin)
    slope = (looked(axis, z, whole, t + d) - looked(axis, z, whole, t - d)) / (2.0 * d)
    trial = attempt(m, whole.v0, z.slipping, t)
    for _ in range(ROOT_STEPS):
        f = over(axis, z, trial)
        if abs(f) <= axis.near:
            return trial, True
        t = min(max(t - f / slope, 0.0), h) if slope > 0.0 else end
        trial = attempt(m, whole.v0, z.slipping, t)
        if slope <= 0.0 or t == 0.0 or t == h:
            break
    # The quintic has seen more than there is, or the crossing is another one: go on from there.
    return trial, over(axis, z, trial) >= 0.0
