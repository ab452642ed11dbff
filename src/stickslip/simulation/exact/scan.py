"""What a window of the meter holds between its nodes: bounds of its signals, and a look at fine steps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import (
    MOVING,
    Turns,
    confirm,
    follow_reference,
    in_second_half,
    reached,
    rest_seen,
)
from stickslip.simulation._nodes import AT, ERROR, ERROR_RATE, MOTOR, REFERENCE_SPEED, SPEED, TRIGGER, summit
from stickslip.simulation.exact.flow import UNMOVED, Matrix, free_motion
from stickslip.simulation.exact.ringing import Five, quartic, value


class Free(NamedTuple):
    """A free motion at the begin of a window, and p'' = -damping p' - square p (1/s, 1/s²)."""

    position: float
    velocity: float
    damping: float
    square: float


LOOK_UP = 4
"""Fine steps between two looks at what is left."""
NO_FREE = Free(0.0, 0.0, 0.0, 0.0)


class Span(NamedTuple):
    """A window: its begin and its width, s."""

    begin: float
    width: float


class Look(NamedTuple):
    """A look at fine steps: the fraction of the window at which it begins, its part of the window, in how many steps,
    the flow of the free motion over each of them, and the free motion."""

    first: float
    part: float
    steps: int
    flow: Matrix
    free: Free


class Farthest(NamedTuple):
    """What may be farther than before in a window: error, velocity, motor torque; and whether something is counted."""

    error: bool
    speed: bool
    motor: bool
    events: bool


class Slack(NamedTuple):
    """How far error, velocity, motor torque and the reference's velocity leave straight lines between the nodes of a
    window."""

    error: float
    speed: float
    motor: float
    reference: float


# ---- bounds ---------------------------------------------------------------------------------------------------


@kernel(exact=False, inline=True)
def bulge(nodes: Any, row: int) -> float:
    """How far the quartic through a row of nodes can leave the straight line between two of them."""
    a = nodes[row]
    b = nodes[row + 1]
    c = nodes[row + 2]
    d = nodes[row + 3]
    e = nodes[row + 4]
    p = c - 2.0 * b + a
    q = d - 2.0 * c + b
    r = e - 2.0 * d + c
    # An eighth of its greatest second derivative.
    return 0.125 * (max(abs(p), abs(q), abs(r)) + max(abs(q - p), abs(r - q)) + abs(p - 2.0 * q + r))


@kernel(exact=False, inline=True)
def slack_of(nodes: Any) -> Slack:
    """The slack of a window, which all of its bounds share."""
    return Slack(bulge(nodes, ERROR), bulge(nodes, SPEED), bulge(nodes, MOTOR), bulge(nodes, REFERENCE_SPEED))


@kernel(exact=False, inline=True)
def bounds(nodes: Any, row: int, k: int, quarters: int, slack: float) -> tuple[float, float]:
    """Least and greatest that the quartic through a row of nodes can have over quarters of the window, from k on."""
    low = nodes[row + k]
    high = low
    for i in range(k + 1, k + quarters + 1):
        low = min(low, nodes[row + i])
        high = max(high, nodes[row + i])
    return low - slack, high + slack


@kernel(exact=False, inline=True)
def reach(nodes: Any, row: int, slack: float) -> float:
    """Greatest magnitude that the quartic through a row of nodes can have."""
    low, high = bounds(nodes, row, 0, 4, slack)
    return max(-low, high)


@kernel(exact=False, inline=True)
def keeps_sign(c: Five) -> bool:
    """Whether a cubic has no zero over s = 0 to 1, as its Bernstein coefficients tell."""
    first = c[0]
    second = c[0] + c[1] / 3.0
    third = second + (c[1] + c[2]) / 3.0
    last = c[0] + c[1] + c[2] + c[3]
    return min(first, second, third, last) > 0.0 or max(first, second, third, last) < 0.0


@kernel(exact=False, inline=True)
def peak_of(nodes: Any, row: int, width: float, steps: int) -> float:
    """Greatest magnitude of the quartic through a row of nodes: at an end, or looked for in so many steps."""
    values = quartic(nodes, row)
    rates = slopes(values, width)
    if keeps_sign(rates):
        return max(abs(nodes[row]), abs(nodes[row + 4]))
    low, high = summits(values, rates, width, Look(0.0, 1.0, steps, UNMOVED, NO_FREE), 0.0, 0.0)
    return max(-low, high)


@kernel(exact=False, inline=True)
def farther(acc: Any, second: bool, low: float, high: float) -> bool:
    """Whether an error within these bounds may be the greatest or the least so far."""
    if high > acc.e_max or -low > acc.e_max:
        return True
    return second and (low < acc.w2_e_low or high > acc.w2_e_high)


@kernel(exact=False, inline=True)
def counts(low: float, high: float, slowest: float, fastest: float) -> bool:
    """Whether a velocity and the reference's within these bounds may reverse, or begin or end a standstill."""
    if slowest < -TRIGGER and fastest > TRIGGER:
        return True
    if low > TRIGGER or high < -TRIGGER:
        return False
    if low <= -TRIGGER or high >= TRIGGER or (low <= 0.0 <= high and low < high):
        return True
    return not (slowest > MOVING or fastest < -MOVING or (slowest > -MOVING and fastest < MOVING))


@kernel(exact=False, inline=True)
def calm(acc: Any, nodes: Any, k: int, quarters: int, swing: float, sway: float, slack: Slack) -> bool:
    """Whether nothing is counted in some quarters of a window, from k on: no reversal, no standstill's begin or end,
    none at the settling band.

    ``swing`` and ``sway`` are the most by which ringing adds to position and velocity.
    """
    low, high = bounds(nodes, SPEED, k, quarters, slack.speed)
    slowest, fastest = bounds(nodes, REFERENCE_SPEED, k, quarters, slack.reference)
    if counts(low - sway, high + sway, slowest, fastest):
        return False
    band = acc.settle_band
    if band > 0.0:
        low, high = bounds(nodes, ERROR, k, quarters, slack.error)
        low -= swing
        high += swing
        return low > band or high < -band or (low >= -band and high <= band)
    return True


# ---- a window through which nothing happens -------------------------------------------------------------------


@kernel(exact=False, inline=True)
def passes(
    acc: Any, turns: Turns, nodes: Any, span: Span, k: int, quarters: int, first: float, last: float
) -> None:  # fmt: skip
    """Note some calm quarters of a window, from k on, over which the velocity runs from `first` to `last`."""
    t, width = span
    begin = t + 0.25 * width * k
    touch(acc, begin, nodes[AT + k], first)
    rest_seen(acc, begin, first, nodes[REFERENCE_SPEED + k])
    confirm(acc, turns, last, in_second_half(acc, t))
    for i in range(k + 1, k + quarters + 1):
        follow_reference(acc, nodes[REFERENCE_SPEED + i])
    # The node in the middle, or at the end of a quarter.
    if acc.settle_band > 0.0 and abs(nodes[ERROR + k + (quarters + 1) // 2]) > acc.settle_band:
        acc.outside_last = begin + 0.25 * width * quarters
    acc.last_velocity = last


@kernel(exact=False, inline=True)
def touch(acc: Any, t: float, position: float, v: float) -> None:
    """Rounding may put a zero of the velocity between the last window and this one."""
    if acc.last_velocity * v < 0.0:
        acc.turn_time = t
        acc.turn_position = position


# ---- a look at fine steps -------------------------------------------------------------------------------------


@kernel(exact=False, inline=True)
def peaks_seen(
    acc: Any, nodes: Any, width: float, look: Look, motor: tuple[float, float], may: Farthest, second: bool
) -> None:  # fmt: skip
    """Note the peaks that a look at a window finds: only signals that may be farther than before are looked at."""
    if may.error:
        low, high = summits(quartic(nodes, ERROR), quartic(nodes, ERROR_RATE), width, look, -1.0, 0.0)
        reached(acc, second, low, high, 0.0, 0.0)
    if may.speed:
        speed = quartic(nodes, SPEED)
        low, high = summits(speed, slopes(speed, width), width, look, 0.0, 1.0)
        acc.v_max = max(acc.v_max, -low, high)
    if may.motor:
        torque = quartic(nodes, MOTOR)
        low, high = summits(torque, slopes(torque, width), width, look, motor[0], motor[1])
        acc.tm_max = max(acc.tm_max, -low, high)


@kernel(exact=False, inline=True)
def events_seen(
    acc: Any, turns: Turns, nodes: Any, span: Span, look: Look, slack: Slack, second: bool
) -> None:  # fmt: skip
    """Note the events that a look at a window finds."""
    if creeps(acc, nodes, look.free, slack):
        turns_while_creeping(acc, nodes, span, look)
    else:
        count_events(acc, turns, nodes, span, look, slack, second)


@kernel(exact=False)
def summits(
    values: Five, rates: Five, width: float, look: Look, of_p: float, of_v: float
) -> tuple[float, float]:  # fmt: skip
    """Least and greatest of a signal over a part of a window: its quartic, whose rate (1/s) is another, and what the
    free motion adds by its position and by its velocity."""
    first, part, count, m, free = look
    step = part / count
    d = width * step
    p = free.position
    q = free.velocity
    y0 = value(values, first) + of_p * p + of_v * q
    d0 = value(rates, first) + of_p * q - of_v * (free.damping * q + free.square * p)
    low = y0
    high = y0
    for i in range(1, count + 1):
        s = first + step * i
        p, q = free_motion(m, p, q)
        y = value(values, s) + of_p * p + of_v * q
        rate = value(rates, s) + of_p * q - of_v * (free.damping * q + free.square * p)
        low = min(low, y)
        high = max(high, y)
        if d0 * rate < 0.0:
            top = summit(y0, d0, y, rate, d)
            low = min(low, top)
            high = max(high, top)
        y0 = y
        d0 = rate
    return low, high


@kernel(exact=False, inline=True)
def creeps(acc: Any, nodes: Any, free: Free, slack: Slack) -> bool:
    """Whether the velocity stays below the trigger in a window, while the reference moves: the last zero of the
    velocity is all that happens."""
    if acc.settle_band > 0.0:
        return False
    slowest, fastest = bounds(nodes, REFERENCE_SPEED, 0, 4, slack.reference)
    if slowest <= MOVING and fastest >= -MOVING:
        return False
    sway = math.sqrt(free.square * free.position * free.position + free.velocity * free.velocity)
    return reach(nodes, SPEED, slack.speed) + sway < TRIGGER


@kernel(exact=False)
def turns_while_creeping(acc: Any, nodes: Any, span: Span, look: Look) -> None:
    """Note the last zero of the velocity over a part of a window that `creeps`."""
    t, width = span
    first, part, count, m, free = look
    speed = quartic(nodes, SPEED)
    step = part / count
    p = free.position
    q = free.velocity
    v0 = value(speed, first) + q
    place = quartic(nodes, AT)
    touch(acc, t + width * first, value(place, first) + p, v0)
    rest_seen(acc, t + width * first, v0, nodes[REFERENCE_SPEED])
    follow_reference(acc, nodes[REFERENCE_SPEED + 4])
    last = 0
    f = 0.0
    at0 = 0.0
    at1 = 0.0
    for i in range(1, count + 1):
        p0 = p
        p, q = free_motion(m, p, q)
        v = value(speed, first + step * i) + q
        if v0 * v <= 0.0 and v0 != v:
            last = i
            f = v0 / (v0 - v)
            at0 = p0
            at1 = p
        v0 = v
    if last > 0:
        s = first + step * last
        at0 += value(place, s - step)
        acc.turn_time = t + width * (s + step * (f - 1.0))
        acc.turn_position = at0 + f * (value(place, s) + at1 - at0)
    acc.last_velocity = v0


@kernel(exact=False)
def count_events(
    acc: Any, turns: Turns, nodes: Any, span: Span, look: Look, slack: Slack, second: bool
) -> None:  # fmt: skip
    """Count reversals and standstills over a part of a window, and note where the error leaves its band."""
    t, width = span
    first, part, count, m, free = look
    speed = quartic(nodes, SPEED)
    rises = slopes(speed, width)
    reference = quartic(nodes, REFERENCE_SPEED)
    step = part / count
    d = width * step
    p = free.position
    q = free.velocity
    v0 = value(speed, first) + q
    a0 = value(rises, first) - free.damping * q - free.square * p
    end = first + part
    ends = value(speed, end), value(reference, end)
    touch(acc, t + width * first, value(quartic(nodes, AT), first) + p, v0)
    rest_seen(acc, t + width * first, v0, value(reference, first))
    for i in range(1, count + 1):
        s = first + step * i
        now = t + width * s
        p0 = p
        p, q = free_motion(m, p, q)
        v = value(speed, s) + q
        a = value(rises, s) - free.damping * q - free.square * p
        rate = value(reference, s)
        crest = v
        if a0 * a < 0.0:
            top = summit(v0, a0, v, a, d)
            if abs(top) > max(abs(v), abs(v0)):
                crest = top
        if v0 * v <= 0.0 and v0 != v:
            f = v0 / (v0 - v)
            place = quartic(nodes, AT)
            at0 = value(place, s - step) + p0
            acc.turn_time = now + d * (f - 1.0)
            acc.turn_position = at0 + f * (value(place, s) + p - at0)
        confirm(acc, turns, crest, second)
        follow_reference(acc, rate)
        rest_seen(acc, now, crest, rate)
        if acc.settle_band > 0.0:
            error = quartic(nodes, ERROR)
            leave_band(acc, now, d, value(error, s - step) - p0, value(error, s) - p)
        v0 = v
        a0 = a
        if i % LOOK_UP == 0 and acc.settle_band == 0.0:
            # Ringing dies out: of what is left, the bounds may tell that it is calm.
            sway = math.sqrt(free.square * p * p + q * q) + slack.speed
            low, high = min(v - q, ends[0]) - sway, max(v - q, ends[0]) + sway
            slowest, fastest = min(rate, ends[1]) - slack.reference, max(rate, ends[1]) + slack.reference
            if not counts(low, high, slowest, fastest):
                follow_reference(acc, ends[1])
                break
    acc.last_velocity = v0


@kernel(exact=False, inline=True)
def slopes(c: Five, width: float) -> Five:
    """The rate of a quartic over a window of `width` s."""
    inverse = 1.0 / width
    return inverse * c[1], inverse * 2.0 * c[2], inverse * 3.0 * c[3], inverse * 4.0 * c[4], 0.0


@kernel(exact=False, inline=True)
def leave_band(acc: Any, now: float, d: float, before: float, error: float) -> None:
    """Note when the error was last outside the band in which it counts as settled."""
    band = acc.settle_band
    if abs(error) > band:
        acc.outside_last = now
    elif abs(before) > band:
        acc.outside_last = now - d + d * (abs(before) - band) / (abs(before) - abs(error))
