"""Output of the exact integrator: rows, and positions on the grid."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel, pointer
from stickslip.simulation.case_arrays import COLUMNS
from stickslip.simulation.exact.flow import UNMOVED, Linear, flow, free_motion, kept_flow
from stickslip.simulation.exact.segment import (
    FREE_POSITION,
    FREE_VELOCITY,
    cubic_of,
    integral_at,
    shows,
    slip_torque_at,
    state_at,
)
from stickslip.simulation.exact.state import EDGE, command, side_of, torques

ROW_SIZE = len(COLUMNS)


@kernel(exact=False, inline=True)
def rows_until(plan: Any, grid: Any, row: int, end: float) -> int:
    """The first row after `row` whose time is after `end`; loops over a known number of rows are vectorised."""
    rows = plan.grid_rows
    last = row
    if plan.spacing > 0.0:
        # A guess that rounding may put one row off.
        last = min(max(int((end - grid[0]) / plan.spacing), row), rows)
        if last > row and grid[last - 1] > end:
            last -= 1
    while last < rows and grid[last] <= end:
        last += 1
    return last


@kernel(exact=False)
def write_grid(
    lin: Linear, plan: Any, now: Any, segment: Any, grid: Any, count: Any, out: Any, h: float, visible: float,
    spaced: Any, generation: int,
) -> None:  # fmt: skip
    """Write position and velocity at the grid's times inside the first h of the segment; the next one is inside.

    On an even grid the free motion is carried from one time to the next by one matrix. A free motion that has
    died out (less than `visible` rad) is left out.
    """
    row = count.grid_written
    last = rows_until(plan, grid, row, now.time + h + EDGE)
    count.grid_written = last
    time = now.time
    c0, c1, c2, c3 = cubic_of(segment)
    if lin.discriminant > 0.0 and not shows(lin, segment, visible):
        for i in range(row, last):
            x = grid[i] - time
            out[2 * i] = c0 + x * (c1 + x * (c2 + x * c3))
            out[2 * i + 1] = c1 + x * (2.0 * c2 + x * 3.0 * c3)
        return
    x = grid[row] - time
    p, q = free_motion(flow(lin, x), segment[FREE_POSITION], segment[FREE_VELOCITY])
    even = plan.spacing > 0.0
    between = kept_flow(lin, spaced, generation, plan.spacing) if even and row + 1 < last else UNMOVED
    for i in range(row, last):
        x = grid[i] - time
        if not even:
            p, q = free_motion(flow(lin, x), segment[FREE_POSITION], segment[FREE_VELOCITY])
        out[2 * i] = c0 + x * (c1 + x * (c2 + x * c3)) + p
        out[2 * i + 1] = c1 + x * (2.0 * c2 + x * 3.0 * c3) + q
        p, q = free_motion(between, p, q)


@kernel(exact=False)
def put_row(
    rows: Any, count: Any, t: float, goal: float, rate: float, theta: float, v: float, tm: float, tf: float, th: float,
    event: float,
) -> None:  # fmt: skip
    """Write the next row, in the order of `case_arrays.COLUMNS`."""
    row_at = pointer(rows, count.rows_written * ROW_SIZE)
    count.rows_written += 1
    row_at[0] = t
    row_at[1] = goal
    row_at[2] = rate
    row_at[3] = theta
    row_at[4] = v
    row_at[5] = tm
    row_at[6] = tf
    row_at[7] = th
    row_at[8] = event


@kernel(exact=False, inline=True)
def signals(
    parameters: Any, plan: Any, cells: Any, sides: Any, now: Any, segment: Any, x: float, theta: float, v: float
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Reference position and velocity; motor, friction and compensating torque at x inside the segment."""
    r, _, goal, rate = command(parameters, plan, cells, now, now.time + x)
    tm, tf, th = torques_at(parameters, plan, sides, now, segment, x, r, goal, rate, theta, v)
    return goal, rate, tm, tf, th


@kernel(exact=False, inline=True)
def torques_at(
    parameters: Any, plan: Any, sides: Any, now: Any, segment: Any, x: float, r: float, goal: float, rate: float,
    theta: float, v: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Motor, friction and compensating torque at x inside the segment, where the reference is known."""
    s0 = slip_torque_at(side_of(sides, 0), segment, x)
    s1 = slip_torque_at(side_of(sides, 1), segment, x) if plan.sides > 1 else 0.0
    integral = integral_at(parameters, now, segment, x)
    return torques(parameters, plan, sides, now, r, goal, rate, integral, theta, v, s0, s1)


@kernel(exact=False)
def write_rows(
    lin: Linear, parameters: Any, plan: Any, cells: Any, sides: Any, now: Any, segment: Any, grid: Any, count: Any,
    rows: Any, h: float,
) -> None:  # fmt: skip
    """Write rows at the grid's times inside the first h of the segment."""
    while count.grid_written < plan.grid_rows:
        t = grid[count.grid_written]
        x = t - now.time
        if x > h + 1e-12:
            return
        theta, v = state_at(lin, segment, x)
        goal, rate, tm, tf, th = signals(parameters, plan, cells, sides, now, segment, x, theta, v)
        put_row(rows, count, t, goal, rate, theta, v, tm, tf, th, 0.0)
        count.grid_written += 1


@kernel(exact=False)
def room_for_event(plan: Any, count: Any) -> bool:
    """Whether an event's rows still leave room for the rest of the grid."""
    return count.rows_written + 2.0 + plan.grid_rows - count.grid_written <= plan.rows


@kernel(exact=False)
def row_before(
    parameters: Any, plan: Any, cells: Any, sides: Any, now: Any, segment: Any, count: Any, rows: Any, x: float,
    theta: float, v: float,
) -> None:  # fmt: skip
    """Write the row of an event at x, as the segment ends there."""
    if room_for_event(plan, count):
        goal, rate, tm, tf, th = signals(parameters, plan, cells, sides, now, segment, x, theta, v)
        put_row(rows, count, now.time + x, goal, rate, theta, v, tm, tf, th, 1.0)


@kernel(exact=False)
def row_after(parameters: Any, plan: Any, sides: Any, now: Any, count: Any, rows: Any) -> None:
    """Write the row after an event if a torque has jumped."""
    last = count.rows_written - 1
    if last < 0 or not room_for_event(plan, count):
        return
    contact, side = side_of(sides, 0), side_of(sides, 1)
    s0 = contact.force + contact.lag * contact.force_rate
    s1 = side.force + side.lag * side.force_rate if plan.sides > 1 else 0.0
    goal = now.goal
    rate = now.goal_rate
    theta = now.position
    v = now.velocity
    tm, tf, th = torques(
        parameters, plan, sides, now, now.command, goal, rate, now.integral, theta, v, s0, s1
    )  # fmt: skip
    before = pointer(rows, last * ROW_SIZE)
    if abs(tm - before[5]) + abs(tf - before[6]) + abs(th - before[7]) > 1e-6:
        put_row(rows, count, now.time, goal, rate, theta, v, tm, tf, th, 1.0)
