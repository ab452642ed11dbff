"""What ends a step of a train: the next element breaks away, or the axis turns. Looked for between its nodes."""

from __future__ import annotations

import math
from typing import NamedTuple

from stickslip.jit import WIDTH, columns_times, kernel, pointer
from stickslip.simulation.sampled.modes import floor_below, heaviest, sign, stays_below
from stickslip.simulation.sampled.rates import SLIPS, spring_of
from stickslip.simulation.sampled.stick import excess as above
from stickslip.simulation.sampled.stretch import Stretch
from stickslip.simulation.train.records import (
    ANGLE,
    ANGLE_POWERS,
    TABLES,
    VELOCITY,
    VELOCITY_POWERS,
    Train,
)
from stickslip.simulation.train.shapes import NODES, PARTS, POWERS

NONE, UNSEEN, TURNS, BREAKS = range(4)
"""What a step holds: nothing, more than its nodes show, or an end at which the axis turns or an element breaks away."""
MARGIN = 0.2
"""Of the range of the nodes' values, by which a motion that they resolve may leave it between them."""
EARLY = 1.0 - 1e-12
SLOW = 8.0
"""Velocity scales of the curve, below which it may not be level."""
FINEST = 1e-5
"""Of a step: what a load may be above the curve for without being seen."""
ROOT_STEPS = 60


class Found(NamedTuple):
    """What a step holds."""

    what: int
    at: float
    """part of the step"""
    direction: float
    """of the velocity there"""


@kernel()
def look(train: Train, h: float, resolved: bool, watched: bool) -> Found:
    """What a step of h s holds; whether it resolves every mode, and whether its nodes follow them at least."""
    slips = train.z.mode == SLIPS
    holds = train.z.spring > 0.0
    calm = not slips or goes_on(train)
    if calm and (not holds or (watched and cannot_break(train))):
        return Found(NONE, 1.0, 0.0)
    if not resolved:
        return Found(UNSEEN, 1.0, 0.0)
    powers(train, VELOCITY, VELOCITY_POWERS, 0.0)
    powers(train, ANGLE, ANGLE_POWERS, train.z.position)
    return slides(train, h) if slips else sticks(train, h)


# ---- the polynomials of a step that resolves its modes ----------------------------------------------------------


@kernel()
def powers(train: Train, nodes: int, out: int, less: float) -> None:
    """Coefficients of the polynomial through values at the nodes, less a constant."""
    mem = train.all
    for i in range(NODES):
        mem[out + WIDTH + i] = mem[nodes + i] - less
    columns_times(pointer(mem, TABLES + POWERS * WIDTH), pointer(mem, out + WIDTH), NODES, pointer(mem, out))


@kernel(inline=True)
def along(train: Train, coefficients: int, at: float) -> float:
    """A polynomial at a part of the step."""
    mem, y = train.all, 2.0 * at - 1.0
    total = 0.0
    for k in range(PARTS, -1, -1):
        total = total * y + mem[coefficients + k]
    return total


@kernel(inline=True)
def slope(train: Train, coefficients: int, at: float) -> float:
    """Its slope over the part."""
    mem, y = train.all, 2.0 * at - 1.0
    total = 0.0
    for k in range(PARTS, 0, -1):
        total = total * y + k * mem[coefficients + k]
    return 2.0 * total


# ---- turns --------------------------------------------------------------------------------------------------------


@kernel()
def goes_on(train: Train) -> bool:
    """Whether the axis cannot have turned, as far as the nodes show."""
    mem, way = train.all, train.z.direction
    low, bend = math.inf, 0.0
    for i in range(1, NODES):
        low = min(low, way * mem[VELOCITY + i])
        if i < PARTS:
            bend = max(bend, abs(mem[VELOCITY + i - 1] - 2.0 * mem[VELOCITY + i] + mem[VELOCITY + i + 1]))
    # Its second differences bound what the velocity does between nodes, of modes that these do not follow, too.
    return low > bend


@kernel()
def turning_of(train: Train, way: float) -> tuple[float, float]:
    """The part of a step after which the velocity has fallen to 0, and where it is least before; 2: there is none."""
    mem, least = train.all, 2.0
    for i in range(PARTS):
        begin, end = i / PARTS, (i + 1.0) / PARTS
        if way * mem[VELOCITY + i + 1] <= 0.0:
            return root(train, begin, end, way), least
        if way * slope(train, VELOCITY_POWERS, begin) < 0.0 < way * slope(train, VELOCITY_POWERS, end):
            low, high = begin, end
            for _ in range(40):
                middle = 0.5 * (low + high)
                if way * slope(train, VELOCITY_POWERS, middle) < 0.0:
                    low = middle
                else:
                    high = middle
            if way * along(train, VELOCITY_POWERS, high) <= 0.0:
                return root(train, begin, high, way), least
            least = min(least, high)
    return 2.0, least


@kernel()
def root(train: Train, low: float, high: float, way: float) -> float:
    """Where the velocity meets 0 between two parts of a step, from the side on which it still goes `way`."""
    f_low = max(way * along(train, VELOCITY_POWERS, low), 0.0)
    f_high = min(way * along(train, VELOCITY_POWERS, high), 0.0)
    for i in range(ROOT_STEPS):
        if high - low <= 1e-14 or f_high == 0.0:
            break
        middle = high - f_high * (high - low) / (f_high - f_low)
        if i > 12 or not low < middle < high:
            middle = 0.5 * (low + high)
        f = way * along(train, VELOCITY_POWERS, middle)
        if f <= 0.0:
            high, f_high, f_low = middle, f, 0.5 * f_low
        else:
            low, f_low, f_high = middle, f, 0.5 * f_high
    return high


# ---- break-aways ----------------------------------------------------------------------------------------------------


@kernel()
def cannot_break(train: Train) -> bool:
    """Whether no load can reach its share of the curve between the least and the largest angle that the nodes show."""
    axis, z, mem = train.axis, train.z, train.all
    least, most, fastest = math.inf, -math.inf, 0.0
    for i in range(NODES):
        least, most = min(least, mem[ANGLE + i]), max(most, mem[ANGLE + i])
        fastest = max(fastest, abs(mem[VELOCITY + i]))
    beyond = MARGIN * (most - least)
    least, most = least - beyond - z.position, most + beyond - z.position
    level = floor_below(axis, (1.0 + MARGIN) * fastest)
    for i in range(axis.count):
        spring = spring_of(axis, i)
        low, high = spring.force + spring.stiffness * least, spring.force + spring.stiffness * most
        if spring.slips == 0.0 and max(abs(low), abs(high)) >= spring.share * level:
            return False
    return True


@kernel()
def at_rest(train: Train) -> bool:
    """Whether what motion there is changes no load by more than loads are told apart.

    Else rounding lets an element at its limit go, and stops the axis at once: without end.
    """
    least, most = math.inf, -math.inf
    for i in range(NODES):
        least, most = min(least, train.all[ANGLE + i]), max(most, train.all[ANGLE + i])
    return (most - least) * train.z.spring <= train.axis.near


@kernel()
def sticks(train: Train, h: float) -> Found:
    """Everything sticks: the step ends where the first element breaks away."""
    mem = train.all
    if at_rest(train):
        return Found(NONE, 1.0, 0.0)
    v = mem[VELOCITY]
    way = sign(v) if v != 0.0 else sign(slope(train, VELOCITY_POWERS, 0.0))
    here = 0.0
    if excess(train, 0.0, way) >= 0.0:
        return Found(BREAKS, 0.0, way)
    for i in range(PARTS):
        end = (i + 1.0) / PARTS
        if way * mem[VELOCITY + i + 1] < 0.0:
            # The loads peak where the axis turns: look there, from the side it comes from.
            top = max(root(train, here, end, way) * EARLY, here)
            at = met(train, h, here, top, way)
            if at <= 1.0:
                return Found(BREAKS, at, way)
            way, here = -way, top
        at = met(train, h, here, end, way)
        if at <= 1.0:
            return Found(BREAKS, at, way)
        here = end
    return Found(NONE, 1.0, way)


@kernel()
def slides(train: Train, h: float) -> Found:
    """Something slips: the step ends where the axis turns, or where an element that holds breaks away."""
    mem, way, holds = train.all, train.z.direction, train.z.spring > 0.0
    # By the acceleration, which is the same whether something slips or not: what a slipping force does until the first
    # node may turn the axis once more, and sticking would start it again, without end.
    if way * mem[VELOCITY] <= 0.0 and way * slope(train, VELOCITY_POWERS, 0.0) <= 0.0:
        return Found(TURNS, 0.0, way)
    if holds and way * mem[VELOCITY] > 0.0 and excess(train, 0.0, way) >= 0.0:
        return Found(BREAKS, 0.0, way)
    turning, least = turning_of(train, way)
    end = min(turning, 1.0)
    here = 0.0
    while holds and here < end:
        ahead = min(here + 1.0 / PARTS, end)
        at = met(train, h, here, ahead, way)
        if at <= 1.0:
            return Found(BREAKS, at, way)
        here = ahead
    if least < 1.0 and way * along(train, VELOCITY_POWERS, least) < SLOW * train.axis.scale:
        # To a node there, so that the step's error is that of the curve where the axis is slowest.
        return Found(NONE, least, way)
    return Found(TURNS, turning, way) if turning <= 1.0 else Found(NONE, 1.0, way)


@kernel(inline=True)
def excess(train: Train, at: float, way: float) -> float:
    """How far the heaviest load lies above the curve at a part of the step, N·m."""
    return above(train.axis, along(train, ANGLE_POWERS, at), along(train, VELOCITY_POWERS, at), way)


@kernel()
def met(train: Train, h: float, begin: float, end: float, way: float) -> float:
    """Where the heaviest load first meets the curve between two parts of a step; 2 where it does not.

    Halved until nothing can happen in a piece: just before the axis turns, the curve may dip under the load and rise
    again.
    """
    axis = train.axis
    here, d = begin, end - begin
    while here < end:
        ahead = min(here + d, end)
        if excess(train, ahead, way) >= 0.0:
            return crossing(train, here, ahead, way)
        from_angle, to_angle = along(train, ANGLE_POWERS, here), along(train, ANGLE_POWERS, ahead)
        piece = Stretch(
            (ahead - here) * h, to_angle - from_angle, along(train, VELOCITY_POWERS, here),
            slope(train, VELOCITY_POWERS, here) / h, along(train, VELOCITY_POWERS, ahead),
            slope(train, VELOCITY_POWERS, ahead) / h,
        )  # fmt: skip
        most = max(heaviest(axis, from_angle, way), heaviest(axis, to_angle, way))
        if d <= FINEST or stays_below(axis, most, piece, way):
            here = ahead
            d *= 2.0
        else:
            d *= 0.5
    return 2.0


@kernel()
def crossing(train: Train, low: float, high: float, way: float) -> float:
    """The part of a step between low and high from which the heaviest load is above the curve (Illinois' rule)."""
    f_low, f_high = min(excess(train, low, way), 0.0), excess(train, high, way)
    near = train.axis.near
    for i in range(ROOT_STEPS):
        if f_high <= near or high - low <= 1e-14:
            break
        middle = high - f_high * (high - low) / (f_high - f_low)
        if i > 10 or not low < middle < high:
            middle = 0.5 * (low + high)
        f = excess(train, middle, way)
        if f >= 0.0:
            high, f_high, f_low = middle, f, 0.5 * f_low
        else:
            low, f_low, f_high = middle, f, 0.5 * f_high
    return high
