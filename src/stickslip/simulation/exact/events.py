"""Events of the exact integrator: where an element breaks away, where the velocity passes through zero.

An event function is a number that rises to zero where a mode ends; `trigger` is the largest of them. Events are
located on the exact flow. Looked for at the middle and the end of a segment, on both sides of a reversal, and where
the velocity dips through zero between them (a grazing reversal).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation.exact.event_functions import (
    BARELY,
    NOISE,
    STILL,
    load_of,
    looks,
    pass_on,
    passes_turn,
    stays,
    trigger,
    trigger_at_node,
    weigh,
)
from stickslip.simulation.exact.flow import UNMOVED, Linear, acceleration, flow, free_motion, moved
from stickslip.simulation.exact.forces import sliding
from stickslip.simulation.exact.segment import cubic_of, state_at
from stickslip.simulation.exact.state import BENDS, RELAXES, Loop, element_of, side_of, sides_of
from stickslip.simulation.exact.stiction import NONE, set_off

NEAR = 1e-3
"""N·m: a guess of how far the event function is below zero."""
ROUNDING = 1e-10
"""N·m by which a load may seem to miss the limit that it was located at."""
ON_EDGE = 1e-6
"""Velocities this near the edge of a steep layer, in parts of it, are on it."""
MOST_DIPS, MOST_HALVINGS = 6, 60
SIMULTANEOUS = 1e-14
"""Times that count as one, s."""


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


@kernel(exact=False, inline=True)
def add_exponents(loop: Loop, h: float, x: float) -> None:
    """Add the decay C int 1/s dt of slipping elements over the first x of a segment of length h."""
    f = x / h
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.slipping > 0.0 and side.kind == RELAXES:
            attraction = side.attraction
            q0 = side.decay
            bend = 2.0 * (q0 + side.decay_end) - 4.0 * side.decay_mid
            slope = side.decay_end - q0 - bend
            side.exponent += attraction * x * (q0 + f * (0.5 * slope + f * bend / 3.0))


@kernel(exact=False, inline=True)
def settle_forces(loop: Loop) -> None:
    """Write every element's force where the loop stands, before modes change."""
    now = loop.now
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.kind == BENDS:
            side.force = side.force_now
            continue
        decay = math.exp(-side.exponent)
        moves = side.kind == RELAXES
        s = 0.0 if moves else sliding(loop, side, now.velocity)
        for j in range(side.first, side.last):
            e = element_of(loop, j)
            if e.slips == 0:
                e.force = e.offset + e.stiffness * now.position
            elif moves:
                part = e.share / side.slipping
                gained = side.force_now - decay * side.force_start
                e.force = decay * e.force + part * gained
            else:
                e.force = e.share * now.sigma * s


@kernel(exact=False, inline=True)
def switch(loop: Loop) -> None:
    """Change the modes that end here: stick at a reversal, slip where the limit is reached."""
    now = loop.now
    v = now.velocity
    settle_forces(loop)
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        enter_or_leave(loop, side, v)
    if now.watched != 0 and now.sigma * v <= 1e-9 * abs(v):
        for i in range(loop.plan.elements):
            element_of(loop, i).slips = 0
        if now.sigma * v > 0.0:
            now.velocity = 0.0
        if not set_off(loop):
            now.sigma = -now.sigma
        # Where the curve rises with the velocity, what stuck before may be loaded beyond it in the new direction.
        if now.sigma != 0.0:
            v = now.sigma * max(now.sigma * now.velocity, BARELY)
            break_away(loop, v, now.sigma)
        return
    break_away(loop, v, 1.0 if v >= 0.0 else -1.0)


@kernel(exact=False, inline=True)
def break_away(loop: Loop, v: float, direction: float) -> None:
    """Let the sticking elements slip whose load in `direction` is at its limit."""
    for i in range(sides_of(loop)):
        side = side_of(loop, i)
        if side.first == side.last:
            continue
        s = sliding(loop, side, v)
        for j in range(side.first, side.last):
            e = element_of(loop, j)
            load = load_of(side.literal != 0, direction, e.force)
            if e.slips == 0 and load >= e.share * s - ROUNDING:
                e.slips = 1
                loop.now.sigma = direction


@kernel(exact=False)
def enter_or_leave(loop: Loop, side: Any, v: float) -> None:
    """Pass the edge of a steep layer if the axis stands there."""
    now = loop.now
    edge = side.layer
    if edge == 0.0:
        return
    if side.inside != 0:
        if abs(v) >= (1.0 - ON_EDGE) * edge:
            side.inside = 0
            now.sigma = 1.0 if v > 0.0 else -1.0
    elif now.sigma * v <= (1.0 + ON_EDGE) * edge:
        side.inside = 1
