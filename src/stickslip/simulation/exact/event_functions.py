"""The event functions of the exact integrator: numbers that rise to zero where a mode ends.

`trigger` is the largest of them. It jumps where the velocity changes its sign, for the load of a sticking element is
counted along the motion: `turn` looks at both sides of a reversal, where a limit that rises with the velocity
(F_S below F_C) may be passed for a moment that no step would see.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.exact.forces import sliding
from stickslip.simulation.exact.state import Loop, element_of, side_of, sides_of

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
