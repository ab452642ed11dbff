"""Metrics, accumulated inside the integrators while a run goes on.

An integrator hands every stretch of time (at most 2 ms long, inside one half of the run and not across 80 % of
it) to `meter`, with five equally spaced nodes of each signal (`_nodes`). Integrals are taken by Boole's rule (order 6),
extremes of the error from its slope, the 50 Hz high-pass by its convolution with the velocity.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import kernel, pointer, record_at, spliced
from stickslip.simulation._nodes import (
    AT,
    COMPENSATING,
    ERROR,
    ERROR_RATE,
    FRICTION,
    MOTOR,
    REFERENCE_SPEED,
    SPEED,
    TRIGGER,
    crest,
    extremes,
    peak,
)

# Thresholds, all stated by the study (issue and reference README).
HIGH_PASS = 2.0 * math.pi * 50.0  # rad/s
MOVING = 2e-3  # rad/s, the reference moves
STANDSTILL = 10e-3  # s, shortest standstill that counts
MAX_WINDOW = 2e-3  # s
LATE = 0.6  # part of the run, from which on limit cycles are looked for
LONG_WINDOW = 16e-3  # s, where only the metrics of COARSE are wanted

METER = np.dtype(
    [
        *((name, np.float64) for name in (
            # Of the run, s; rad in which the error counts as settled, 0: none; the longest stretch it is handed, s.
            "duration", "settle_band", "window",
            # Integrals of e², (de/dt)², T_m², (T_f - T_c)² and of the square of the velocity above 50 Hz; of e over the
            # last fifth; rad²s, rad²/s, N²m²s, rad s.
            "e2", "ev2", "tm2", "df2", "hp2", "ss_e",
            # Greatest error, velocity and motor torque, and the last error: rad, rad/s, N·m.
            "e_max", "v_max", "tm_max", "e_end",
            # The same of the second half of the run, and the least and greatest error there.
            "w2_e2", "w2_ev2", "w2_tm2", "w2_hp2", "w2_e_max", "w2_e_low", "w2_e_high",
            # The velocity below 50 Hz, rad/s; the side on which it, and the reference's, was beyond the trigger last.
            "low_pass", "side", "reference_side",
            # Since when the axis stands still, s, -1: it moves; the longest standstill, s; last time outside the band.
            "still_since", "still_longest", "outside_last",
            # Of the motor, of friction, and of the compensator, J.
            "work", "loss", "compensation_work",
            # The last zero of the velocity, s and rad; the velocity at the end of the last stretch, rad/s.
            "turn_time", "turn_position", "last_velocity",
        )),
        *((name, np.int64) for name in (
            "reversals", "w2_reversals", "reference_reversals",
            # Standstills; reversals whose time and position are kept.
            "still_count", "turn_count",
        )),
    ]
)  # fmt: skip
"""What the meter has gathered so far."""
SIZE = METER.itemsize // 8


def new_meter(duration: float, settle_band: float, window: float = MAX_WINDOW) -> Any:
    """Return an empty accumulator for a run of `duration` s; `settle_band` in rad, 0 for none.

    `window` is the longest stretch in s that the meter is handed. With one above MAX_WINDOW it leaves out what needs
    short ones, and the metrics are those of `COARSE`.
    """
    acc = np.zeros(SIZE)
    begun = gathered(acc)
    begun["window"] = window
    begun["duration"] = duration
    begun["settle_band"] = settle_band
    begun["still_since"] = -1.0
    begun["w2_e_low"] = math.inf
    begun["w2_e_high"] = -math.inf
    return acc


def gathered(acc: Any) -> Any:
    """What accumulators hold, by name; shape (..., SIZE) gives (...), a view."""
    return acc.view(METER)[..., 0]


def turning_points(acc: Any, turns: Any) -> Any:
    """Time (s) and position (rad) of the reversals that were kept, shape (n, 2)."""
    return turns[: int(gathered(acc)["turn_count"])]


@spliced
def meter_of(acc: Any) -> Any:
    """What an accumulator holds, for kernels."""
    return record_at(pointer(acc, 0), METER)


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


class Turns(NamedTuple):
    """Where reversals are kept: the address of (n, 2) numbers, time and position, and room for how many."""

    at: Any
    room: int


@spliced
def turns_of(turns: Any) -> Turns:
    """The turns of an array that outlives the call: handed on, arrays count references, at a quarter of the price."""
    return Turns(pointer(turns, 0), turns.shape[0])


@kernel(exact=False)
def meter(acc: Any, turns: Any, t: float, h: float, nodes: Any) -> None:
    """Add the stretch [t, t + h] to the accumulator.

    ``nodes`` has a row for each signal (`_nodes`) and five columns in time; ``turns`` (n, 2) receives
    time and position of every reversal, as long as it has room.
    """
    add_stretch(meter_of(acc), turns_of(turns), t, h, pointer(nodes, 0))


@kernel(exact=False)
def add_stretch(so_far: Any, turns: Turns, t: float, h: float, nodes: Any) -> None:
    """Add a stretch, of whose nodes this is the address."""
    low, high = extremes(nodes, 0.25 * h)
    motor = 0.0
    for i in range(5):
        motor = max(motor, abs(nodes[MOTOR + i]))
    second = add(so_far, t, h, sums(nodes), nodes[ERROR + 4])
    reached(so_far, second, low, high, peak(nodes, so_far.v_max), motor)
    if so_far.window > MAX_WINDOW:
        return
    high_pass(so_far, h, nodes, second)
    reversals(so_far, turns, t, h, nodes, second)
    standstill(so_far, t, h, nodes)
    settling(so_far, t, h, nodes)


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
        e += w * nodes[ERROR + i]
        e2 += w * nodes[ERROR + i] * nodes[ERROR + i]
        ev2 += w * nodes[ERROR_RATE + i] * nodes[ERROR_RATE + i]
        tm2 += w * nodes[MOTOR + i] * nodes[MOTOR + i]
        df2 += (
            w
            * (nodes[FRICTION + i] - nodes[COMPENSATING + i])
            * (nodes[FRICTION + i] - nodes[COMPENSATING + i])
        )
        work += w * nodes[MOTOR + i] * nodes[SPEED + i]
        loss += w * nodes[FRICTION + i] * nodes[SPEED + i]
        compensation += w * nodes[COMPENSATING + i] * nodes[SPEED + i]
    return Sums(e, e2, ev2, tm2, df2, work, loss, compensation)


@kernel(exact=False, inline=True)
def add(acc: Any, t: float, h: float, total: Sums, end: float) -> bool:
    """Add a stretch's integrals and its last error; returns whether it lies in the second half of the run."""
    second = in_second_half(acc, t)
    scale = h / 90.0
    acc.e2 += scale * total.e2
    acc.ev2 += scale * total.ev2
    acc.tm2 += scale * total.tm2
    acc.df2 += scale * total.df2
    acc.work += scale * total.work
    acc.loss += scale * total.loss
    acc.compensation_work += scale * total.compensation
    if t >= 0.8 * acc.duration * (1.0 - 1e-12):
        acc.ss_e += scale * total.e
    acc.e_end = end
    if second:
        acc.w2_e2 += scale * total.e2
        acc.w2_ev2 += scale * total.ev2
        acc.w2_tm2 += scale * total.tm2
    return second


@kernel(exact=False, inline=True)
def reached(acc: Any, second: bool, low: float, high: float, speed: float, motor: float) -> None:
    """Note the least and greatest error of a stretch, and the peaks of |v| and of the motor's torque."""
    acc.e_max = max(acc.e_max, -low, high)
    acc.v_max = max(acc.v_max, speed)
    acc.tm_max = max(acc.tm_max, motor)
    if second:
        acc.w2_e_max = max(acc.w2_e_max, -low, high)
        acc.w2_e_low = min(acc.w2_e_low, low)
        acc.w2_e_high = max(acc.w2_e_high, high)


@kernel(exact=False, inline=True)
def in_second_half(acc: Any, t: float) -> bool:
    """Whether a stretch that begins at t lies in the second half of the run."""
    return t >= 0.5 * acc.duration * (1.0 - 1e-12)


@kernel(exact=False)
def high_pass(acc: Any, h: float, nodes: Any, second: bool) -> None:
    """Advance the 50 Hz low-pass y' = w (v - y) and add the integral of (v - y)²."""
    half = math.exp(-0.125 * HIGH_PASS * h)
    weight = HIGH_PASS * h / 24.0
    y = acc.low_pass
    total = 7.0 * (nodes[SPEED] - y) * (nodes[SPEED] - y)
    for i in range(4):
        # Simpson's rule on the convolution over a quarter; its middle value from the cubic through four nodes.
        if i == 0:
            middle = (
                5.0 * nodes[SPEED] + 15.0 * nodes[SPEED + 1] - 5.0 * nodes[SPEED + 2] + nodes[SPEED + 3]
            ) / 16.0
        elif i == 3:
            middle = (
                5.0 * nodes[SPEED + 4] + 15.0 * nodes[SPEED + 3] - 5.0 * nodes[SPEED + 2] + nodes[SPEED + 1]
            ) / 16.0
        else:
            middle = (
                9.0 * (nodes[SPEED + i] + nodes[SPEED + i + 1]) - nodes[SPEED + i - 1] - nodes[SPEED + i + 2]
            ) / 16.0
        y = half * half * y + weight * (
            half * half * nodes[SPEED + i] + 4.0 * half * middle + nodes[SPEED + i + 1]
        )
        w = 7.0 if i == 3 else (12.0 if i == 1 else 32.0)
        total += w * (nodes[SPEED + i + 1] - y) * (nodes[SPEED + i + 1] - y)
    acc.low_pass = y
    add_high_pass(acc, h / 90.0 * total, second)


@kernel(exact=False, inline=True)
def add_high_pass(acc: Any, total: float, second: bool) -> None:
    """Add an integral of the squared high-passed velocity."""
    acc.hp2 += total
    if second:
        acc.w2_hp2 += total


@kernel(exact=False)
def reversals(acc: Any, turns: Turns, t: float, h: float, nodes: Any, second: bool) -> None:
    """Count sign reversals of v and of the reference with a Schmitt trigger; keep the turning points."""
    # Rounding may put a zero between the end of the last stretch and the start of this one.
    if acc.last_velocity * nodes[SPEED] < 0.0:
        acc.turn_time = t
        acc.turn_position = nodes[AT]
    acc.last_velocity = nodes[SPEED + 4]
    for i in range(1, 5):
        # The last zero of v is the turning point, if the trigger then confirms a reversal.
        if nodes[SPEED + i - 1] * nodes[SPEED + i] <= 0.0 and nodes[SPEED + i - 1] != nodes[SPEED + i]:
            f = nodes[SPEED + i - 1] / (nodes[SPEED + i - 1] - nodes[SPEED + i])
            acc.turn_time = t + 0.25 * h * (i - 1 + f)
            acc.turn_position = nodes[AT + i - 1] + f * (nodes[AT + i] - nodes[AT + i - 1])
        confirm(acc, turns, crest(nodes, i), second)
        follow_reference(acc, nodes[REFERENCE_SPEED + i])


@kernel(exact=False, inline=True)
def confirm(acc: Any, turns: Turns, v: float, second: bool) -> None:
    """Let a velocity beyond the trigger confirm a reversal at its last zero, if the side is another."""
    if abs(v) <= TRIGGER:
        return
    side = 1.0 if v > 0.0 else -1.0
    if side * acc.side < 0.0:
        acc.reversals += 1
        if second:
            acc.w2_reversals += 1
        if acc.turn_count == turns.room:
            forget_early(acc, turns)
        n = acc.turn_count
        if n < turns.room:
            turns.at[2 * n] = acc.turn_time
            turns.at[2 * n + 1] = acc.turn_position
            acc.turn_count += 1
    acc.side = side


@kernel(exact=False)
def forget_early(acc: Any, turns: Turns) -> None:
    """Make room by the turns before those among which a limit cycle is looked for: fast ones fill it long before."""
    early = 0
    while early < turns.room and turns.at[2 * early] < LATE * acc.duration:
        early += 1
    for i in range(2 * early, 2 * turns.room):
        turns.at[i - 2 * early] = turns.at[i]
    acc.turn_count -= early


@kernel(exact=False, inline=True)
def follow_reference(acc: Any, rate: float) -> None:
    """Count the reversals of the reference, whose velocity this is."""
    if abs(rate) > TRIGGER:
        side = 1.0 if rate > 0.0 else -1.0
        if side * acc.reference_side < 0.0:
            acc.reference_reversals += 1
        acc.reference_side = side


@kernel(exact=False)
def standstill(acc: Any, t: float, h: float, nodes: Any) -> None:
    """Find standstills: |v| below the trigger for at least 10 ms while the reference moves."""
    for i in range(5):
        v = nodes[SPEED + i] if i == 0 else crest(nodes, i)
        rest_seen(acc, t + 0.25 * h * i, v, nodes[REFERENCE_SPEED + i])


@kernel(exact=False, inline=True)
def rest_seen(acc: Any, now: float, v: float, rate: float) -> None:
    """Begin or end a standstill at a velocity and the reference's."""
    still = abs(v) < TRIGGER and abs(rate) > MOVING
    if still and acc.still_since < 0.0:
        acc.still_since = now
    elif not still and acc.still_since >= 0.0:
        end_standstill(acc, now)


@kernel(exact=False)
def settling(acc: Any, t: float, h: float, nodes: Any) -> None:
    """Note when the error was last outside the band in which it counts as settled."""
    band = acc.settle_band
    if band > 0.0:
        for i in range(5):
            now = abs(nodes[ERROR + i])
            if now > band:
                acc.outside_last = t + 0.25 * h * i
                if i < 4 and abs(nodes[ERROR + i + 1]) <= band:
                    acc.outside_last += 0.25 * h * (now - band) / (now - abs(nodes[ERROR + i + 1]))


@kernel(exact=False, inline=True)
def end_standstill(acc: Any, now: float) -> None:
    """End a standstill, counting it if it was long enough."""
    if acc.still_since >= 0.0:
        length = now - acc.still_since
        if length >= STANDSTILL:
            acc.still_count += 1
            acc.still_longest = max(acc.still_longest, length)
        acc.still_since = -1.0


@kernel(exact=False)
def close_standstill(acc: Any, now: float) -> None:
    """End a standstill with the run; integrators call it."""
    end_standstill(meter_of(acc), now)
