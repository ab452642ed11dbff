"""What a fixed step hands out: rows at output times and events, and windows for the meter.

Inside a step the position follows the cubic through both ends; velocity and torques are linear.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulation._meter import MAX_WINDOW, meter
from stickslip.simulation.fixed.layout import Loop
from stickslip.simulation.fixed.loop import NUDGE, refer

JUMP = 1e-9  # N·m, from which a change of torque at one time is a jump


@kernel()
def position_inside(a: Any, b: Any, h: float, x: float) -> float:
    """Position at the fraction x of a step: the cubic through positions and velocities of its ends, rad."""
    y = 1.0 - x
    return (
        y * y * (1.0 + 2.0 * x) * a.position
        + x * x * (3.0 - 2.0 * x) * b.position
        + x * y * h * (y * a.velocity - x * b.velocity)
    )


@kernel()
def write(loop: Loop, a: Any, b: Any, x: float, h: float, time: float, event: float, rows: Any) -> Any:
    """Add the row at the fraction x of a step of h from a to b; returns the rows, grown where they were full."""
    written = loop.progress.rows
    if written == rows.shape[0]:
        grown = np.zeros((2 * rows.shape[0], rows.shape[1]))
        grown[: rows.shape[0]] = rows
        rows = grown
    refer(loop, time)
    row = rows[written]
    row[0] = time
    row[1], row[2] = loop.now.reference.position, loop.now.reference.velocity
    row[3] = position_inside(a, b, h, x)
    row[4] = a.velocity + x * (b.velocity - a.velocity)
    row[5] = a.motor + x * (b.motor - a.motor)
    row[6] = a.friction + x * (b.friction - a.friction)
    row[7] = a.compensating + x * (b.compensating - a.compensating)
    row[8] = event
    loop.progress.rows = written + 1
    return rows


@kernel()
def record(loop: Loop, t: float, h: float, event: bool, grid: Any, rows: Any) -> Any:
    """Write the rows of the output times inside [t, t + h), and of the event at its end; returns the rows."""
    a, b, reached = loop.here, loop.end, loop.progress
    while reached.outputs < grid.size and grid[reached.outputs] < t + h - 1e-12 * max(1.0, t):
        time = grid[reached.outputs]
        x = min(max((time - t) / h, 0.0), 1.0)
        rows = write(loop, a, b, x, h, time, 0.0, rows)
        reached.outputs += 1
    if event:
        rows = write(loop, b, b, 1.0, 0.0, t + h, 1.0, rows)
    return rows


@kernel()
def record_jump(loop: Loop, before: Any, after: Any, t: float, rows: Any) -> Any:
    """Write the rows before and after a jump of a torque at t, if there is one; returns the rows."""
    jump = abs(after.motor - before.motor) > JUMP or abs(after.friction - before.friction) > JUMP
    if jump and t > 0.0:
        written = loop.progress.rows
        last = rows[written - 1]
        if written == 0 or last[0] != t or last[8] == 0.0:
            rows = write(loop, before, before, 0.0, 0.0, t, 1.0, rows)
        rows = write(loop, after, after, 0.0, 0.0, t, 1.0, rows)
    return rows


@kernel()
def measure(loop: Loop, t: float, h: float, nodes: Any, accumulator: Any, turns: Any) -> None:
    """Hand the step to the meter in windows of at most MAX_WINDOW, torques and velocity linear inside it."""
    if h <= 0.0:
        return
    a, b, asked = loop.here, loop.end, loop.now.reference
    windows = math.ceil(h / MAX_WINDOW * (1.0 - 1e-9))
    for window in range(windows):
        for i in range(5):
            x = (window + 0.25 * i) / windows
            inside = min(max(t + x * h, t + min(NUDGE, 0.5 * h)), t + h - min(NUDGE, 0.5 * h))
            refer(loop, inside)
            position = position_inside(a, b, h, x)
            v = a.velocity + x * (b.velocity - a.velocity)
            nodes[0, i] = asked.position - position
            nodes[1, i] = asked.velocity - v
            nodes[2, i] = position
            nodes[3, i] = v
            nodes[4, i] = asked.velocity
            nodes[5, i] = a.motor + x * (b.motor - a.motor)
            nodes[6, i] = a.friction + x * (b.friction - a.friction)
            nodes[7, i] = a.compensating + x * (b.compensating - a.compensating)
        meter(
            accumulator, turns, t + h * window / windows, h / windows,
            nodes)  # fmt: skip
