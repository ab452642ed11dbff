"""Rest of the exact integrator: an axis that rigid friction holds at v = 0, until the applied torque is larger."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation._case import KI
from stickslip.simulation._exact_events import NONE, applied, stiction
from stickslip.simulation._exact_state import GOAL, GOAL_RATE, INTEGRAL, POSITION, TIME, R, command
from stickslip.simulation._exact_step import (
    GOAL_END,
    GOAL_MID,
    INTEGRAL_END,
    POSITION_EVENT,
    RATE_END,
    VELOCITY_EVENT,
    look_ahead,
    remember,
)

LONGEST_REST = 2e-3


@kernel(exact=False)
def rest(
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, loop: Any, stretch: Any, left: float
) -> float:  # fmt: skip
    """Stay at rest for at most `left` s; fills `stretch`, returns when the axis breaks away or NONE."""
    h = min(left, LONGEST_REST)
    theta = loop[POSITION]
    look_ahead(parameters, plan, cells, loop, stretch, h, 0.0)
    remember(stretch, (theta, 0.0, 0.0, 0.0), h, 0.0, 0.0, theta, 0.0, theta, 0.0, 0)
    wanted = h / 30.0 * (7.0 * (loop[GOAL] + stretch[GOAL_END]) + 16.0 * stretch[GOAL_MID])
    wanted += h * h / 60.0 * (loop[GOAL_RATE] - stretch[RATE_END])
    stretch[INTEGRAL_END] = loop[INTEGRAL] + wanted - theta * h
    stretch[POSITION_EVENT] = theta
    stretch[VELOCITY_EVENT] = 0.0
    low = 0.0
    if excess(parameters, plan, cells, elements, sides, loop, 0.0) > 0.0:
        return 0.0
    for node in range(1, 3):
        high = 0.5 * node * h
        if excess(parameters, plan, cells, elements, sides, loop, high) > 0.0:
            for _ in range(60):
                x = 0.5 * (low + high)
                if excess(parameters, plan, cells, elements, sides, loop, x) > 0.0:
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
    parameters: Any, plan: Any, cells: Any, elements: Any, sides: Any, loop: Any, x: float
) -> float:  # fmt: skip
    """Applied torque beyond what is held, after another x at rest, N·m."""
    _, _, middle, _ = command(parameters, plan, cells, loop, loop[TIME] + 0.5 * x)
    r, _, goal, rate = command(parameters, plan, cells, loop, loop[TIME] + x)
    torque = applied(parameters, plan, elements, sides, loop) + r - loop[R]
    if parameters[KI] != 0.0:
        wanted = x / 30.0 * (7.0 * (loop[GOAL] + goal) + 16.0 * middle)
        wanted += x * x / 60.0 * (loop[GOAL_RATE] - rate)
        torque += parameters[KI] * (wanted - loop[POSITION] * x)
    return abs(torque) - max(stiction(plan, sides), 0.0)
