"""Events of the exact integrator: where an element breaks away, where the velocity passes through zero.

An event function is a number that rises to zero where a mode ends; `trigger` is the largest of them. Events are
located on the exact flow. Looked for at the middle and the end of a stretch, and where the velocity dips through
zero between them (a grazing reversal).
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel, pointer
from stickslip.simulate._case import KI, KP
from stickslip.simulate._exact_flow import Linear, acceleration
from stickslip.simulate._exact_state import (
    ATTRACTION,
    BREAKAWAY,
    ELEMENT_SIZE,
    ELEMENTS,
    EXPONENT,
    FORCE,
    HELD,
    INTEGRAL,
    LITERAL,
    LOAD_AT_0,
    LOAD_SLOPE,
    LOWEST,
    OFFSET,
    POSITION,
    Q_END,
    Q_MID,
    RIGID,
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
    WEIGHT,
    Q,
    R,
    first_of,
    sliding,
)
from stickslip.simulate._exact_step import (
    LENGTH,
    POSITION_END,
    POSITION_MID,
    VELOCITY_END,
    VELOCITY_MID,
    cubic_of,
    state_at,
)

NONE = -1.0
NEAR = 1e-3
"""N·m: a guess of how far the event function is below zero."""
NOISE = 1e-12
"""Velocities this small (rad/s) may be rounding errors of one that creeps to zero: no reversal yet."""
ROUNDING = 1e-10
"""N·m by which a load may seem to miss the limit that it was located at."""
VELOCITY_WEIGHT = 10.0
"""N·m per rad/s: puts a reversal on the scale of a break-away."""


@kernel(exact=False)
def load_of(literal: bool, direction: float, force: float) -> float:
    """The load that the slip rule compares (`stickslip.laws._stick`)."""
    return abs(force) if literal else direction * force


@kernel(exact=False)
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


@kernel(exact=False)
def trigger(
    parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, theta: float, v: float
) -> float:
    """The largest event function at a state: not negative where a mode ends."""
    g = -1e9
    if loop[WATCHED] > 0.0:
        g = -VELOCITY_WEIGHT * (loop[SIGMA] * v + NOISE)
    for side in range(int(plan[SIDES])):
        if sides[side * SIDE_SIZE + STICKING] > 0.0:
            top = heaviest(plan, elements, sides, side, theta, v)
            # The curve is only asked for where its lowest level is in reach.
            limit = sides[side * SIDE_SIZE + LOWEST]
            if top > limit:
                limit = sliding(parameters, plan, sides, side, v)
            g = max(g, top - limit)
    return g


@kernel(exact=False)
def too_long(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any
) -> bool:
    """Whether the velocity changes too much for a sticking element that is near its limit.

    Such a load can cross its limit up and down between the nodes, since s(v) varies over v_s. Not where the
    motion speeds up all along: there
    load and event function rise with it.
    """
    v0 = loop[VELOCITY]
    v1 = stretch[VELOCITY_MID]
    v2 = stretch[VELOCITY_END]
    jump = max(abs(v1 - v0), abs(v2 - v1))
    least = min(abs(v0), abs(v1), abs(v2))
    fastest = max(abs(v0), abs(v1), abs(v2)) + 1.0 * jump
    for side in range(int(plan[SIDES])):
        scale = sides[side * SIDE_SIZE + SCALE]
        if (
            sides[side * SIDE_SIZE + STICKING] > 0.0
            and jump > 0.1 * scale
            and least < 3.0 * scale
            and scale > 0.0
        ):
            top0 = heaviest(plan, elements, sides, side, loop[POSITION], v0)
            top1 = heaviest(plan, elements, sides, side, stretch[POSITION_MID], v1)
            top2 = heaviest(plan, elements, sides, side, stretch[POSITION_END], v2)
            top = max(top0, top1, top2)
            if top > sides[side * SIDE_SIZE + LOWEST] and not (
                top0 <= top1 <= top2 and speeds_up(lin, loop, stretch)
            ):
                lowest = min(
                    sliding(parameters, plan, sides, side, fastest),
                    sliding(parameters, plan, sides, side, -fastest),
                )
                if top > lowest:
                    return True
    return False


@kernel(exact=False)
def speeds_up(lin: Linear, loop: Any, stretch: Any) -> bool:
    """Whether velocity and acceleration have one and the same sign at all nodes."""
    c = cubic_of(stretch)
    h = stretch[LENGTH]
    v0 = loop[VELOCITY]
    v1 = stretch[VELOCITY_MID]
    v2 = stretch[VELOCITY_END]
    a0 = acceleration(lin, c, 0.0, loop[POSITION], v0) * v2
    a1 = acceleration(lin, c, 0.5 * h, stretch[POSITION_MID], v1) * v2
    a2 = acceleration(lin, c, h, stretch[POSITION_END], v2) * v2
    return v0 * v1 >= 0.0 and v1 * v2 > 0.0 and a0 > 0.0 and a1 > 0.0 and a2 > 0.0


@kernel(exact=False)
def grazing(
    lin: Linear, loop: Any, stretch: Any, x0: float, x1: float, theta1: float, v1: float, a0: float
) -> float:
    """Time of the dip in [x0, x1] if the velocity is through zero there, else NONE; a0 is the acceleration at x0."""
    sigma = loop[SIGMA]
    a1 = sigma * acceleration(lin, cubic_of(stretch), x1, theta1, v1)
    a0 = sigma * a0
    if a0 < 0.0 and a1 > 0.0 and sigma * v1 > 0.0 and sigma * v1 < -a0 * stretch[LENGTH]:
        x = x0 + (x1 - x0) * a0 / (a0 - a1)
        _, v = state_at(lin, stretch, x)
        if sigma * v <= -NOISE:
            return x
    return NONE


@kernel(exact=False)
def find(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any, tol: float
) -> float:  # fmt: skip
    """Time of the first event inside the stretch, or NONE."""
    c = cubic_of(stretch)
    left = 0.0
    theta = loop[POSITION]
    v = loop[VELOCITY]
    g_left = -NEAR
    for node in range(1, 3):
        right = 0.5 * node * stretch[LENGTH]
        theta_right = stretch[POSITION_MID] if node == 1 else stretch[POSITION_END]
        v_right = stretch[VELOCITY_MID] if node == 1 else stretch[VELOCITY_END]
        if loop[WATCHED] > 0.0:
            a = acceleration(lin, c, left, theta, v)
            dip = grazing(lin, loop, stretch, left, right, theta_right, v_right, a)
            if dip > 0.0:
                theta, v = state_at(lin, stretch, dip)
                g = trigger(parameters, plan, elements, sides, loop, theta, v)
                return locate(
                    lin, parameters, plan, elements, sides, loop, stretch, left, dip, g_left, g, tol
                )
        g = trigger(parameters, plan, elements, sides, loop, theta_right, v_right)
        if g >= 0.0:
            if node == 1:
                g_left = trigger(parameters, plan, elements, sides, loop, theta, v)
            return locate(lin, parameters, plan, elements, sides, loop, stretch, left, right, g_left, g, tol)
        g_left = g
        left = right
        theta = theta_right
        v = v_right
    return NONE


@kernel(exact=False)
def locate(
    lin: Linear, parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any, stretch: Any, low: float,
    high: float, g_low: float, g_high: float, tol: float,
) -> float:  # fmt: skip
    """Root of `trigger` in [low, high], from its far side: regula falsi (Illinois), then bisection."""
    g_low = min(g_low, -1e-15)
    g_high = max(g_high, 1e-15)
    side = 0
    for turn in range(60):
        x = (low * g_high - high * g_low) / (g_high - g_low)
        if turn > 10 or not low < x < high:
            x = 0.5 * (low + high)
        theta, v = state_at(lin, stretch, x)
        g = trigger(parameters, plan, elements, sides, loop, theta, v)
        if g >= 0.0:
            high = x
            g_high = g
            if side == 1:
                g_low *= 0.5
            side = 1
        else:
            low = x
            g_low = g
            if side == -1:
                g_high *= 0.5
            side = -1
        if high - low < 1e-3 * tol or 0.0 <= g < 50.0 * tol:
            break
    return high


@kernel(exact=False)
def add_exponents(plan: Any, sides: Any, h: float, x: float) -> None:
    """Add the decay C int 1/s dt of slipping elements over the first x of a stretch of length h."""
    f = x / h
    for side in range(int(plan[SIDES])):
        attraction = sides[side * SIDE_SIZE + ATTRACTION]
        if sides[side * SIDE_SIZE + SLIPPING] > 0.0 and attraction < math.inf:
            q0 = sides[side * SIDE_SIZE + Q]
            bend = 2.0 * (q0 + sides[side * SIDE_SIZE + Q_END]) - 4.0 * sides[side * SIDE_SIZE + Q_MID]
            slope = sides[side * SIDE_SIZE + Q_END] - q0 - bend
            sides[side * SIDE_SIZE + EXPONENT] += attraction * x * (q0 + f * (0.5 * slope + f * bend / 3.0))


@kernel(exact=False)
def settle_forces(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> None:
    """Write every element's force where the loop stands, before modes change."""
    for side in range(int(plan[SIDES])):
        decay = math.exp(-sides[side * SIDE_SIZE + EXPONENT])
        moves = sides[side * SIDE_SIZE + ATTRACTION] < math.inf
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


@kernel(exact=False)
def switch(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> None:
    """Change the modes that end here: stick at a reversal, slip where the limit is reached."""
    v = loop[VELOCITY]
    settle_forces(parameters, plan, elements, sides, loop)
    if loop[WATCHED] > 0.0 and loop[SIGMA] * v <= 1e-9 * abs(v):
        for i in range(int(plan[ELEMENTS])):
            elements[i * ELEMENT_SIZE + SLIPS] = 0.0
        if loop[SIGMA] * v > 0.0:
            loop[VELOCITY] = 0.0
        set_off(plan, elements, sides, parameters, loop)
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
def stiction(plan: Any, sides: Any) -> float:
    """Half the net interval of torque that rigid elements hold at rest, N·m; negative where they repel."""
    total = 0.0
    for side in range(int(plan[SIDES])):
        total += (
            sides[side * SIDE_SIZE + WEIGHT]
            * sides[side * SIDE_SIZE + RIGID]
            * sides[side * SIDE_SIZE + BREAKAWAY]
        )
    return total


@kernel(exact=False)
def applied(parameters: Any, plan: Any, elements: Any, sides: Any, loop: Any) -> float:
    """Torque on the resting axis without its rigid elements, N·m."""
    torque = loop[R] + parameters[KI] * loop[INTEGRAL] - parameters[KP] * loop[POSITION]
    for side in range(int(plan[SIDES])):
        for i in range(first_of(plan, side), first_of(plan, side + 1)):
            torque -= sides[side * SIDE_SIZE + WEIGHT] * elements[i * ELEMENT_SIZE + FORCE]
    return torque


@kernel(exact=False)
def set_off(plan: Any, elements: Any, sides: Any, parameters: Any, loop: Any) -> None:
    """At v = 0, with rigid elements: rest, or the direction in which the axis goes on.

    Rigid friction in the plant holds what lies inside its interval, less the jump of a compensator that acts on
    sign(v). A compensator that jumps by more than the plant repels: the axis goes on through zero.
    """
    rigid = sides[RIGID] > 0.0 or (plan[SIDES] > 1 and sides[SIDE_SIZE + RIGID] > 0.0)
    if not rigid:
        return
    interval = stiction(plan, sides)
    torque = applied(parameters, plan, elements, sides, loop)
    before = loop[SIGMA]
    loop[HELD] = 0.0
    if abs(torque) > max(interval, 0.0):
        loop[SIGMA] = 1.0 if torque > 0.0 else -1.0
    elif interval < 0.0 and before != 0.0:
        loop[SIGMA] = -before
    else:
        loop[SIGMA] = 0.0
        loop[HELD] = 1.0
        loop[VELOCITY] = 0.0
    if loop[SIGMA] * loop[VELOCITY] < 0.0:
        loop[VELOCITY] = 0.0


@kernel(exact=False)
def release(plan: Any, elements: Any, sides: Any, parameters: Any, loop: Any) -> None:
    """Leave rest in the direction of the applied torque."""
    loop[HELD] = 0.0
    loop[SIGMA] = 1.0 if applied(parameters, plan, elements, sides, loop) > 0.0 else -1.0
