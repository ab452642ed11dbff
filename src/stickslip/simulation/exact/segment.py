"""The motion over one segment of the exact integrator: what is kept of it, and the state inside it."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.case_arrays import KI
from stickslip.simulation.exact.flow import Cubic, Linear, flow, hermite, hermite_slope, moved
from stickslip.simulation.exact.state import Loop

Pair = tuple[float, float]


@kernel(exact=False, inline=True)
def remember(segment: Any, c: Cubic, h: float, free: Pair, middle: Pair, end: Pair, rounds: int) -> None:
    """Keep the motion over the segment; pairs are a position and a velocity."""
    segment.length = h
    segment.c0, segment.c1, segment.c2, segment.c3 = c
    segment.free_position, segment.free_velocity = free
    segment.position_mid, segment.velocity_mid = middle
    segment.position_end, segment.velocity_end = end
    segment.rounds = rounds


@kernel(exact=False)
def shows(lin: Linear, segment: Any, least: float) -> bool:
    """Whether something rings in this segment with an amplitude of more than `least`, rad."""
    p = segment.free_position
    q = segment.free_velocity
    return lin.discriminant > 0.0 and lin.discriminant * (p * p - least * least) + q * q > 0.0


@kernel(exact=False)
def cubic_of(segment: Any) -> Cubic:
    """The particular solution of the segment."""
    return segment.c0, segment.c1, segment.c2, segment.c3


@kernel(exact=False, inline=True)
def state_at(lin: Linear, segment: Any, x: float) -> tuple[float, float]:
    """Position and velocity at x inside the segment, exact for its forcing."""
    return moved(cubic_of(segment), flow(lin, x), x, segment.free_position, segment.free_velocity)


@kernel(exact=False, inline=True)
def slip_force_at(side: Any, segment: Any, x: float) -> float:
    """Slipping force of a side at x inside the segment."""
    if side.varies == 0 or side.slipping == 0.0:
        return side.force
    y = x * (segment.length - x)
    return side.lift * y * y + hermite(
        side.force,
        side.force_rate,
        side.force_end,
        side.force_rate_end,
        segment.length,
        x,
    )


@kernel(exact=False, inline=True)
def slip_torque_at(side: Any, segment: Any, x: float) -> float:
    """Torque of a side's slipping force at x inside the segment: a bristle's damping adds to the force."""
    force = slip_force_at(side, segment, x)
    if side.lag == 0.0 or side.slipping == 0.0:
        return force
    y = x * (segment.length - x)
    slope = 2.0 * side.lift * y * (segment.length - 2.0 * x) + hermite_slope(
        side.force,
        side.force_rate,
        side.force_end,
        side.force_rate_end,
        segment.length,
        x,
    )
    return force + side.lag * slope


@kernel(exact=False, inline=True)
def integral_at(loop: Loop, x: float) -> float:
    """Integral of the position error at x inside the segment, rad·s."""
    now, segment = loop.now, loop.segment
    if loop.parameters[KI] == 0.0:
        return 0.0
    return hermite(
        now.integral,
        now.goal - now.position,
        segment.integral_end,
        segment.goal_end - segment.position_end,
        segment.length,
        x,
    )
