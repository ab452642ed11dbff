"""Metrics, accumulated inside the integrators while a run goes on.

An integrator hands every stretch of time (at most 2 ms long, inside one half of the run and not across 80 % of
it) to `meter`, with five equally spaced nodes of each signal. Integrals are taken by Boole's rule (order 6),
extremes of the error from its slope, the 50 Hz high-pass by its convolution with the velocity.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import kernel

# Thresholds, all stated by the study (issue and reference README).
HIGH_PASS = 2.0 * math.pi * 50.0  # rad/s
TRIGGER = 1e-3  # rad/s, Schmitt trigger of the reversals, and standstill
MOVING = 2e-3  # rad/s, the reference moves
NEARLY = 0.9  # of it; between nodes that are lower no crest passes it
STANDSTILL = 10e-3  # s, shortest standstill that counts
MAX_WINDOW = 2e-3  # s
LONG_WINDOW = 16e-3  # s, where only the metrics of COARSE are wanted

# ---- layout of the accumulator --------------------------------------------------------------------------------
(
    DURATION, SETTLE_BAND, E2, E_MAX, EV2, TM2, TM_MAX, DF2, HP2, V_MAX, REVERSALS, SS_E, E_END,
    W2_E2, W2_E_MAX, W2_E_LOW, W2_E_HIGH, W2_EV2, W2_TM2, W2_HP2, W2_REVERSALS,
    LOW_PASS, SIDE, STILL_SINCE, STILL_COUNT, STILL_LONGEST, OUTSIDE_LAST, WORK, LOSS, COMPENSATION_WORK,
    REFERENCE_SIDE, REFERENCE_REVERSALS, TURN_TIME, TURN_POSITION, TURN_COUNT,
    LAST_VELOCITY, WINDOW, SIZE,
) = range(38)  # fmt: skip


def new_meter(duration: float, settle_band: float, window: float = MAX_WINDOW) -> Any:
    """Return an empty accumulator for a run of `duration` s; `settle_band` in rad, 0 for none.

    `window` is the longest stretch in s that the meter is handed. With one above MAX_WINDOW it leaves out what needs
    short ones, and the metrics are those of `COARSE`.
    """
    acc = np.zeros(SIZE)
    acc[WINDOW] = window
    acc[DURATION] = duration
    acc[SETTLE_BAND] = settle_band
    acc[STILL_SINCE] = -1.0
    acc[W2_E_LOW] = math.inf
    acc[W2_E_HIGH] = -math.inf
    return acc


class Sums(NamedTuple):
    """Integrals over a stretch: e, e², (de/dt)², T_m², (T_f - T_c)², T_m v, T_f v and T_c v."""

    e: float
    e2: float
    ev2: float
    tm2: float
    df2: float
    work: float
    loss: float
    compensation: float


# ---- rows of the nodes: position error, velocity error, position, velocity, reference velocity, and the torques of
# motor, friction and compensator
ERROR, ERROR_RATE, AT, SPEED, REFERENCE_SPEED, MOTOR, FRICTION, COMPENSATING, SIGNALS = range(9)


@kernel(exact=False)
def meter(acc: Any, turns: Any, t: float, h: float, nodes: Any) -> None:
    """Add the stretch [t, t + h] to the accumulator.

    ``nodes`` has a row for each signal (see the names above) and five columns in time; ``turns`` (n, 2) receives
    time and position of every reversal, as long as it has room.
    """
    low, high = extremes(nodes, 0.25 * h)
    motor = 0.0
    for i in range(5):
        motor = max(motor, abs(nodes[MOTOR, i]))
    second = add(acc, t, h, sums(nodes), nodes[ERROR, 4])
    reached(acc, second, low, high, peak(nodes, acc[V_MAX]), motor)
    if acc[WINDOW] > MAX_WINDOW:
        return
    high_pass(acc, h, nodes, second)
    reversals(acc, turns, t, h, nodes, second)
    standstill(acc, t, h, nodes)
    settling(acc, t, h, nodes)


@kernel(exact=False, inline=True)
def sums(nodes: Any) -> Sums:
    """Integrals over a window of 90 (Boole's rule has that denominator), in the order of `Sums`."""
    e = 0.0
    e2 = 0.0
    ev2 = 0.0
    tm2 = 0.0
    df2 = 0.0
    work = 0.0
    loss = 0.0
    compensation = 0.0
    for i in range(5):
        w = 7.0 if i == 0 or i == 4 else (12.0 if i == 2 else 32.0)
        e += w * nodes[ERROR, i]
        e2 += w * nodes[ERROR, i] * nodes[ERROR, i]
        ev2 += w * nodes[ERROR_RATE, i] * nodes[ERROR_RATE, i]
        tm2 += w * nodes[MOTOR, i] * nodes[MOTOR, i]
        df2 += (
            w * (nodes[FRICTION, i] - nodes[COMPENSATING, i]) * (nodes[FRICTION, i] - nodes[COMPENSATING, i])
        )
        work += w * nodes[MOTOR, i] * nodes[SPEED, i]
        loss += w * nodes[FRICTION, i] * nodes[SPEED, i]
        compensation += w * nodes[COMPENSATING, i] * nodes[SPEED, i]
    return Sums(e, e2, ev2, tm2, df2, work, loss, compensation)


@kernel(exact=False, inline=True)
def add(acc: Any, t: float, h: float, total: Sums, end: float) -> bool:
    """Add a stretch's integrals and its last error; returns whether it lies in the second half of the run."""
    second = in_second_half(acc, t)
    scale = h / 90.0
    acc[E2] += scale * total.e2
    acc[EV2] += scale * total.ev2
    acc[TM2] += scale * total.tm2
    acc[DF2] += scale * total.df2
    acc[WORK] += scale * total.work
    acc[LOSS] += scale * total.loss
    acc[COMPENSATION_WORK] += scale * total.compensation
    if t >= 0.8 * acc[DURATION] * (1.0 - 1e-12):
        acc[SS_E] += scale * total.e
    acc[E_END] = end
    if second:
        acc[W2_E2] += scale * total.e2
        acc[W2_EV2] += scale * total.ev2
        acc[W2_TM2] += scale * total.tm2
    return second


@kernel(exact=False, inline=True)
def reached(acc: Any, second: bool, low: float, high: float, speed: float, motor: float) -> None:
    """Note the least and greatest error of a stretch, and the peaks of |v| and of the motor's torque."""
    acc[E_MAX] = max(acc[E_MAX], -low, high)
    acc[V_MAX] = max(acc[V_MAX], speed)
    acc[TM_MAX] = max(acc[TM_MAX], motor)
    if second:
        acc[W2_E_MAX] = max(acc[W2_E_MAX], -low, high)
        acc[W2_E_LOW] = min(acc[W2_E_LOW], low)
        acc[W2_E_HIGH] = max(acc[W2_E_HIGH], high)


@kernel(exact=False, inline=True)
def in_second_half(acc: Any, t: float) -> bool:
    """Whether a stretch that begins at t lies in the second half of the run."""
    return t >= 0.5 * acc[DURATION] * (1.0 - 1e-12)


@kernel(exact=False)
def extremes(nodes: Any, d: float) -> tuple[float, float]:
    """Smallest and largest error over the nodes, spaced d apart, and between them where its slope changes sign."""
    low = nodes[ERROR, 0]
    high = nodes[ERROR, 0]
    for i in range(1, 5):
        low = min(low, nodes[ERROR, i])
        high = max(high, nodes[ERROR, i])
        if nodes[ERROR_RATE, i - 1] * nodes[ERROR_RATE, i] < 0.0:
            between = summit(
                nodes[ERROR, i - 1], nodes[ERROR_RATE, i - 1], nodes[ERROR, i], nodes[ERROR_RATE, i], d
            )  # fmt: skip
            low = min(low, between)
            high = max(high, between)
    return low, high


@kernel(exact=False, inline=True)
def summit(y0: float, d0: float, y1: float, d1: float, d: float) -> float:
    """The cubic through two values and slopes of opposite sign, d apart, where a straight slope vanishes."""
    x = d0 / (d0 - d1)
    y = 1.0 - x
    return y * y * (1.0 + 2.0 * x) * y0 + x * x * (3.0 - 2.0 * x) * y1 + x * y * d * (y * d0 - x * d1)


@kernel(exact=False)
def speed_at(nodes: Any, x: float) -> float:
    """The quartic through the velocities at the five nodes, at x = 0 to 4."""
    d1 = nodes[SPEED, 1] - nodes[SPEED, 0]
    d2 = nodes[SPEED, 2] - 2.0 * nodes[SPEED, 1] + nodes[SPEED, 0]
    d3 = nodes[SPEED, 3] - 3.0 * nodes[SPEED, 2] + 3.0 * nodes[SPEED, 1] - nodes[SPEED, 0]
    d4 = (
        nodes[SPEED, 4]
        - 4.0 * nodes[SPEED, 3]
        + 6.0 * nodes[SPEED, 2]
        - 4.0 * nodes[SPEED, 1]
        + nodes[SPEED, 0]
    )
    rise = d3 + 0.25 * (x - 3.0) * d4
    return nodes[SPEED, 0] + x * (d1 + 0.5 * (x - 1.0) * (d2 + (x - 2.0) / 3.0 * rise))


@kernel(exact=False)
def crest(nodes: Any, i: int) -> float:
    """The velocity at node i, or, where only a crest between the node before and it passes TRIGGER, that crest.

    Else the place of the nodes, which is the step's and not the motion's, would decide whether it counts.
    """
    v = nodes[SPEED, i]
    near = max(abs(v), abs(nodes[SPEED, i - 1]))
    if near > TRIGGER or near < NEARLY * TRIGGER:
        return v
    top = v
    before = nodes[SPEED, i - 1]
    now = speed_at(nodes, i - 0.875)
    for j in range(2, 9):
        after = speed_at(nodes, i - 1.0 + 0.125 * j)
        bend = before - 2.0 * now + after
        if abs(now) > abs(top) and (now - before) * (after - now) <= 0.0 and bend * now < 0.0:
            top = now - (after - before) * (after - before) / (8.0 * bend)
        before, now = now, after
    return top


@kernel(exact=False)
def peak(nodes: Any, so_far: float) -> float:
    """Largest |v| of the quartic through the five nodes, where it may exceed the one so far; else 0.

    Sampled finely and refined by a parabola.
    """
    if (
        1.3
        * max(
            abs(nodes[SPEED, 0]),
            abs(nodes[SPEED, 1]),
            abs(nodes[SPEED, 2]),
            abs(nodes[SPEED, 3]),
            abs(nodes[SPEED, 4]),
        )
        < so_far
    ):
        return 0.0
    top = 0.0
    before, middle = 0.0, 0.0
    for i in range(33):
        now = abs(speed_at(nodes, i / 8.0))
        bend = before - 2.0 * middle + now
        if i > 1 and middle >= before and middle >= now and bend < 0.0:
            top = max(top, middle - (now - before) * (now - before) / (8.0 * bend))
        top = max(top, now)
        before, middle = middle, now
    return top


@kernel(exact=False)
def high_pass(acc: Any, h: float, nodes: Any, second: bool) -> None:
    """Advance the 50 Hz low-pass y' = w (v - y) and add the integral of (v - y)²."""
    half = math.exp(-0.125 * HIGH_PASS * h)
    weight = HIGH_PASS * h / 24.0
    y = acc[LOW_PASS]
    total = 7.0 * (nodes[SPEED, 0] - y) * (nodes[SPEED, 0] - y)
    for i in range(4):
        # Simpson's rule on the convolution over a quarter; its middle value from the cubic through four nodes.
        if i == 0:
            middle = (
                5.0 * nodes[SPEED, 0] + 15.0 * nodes[SPEED, 1] - 5.0 * nodes[SPEED, 2] + nodes[SPEED, 3]
            ) / 16.0
        elif i == 3:
            middle = (
                5.0 * nodes[SPEED, 4] + 15.0 * nodes[SPEED, 3] - 5.0 * nodes[SPEED, 2] + nodes[SPEED, 1]
            ) / 16.0
        else:
            middle = (
                9.0 * (nodes[SPEED, i] + nodes[SPEED, i + 1]) - nodes[SPEED, i - 1] - nodes[SPEED, i + 2]
            ) / 16.0
        y = half * half * y + weight * (
            half * half * nodes[SPEED, i] + 4.0 * half * middle + nodes[SPEED, i + 1]
        )
        w = 7.0 if i == 3 else (12.0 if i == 1 else 32.0)
        total += w * (nodes[SPEED, i + 1] - y) * (nodes[SPEED, i + 1] - y)
    acc[LOW_PASS] = y
    add_high_pass(acc, h / 90.0 * total, second)


@kernel(exact=False, inline=True)
def add_high_pass(acc: Any, total: float, second: bool) -> None:
    """Add an integral of the squared high-passed velocity."""
    acc[HP2] += total
    if second:
        acc[W2_HP2] += total


@kernel(exact=False)
def reversals(acc: Any, turns: Any, t: float, h: float, nodes: Any, second: bool) -> None:
    """Count sign reversals of v and of the reference with a Schmitt trigger; keep the turning points."""
    # Rounding may put a zero between the end of the last stretch and the start of this one.
    if acc[LAST_VELOCITY] * nodes[SPEED, 0] < 0.0:
        acc[TURN_TIME] = t
        acc[TURN_POSITION] = nodes[AT, 0]
    acc[LAST_VELOCITY] = nodes[SPEED, 4]
    for i in range(1, 5):
        # The last zero of v is the turning point, if the trigger then confirms a reversal.
        if nodes[SPEED, i - 1] * nodes[SPEED, i] <= 0.0 and nodes[SPEED, i - 1] != nodes[SPEED, i]:
            f = nodes[SPEED, i - 1] / (nodes[SPEED, i - 1] - nodes[SPEED, i])
            acc[TURN_TIME] = t + 0.25 * h * (i - 1 + f)
            acc[TURN_POSITION] = nodes[AT, i - 1] + f * (nodes[AT, i] - nodes[AT, i - 1])
        confirm(acc, turns, crest(nodes, i), second)
        follow_reference(acc, nodes[REFERENCE_SPEED, i])


@kernel(exact=False, inline=True)
def confirm(acc: Any, turns: Any, v: float, second: bool) -> None:
    """Let a velocity beyond the trigger confirm the reversal that TURN_TIME remembers, if the side is another."""
    if abs(v) <= TRIGGER:
        return
    side = 1.0 if v > 0.0 else -1.0
    if side * acc[SIDE] < 0.0:
        acc[REVERSALS] += 1.0
        if second:
            acc[W2_REVERSALS] += 1.0
        n = int(acc[TURN_COUNT])
        if n < turns.shape[0]:
            turns[n, 0] = acc[TURN_TIME]
            turns[n, 1] = acc[TURN_POSITION]
            acc[TURN_COUNT] += 1.0
    acc[SIDE] = side


@kernel(exact=False, inline=True)
def follow_reference(acc: Any, rate: float) -> None:
    """Count the reversals of the reference, whose velocity this is."""
    if abs(rate) > TRIGGER:
        side = 1.0 if rate > 0.0 else -1.0
        if side * acc[REFERENCE_SIDE] < 0.0:
            acc[REFERENCE_REVERSALS] += 1.0
        acc[REFERENCE_SIDE] = side


@kernel(exact=False)
def standstill(acc: Any, t: float, h: float, nodes: Any) -> None:
    """Find standstills: |v| below the trigger for at least 10 ms while the reference moves."""
    for i in range(5):
        v = nodes[SPEED, i] if i == 0 else crest(nodes, i)
        rest_seen(acc, t + 0.25 * h * i, v, nodes[REFERENCE_SPEED, i])


@kernel(exact=False, inline=True)
def rest_seen(acc: Any, now: float, v: float, rate: float) -> None:
    """Begin or end a standstill at a velocity and the reference's."""
    still = abs(v) < TRIGGER and abs(rate) > MOVING
    if still and acc[STILL_SINCE] < 0.0:
        acc[STILL_SINCE] = now
    elif not still and acc[STILL_SINCE] >= 0.0:
        close_standstill(acc, now)


@kernel(exact=False)
def settling(acc: Any, t: float, h: float, nodes: Any) -> None:
    """Note when the error was last outside the band in which it counts as settled."""
    band = acc[SETTLE_BAND]
    if band > 0.0:
        for i in range(5):
            now = abs(nodes[ERROR, i])
            if now > band:
                acc[OUTSIDE_LAST] = t + 0.25 * h * i
                if i < 4 and abs(nodes[ERROR, i + 1]) <= band:
                    acc[OUTSIDE_LAST] += 0.25 * h * (now - band) / (now - abs(nodes[ERROR, i + 1]))


@kernel(exact=False)
def close_standstill(acc: Any, now: float) -> None:
    """End a standstill, counting it if it was long enough; integrators call it at the end of a run too."""
    if acc[STILL_SINCE] >= 0.0:
        length = now - acc[STILL_SINCE]
        if length >= STANDSTILL:
            acc[STILL_COUNT] += 1.0
            acc[STILL_LONGEST] = max(acc[STILL_LONGEST], length)
        acc[STILL_SINCE] = -1.0
