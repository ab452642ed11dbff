"""Events of the exact integrator: where an element breaks away, where the velocity passes through zero.

An event function is a number that rises to zero where a mode ends; `trigger` is the largest of them. Events are
located on the exact flow. Looked for at the middle and the end of a segment, on both sides of a reversal, and where
the velocity dips through zero between them (a grazing reversal).
"""

from __future__ import annotations

import math
from typing import Any

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
from stickslip.simulation.exact.segment import (
    LENGTH,
    POSITION_END,
    POSITION_EVENT,
    POSITION_MID,
    VELOCITY_END,
    VELOCITY_EVENT,
    VELOCITY_MID,
    cubic_of,
    state_at,
)
from stickslip.simulation.exact.state import (
    BENDS,
    RELAXES,
    element_of,
    side_of,
    sides_of,
    sliding,
)
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


@kernel(exact=False, inline=True)
def grazing(
    lin: Linear, now: Any, segment: Any, x0: float, x1: float, v1: float, a0: float, a1: float
) -> float:
    """Time in [x0, x1] at which the velocity has dipped through zero, else NONE; a0, a1 are accelerations there."""
    sigma = now.sigma
    a0 = sigma * a0
    a1 = sigma * a1
    edge = now.narrow
    if not (a0 < 0.0 and a1 > 0.0 and sigma * v1 > edge and sigma * v1 - edge < -a0 * segment[LENGTH]):
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
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, now: Any, segment: Any, left: float,
    theta: float, v: float, g_left: float, width: float, parts: int, slows: bool, tol: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Look for an event at the ends of `parts` parts of [left, left + width], but for the last; the end is weighed.

    Returns its time or NONE, the last time looked at, and the event function there.
    """
    c = cubic_of(segment)
    step = width / parts
    m = flow(lin, step)
    p = theta - (c[0] + left * (c[1] + left * (c[2] + left * c[3])))
    q = v - (c[1] + left * (2.0 * c[2] + left * 3.0 * c[3]))
    for _ in range(1, parts):
        p, q = free_motion(m, p, q)
        x = left + step
        theta, v = moved(c, UNMOVED, x, p, q)
        g = trigger(parameters, plan, elements, sides, now, theta, v)
        if g >= 0.0:
            event = locate(
                lin, parameters, plan, elements, sides, now, segment, left, g_left, x, g, theta, v, tol
            )
            return event, left, g_left
        left = x
        g_left = g
        if slows and stays(parameters, plan, sides, v):
            break
    return NONE, left, g_left


@kernel(exact=False, inline=True)
def find(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, now: Any, segment: Any, tol: float
) -> float:  # fmt: skip
    """Time of the first event inside the segment, or NONE."""
    c = cubic_of(segment)
    half = 0.5 * segment[LENGTH]
    left = 0.0
    theta = now.position
    v = now.velocity
    watched = now.watched != 0
    g_left = -NEAR
    for node in range(1, 3):
        right = half * node
        theta_right = segment[POSITION_MID] if node == 1 else segment[POSITION_END]
        v_right = segment[VELOCITY_MID] if node == 1 else segment[VELOCITY_END]
        near = weigh(plan, elements, sides, theta_right, v_right)
        turns = v * v_right < 0.0 and abs(v_right - v) > STILL
        if watched or near or turns:
            a = acceleration(lin, c, right - half, theta, v)
            a_right = acceleration(lin, c, right, theta_right, v_right)
        else:
            a = a_right = 0.0
        if watched:
            dip = grazing(lin, now, segment, left, right, v_right, a, a_right)
            if dip > 0.0:
                theta, v = state_at(lin, segment, dip)
                g = trigger(parameters, plan, elements, sides, now, theta, v)
                return locate(
                    lin, parameters, plan, elements, sides, now, segment, left, g_left, dip, g, theta, v, tol
                )
        elif turns and passes_turn(parameters, plan, elements, sides, half, theta, v, theta_right, v_right):
            event = at_turn(lin, parameters, plan, elements, sides, now, segment, left, right, v, g_left, tol)
            if event >= 0.0:
                return event
        if near or turns:
            parts = looks(parameters, plan, elements, sides, half, theta, v, a, theta_right, v_right, a_right)
            if parts > 1:
                slows = v * v_right >= 0.0 and a * v < 0.0 and a_right * v_right < 0.0
                event, left, g_left = between(
                    lin, parameters, plan, elements, sides, now, segment, left, theta, v, g_left, half, parts,
                    slows, tol,
                )  # fmt: skip
                if event >= 0.0:
                    return event
        g = trigger_at_node(parameters, plan, sides, now, v_right)
        if g >= 0.0:
            if left == 0.0:
                g_left = trigger(parameters, plan, elements, sides, now, theta, v)
            return locate(
                lin, parameters, plan, elements, sides, now, segment, left, g_left, right, g, theta_right,
                v_right, tol,
            )  # fmt: skip
        pass_on(plan, sides)
        left, theta, v, g_left = right, theta_right, v_right, g
    return NONE


@kernel(exact=False)
def locate(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, now: Any, segment: Any, low: float,
    g_low: float, high: float, g_high: float, theta: float, v: float, tol: float,
) -> float:  # fmt: skip
    """Root of `trigger` in [low, high], from its far side: regula falsi (Anderson and Björck), then bisection.

    The motion at `high` is (theta, v); that at the root is kept in `segment`. Sought is a value just beyond the
    root, so that iterates from both sides are good.
    """
    margin = 25.0 * tol
    segment[POSITION_EVENT] = theta
    segment[VELOCITY_EVENT] = v
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
        miss = trigger(parameters, plan, elements, sides, now, theta, v) - margin
        if miss >= -margin:
            if side == 1:
                low_miss *= 1.0 - miss / high_miss if miss < high_miss else 0.5
            high = x
            high_miss = beyond = miss
            side = 1
            segment[POSITION_EVENT] = theta
            segment[VELOCITY_EVENT] = v
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
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, now: Any, segment: Any, low: float,
    high: float, v_low: float, g_low: float, tol: float,
) -> float:  # fmt: skip
    """Time of an event on either side of the reversal in [low, high], or NONE."""
    left = low
    x = high
    theta = now.position
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
    g = trigger(parameters, plan, elements, sides, now, theta, before)
    if g >= 0.0:
        return locate(
            lin, parameters, plan, elements, sides, now, segment, left, g_low, x, g, theta, before, tol
        )
    if trigger(parameters, plan, elements, sides, now, theta, -before) < 0.0:
        return NONE
    segment[POSITION_EVENT] = theta
    segment[VELOCITY_EVENT] = -before
    return x


@kernel(exact=False, inline=True)
def add_exponents(plan: Any, sides: Any, h: float, x: float) -> None:
    """Add the decay C int 1/s dt of slipping elements over the first x of a segment of length h."""
    f = x / h
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        if side.slipping > 0.0 and side.kind == RELAXES:
            attraction = side.attraction
            q0 = side.decay
            bend = 2.0 * (q0 + side.decay_end) - 4.0 * side.decay_mid
            slope = side.decay_end - q0 - bend
            side.exponent += attraction * x * (q0 + f * (0.5 * slope + f * bend / 3.0))


@kernel(exact=False, inline=True)
def settle_forces(parameters: Any, plan: Any, elements: Any, sides: Any, now: Any) -> None:
    """Write every element's force where the loop stands, before modes change."""
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        if side.kind == BENDS:
            side.force = side.force_now
            continue
        decay = math.exp(-side.exponent)
        moves = side.kind == RELAXES
        s = 0.0 if moves else sliding(parameters, plan, sides, side, now.velocity)
        for j in range(side.first, side.last):
            e = element_of(elements, j)
            if e.slips == 0:
                e.force = e.offset + e.stiffness * now.position
            elif moves:
                part = e.share / side.slipping
                gained = side.force_now - decay * side.force_start
                e.force = decay * e.force + part * gained
            else:
                e.force = e.share * now.sigma * s


@kernel(exact=False, inline=True)
def switch(parameters: Any, plan: Any, elements: Any, sides: Any, now: Any) -> None:
    """Change the modes that end here: stick at a reversal, slip where the limit is reached."""
    v = now.velocity
    settle_forces(parameters, plan, elements, sides, now)
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        enter_or_leave(sides, now, side, v)
    if now.watched != 0 and now.sigma * v <= 1e-9 * abs(v):
        for i in range(plan.elements):
            element_of(elements, i).slips = 0
        if now.sigma * v > 0.0:
            now.velocity = 0.0
        if not set_off(plan, elements, sides, parameters, now):
            now.sigma = -now.sigma
        # Where the curve rises with the velocity, what stuck before may be loaded beyond it in the new direction.
        if now.sigma != 0.0:
            v = now.sigma * max(now.sigma * now.velocity, BARELY)
            break_away(parameters, plan, elements, sides, now, v, now.sigma)
        return
    break_away(parameters, plan, elements, sides, now, v, 1.0 if v >= 0.0 else -1.0)


@kernel(exact=False, inline=True)
def break_away(
    parameters: Any, plan: Any, elements: Any, sides: Any, now: Any, v: float, direction: float
) -> None:
    """Let the sticking elements slip whose load in `direction` is at its limit."""
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        if side.first == side.last:
            continue
        s = sliding(parameters, plan, sides, side, v)
        for j in range(side.first, side.last):
            e = element_of(elements, j)
            load = load_of(side.literal != 0, direction, e.force)
            if e.slips == 0 and load >= e.share * s - ROUNDING:
                e.slips = 1
                now.sigma = direction


@kernel(exact=False)
def enter_or_leave(sides: Any, now: Any, side: Any, v: float) -> None:
    """Pass the edge of a steep layer if the axis stands there."""
    edge = side.layer
    if edge == 0.0:
        return
    if side.inside != 0:
        if abs(v) >= (1.0 - ON_EDGE) * edge:
            side.inside = 0
            now.sigma = 1.0 if v > 0.0 else -1.0
    elif now.sigma * v <= (1.0 + ON_EDGE) * edge:
        side.inside = 1
