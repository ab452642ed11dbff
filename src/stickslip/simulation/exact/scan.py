"""What a window of the meter holds between its nodes: bounds of its signals, and a look at fine steps."""

from __future__ import annotations

from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import (
    AT,
    E_MAX,
    ERROR,
    LAST_VELOCITY,
    MOTOR,
    MOVING,
    OUTSIDE_LAST,
    REFERENCE_SPEED,
    SETTLE_BAND,
    SPEED,
    TRIGGER,
    TURN_POSITION,
    TURN_TIME,
    W2_E_HIGH,
    W2_E_LOW,
    confirm,
    follow_reference,
    in_second_half,
    reached,
    rest_seen,
    summit,
)
from stickslip.simulation.exact.flow import Matrix, free_motion
from stickslip.simulation.exact.ringing import Five, quartic, value


class Free(NamedTuple):
    """A free motion at the begin of a window, and p'' = -damping p' - square p (1/s, 1/s²)."""

    position: float
    velocity: float
    damping: float
    square: float


NO_FREE = Free(0.0, 0.0, 0.0, 0.0)

# ---- bounds ---------------------------------------------------------------------------------------------------


@kernel(exact=False, inline=True)
def bulge(nodes: Any, row: int) -> float:
    """How far the quartic through a row of nodes can leave the straight line between two of them."""
    a = nodes[row, 0]
    b = nodes[row, 1]
    c = nodes[row, 2]
    d = nodes[row, 3]
    e = nodes[row, 4]
    p = c - 2.0 * b + a
    q = d - 2.0 * c + b
    r = e - 2.0 * d + c
    # An eighth of its greatest second derivative.
    return 0.125 * (max(abs(p), abs(q), abs(r)) + max(abs(q - p), abs(r - q)) + abs(p - 2.0 * q + r))


@kernel(exact=False, inline=True)
def bounds(nodes: Any, row: int) -> tuple[float, float]:
    """Least and greatest that the quartic through a row of nodes can have."""
    low = min(nodes[row, 0], nodes[row, 1], nodes[row, 2], nodes[row, 3], nodes[row, 4])
    high = max(nodes[row, 0], nodes[row, 1], nodes[row, 2], nodes[row, 3], nodes[row, 4])
    rise = bulge(nodes, row)
    return low - rise, high + rise


@kernel(exact=False, inline=True)
def reach(nodes: Any, row: int) -> float:
    """Greatest magnitude that the quartic through a row of nodes can have."""
    low, high = bounds(nodes, row)
    return max(-low, high)


@kernel(exact=False, inline=True)
def farther(acc: Any, second: bool, low: float, high: float) -> bool:
    """Whether an error within these bounds may be the greatest or the least so far."""
    if high > acc[E_MAX] or -low > acc[E_MAX]:
        return True
    return second and (low < acc[W2_E_LOW] or high > acc[W2_E_HIGH])


@kernel(exact=False)
def calm(acc: Any, nodes: Any, swing: float, sway: float) -> bool:
    """Whether nothing is counted in a window: no reversal, no standstill's begin or end, none at the settling band.

    ``swing`` and ``sway`` are the most by which ringing adds to position and velocity.
    """
    low, high = bounds(nodes, SPEED)
    low -= sway
    high += sway
    slowest, fastest = bounds(nodes, REFERENCE_SPEED)
    if slowest < -TRIGGER and fastest > TRIGGER:
        return False
    if low <= TRIGGER and high >= -TRIGGER:
        if low <= -TRIGGER or high >= TRIGGER or (low <= 0.0 <= high and low < high):
            return False
        if not (slowest > MOVING or fastest < -MOVING or (slowest > -MOVING and fastest < MOVING)):
            return False
    band = acc[SETTLE_BAND]
    if band > 0.0:
        low, high = bounds(nodes, ERROR)
        low -= swing
        high += swing
        return low > band or high < -band or (low >= -band and high <= band)
    return True


# ---- a window through which nothing happens -------------------------------------------------------------------


@kernel(exact=False, inline=True)
def passes(acc: Any, turns: Any, t: float, end: float, nodes: Any, first: float, last: float) -> None:
    """Note a calm window, whose velocity runs from `first` to `last`."""
    touch(acc, t, nodes[AT, 0], first)
    rest_seen(acc, t, first, nodes[REFERENCE_SPEED, 0])
    confirm(acc, turns, last, in_second_half(acc, t))
    for i in range(1, 5):
        follow_reference(acc, nodes[REFERENCE_SPEED, i])
    if acc[SETTLE_BAND] > 0.0 and abs(nodes[ERROR, 2]) > acc[SETTLE_BAND]:
        acc[OUTSIDE_LAST] = end
    acc[LAST_VELOCITY] = last


@kernel(exact=False, inline=True)
def touch(acc: Any, t: float, position: float, v: float) -> None:
    """Rounding may put a zero of the velocity between the last window and this one."""
    if acc[LAST_VELOCITY] * v < 0.0:
        acc[TURN_TIME] = t
        acc[TURN_POSITION] = position


# ---- a look at fine steps -------------------------------------------------------------------------------------


@kernel(exact=False)
def scan(
    acc: Any, turns: Any, t: float, width: float, nodes: Any, first: float, part: float, m: Matrix, free: Free,
    motor_p: float, motor_v: float, count: int, events: bool,
) -> None:  # fmt: skip
    """Note the extremes over a `part` of a window that begins at its fraction `first`, in `count` steps over each of
    which `m` carries the free motion; counts reversals and standstills on the way if `events`."""
    error = quartic(nodes, ERROR)
    speed = quartic(nodes, SPEED)
    reference = quartic(nodes, REFERENCE_SPEED)
    torque = quartic(nodes, MOTOR)
    place = quartic(nodes, AT)
    second = in_second_half(acc, t)
    step = part / count
    d = width * step
    p = free.position
    q = free.velocity
    e0 = value(error, first) - p
    v0 = value(speed, first) + q
    free_rise = -free.damping * q - free.square * p
    a0 = slope(speed, first) / width + free_rise
    g0 = value(reference, first) - v0
    low = e0
    high = e0
    fastest = abs(v0)
    push0 = value(torque, first) + motor_p * p + motor_v * q
    rise0 = slope(torque, first) / width + motor_p * q + motor_v * free_rise
    strongest = abs(push0)
    if events:
        touch(acc, t + width * first, value(place, first) + p, v0)
        rest_seen(acc, t + width * first, v0, value(reference, first))
    for i in range(1, count + 1):
        s = first + step * i
        p0 = p
        p, q = free_motion(m, p, q)
        e = value(error, s) - p
        v = value(speed, s) + q
        free_rise = -free.damping * q - free.square * p
        a = slope(speed, s) / width + free_rise
        rate = value(reference, s)
        g = rate - v
        low = min(low, e)
        high = max(high, e)
        if g0 * g < 0.0:
            top = summit(e0, g0, e, g, d)
            low = min(low, top)
            high = max(high, top)
        crest = v
        if a0 * a < 0.0:
            top = summit(v0, a0, v, a, d)
            fastest = max(fastest, abs(top))
            if abs(top) > max(abs(v), abs(v0)):
                crest = top
        fastest = max(fastest, abs(v))
        push = value(torque, s) + motor_p * p + motor_v * q
        rise = slope(torque, s) / width + motor_p * q + motor_v * free_rise
        strongest = max(strongest, abs(push))
        if rise0 * rise < 0.0:
            strongest = max(strongest, abs(summit(push0, rise0, push, rise, d)))
        if events:
            now = t + width * s
            if v0 * v <= 0.0 and v0 != v:
                f = v0 / (v0 - v)
                at0 = value(place, s - step) + p0
                acc[TURN_TIME] = now + d * (f - 1.0)
                acc[TURN_POSITION] = at0 + f * (value(place, s) + p - at0)
            confirm(acc, turns, crest, second)
            follow_reference(acc, rate)
            rest_seen(acc, now, crest, rate)
            leave_band(acc, now, d, e0, e)
        e0 = e
        v0 = v
        a0 = a
        g0 = g
        push0 = push
        rise0 = rise
    if events:
        acc[LAST_VELOCITY] = v0
    reached(acc, second, low, high, fastest, strongest)


@kernel(exact=False, inline=True)
def slope(c: Five, s: float) -> float:
    """Slope of a quartic at s."""
    return c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * 4.0 * c[4]))


@kernel(exact=False, inline=True)
def leave_band(acc: Any, now: float, d: float, before: float, error: float) -> None:
    """Note when the error was last outside the band in which it counts as settled."""
    band = acc[SETTLE_BAND]
    if band <= 0.0:
        return
    if abs(error) > band:
        acc[OUTSIDE_LAST] = now
    elif abs(before) > band:
        acc[OUTSIDE_LAST] = now - d + d * (abs(before) - band) / (abs(before) - abs(error))
