"""The motion over one segment of the exact integrator: what is kept of it, and the state inside it."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import KI
from stickslip.simulation.exact.flow import Cubic, Linear, flow, hermite, hermite_slope, moved

# ---- entries of `segment`: the motion over one accepted step -------------------------------------------------
(
    LENGTH, C0, C1, C2, C3, FREE_POSITION, FREE_VELOCITY, POSITION_MID, VELOCITY_MID, POSITION_END, VELOCITY_END,
    R_MID, R_END, DR_END, GOAL_MID, RATE_MID, GOAL_END, RATE_END, INTEGRAL_END, ERROR, ROUNDS,
    POSITION_EVENT, VELOCITY_EVENT, SEGMENT_SIZE,
) = range(24)  # fmt: skip


@kernel(exact=False, inline=True)
def remember(
    segment: Any, c: Cubic, h: float, free_position: float, free_velocity: float, theta_mid: float, v_mid: float,
    theta_end: float, v_end: float, rounds: int,
) -> None:  # fmt: skip
    """Keep the motion over the segment."""
    segment[LENGTH] = h
    segment[C0] = c[0]
    segment[C1] = c[1]
    segment[C2] = c[2]
    segment[C3] = c[3]
    segment[FREE_POSITION] = free_position
    segment[FREE_VELOCITY] = free_velocity
    segment[POSITION_MID] = theta_mid
    segment[VELOCITY_MID] = v_mid
    segment[POSITION_END] = theta_end
    segment[VELOCITY_END] = v_end
    segment[ROUNDS] = rounds


@kernel(exact=False)
def shows(lin: Linear, segment: Any, least: float) -> bool:
    """Whether something rings in this segment with an amplitude of more than `least`, rad."""
    p = segment[FREE_POSITION]
    q = segment[FREE_VELOCITY]
    return lin.discriminant > 0.0 and lin.discriminant * (p * p - least * least) + q * q > 0.0


@kernel(exact=False)
def cubic_of(segment: Any) -> Cubic:
    """The particular solution of the segment."""
    return segment[C0], segment[C1], segment[C2], segment[C3]


@kernel(exact=False, inline=True)
def state_at(lin: Linear, segment: Any, x: float) -> tuple[float, float]:
    """Position and velocity at x inside the segment, exact for its forcing."""
    return moved(cubic_of(segment), flow(lin, x), x, segment[FREE_POSITION], segment[FREE_VELOCITY])


@kernel(exact=False, inline=True)
def slip_force_at(side: Any, segment: Any, x: float) -> float:
    """Slipping force of a side at x inside the segment."""
    if side.varies == 0 or side.slipping == 0.0:
        return side.force
    y = x * (segment[LENGTH] - x)
    return side.lift * y * y + hermite(
        side.force,
        side.force_rate,
        side.force_end,
        side.force_rate_end,
        segment[LENGTH],
        x,
    )


@kernel(exact=False, inline=True)
def slip_torque_at(side: Any, segment: Any, x: float) -> float:
    """Torque of a side's slipping force at x inside the segment: a bristle's damping adds to the force."""
    force = slip_force_at(side, segment, x)
    if side.lag == 0.0 or side.slipping == 0.0:
        return force
    y = x * (segment[LENGTH] - x)
    slope = 2.0 * side.lift * y * (segment[LENGTH] - 2.0 * x) + hermite_slope(
        side.force,
        side.force_rate,
        side.force_end,
        side.force_rate_end,
        segment[LENGTH],
        x,
    )
    return force + side.lag * slope


@kernel(exact=False, inline=True)
def integral_at(parameters: Any, now: Any, segment: Any, x: float) -> float:
    """Integral of the position error at x inside the segment, rad·s."""
    if parameters[KI] == 0.0:
        return 0.0
    return hermite(
        now.integral,
        now.goal - now.position,
        segment[INTEGRAL_END],
        segment[GOAL_END] - segment[POSITION_END],
        segment[LENGTH],
        x,
    )
