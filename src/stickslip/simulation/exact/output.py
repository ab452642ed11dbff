"""Output of the exact integrator: rows, and positions on the grid."""

from __future__ import annotations

from stickslip.jit import kernel
from stickslip.simulation.exact.flow import UNMOVED, Linear, flow, free_motion, kept_flow
from stickslip.simulation.exact.forces import Command, Torques, command, torques
from stickslip.simulation.exact.segment import cubic_of, integral_at, shows, slip_torque_at, state_at
from stickslip.simulation.exact.state import EDGE, SPACED, Loop, kept_of, row_of, side_of


@kernel(exact=False, inline=True)
def rows_until(loop: Loop, row: int, end: float) -> int:
    """The first row after `row` whose time is after `end`; loops over a known number of rows are vectorised."""
    plan, grid = loop.plan, loop.grid
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
def write_grid(lin: Linear, loop: Loop, h: float, visible: float, generation: int) -> None:
    """Write position and velocity at the grid's times inside the first h of the segment; the next one is inside.

    On an even grid the free motion is carried from one time to the next by one matrix. A free motion that has
    died out (less than `visible` rad) is left out.
    """
    plan, now, segment = loop.plan, loop.now, loop.segment
    count, grid, out = loop.count, loop.grid, loop.motion
    row = count.grid_written
    last = rows_until(loop, row, now.time + h + EDGE)
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
    p, q = free_motion(flow(lin, x), segment.free_position, segment.free_velocity)
    even = plan.spacing > 0.0
    between = UNMOVED
    if even and row + 1 < last:
        between = kept_flow(lin, kept_of(loop, SPACED), generation, plan.spacing)
    for i in range(row, last):
        x = grid[i] - time
        if not even:
            p, q = free_motion(flow(lin, x), segment.free_position, segment.free_velocity)
        out[2 * i] = c0 + x * (c1 + x * (c2 + x * c3)) + p
        out[2 * i + 1] = c1 + x * (2.0 * c2 + x * 3.0 * c3) + q
        p, q = free_motion(between, p, q)


@kernel(exact=False)
def put_row(
    loop: Loop, t: float, asked: Command, theta: float, v: float, torque: Torques, event: float
) -> None:  # fmt: skip
    """Write the next row."""
    row = row_of(loop, loop.count.rows_written)
    loop.count.rows_written += 1
    row.time = t
    row.position_reference, row.velocity_reference = asked.position, asked.velocity
    row.position, row.velocity = theta, v
    row.motor_torque, row.friction_torque, row.compensation_torque = torque
    row.event = event


@kernel(exact=False, inline=True)
def torques_at(loop: Loop, x: float, asked: Command, theta: float, v: float) -> Torques:
    """Motor, friction and compensating torque at x inside the segment, where the reference is known."""
    segment = loop.segment
    s0 = slip_torque_at(side_of(loop, 0), segment, x)
    s1 = slip_torque_at(side_of(loop, 1), segment, x) if loop.plan.sides > 1 else 0.0
    integral = integral_at(loop, x)
    return torques(loop, asked, integral, theta, v, s0, s1)


@kernel(exact=False)
def write_rows(lin: Linear, loop: Loop, h: float) -> None:
    """Write rows at the grid's times inside the first h of the segment."""
    now, count = loop.now, loop.count
    while count.grid_written < loop.plan.grid_rows:
        t = loop.grid[count.grid_written]
        x = t - now.time
        if x > h + 1e-12:
            return
        theta, v = state_at(lin, loop.segment, x)
        asked = command(loop, now.time + x)
        put_row(loop, t, asked, theta, v, torques_at(loop, x, asked, theta, v), 0.0)
        count.grid_written += 1


@kernel(exact=False)
def room_for_event(loop: Loop) -> bool:
    """Whether an event's rows still leave room for the rest of the grid."""
    plan, count = loop.plan, loop.count
    return count.rows_written + 2 + plan.grid_rows - count.grid_written <= plan.rows


@kernel(exact=False)
def row_before(loop: Loop, x: float, theta: float, v: float) -> None:
    """Write the row of an event at x, as the segment ends there."""
    if room_for_event(loop):
        t = loop.now.time + x
        asked = command(loop, t)
        put_row(loop, t, asked, theta, v, torques_at(loop, x, asked, theta, v), 1.0)


@kernel(exact=False)
def row_after(loop: Loop) -> None:
    """Write the row after an event if a torque has jumped."""
    now = loop.now
    last = loop.count.rows_written - 1
    if last < 0 or not room_for_event(loop):
        return
    contact, side = side_of(loop, 0), side_of(loop, 1)
    s0 = contact.force + contact.lag * contact.force_rate
    s1 = side.force + side.lag * side.force_rate if loop.plan.sides > 1 else 0.0
    asked = Command(now.command, now.command_rate, now.goal, now.goal_rate)
    torque = torques(loop, asked, now.integral, now.position, now.velocity, s0, s1)
    before = row_of(loop, last)
    jump = abs(torque[0] - before.motor_torque) + abs(torque[1] - before.friction_torque)
    if jump + abs(torque[2] - before.compensation_torque) > 1e-6:
        put_row(loop, now.time, asked, now.position, now.velocity, torque, 1.0)
