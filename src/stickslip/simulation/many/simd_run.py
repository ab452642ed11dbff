"""Many steps of many closed loops side by side, and what is measured of them.

Specialised by `many.simd_source` behind `many.simd_step`, whose rows and steps it uses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.jit import pointer, select
from stickslip.simulation.many.simd_names import (
    ELEMENTS,
    FIRST_1,
    KIND_0,
    KIND_1,
    LANES,
    METERED,
    RIGID_0,
    RIGID_1,
    VARIED,
    attraction,
    curve,
    gain,
    kd,
    ki,
    kp,
    kr,
    lag,
    rigid,
    viscous,
)
from stickslip.simulation.many.simd_step import (
    BENDS,
    BRISTLE_0,
    BRISTLE_1,
    CURVE_0,
    CURVE_1,
    DIRECTION,
    ERROR_2,
    ERROR_HIGH,
    ERROR_LOW,
    ERROR_PEAK,
    ERROR_SUM,
    EVENT,
    FAR,
    FED_BEGIN,
    FED_END,
    FORCE,
    GOAL_BEGIN,
    GOAL_END,
    INTEGRAL,
    LOSS,
    MOTOR_2,
    MOTOR_PEAK,
    NUMBERS,
    POSITION,
    RATE_2,
    RATE_BEGIN,
    RATE_END,
    RESIDUAL_2,
    SPEED_PEAK,
    SUMS,
    UNRESOLVED,
    VELOCITY,
    WORK,
    accept,
    finish,
    stick,
    trial,
)

# ---- what is measured ------------------------------------------------------------------------------------------


def measure(z: Any, lane: int, c: Any, weight: float, now: Any, fine: bool) -> None:
    """Add the state, with its weight in the sums, to what is measured, if it is fine."""
    weight = select(fine, weight, 0.0)
    error = now[GOAL_END] - z[POSITION * LANES + lane]
    z[ERROR_2 * LANES + lane] += weight * error * error
    highest(z, lane, ERROR_PEAK, abs(error), fine)
    if METERED:
        measure_all(z, lane, c, weight, now, fine, error)


def measure_all(z: Any, lane: int, c: Any, weight: float, now: Any, fine: bool, error: float) -> None:
    """What `measure` adds besides the error in position."""
    v = z[VELOCITY * LANES + lane]
    highest(z, lane, ERROR_LOW, -error, fine)
    highest(z, lane, ERROR_HIGH, error, fine)
    z[ERROR_SUM * LANES + lane] += weight * error
    rate = now[RATE_END] - v
    z[RATE_2 * LANES + lane] += weight * rate * rate
    highest(z, lane, SPEED_PEAK, abs(v), fine)
    friction = torque(z, lane, c, 0)
    helped = gain(c, z, lane) * now[FED_END]
    if KIND_1 >= 0:
        helped += gain(c, z, lane) * torque(z, lane, c, 1)
    motor = kp(c, z, lane) * error + kr(c, z, lane) * now[RATE_END] - kd(c, z, lane) * v
    motor += ki(c, z, lane) * z[INTEGRAL * LANES + lane] + helped
    highest(z, lane, MOTOR_PEAK, abs(motor), fine)
    z[MOTOR_2 * LANES + lane] += weight * motor * motor
    z[RESIDUAL_2 * LANES + lane] += weight * (friction - helped) * (friction - helped)
    z[WORK * LANES + lane] += weight * motor * v
    z[LOSS * LANES + lane] += weight * friction * v


def highest(z: Any, lane: int, row: int, value: float, fine: bool) -> None:
    """Keep the largest value."""
    before = z[row * LANES + lane]
    z[row * LANES + lane] = select((value > before) & fine, value, before)


def torque(z: Any, lane: int, c: Any, which: int) -> float:
    """Friction torque of a law, N·m."""
    kind = KIND_0 if which == 0 else KIND_1
    v = z[VELOCITY * LANES + lane]
    s = z[(CURVE_0 if which == 0 else CURVE_1) * LANES + lane]
    total = viscous(c, z, lane, which) * v
    if RIGID_0 if which == 0 else RIGID_1:
        total += rigid(c, z, lane, which) * z[DIRECTION * LANES + lane] * s
    if kind == BENDS:
        force = z[(BRISTLE_0 if which == 0 else BRISTLE_1) * LANES + lane]
        total += force + lag(c, z, lane, which) * attraction(c, z, lane, which) * (v - abs(v) * force / s)
    for i in range(ELEMENTS):
        if (i < FIRST_1) == (which == 0):
            total += z[(FORCE + i) * LANES + lane]
    return total


# ---- many steps ------------------------------------------------------------------------------------------------


def run(z: Any, c: Any, h: float, reference: Any, first: int, last: int) -> None:
    """Steps first to last - 1 of LANES cases; row t of `reference` is ``now`` in step t."""
    for t in range(first, last):
        now = (
            reference[t, 0], reference[t, 1], reference[t, 2], reference[t, 3], reference[t, 4], reference[t, 5],
        )  # fmt: skip
        events = 0
        for lane in range(LANES):
            event = trial(z, lane, c, h, 1.0, now)
            accept(z, lane, 1.0)
            measure(z, lane, c, 1.0, now, not event)
            z[EVENT * LANES + lane] = select(event, 1.0, 0.0)
            events += event
        if events > 0:
            for lane in range(LANES):
                if z[EVENT * LANES + lane] > 0.0:
                    finish(z, lane, c, h, now)
                    measure(z, lane, c, 1.0, now, True)


def begin(z: Any, lane: int, c: Any, start: Any) -> None:
    """The state at the start, every element sticking and unloaded."""
    for i in range(NUMBERS):
        z[i * LANES + lane] = 0.0
    z[POSITION * LANES + lane] = start[0]
    z[VELOCITY * LANES + lane] = start[1]
    z[DIRECTION * LANES + lane] = start[2]
    z[CURVE_0 * LANES + lane] = curve(start[1], c, z, lane, 0)
    if KIND_1 >= 0:
        z[CURVE_1 * LANES + lane] = curve(start[1], c, z, lane, 1)
    stick(z, lane, c)


def clear(z: Any, lane: int) -> None:
    """Begin to measure."""
    for i in range(SUMS, NUMBERS):
        z[i * LANES + lane] = 0.0
    z[ERROR_LOW * LANES + lane] = -FAR
    z[ERROR_HIGH * LANES + lane] = -FAR


def edge(reference: Any, t: int, begins: bool) -> Any:
    """What `measure` reads at the begin or at the end of step t."""
    goal = reference[t, GOAL_BEGIN] if begins else reference[t, GOAL_END]
    rate_now = reference[t, RATE_BEGIN] if begins else reference[t, RATE_END]
    fed = reference[t, FED_BEGIN] if begins else reference[t, FED_END]
    return (goal, goal, rate_now, rate_now, fed, fed)


def run_parts(z: Any, c: Any, h: float, reference: Any, cuts: Any, sums: Any, base: int, count: int) -> None:
    """Run LANES cases part by part; integrals are sums by the trapezoidal rule."""
    for part in range(cuts.size - 1):
        first, last = cuts[part], cuts[part + 1]
        for lane in range(LANES):
            clear(z, lane)
            measure(z, lane, c, 0.5, edge(reference, first, True), True)
        run(z, c, h, reference, first, last)
        for lane in range(count):
            measure(z, lane, c, -0.5, edge(reference, last - 1, False), True)
            for i in range(NUMBERS - SUMS):
                sums[base + lane, part, i] = z[(SUMS + i) * LANES + lane]


def begin_block(z: Any, c: Any, columns: Any, start: Any, base: int) -> int:
    """Lay out the LANES cases from `base` on, the last one again where there are fewer; returns how many there are."""
    n = columns.shape[0]
    for lane in range(LANES):
        for j in range(VARIED):
            z[(NUMBERS + j) * LANES + lane] = columns[min(base + lane, n - 1), j]
        begin(z, lane, c, start)
    return min(LANES, n - base)


def end_block(z: Any, ends: Any, base: int, count: int) -> None:
    """Where the cases from `base` on have ended."""
    for lane in range(count):
        ends[base + lane, 0] = z[POSITION * LANES + lane]
        ends[base + lane, 1] = z[VELOCITY * LANES + lane]
        ends[base + lane, 2] = z[UNRESOLVED * LANES + lane]


def solve_lanes(
    c: Any, columns: Any, start: Any, h: float, reference: Any, cuts: Any, sums: Any, ends: Any
) -> None:  # fmt: skip
    """Run all cases, LANES at a time.

    ``columns`` (n, VARIED) is what varies, ``start`` position, velocity and direction at the begin, ``reference``
    (steps, 7) what ``now`` names, ``cuts`` the steps at which parts of the run begin, and its end. ``sums`` (n, parts,
    rows) receives what is measured in each part, ``ends`` (n, 3) position, velocity and the number of steps with more
    events than were followed.
    """
    room = aligned((NUMBERS + VARIED) * LANES)
    z = pointer(room, 0)
    for base in range(0, columns.shape[0], LANES):
        count = begin_block(z, c, columns, start, base)
        run_parts(z, c, h, reference, cuts, sums, base, count)
        end_block(z, ends, base, count)
    room[0] = 0.0  # So long it is needed: an array is freed after its last use, whatever points into it.


def aligned(size: int) -> Any:
    """Zeros that begin on a cache line, since vectors across two of them cost twice."""
    room = np.zeros(size + 8)
    first = (64 - room.ctypes.data % 64) % 64 // 8
    return room[first : first + size]
