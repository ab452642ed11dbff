"""Events of the exact integrator: where an element breaks away, where the velocity passes through zero.

An event function is a number that rises to zero where a mode ends; `trigger` is the largest of them. Events are
located on the exact flow. Looked for at the middle and the end of a stretch, and where the velocity dips through
zero between them (a grazing reversal).
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel, pointer
from stickslip.simulation._exact_flow import UNMOVED, Linear, acceleration, flow, free_motion, moved
from stickslip.simulation._exact_rest import NONE, set_off
from stickslip.simulation._exact_state import (
    ATTRACTION,
    BENDS,
    ELEMENT_SIZE,
    ELEMENTS,
    EXPONENT,
    FORCE,
    INSIDE,
    KIND,
    LAYER,
    LITERAL,
    LOAD_AT_0,
    LOAD_SLOPE,
    LOWEST,
    NARROW,
    OFFSET,
    POSITION,
    Q_END,
    Q_MID,
    RELAXES,
    S_NOW,
    S_START,
    SCALE,
    SHARE,
    SIDE_SIZE,
    SIDES,
    SIGMA,
    SLIPPING,
    SLIPS,
    STICKING,
    STIFFNESS,
    VELOCITY,
    WATCHED,
    Q,
    S,
    first_of,
    sliding,
)
from stickslip.simulation._exact_stretch import (
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

NEAR = 1e-3
"""N·m: a guess of how far the event function is below zero."""
NOISE = 1e-12
"""Velocities this small (rad/s) may be rounding errors of one that creeps to zero: no reversal yet."""
ROUNDING = 1e-10
"""N·m by which a load may seem to miss the limit that it was located at."""
ON_EDGE = 1e-6
"""Velocities this near the edge of a steep layer, in parts of it, are on it."""
MOST_DIPS = 6
LOOK, MOST_LOOKS, LOOKS_AT_TURN = 0.1, 16.0, 8
"""Where an event may hide between two nodes, it is looked for at every such change of velocity, in parts of v_s,
so often at most, and so often where the velocity turns."""
VELOCITY_WEIGHT = 10.0
"""N·m per rad/s: puts a reversal on the scale of a break-away."""


@kernel(exact=False)
def load_of(literal: bool, direction: float, force: float) -> float:
    """The load that the slip rule compares (`stickslip.laws._stick`)."""
    return abs(force) if literal else direction * force


@kernel(exact=False, inline=True)
def heaviest(plan: Any, elements: Any, sides: Any, side: int, theta: float, v: float) -> float:
    """Largest load per share among a side's sticking elements, N·m."""
    top = -1e300
    first = first_of(plan, side)
    literal = plan[LITERAL] > 0.0
    direction = 1.0 if v >= 0.0 else -1.0
    for i in range(first, first + int(sides[side * SIDE_SIZE + STICKING])):
        e = pointer(elements, i * ELEMENT_SIZE)
        load = load_of(literal, direction, e[LOAD_AT_0] + e[LOAD_SLOPE] * theta)
        if load > top:
            top = load
    return top


@kernel(exact=False, inline=True)
def trigger(
    parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, theta: float, v: float
) -> float:
    """The largest event function at a state: not negative where a mode ends."""
    g = -1e9
    if loop[WATCHED] > 0.0:
        g = -VELOCITY_WEIGHT * (loop[SIGMA] * v - loop[NARROW] + NOISE)
    for side in range(int(plan[SIDES])):
        if sides[side * SIDE_SIZE + INSIDE] > 0.0:
            g = max(g, VELOCITY_WEIGHT * (abs(v) - sides[side * SIDE_SIZE + LAYER]))
        if sides[side * SIDE_SIZE + STICKING] > 0.0:
            top = heaviest(plan, elements, sides, side, theta, v)
            # The curve is only asked for where its lowest level is in reach.
            limit = sides[side * SIDE_SIZE + LOWEST]
            if top > limit:
                limit = sliding(parameters, plan, sides, side, v)
            g = max(g, top - limit)
    return g


@kernel(exact=False, inline=True)
def looks(
    parameters: Any, plan: Any, elements: Any, sides: Any, width: float, theta0: float, v0: float, a0: float,
    theta1: float, v1: float, a1: float,
) -> int:  # fmt: skip
    """Number of parts of a stretch at whose ends events are looked for; the stretch's ends are given.

    The load of a sticking element near its limit can cross it up and down between two nodes, since s(v) varies
    over v_s. Not where the motion speeds up all along: there the event function rises with the load.
    """
    jump = abs(v1 - v0)
    fastest = max(abs(v0), abs(v1)) + jump
    rises = v0 * v1 >= 0.0 and a0 * v1 > 0.0 and a1 * v1 > 0.0
    parts = 1
    # Where the velocity turns, the load is largest between the ends, and no further than this.
    peak = (
        theta0 + 0.5 * (theta1 - theta0) + math.copysign(0.5 * abs(theta1 - theta0) + 0.25 * width * jump, v0)
    )
    for side in range(int(plan[SIDES])):
        if (
            v0 * v1 < 0.0
            and sides[side * SIDE_SIZE + STICKING] > 0.0
            and heaviest(plan, elements, sides, side, peak, v0) > sides[side * SIDE_SIZE + LOWEST]
        ):
            parts = LOOKS_AT_TURN
        seen = LOOK * sides[side * SIDE_SIZE + SCALE]
        if sides[side * SIDE_SIZE + STICKING] > 0.0 and jump > seen > 0.0:
            top0 = heaviest(plan, elements, sides, side, theta0, v0)
            top1 = heaviest(plan, elements, sides, side, theta1, v1)
            top = max(top0, top1)
            if top > sides[side * SIDE_SIZE + LOWEST] and not (rises and top0 <= top1):
                lowest = sliding(parameters, plan, sides, side, fastest)
                lowest = min(lowest, sliding(parameters, plan, sides, side, -fastest))
                if top > lowest:
                    parts = max(parts, int(min(jump / seen, MOST_LOOKS)) + 1)
    return parts


@kernel(exact=False, inline=True)
def grazing(
    lin: Linear, loop: Any, stretch: Any, x0: float, x1: float, v1: float, a0: float, a1: float
) -> float:
    """Time in [x0, x1] at which the velocity has dipped through zero, else NONE; a0, a1 are accelerations there."""
    sigma = loop[SIGMA]
    a0 = sigma * a0
    a1 = sigma * a1
    edge = loop[NARROW]
    if not (a0 < 0.0 and a1 > 0.0 and sigma * v1 > edge and sigma * v1 - edge < -a0 * stretch[LENGTH]):
        return NONE
    c = cubic_of(stretch)
    for _ in range(MOST_DIPS):
        x = x0 + (x1 - x0) * min(max(a0 / (a0 - a1), 0.1), 0.9)
        theta, v = state_at(lin, stretch, x)
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
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any, left: float,
    theta: float, v: float, g_left: float, width: float, parts: int, tol: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Look for an event at the ends of `parts` parts of [left, left + width], but for the last.

    Returns its time or NONE, the last time looked at, and the event function there.
    """
    c = cubic_of(stretch)
    step = width / parts
    m = flow(lin, step)
    p = theta - (c[0] + left * (c[1] + left * (c[2] + left * c[3])))
    q = v - (c[1] + left * (2.0 * c[2] + left * 3.0 * c[3]))
    for _ in range(1, parts):
        p, q = free_motion(m, p, q)
        x = left + step
        theta, v = moved(c, UNMOVED, x, p, q)
        g = trigger(parameters, plan, elements, sides, loop, theta, v)
        if g >= 0.0:
            event = locate(
                lin, parameters, plan, elements, sides, loop, stretch, left, g_left, x, g, theta, v, tol
            )
            return event, left, g_left
        left = x
        g_left = g
    return NONE, left, g_left


@kernel(exact=False, inline=True)
def find(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any, tol: float
) -> float:  # fmt: skip
    """Time of the first event inside the stretch, or NONE."""
    c = cubic_of(stretch)
    half = 0.5 * stretch[LENGTH]
    left = 0.0
    theta = loop[POSITION]
    v = loop[VELOCITY]
    a = acceleration(lin, c, 0.0, theta, v)
    g_left = -NEAR
    for node in range(1, 3):
        right = half * node
        theta_right = stretch[POSITION_MID] if node == 1 else stretch[POSITION_END]
        v_right = stretch[VELOCITY_MID] if node == 1 else stretch[VELOCITY_END]
        a_right = acceleration(lin, c, right, theta_right, v_right)
        if loop[WATCHED] > 0.0:
            dip = grazing(lin, loop, stretch, left, right, v_right, a, a_right)
            if dip > 0.0:
                theta, v = state_at(lin, stretch, dip)
                g = trigger(parameters, plan, elements, sides, loop, theta, v)
                return locate(
                    lin, parameters, plan, elements, sides, loop, stretch, left, g_left, dip, g, theta, v, tol
                )
        parts = looks(parameters, plan, elements, sides, half, theta, v, a, theta_right, v_right, a_right)
        if parts > 1:
            event, left, g_left = between(
                lin,
                parameters,
                plan,
                elements,
                sides,
                loop,
                stretch,
                left,
                theta,
                v,
                g_left,
                half,
                parts,
                tol,
            )
            if event >= 0.0:
                return event
        g = trigger(parameters, plan, elements, sides, loop, theta_right, v_right)
        if g >= 0.0:
            if left == 0.0:
                g_left = trigger(parameters, plan, elements, sides, loop, theta, v)
            return locate(
                lin, parameters, plan, elements, sides, loop, stretch, left, g_left, right, g, theta_right,
                v_right, tol,
            )  # fmt: skip
        left, theta, v, a, g_left = right, theta_right, v_right, a_right, g
    return NONE


@kernel(exact=False)
def locate(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any, low: float,
    g_low: float, high: float, g_high: float, theta: float, v: float, tol: float,
) -> float:  # fmt: skip
    """Root of `trigger` in [low, high], from its far side: regula falsi (Anderson and Björck), then bisection.

    The motion at `high` is (theta, v); that at the root is kept in `stretch`. Wanted is a value just beyond the
    root, so that iterates from both sides are good.
    """
    wanted = 25.0 * tol
    stretch[POSITION_EVENT] = theta
    stretch[VELOCITY_EVENT] = v
    low_miss = min(g_low, 0.0) - wanted
    high_miss = g_high - wanted
    side = 0
    turn = 0
    while high_miss > wanted and high - low > 1e-3 * tol:
        x = (low * high_miss - high * low_miss) / (high_miss - low_miss)
        if turn > 10 or not low < x < high:
            x = 0.5 * (low + high)
        theta, v = state_at(lin, stretch, x)
        miss = trigger(parameters, plan, elements, sides, loop, theta, v) - wanted
        if miss >= -wanted:
            if side == 1:
                low_miss *= 1.0 - miss / high_miss if miss < high_miss else 0.5
            high = x
            high_miss = miss
            side = 1
            stretch[POSITION_EVENT] = theta
            stretch[VELOCITY_EVENT] = v
        else:
            if side == -1:
                high_miss *= 1.0 - miss / low_miss if miss > low_miss else 0.5
            low = x
            low_miss = miss
            side = -1
        turn += 1
    return high


@kernel(exact=False, inline=True)
def add_exponents(plan: Any, sides: Any, h: float, x: float) -> None:
    """Add the decay C int 1/s dt of slipping elements over the first x of a stretch of length h."""
    f = x / h
    for side in range(int(plan[SIDES])):
        if sides[side * SIDE_SIZE + SLIPPING] > 0.0 and sides[side * SIDE_SIZE + KIND] == RELAXES:
            attraction = sides[side * SIDE_SIZE + ATTRACTION]
            q0 = sides[side * SIDE_SIZE + Q]
            bend = 2.0 * (q0 + sides[side * SIDE_SIZE + Q_END]) - 4.0 * sides[side * SIDE_SIZE + Q_MID]
            slope = sides[side * SIDE_SIZE + Q_END] - q0 - bend
            sides[side * SIDE_SIZE + EXPONENT] += attraction * x * (q0 + f * (0.5 * slope + f * bend / 3.0))


@kernel(exact=False, inline=True)
def settle_forces(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> None:
    """Write every element's force where the loop stands, before modes change."""
    for side in range(int(plan[SIDES])):
        if sides[side * SIDE_SIZE + KIND] == BENDS:
            sides[side * SIDE_SIZE + S] = sides[side * SIDE_SIZE + S_NOW]
            continue
        decay = math.exp(-sides[side * SIDE_SIZE + EXPONENT])
        moves = sides[side * SIDE_SIZE + KIND] == RELAXES
        s = 0.0 if moves else sliding(parameters, plan, sides, side, loop[VELOCITY])
        for i in range(first_of(plan, side), first_of(plan, side + 1)):
            if elements[i * ELEMENT_SIZE + SLIPS] == 0.0:
                elements[i * ELEMENT_SIZE + FORCE] = (
                    elements[i * ELEMENT_SIZE + OFFSET]
                    + elements[i * ELEMENT_SIZE + STIFFNESS] * loop[POSITION]
                )
            elif moves:
                part = elements[i * ELEMENT_SIZE + SHARE] / sides[side * SIDE_SIZE + SLIPPING]
                gained = sides[side * SIDE_SIZE + S_NOW] - decay * sides[side * SIDE_SIZE + S_START]
                elements[i * ELEMENT_SIZE + FORCE] = (
                    decay * elements[i * ELEMENT_SIZE + FORCE] + part * gained
                )
            else:
                elements[i * ELEMENT_SIZE + FORCE] = elements[i * ELEMENT_SIZE + SHARE] * loop[SIGMA] * s


@kernel(exact=False, inline=True)
def switch(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> None:
    """Change the modes that end here: stick at a reversal, slip where the limit is reached."""
    v = loop[VELOCITY]
    settle_forces(parameters, plan, elements, sides, loop)
    for side in range(int(plan[SIDES])):
        enter_or_leave(sides, loop, side, v)
    if loop[WATCHED] > 0.0 and loop[SIGMA] * v <= 1e-9 * abs(v):
        for i in range(int(plan[ELEMENTS])):
            elements[i * ELEMENT_SIZE + SLIPS] = 0.0
        if loop[SIGMA] * v > 0.0:
            loop[VELOCITY] = 0.0
        if not set_off(plan, elements, sides, parameters, loop):
            loop[SIGMA] = -loop[SIGMA]
        return
    direction = 1.0 if v >= 0.0 else -1.0
    for side in range(int(plan[SIDES])):
        if sides[side * SIDE_SIZE + STICKING] > 0.0:
            s = sliding(parameters, plan, sides, side, v)
            for i in range(first_of(plan, side), first_of(plan, side + 1)):
                load = load_of(plan[LITERAL] > 0.0, direction, elements[i * ELEMENT_SIZE + FORCE])
                if (
                    elements[i * ELEMENT_SIZE + SLIPS] == 0.0
                    and load >= elements[i * ELEMENT_SIZE + SHARE] * s - ROUNDING
                ):
                    elements[i * ELEMENT_SIZE + SLIPS] = 1.0
                    loop[SIGMA] = direction


@kernel(exact=False)
def enter_or_leave(sides: Any, loop: Any, side: int, v: float) -> None:
    """Pass the edge of a steep layer if the axis stands there."""
    edge = sides[side * SIDE_SIZE + LAYER]
    if edge == 0.0:
        return
    if sides[side * SIDE_SIZE + INSIDE] > 0.0:
        if abs(v) >= (1.0 - ON_EDGE) * edge:
            sides[side * SIDE_SIZE + INSIDE] = 0.0
            loop[SIGMA] = 1.0 if v > 0.0 else -1.0
    elif loop[SIGMA] * v <= (1.0 + ON_EDGE) * edge:
        sides[side * SIDE_SIZE + INSIDE] = 1.0
