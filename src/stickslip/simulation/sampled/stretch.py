"""What both ends of a stretch of time say of the motion inside it."""

from __future__ import annotations

from typing import NamedTuple

from stickslip.jit import kernel
from stickslip.simulation.exact.flow import hermite


class Stretch(NamedTuple):
    """A stretch of time by its ends: rad, rad/s, rad/s²."""

    time: float
    """its length, s"""
    moved: float
    """displacement over it"""
    v0: float
    a0: float
    v1: float
    a1: float


@kernel(exact=False, inline=True)
def velocity_in(s: Stretch, t: float) -> float:
    """The cubic through velocities and accelerations of both ends, rad/s."""
    return hermite(s.v0, s.a0, s.v1, s.a1, s.time, t)


@kernel(exact=False)
def lowest(s: Stretch, way: float) -> float:
    """Where the cubic is nearest to turning: its slope changes sign once between slopes of opposite signs."""
    low, high = 0.0, s.time
    for _ in range(30):
        t = 0.5 * (low + high)
        d = 1e-4 * s.time
        if way * (velocity_in(s, t + d) - velocity_in(s, t - d)) < 0.0:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@kernel(exact=False, inline=True)
def within(s: Stretch, t: float) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration after t: the quintic of what both ends say."""
    h = s.time
    x = t / h
    p, q = s.moved - h * (s.v0 + 0.5 * h * s.a0), h * (s.v1 - s.v0 - h * s.a0)
    r = h * h * (s.a1 - s.a0)
    c3 = 10.0 * p - 4.0 * q + 0.5 * r
    c4 = -15.0 * p + 7.0 * q - r
    c5 = 6.0 * p - 3.0 * q + 0.5 * r
    moved = t * (s.v0 + 0.5 * t * s.a0) + x * x * x * (c3 + x * (c4 + x * c5))
    v = s.v0 + t * s.a0 + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / h
    return moved, v, s.a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)) / (h * h)
