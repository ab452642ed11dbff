"""Where the loop of the exact integrator stands: at its start, after a step, at an event, at a break."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import (
    PERTURBATION,
    POSITION_0,
    VELOCITY_0,
)
from stickslip.simulation.exact.events import add_exponents, switch
from stickslip.simulation.exact.output import row_before
from stickslip.simulation.exact.perturbation import perturbation
from stickslip.simulation.exact.segment import (
    DR_END,
    GOAL_END,
    INTEGRAL_END,
    LENGTH,
    POSITION_END,
    POSITION_EVENT,
    R_END,
    RATE_END,
    VELOCITY_END,
    VELOCITY_EVENT,
    integral_at,
    slip_force_at,
)
from stickslip.simulation.exact.state import (
    EDGE,
    command,
    side_of,
    sides_of,
)
from stickslip.simulation.exact.stiction import applied, release, set_off

SOON = 1e-9
"""Time at which the commanded torque tells where a free axis sets off, s."""


@kernel(exact=False, inline=True)
def finish_step(plan: Any, sides: Any, now: Any, segment: Any, t: float, ki: float) -> None:
    """Stand at the end of the segment; modes stay."""
    add_exponents(plan, sides, segment[LENGTH], segment[LENGTH])
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        if side.slipping > 0.0 and side.varies != 0:
            side.force = side.force_end
            side.force_now = side.force_end
            side.force_rate = side.force_rate_end
            side.decay = side.decay_end
    now.time = t
    now.position = segment[POSITION_END]
    now.velocity = segment[VELOCITY_END]
    now.command = segment[R_END]
    now.command_rate = segment[DR_END]
    now.goal = segment[GOAL_END]
    now.goal_rate = segment[RATE_END]
    if ki != 0.0:
        now.integral = segment[INTEGRAL_END]


@kernel(exact=False)
def finish_event(
    parameters: Any, plan: Any, cells: Any, sides: Any, now: Any, segment: Any, x: float, theta: float, v: float
) -> None:  # fmt: skip
    """Stand at the event x; modes are about to change."""
    add_exponents(plan, sides, segment[LENGTH], x)
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        side.force_now = slip_force_at(side, segment, x)
    now.integral = integral_at(parameters, now, segment, x)
    now.time += x
    now.position = theta
    now.velocity = v
    stand(parameters, plan, cells, now)


@kernel(exact=False, inline=True)
def cross(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, now: Any, segment: Any, count: Any, rows: Any,
    h: float, tol: float, held: bool, full: bool,
) -> None:  # fmt: skip
    """Stand at the event h, with a row of it if `full`, and change modes."""
    count.events += 1
    now.jumped = 1
    theta = segment[POSITION_EVENT]
    v = segment[VELOCITY_EVENT]
    if full:
        row_before(parameters, plan, cells, sides, now, segment, count, rows, h, theta, v)
    finish_event(parameters, plan, cells, sides, now, segment, h, theta, v)
    switch(parameters, plan, elements, sides, now)
    if held:
        release(plan, elements, sides, parameters, now)
    if parameters[PERTURBATION] != 0.0:
        perturbation(parameters, plan, elements, now, h, tol, True)


@kernel(exact=False)
def stand(parameters: Any, plan: Any, cells: Any, now: Any) -> None:
    """Take the reference where the loop stands."""
    r, dr, goal, rate = command(parameters, plan, cells, now, now.time)
    now.command = r
    now.command_rate = dr
    now.goal = goal
    now.goal_rate = rate


@kernel(exact=False)
def start(parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, now: Any, breaks: Any) -> None:
    """Stand at t = 0."""
    now.jumped = 1
    now.edge_low = EDGE
    now.edge_high = breaks[0] - EDGE
    now.position = parameters[POSITION_0]
    now.velocity = parameters[VELOCITY_0]
    if now.velocity != 0.0:
        now.sigma = 1.0 if now.velocity > 0.0 else -1.0
    stand(parameters, plan, cells, now)
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        side.inside = 1 if abs(now.velocity) < side.layer else 0
    if now.velocity == 0.0 and not set_off(plan, elements, sides, parameters, now):
        r, _, _, _ = command(parameters, plan, cells, now, SOON)
        push = applied(parameters, plan, elements, sides, now) + r - now.command
        now.sigma = 1.0 if push >= 0.0 else -1.0


@kernel(exact=False)
def pass_break(
    parameters: Any, plan: Any, cells: Any, sides: Any, now: Any, t: float, following: float
) -> bool:  # fmt: skip
    """Stand on the other side of a break; returns whether the commanded torque jumps."""
    before = now.command
    now.jumped = 1
    now.time = t
    now.edge_low = t + EDGE
    now.edge_high = following - EDGE
    now.unseen = 0
    stand(parameters, plan, cells, now)
    return abs(now.command - before) > 1e-9
