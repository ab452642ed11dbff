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
    DR,
    DS,
    DS_END,
    EDGE,
    EDGE_HIGH,
    EDGE_LOW,
    EVENTS,
    GOAL,
    GOAL_RATE,
    INSIDE,
    INTEGRAL,
    JUMPED,
    LAYER,
    POSITION,
    Q_END,
    S_END,
    S_NOW,
    SIDE_SIZE,
    SIGMA,
    SLIPPING,
    TIME,
    UNSEEN,
    VARIES,
    VELOCITY,
    Q,
    R,
    S,
    command,
    sides_of,
)
from stickslip.simulation.exact.stiction import applied, release, set_off

SOON = 1e-9
"""Time at which the commanded torque tells where a free axis sets off, s."""


@kernel(exact=False, inline=True)
def finish_step(plan: Any, sides: Any, loop: Any, segment: Any, t: float, ki: float) -> None:
    """Stand at the end of the segment; modes stay."""
    add_exponents(plan, sides, segment[LENGTH], segment[LENGTH])
    for side in range(sides_of(plan)):
        if sides[side * SIDE_SIZE + SLIPPING] > 0.0 and sides[side * SIDE_SIZE + VARIES] > 0.0:
            sides[side * SIDE_SIZE + S] = sides[side * SIDE_SIZE + S_END]
            sides[side * SIDE_SIZE + S_NOW] = sides[side * SIDE_SIZE + S_END]
            sides[side * SIDE_SIZE + DS] = sides[side * SIDE_SIZE + DS_END]
            sides[side * SIDE_SIZE + Q] = sides[side * SIDE_SIZE + Q_END]
    loop[TIME] = t
    loop[POSITION] = segment[POSITION_END]
    loop[VELOCITY] = segment[VELOCITY_END]
    loop[R] = segment[R_END]
    loop[DR] = segment[DR_END]
    loop[GOAL] = segment[GOAL_END]
    loop[GOAL_RATE] = segment[RATE_END]
    if ki != 0.0:
        loop[INTEGRAL] = segment[INTEGRAL_END]


@kernel(exact=False)
def finish_event(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, segment: Any, x: float, theta: float, v: float
) -> None:  # fmt: skip
    """Stand at the event x; modes are about to change."""
    add_exponents(plan, sides, segment[LENGTH], x)
    for side in range(sides_of(plan)):
        sides[side * SIDE_SIZE + S_NOW] = slip_force_at(sides, segment, side, x)
    loop[INTEGRAL] = integral_at(parameters, loop, segment, x)
    loop[TIME] += x
    loop[POSITION] = theta
    loop[VELOCITY] = v
    stand(parameters, plan, cells, loop)


@kernel(exact=False, inline=True)
def cross(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, loop: Any, segment: Any, count: Any, rows: Any,
    h: float, tol: float, held: bool, full: bool,
) -> None:  # fmt: skip
    """Stand at the event h, with a row of it if `full`, and change modes."""
    count[EVENTS] += 1.0
    loop[JUMPED] = 1.0
    theta = segment[POSITION_EVENT]
    v = segment[VELOCITY_EVENT]
    if full:
        row_before(parameters, plan, cells, sides, loop, segment, count, rows, h, theta, v)
    finish_event(parameters, plan, cells, sides, loop, segment, h, theta, v)
    switch(parameters, plan, elements, sides, loop)
    if held:
        release(plan, elements, sides, parameters, loop)
    if parameters[PERTURBATION] != 0.0:
        perturbation(parameters, plan, elements, loop, h, tol, True)


@kernel(exact=False)
def stand(parameters: Any, plan: Any, cells: Any, loop: Any) -> None:
    """Take the reference where the loop stands."""
    r, dr, goal, rate = command(parameters, plan, cells, loop, loop[TIME])
    loop[R] = r
    loop[DR] = dr
    loop[GOAL] = goal
    loop[GOAL_RATE] = rate


@kernel(exact=False)
def start(parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, loop: Any, breaks: Any) -> None:
    """Stand at t = 0."""
    loop[JUMPED] = 1.0
    loop[EDGE_LOW] = EDGE
    loop[EDGE_HIGH] = breaks[0] - EDGE
    loop[POSITION] = parameters[POSITION_0]
    loop[VELOCITY] = parameters[VELOCITY_0]
    if loop[VELOCITY] != 0.0:
        loop[SIGMA] = 1.0 if loop[VELOCITY] > 0.0 else -1.0
    stand(parameters, plan, cells, loop)
    for side in range(sides_of(plan)):
        sides[side * SIDE_SIZE + INSIDE] = (
            1.0 if abs(loop[VELOCITY]) < sides[side * SIDE_SIZE + LAYER] else 0.0
        )
    if loop[VELOCITY] == 0.0 and not set_off(plan, elements, sides, parameters, loop):
        r, _, _, _ = command(parameters, plan, cells, loop, SOON)
        push = applied(parameters, plan, elements, sides, loop) + r - loop[R]
        loop[SIGMA] = 1.0 if push >= 0.0 else -1.0


@kernel(exact=False)
def pass_break(
    parameters: Any, plan: Any, cells: Any, sides: Any, loop: Any, now: float, following: float
) -> bool:  # fmt: skip
    """Stand on the other side of a break; returns whether the commanded torque jumps."""
    before = loop[R]
    loop[JUMPED] = 1.0
    loop[TIME] = now
    loop[EDGE_LOW] = now + EDGE
    loop[EDGE_HIGH] = following - EDGE
    loop[UNSEEN] = 0.0
    stand(parameters, plan, cells, loop)
    return abs(loop[R] - before) > 1e-9
