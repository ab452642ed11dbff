"""Rest of the exact integrator: an axis that rigid friction holds at v = 0, until the applied torque is larger."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import KI, KP
from stickslip.simulation.exact.segment import (
    GOAL_END,
    GOAL_MID,
    INTEGRAL_END,
    POSITION_EVENT,
    RATE_END,
    VELOCITY_EVENT,
    remember,
)
from stickslip.simulation.exact.state import (
    BENDS,
    command,
    element_of,
    side_of,
    sides_of,
)
from stickslip.simulation.exact.step import look_ahead

NONE = -1.0
LONGEST_REST = 2e-3


@kernel(exact=False)
def rest(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, now: Any, segment: Any, left: float
) -> float:  # fmt: skip
    """Stay at rest for at most `left` s; fills `segment`, returns when the axis breaks away or NONE."""
    h = min(left, LONGEST_REST)
    theta = now.position
    look_ahead(parameters, plan, cells, now, segment, h, 0.0)
    remember(segment, (theta, 0.0, 0.0, 0.0), h, 0.0, 0.0, theta, 0.0, theta, 0.0, 0)
    reference_integral = h / 30.0 * (7.0 * (now.goal + segment[GOAL_END]) + 16.0 * segment[GOAL_MID])
    reference_integral += h * h / 60.0 * (now.goal_rate - segment[RATE_END])
    segment[INTEGRAL_END] = now.integral + reference_integral - theta * h
    segment[POSITION_EVENT] = theta
    segment[VELOCITY_EVENT] = 0.0
    low = 0.0
    if excess(parameters, plan, cells, elements, sides, now, 0.0) > 0.0:
        return 0.0
    for node in range(1, 3):
        high = 0.5 * node * h
        if excess(parameters, plan, cells, elements, sides, now, high) > 0.0:
            for _ in range(60):
                x = 0.5 * (low + high)
                if excess(parameters, plan, cells, elements, sides, now, x) > 0.0:
                    high = x
                else:
                    low = x
                if high - low < 1e-13:
                    break
            return high
        low = high
    return NONE


@kernel(exact=False)
def excess(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, now: Any, x: float
) -> float:  # fmt: skip
    """Applied torque beyond what is held, after another x at rest, N·m."""
    _, _, middle, _ = command(parameters, plan, cells, now, now.time + 0.5 * x)
    r, _, goal, rate = command(parameters, plan, cells, now, now.time + x)
    torque = applied(parameters, plan, elements, sides, now) + r - now.command
    if parameters[KI] != 0.0:
        reference_integral = x / 30.0 * (7.0 * (now.goal + goal) + 16.0 * middle)
        reference_integral += x * x / 60.0 * (now.goal_rate - rate)
        torque += parameters[KI] * (reference_integral - now.position * x)
    return abs(torque) - max(stiction(plan, sides), 0.0)


@kernel(exact=False)
def stiction(plan: Any, sides: Any) -> float:
    """Half the net interval of torque that rigid elements hold at rest, N·m; negative where they repel."""
    total = 0.0
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        total += side.weight * side.rigid * side.breakaway
    return total


@kernel(exact=False)
def applied(parameters: Any, plan: Any, elements: Any, sides: Any, now: Any) -> float:
    """Torque on the resting axis without its rigid elements, N·m."""
    torque = now.command + parameters[KI] * now.integral - parameters[KP] * now.position
    for i in range(sides_of(plan)):
        side = side_of(sides, i)
        if side.kind == BENDS:
            force = side.spring * now.position + side.spring_offset
            torque -= side.weight * (force + side.force)
        for j in range(side.first, side.last):
            torque -= side.weight * element_of(elements, j).force
    return torque


@kernel(exact=False)
def set_off(plan: Any, elements: Any, sides: Any, parameters: Any, now: Any) -> bool:
    """At v = 0: rest, or the direction in which the axis goes on; False where no rigid elements decide that.

    Rigid friction in the plant holds what lies inside its interval, less the jump of a compensator that acts on
    sign(v). A compensator that jumps by more than the plant repels: the axis goes on through zero.
    """
    rigid = side_of(sides, 0).rigid > 0.0 or (plan.sides > 1 and side_of(sides, 1).rigid > 0.0)
    if not rigid:
        return False
    interval = stiction(plan, sides)
    torque = applied(parameters, plan, elements, sides, now)
    before = now.sigma
    now.held = 0
    if abs(torque) > max(interval, 0.0):
        now.sigma = 1.0 if torque > 0.0 else -1.0
    elif interval < 0.0 and before != 0.0:
        now.sigma = -before
    else:
        now.sigma = 0.0
        now.held = 1
        now.velocity = 0.0
    if now.sigma * now.velocity < 0.0:
        now.velocity = 0.0
    return True


@kernel(exact=False)
def release(plan: Any, elements: Any, sides: Any, parameters: Any, now: Any) -> None:
    """Leave rest in the direction of the applied torque."""
    now.held = 0
    now.sigma = 1.0 if applied(parameters, plan, elements, sides, now) > 0.0 else -1.0
