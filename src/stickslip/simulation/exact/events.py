"""Events of the exact integrator: where an element breaks away, where the velocity passes through zero.

An event function is a number that rises to zero where a mode ends; `trigger` is the largest of them. It jumps where
the velocity changes its sign, for the load of a sticking element is counted along the motion. Events are located on
the exact flow. Looked for at the middle and the end of a segment, on both sides of a reversal, where a limit that rises
with the velocity (F_S below F_C) may be passed for a moment that no step would see, and where the velocity dips through
zero between them (a grazing reversal).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation.exact.flow import UNMOVED, Linear, acceleration, flow, free_motion, moved
from stickslip.simulation.exact.forces import sliding
from stickslip.simulation.exact.segment import cubic_of, state_at
from stickslip.simulation.exact.state import Loop, element_of, side_of, sides_of

NONE = -1.0
NOISE = 1e-12
"""Velocities this small (rad/s) may be rounding errors of one that creeps to zero: no reversal yet."""
BARELY = 1e-12
"""Velocity that stands for a side of zero, rad/s."""
STILL = 1e-9
"""An axis whose velocity changes by less than this between two nodes (rad/s) rests, whatever sign rounding gives it."""
LOOK, MOST_LOOKS, LOOKS_AT_TURN = 0.1, 16.0, 8
"""Where an event may hide between two nodes, it is looked for at every such change of velocity, in parts of v_s,
so often at most, and so often where the velocity turns."""
VELOCITY_WEIGHT = 10.0
"""N·m per rad/s: puts a reversal on the scale of a break-away."""
NEAR = 1e-3
"""N·m: a guess of how far the event function is below zero."""
MOST_DIPS, MOST_HALVINGS = 6, 60
SIMULTANEOUS = 1e-14
"""Times that count as one, s."""


@kernel(exact=False)
def load_of(literal: bool, direction: float, force: float) -> float:
    """The load that the slip rule compares (`stickslip.laws.slip_rule`)."""
    return abs(force) if literal else direction * force


@kernel(exact=False, inline=True)
def heaviest(loop: Loop, side: Any, theta: float, v: float) -> float:
    """Largest load per share among a side's sticking elements, N·m."""
    top = -1e300
    direction = 1.0 if v >= 0.0 else -1.0
    for i in range(side.first, side.first + side.sticking):
        e = element_of(loop, i)
        load = load_of(side.literal != 0, direction, e.load_at_0 + e.load_slope * theta)
        if load > top:
            top = load
    return top


@kernel(exact=False, inline=True)
def mode_ends(now: Any, side: Any, i: int, v: float) -> float:
    """How far the velocity is beyond where it ends a mode: at a reversal, or at the edge of a steep layer."""
    g = -1e9
    if i == 0 and now.watched != 0:
        g = -VELOCITY_WEIGHT * (now.sigma * v - now.narrow + NOISE)
    if side.inside != 0:
        g = max(g, VELOCITY_WEIGHT * (abs(v) - side.layer))
    return g


@kernel(exact=False, inline=True)
def beyond_limit(loop: Loop, side: Any, top: float, v: float) -> float:
    """How far a side's largest load is beyond the limit; the curve is asked for where its least level is in reach."""
    limit = side.lowest
    if top > limit:
        # At rest, rounding would ask for the curve at ever other velocities.
        limit = sliding(loop, side, v if abs(v) > BARELY else math.copysign(BARELY, v))
    return top - limit


@kernel(exact=False, inline=True)
def trigger(loop: Loop, theta: float, v: float) -> float:
    """The largest event function at a state: not negative where a mode ends."""
    g = -1e9
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        g = max(g, mode_ends(loop.now, side, i, v))
        if side.sticking != 0:
            top = heaviest(loop, side, theta, v)
            g = max(g, beyond_limit(loop, side, top, v))
    return g


@kernel(exact=False, inline=True)
def trigger_at_node(loop: Loop, v: float) -> float:
    """`trigger` at the next node, which is weighed."""
    g = -1e9
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        g = max(g, mode_ends(loop.now, side, i, v))
        if side.sticking != 0:
            g = max(g, beyond_limit(loop, side, side.top_next, v))
    return g


@kernel(exact=False, inline=True)
def stays(loop: Loop, v: float) -> bool:
    """Whether the loads at the next node are within the limit at v: up to there, while the motion slows down."""
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.sticking != 0 and beyond_limit(loop, side, side.top_next, v) >= 0.0:
            return False
    return True


@kernel(exact=False, inline=True)
def weigh(loop: Loop, theta: float, v: float) -> bool:
    """Note each side's largest load at the next node; returns whether one is near its limit there or here."""
    near = False
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.sticking != 0:
            top = heaviest(loop, side, theta, v)
            side.top_next = top
            near = near or max(top, side.top) > side.lowest
    return near


@kernel(exact=False, inline=True)
def pass_on(loop: Loop) -> None:
    """Stand at the next node."""
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        side.top = side.top_next


@kernel(exact=False, inline=True)
def weigh_here(loop: Loop) -> None:
    """Note each side's largest load where the loop stands."""
    now = loop.now
    weigh(loop, now.position, now.velocity)
    pass_on(loop)


@kernel(exact=False, inline=True)
def farthest(width: float, theta0: float, v0: float, theta1: float, v1: float) -> float:
    """A position beyond which a motion that turns within `width` does not go."""
    beyond = 0.5 * abs(theta1 - theta0) + 0.25 * width * abs(v1 - v0)
    return theta0 + 0.5 * (theta1 - theta0) + math.copysign(beyond, v0)


@kernel(exact=False, inline=True)
def passes_turn(loop: Loop, width: float, theta0: float, v0: float, theta1: float, v1: float) -> bool:
    """Whether a sticking element may be loaded beyond its limit where the velocity passes zero; ends are given."""
    peak = farthest(width, theta0, v0, theta1, v1)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.sticking != 0:
            before = heaviest(loop, side, peak, v0)
            after = heaviest(loop, side, theta1, v1)
            lowest = side.lowest
            if before > lowest and before > sliding(loop, side, math.copysign(BARELY, v0)):
                return True
            if after > lowest and after > sliding(loop, side, math.copysign(BARELY, v1)):
                return True
    return False


@kernel(exact=False, inline=True)
def looks(
    loop: Loop, width: float, theta0: float, v0: float, a0: float, theta1: float, v1: float, a1: float
) -> int:
    """Number of parts of a segment at whose ends events are looked for; the segment's ends are given, and weighed.

    The load of a sticking element near its limit can cross it up and down between two nodes, since s(v) varies
    over v_s. Not where the motion speeds up all along: there the event function rises with the load.
    """
    jump = abs(v1 - v0)
    # A smooth velocity leaves its chord by less than this, and the range of its ends by even less.
    mean = (v1 - v0) / width
    bulge = 0.5 * width * (abs(a0 - mean) + abs(a1 - mean))
    fastest = max(abs(v0), abs(v1)) + min(jump, bulge)
    rises = v0 * v1 >= 0.0 and a0 * v1 > 0.0 and a1 * v1 > 0.0
    parts = 1
    peak = farthest(width, theta0, v0, theta1, v1)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.sticking == 0:
            continue
        lowest = side.lowest
        if jump > STILL and v0 * v1 < 0.0 and heaviest(loop, side, peak, v0) > lowest:
            parts = LOOKS_AT_TURN
        seen = LOOK * side.scale
        if jump > seen > 0.0:
            top0 = side.top
            top1 = side.top_next
            top = max(top0, top1)
            if top > lowest and not (rises and top0 <= top1):
                lowest = sliding(loop, side, fastest)
                lowest = min(lowest, sliding(loop, side, -fastest))
                if top > lowest:
                    parts = max(parts, int(min(jump / seen, MOST_LOOKS)) + 1)
    return parts


class Node(NamedTuple):
    """Where events are looked for: time in the segment, s, position, rad, velocity, rad/s, and the event function."""

    time: float
    position: float
    velocity: float
    trigger: float


@kernel(exact=False, inline=True)
def grazing(lin: Linear, loop: Loop, x0: float, x1: float, v1: float, a0: float, a1: float) -> float:
    """Time in [x0, x1] at which the velocity has dipped through zero, else NONE; a0, a1 are accelerations there."""
    now, segment = loop.now, loop.segment
    sigma = now.sigma
    a0 = sigma * a0
    a1 = sigma * a1
    edge = now.narrow
    if not (a0 < 0.0 and a1 > 0.0 and sigma * v1 > edge and sigma * v1 - edge < -a0 * segment.length):
        return NONE
    c = cubic_of(segment)
    for _ in range(MOST_DIPS):
        x = x0 + (x1 - x0) * min(max(a0 / (a0 - a1), 0.1), 0.9)
        theta, v = state_at(lin, segment, x)
        if sigma * v <= edge - NOISE:
            return x
        a = sigma * acceleration(lin, c, x, theta, v)
        # The velocity falls no further than its tangent.
        if a < 0.0:
            a0 = a
            x0 = x
        else:
            a1 = a
            x1 = x
        if sigma * v - edge > max(-a0, a1) * (x1 - x0):
            break
    return NONE


@kernel(exact=False, inline=True)
def between(
    lin: Linear, loop: Loop, begin: Node, width: float, parts: int, slows: bool, tol: float
) -> tuple[float, float, float]:  # fmt: skip
    """Look for an event at the ends of `parts` parts of a width, but for the last; its end is weighed.

    Returns its time or NONE, the last time looked at, and the event function there.
    """
    left, theta, v, g_left = begin
    c = cubic_of(loop.segment)
    step = width / parts
    m = flow(lin, step)
    p = theta - (c[0] + left * (c[1] + left * (c[2] + left * c[3])))
    q = v - (c[1] + left * (2.0 * c[2] + left * 3.0 * c[3]))
    for _ in range(1, parts):
        p, q = free_motion(m, p, q)
        x = left + step
        theta, v = moved(c, UNMOVED, x, p, q)
        g = trigger(loop, theta, v)
        if g >= 0.0:
            event = locate(lin, loop, left, g_left, Node(x, theta, v, g), tol)
            return event, left, g_left
        left = x
        g_left = g
        if slows and stays(loop, v):
            break
    return NONE, left, g_left


@kernel(exact=False, inline=True)
def find(lin: Linear, loop: Loop, tol: float) -> float:
    """Time of the first event inside the segment, or NONE."""
    now, segment = loop.now, loop.segment
    c = cubic_of(segment)
    half = 0.5 * segment.length
    left = 0.0
    theta = now.position
    v = now.velocity
    watched = now.watched != 0
    g_left = -NEAR
    for node in range(1, 3):
        right = half * node
        theta_right = segment.position_mid if node == 1 else segment.position_end
        v_right = segment.velocity_mid if node == 1 else segment.velocity_end
        near = weigh(loop, theta_right, v_right)
        turns = v * v_right < 0.0 and abs(v_right - v) > STILL
        if watched or near or turns:
            a = acceleration(lin, c, right - half, theta, v)
            a_right = acceleration(lin, c, right, theta_right, v_right)
        else:
            a = a_right = 0.0
        if watched:
            dip = grazing(lin, loop, left, right, v_right, a, a_right)
            if dip > 0.0:
                theta, v = state_at(lin, segment, dip)
                g = trigger(loop, theta, v)
                return locate(lin, loop, left, g_left, Node(dip, theta, v, g), tol)
        elif turns and passes_turn(loop, half, theta, v, theta_right, v_right):
            event = at_turn(lin, loop, left, right, v, g_left, tol)
            if event >= 0.0:
                return event
        if near or turns:
            parts = looks(loop, half, theta, v, a, theta_right, v_right, a_right)
            if parts > 1:
                slows = v * v_right >= 0.0 and a * v < 0.0 and a_right * v_right < 0.0
                event, left, g_left = between(
                    lin, loop, Node(left, theta, v, g_left), half, parts, slows, tol
                )
                if event >= 0.0:
                    return event
        g = trigger_at_node(loop, v_right)
        if g >= 0.0:
            if left == 0.0:
                g_left = trigger(loop, theta, v)
            return locate(lin, loop, left, g_left, Node(right, theta_right, v_right, g), tol)
        pass_on(loop)
        left, theta, v, g_left = right, theta_right, v_right, g
    return NONE


@kernel(exact=False)
def locate(lin: Linear, loop: Loop, low: float, g_low: float, end: Node, tol: float) -> float:
    """Root of `trigger` between `low` and `end`, from its far side: regula falsi (Anderson and Björck), then bisection.

    The motion at the root is kept in `segment`. Sought is a value just beyond the
    root, so that iterates from both sides are good.
    """
    segment = loop.segment
    high, theta, v, g_high = end
    margin = 25.0 * tol
    segment.position_event = theta
    segment.velocity_event = v
    low_miss = min(g_low, 0.0) - margin
    high_miss = g_high - margin
    # The misses that guide the search are weighted; this is the true one at `high`.
    beyond = high_miss
    side = 0
    turn = 0
    while beyond > margin and high - low > 1e-3 * tol:
        x = (low * high_miss - high * low_miss) / (high_miss - low_miss)
        if turn > 10 or not low < x < high:
            x = 0.5 * (low + high)
        theta, v = state_at(lin, segment, x)
        miss = trigger(loop, theta, v) - margin
        if miss >= -margin:
            if side == 1:
                low_miss *= 1.0 - miss / high_miss if miss < high_miss else 0.5
            high = x
            high_miss = beyond = miss
            side = 1
            segment.position_event = theta
            segment.velocity_event = v
        else:
            if side == -1:
                high_miss *= 1.0 - miss / low_miss if miss > low_miss else 0.5
            low = x
            low_miss = miss
            side = -1
        turn += 1
    return high


@kernel(exact=False)
def at_turn(
    lin: Linear, loop: Loop, low: float, high: float, v_low: float, g_low: float, tol: float
) -> float:
    """Time of an event on either side of the reversal in [low, high], or NONE."""
    segment = loop.segment
    left = low
    x = high
    theta = loop.now.position
    for _ in range(MOST_HALVINGS):
        x = 0.5 * (low + high)
        theta, v = state_at(lin, segment, x)
        if v * v_low > 0.0:
            low = x
        else:
            high = x
        if high - low < SIMULTANEOUS:
            break
    before = math.copysign(BARELY, v_low)
    g = trigger(loop, theta, before)
    if g >= 0.0:
        return locate(lin, loop, left, g_low, Node(x, theta, before, g), tol)
    if trigger(loop, theta, -before) < 0.0:
        return NONE
    segment.position_event = theta
    segment.velocity_event = -before
    return x
