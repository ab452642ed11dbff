"""What a fixed step hands out: rows at output times and events, and windows for the meter.

Inside a step the position follows the cubic through both ends; velocity and torques are linear.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import call_profile, kernel, pointer
from stickslip.simulation._meter import MAX_WINDOW, meter
from stickslip.simulation.fixed.loop import COMPENSATING, FRICTION, MOTOR, NUDGE, POSITION, VELOCITY, Loop

STEPS, OUTPUTS, EVENTS, ROWS = range(4)  # of the counts
JUMP = 1e-9  # N·m, from which a change of torque at one time is a jump


@kernel()
def position_inside(a: Any, b: Any, h: float, x: float) -> float:
    """Position at the fraction x of a step: the cubic through positions and velocities of its ends, rad."""
    y = 1.0 - x
    return (
        y * y * (1.0 + 2.0 * x) * a[POSITION]
        + x * x * (3.0 - 2.0 * x) * b[POSITION]
        + x * y * h * (y * a[VELOCITY] - x * b[VELOCITY])
    )


@kernel()
def write(
    loop: Loop,
    a: Any,
    b: Any,
    t: float,
    x: float,
    h: float,
    time: float,
    event: float,
    rows: Any,
    counts: Any,
) -> Any:
    """Add the row at the fraction x of the step [t, t + h]; returns the rows, grown where they were full."""
    if counts[ROWS] == rows.shape[0]:
        grown = np.zeros((2 * rows.shape[0], rows.shape[1]))
        grown[: rows.shape[0]] = rows
        rows = grown
    call_profile(loop.profile, time, pointer(loop.reference_parameters, 0), pointer(loop.motion, 0))
    row = rows[counts[ROWS]]
    row[0] = time
    row[1], row[2] = loop.motion[0], loop.motion[1]
    row[3] = position_inside(a, b, h, x)
    row[4] = a[VELOCITY] + x * (b[VELOCITY] - a[VELOCITY])
    row[5] = a[MOTOR] + x * (b[MOTOR] - a[MOTOR])
    row[6] = a[FRICTION] + x * (b[FRICTION] - a[FRICTION])
    row[7] = a[COMPENSATING] + x * (b[COMPENSATING] - a[COMPENSATING])
    row[8] = event
    counts[ROWS] += 1
    return rows


@kernel()
def record(
    loop: Loop, a: Any, b: Any, t: float, h: float, event: bool, grid: Any, rows: Any, counts: Any
) -> Any:
    """Write the rows of the output times inside [t, t + h), and of the event at its end; returns the rows."""
    while counts[OUTPUTS] < grid.size and grid[counts[OUTPUTS]] < t + h - 1e-12 * max(1.0, t):
        time = grid[counts[OUTPUTS]]
        x = min(max((time - t) / h, 0.0), 1.0)
        rows = write(loop, a, b, t, x, h, time, 0.0, rows, counts)
        counts[OUTPUTS] += 1
    if event:
        rows = write(loop, b, b, t, 1.0, 0.0, t + h, 1.0, rows, counts)
    return rows


@kernel()
def record_jump(loop: Loop, before: Any, after: Any, t: float, rows: Any, counts: Any) -> Any:
    """Write the rows before and after a jump of a torque at t, if there is one; returns the rows."""
    jump = abs(after[MOTOR] - before[MOTOR]) > JUMP or abs(after[FRICTION] - before[FRICTION]) > JUMP
    if jump and t > 0.0:
        last = rows[counts[ROWS] - 1]
        if counts[ROWS] == 0 or last[0] != t or last[8] == 0.0:
            rows = write(loop, before, before, t, 0.0, 0.0, t, 1.0, rows, counts)
        rows = write(loop, after, after, t, 0.0, 0.0, t, 1.0, rows, counts)
    return rows


@kernel()
def measure(loop: Loop, a: Any, b: Any, t: float, h: float, accumulator: Any, turns: Any) -> None:
    """Hand the step to the meter in windows of at most MAX_WINDOW, torques and velocity linear inside it."""
    if h <= 0.0:
        return
    nodes = loop.nodes
    windows = math.ceil(h / MAX_WINDOW * (1.0 - 1e-9))
    for window in range(windows):
        for i in range(5):
            x = (window + 0.25 * i) / windows
            inside = min(max(t + x * h, t + min(NUDGE, 0.5 * h)), t + h - min(NUDGE, 0.5 * h))
            call_profile(loop.profile, inside, pointer(loop.reference_parameters, 0), pointer(loop.motion, 0))
            position = position_inside(a, b, h, x)
            v = a[VELOCITY] + x * (b[VELOCITY] - a[VELOCITY])
            nodes[0, i] = loop.motion[0] - position
            nodes[1, i] = loop.motion[1] - v
            nodes[2, i] = position
            nodes[3, i] = v
            nodes[4, i] = loop.motion[1]
            nodes[5, i] = a[MOTOR] + x * (b[MOTOR] - a[MOTOR])
            nodes[6, i] = a[FRICTION] + x * (b[FRICTION] - a[FRICTION])
            nodes[7, i] = a[COMPENSATING] + x * (b[COMPENSATING] - a[COMPENSATING])
        meter(
            accumulator, turns, t + h * window / windows, h / windows,
            nodes)  # fmt: skip
