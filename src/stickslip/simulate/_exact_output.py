"""Output of the exact integrator: rows, positions on the grid, and windows for the meter."""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulate._exact_flow import Linear, flow, moved
from stickslip.simulate._exact_state import (
    GOAL,
    GOAL_RATE,
    INTEGRAL,
    POSITION,
    SIDES,
    TIME,
    VELOCITY,
    R,
    S,
    command,
    torques,
)
from stickslip.simulate._exact_step import (
    FREE_POSITION,
    FREE_VELOCITY,
    cubic_of,
    integral_at,
    slip_force_at,
    state_at,
)
from stickslip.simulate._meter import MAX_WINDOW, meter

SHORTEST_WINDOW = 2e-8
"""Shorter stretches are left out of the metrics (s); the high-pass loses its digits there."""


@kernel(exact=False)
def write_grid(
    lin: Linear, loop: Any, stretch: Any, grid: Any, spacing: float, out: Any, row: int, h: float
) -> int:
    """Write position and velocity at the grid's times inside the first h of the stretch; returns the next row.

    On an even grid the free motion is carried from one time to the next by one and the same matrix.
    """
    n = grid.shape[0]
    t = loop[TIME]
    if row >= n or grid[row] > t + h + 1e-12:
        return row
    c = cubic_of(stretch)
    x = grid[row] - t
    m = flow(lin, x)
    p = m[0] * stretch[FREE_POSITION] + m[1] * stretch[FREE_VELOCITY]
    q = m[2] * stretch[FREE_POSITION] + m[3] * stretch[FREE_VELOCITY]
    if spacing > 0.0 and row + 1 < n and grid[row + 1] <= t + h + 1e-12:
        m = flow(lin, spacing)
    while True:
        out[row, 0] = c[0] + x * (c[1] + x * (c[2] + x * c[3])) + p
        out[row, 1] = c[1] + x * (2.0 * c[2] + x * 3.0 * c[3]) + q
        row += 1
        if row >= n or grid[row] > t + h + 1e-12:
            return row
        x = grid[row] - t
        if spacing > 0.0:
            p, q = m[0] * p + m[1] * q, m[2] * p + m[3] * q
        else:
            m = flow(lin, x)
            p = m[0] * stretch[FREE_POSITION] + m[1] * stretch[FREE_VELOCITY]
            q = m[2] * stretch[FREE_POSITION] + m[3] * stretch[FREE_VELOCITY]


@kernel(exact=False)
def put_row(
    rows: Any, row: int, t: float, goal: float, rate: float, theta: float, v: float, tm: float, tf: float, th: float,
    event: float,
) -> None:  # fmt: skip
    """Write one row, in the order of `_case.COLUMNS`."""
    rows[row, 0] = t
    rows[row, 1] = goal
    rows[row, 2] = rate
    rows[row, 3] = theta
    rows[row, 4] = v
    rows[row, 5] = tm
    rows[row, 6] = tf
    rows[row, 7] = th
    rows[row, 8] = event


@kernel(exact=False)
def signals(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, x: float, theta: float, v: float
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Reference position and velocity; motor, friction and compensating torque at x inside the stretch."""
    r, _, goal, rate = command(parameters, plan, cells, loop, loop[TIME] + x)
    s0 = slip_force_at(sides, stretch, 0, x)
    s1 = slip_force_at(sides, stretch, 1, x) if plan[SIDES] > 1 else 0.0
    integral = integral_at(parameters, loop, stretch, x)
    tm, tf, th = torques(parameters, plan, sides, loop, r, goal, rate, integral, theta, v, s0, s1)
    return goal, rate, tm, tf, th


@kernel(exact=False)
def write_rows(
    lin: Linear, parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, grid: Any, count: Any,
    rows: Any, h: float,
) -> None:  # fmt: skip
    """Write rows at the grid's times inside the first h; ``count`` is (rows written, grid rows written)."""
    while count[1] < grid.shape[0] and grid[count[1]] <= loop[TIME] + h + 1e-12:
        x = grid[count[1]] - loop[TIME]
        theta, v = state_at(lin, stretch, x)
        goal, rate, tm, tf, th = signals(parameters, plan, cells, sides, loop, stretch, x, theta, v)
        put_row(rows, count[0], grid[count[1]], goal, rate, theta, v, tm, tf, th, 0.0)
        count[0] += 1
        count[1] += 1


@kernel(exact=False)
def room_for_event(grid: Any, count: Any, rows: Any) -> bool:
    """Whether an event's rows still leave room for the rest of the grid."""
    return count[0] + 2 + grid.shape[0] - count[1] <= rows.shape[0]


@kernel(exact=False)
def row_before(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, grid: Any, count: Any, rows: Any,
    x: float, theta: float, v: float,
) -> None:  # fmt: skip
    """Write the row of an event at x, as the stretch ends there."""
    if room_for_event(grid, count, rows):
        goal, rate, tm, tf, th = signals(parameters, plan, cells, sides, loop, stretch, x, theta, v)
        put_row(rows, count[0], loop[TIME] + x, goal, rate, theta, v, tm, tf, th, 1.0)
        count[0] += 1


@kernel(exact=False)
def row_after(parameters: Any, plan: Any, sides: Any, loop: Any, grid: Any, count: Any, rows: Any) -> None:
    """Write the row after an event if a torque has jumped."""
    if not room_for_event(grid, count, rows) or count[0] == 0:
        return
    s1 = sides[1, S] if plan[SIDES] > 1 else 0.0
    tm, tf, th = torques(
        parameters, plan, sides, loop, loop[R], loop[GOAL], loop[GOAL_RATE], loop[INTEGRAL], loop[POSITION],
        loop[VELOCITY], sides[0, S], s1,
    )  # fmt: skip
    last = count[0] - 1
    if abs(tm - rows[last, 5]) + abs(tf - rows[last, 6]) + abs(th - rows[last, 7]) > 1e-6:
        put_row(
            rows, count[0], loop[TIME], loop[GOAL], loop[GOAL_RATE], loop[POSITION], loop[VELOCITY], tm, tf, th, 1.0
        )  # fmt: skip
        count[0] += 1


@kernel(exact=False)
def window_of(lin: Linear, stretch: Any) -> float:
    """Longest window whose five nodes follow the free motion, s.

    Boole's rule is wrong by about 2e-3 y^6 of the oscillating part for nodes y/2 of a radian apart.
    """
    if lin.discriminant > 0.0:
        rate = lin.frequency
    else:
        rate = lin.decay + lin.frequency
    speed = abs(stretch[FREE_VELOCITY]) + rate * abs(stretch[FREE_POSITION])
    if speed == 0.0:
        return MAX_WINDOW
    y = max(0.06, min(1.0, 0.13 * (1e-2 / (speed + 1e-12)) ** (1.0 / 3.0)))
    return min(MAX_WINDOW, 2.0 * y / (abs(rate) + 1e-9))


@kernel(exact=False)
def measure(
    lin: Linear, parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, h: float, acc: Any,
    turns: Any, nodes: Any,
) -> None:  # fmt: skip
    """Hand the first h of the stretch to the meter, in windows of five nodes."""
    if h < SHORTEST_WINDOW:
        return
    windows = int(math.ceil(h / window_of(lin, stretch) * (1.0 - 1e-9)))
    width = h / windows
    c = cubic_of(stretch)
    m = flow(lin, 0.25 * width)
    p = stretch[FREE_POSITION]
    q = stretch[FREE_VELOCITY]
    fill(parameters, plan, cells, sides, loop, stretch, 0.0, loop[POSITION], loop[VELOCITY], nodes, 4)
    for w in range(windows):
        for j in range(8):
            nodes[j, 0] = nodes[j, 4]
        for k in range(1, 5):
            x = (w + 0.25 * k) * width
            p, q = m[0] * p + m[1] * q, m[2] * p + m[3] * q
            theta, v = moved(c, (1.0, 0.0, 0.0, 1.0), x, p, q)
            fill(parameters, plan, cells, sides, loop, stretch, x, theta, v, nodes, k)
        meter(
            acc, turns, loop[TIME] + w * width, width, nodes[0], nodes[1], nodes[2], nodes[3], nodes[4], nodes[5],
            nodes[6], nodes[7],
        )  # fmt: skip


@kernel(exact=False)
def fill(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, stretch: Any, x: float, theta: float, v: float,
    nodes: Any, k: int,
) -> None:  # fmt: skip
    """Write one node of every signal that the meter reads."""
    goal, rate, tm, tf, th = signals(parameters, plan, cells, sides, loop, stretch, x, theta, v)
    nodes[0, k] = goal - theta
    nodes[1, k] = rate - v
    nodes[2, k] = theta
    nodes[3, k] = v
    nodes[4, k] = rate
    nodes[5, k] = tm
    nodes[6, k] = tf
    nodes[7, k] = th
