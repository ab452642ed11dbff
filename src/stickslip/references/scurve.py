"""A rest-to-rest move with limited velocity, acceleration and jerk (seven segments)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Limits of the move; Biagiotti and Melchiorri 2008, section 3.4."""

    distance: Annotated[float, Par("rad", "h", "distance of the move", positive=True)]
    velocity: Annotated[float, Par("rad/s", "v_max", "largest velocity", positive=True)]
    acceleration: Annotated[float, Par("rad/s²", "a_max", "largest acceleration", positive=True)]
    jerk: Annotated[float, Par("rad/s³", "j_max", "largest jerk", positive=True)]


def ramp_time(p: Any) -> float:
    """Time from rest to the highest velocity reached, s."""
    return jerk_time(p) + acceleration_time(p)


def jerk_time(p: Any) -> float:
    """Length of a segment of constant jerk, s: shortened where velocity or distance end it first."""
    return min(
        p.acceleration / p.jerk, math.sqrt(p.velocity / p.jerk), (0.5 * p.distance / p.jerk) ** (1.0 / 3.0)
    )


def acceleration_time(p: Any) -> float:
    """Time from the begin to the end of acceleration less one segment of jerk, s (at least that segment)."""
    tj = jerk_time(p)
    a = p.jerk * tj
    by_velocity = p.velocity / a
    # Without a segment of constant velocity: h = a ta (ta + tj).
    by_distance = 0.5 * (math.sqrt(tj * tj + 4.0 * p.distance / a) - tj)
    return max(tj, min(by_velocity, by_distance))


def cruise_time(p: Any) -> float:
    """Length of the segment of constant velocity, s."""
    top = p.jerk * jerk_time(p) * acceleration_time(p)
    return max(0.0, p.distance / top - ramp_time(p))


def rise(t: float, j: float, tj: float, ta: float, order: int) -> float:
    """Position (order 0), velocity (1) or acceleration (2) while speeding up from rest at t = 0, and after."""
    if t >= ta + tj:
        # The cubics below cancel there, and lose digits the longer the cruise lasts.
        if order == 0:
            return j * tj * ta * (t - 0.5 * (ta + tj))
        if order == 1:
            return j * tj * ta
        return 0.0
    out = 0.0
    for i in range(4):
        since = t - tj * (i % 2) - ta * (i // 2)
        sign = 1.0
        if i == 1:
            sign = -1.0
        if i == 2:
            sign = -1.0
        if since > 0.0:
            if order == 0:
                out += sign * j * since * since * since / 6.0
            if order == 1:
                out += sign * j * since * since / 2.0
            if order == 2:
                out += sign * j * since
    return out


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t; the second half mirrors the first."""
    tj = jerk_time(p)
    ta = acceleration_time(p)
    end = 2.0 * ramp_time(p) + cruise_time(p)
    if t >= end:
        out.position = p.distance
        out.velocity = 0.0
        out.acceleration = 0.0
    elif t > 0.5 * end:
        out.position = p.distance - rise(end - t, p.jerk, tj, ta, 0)
        out.velocity = rise(end - t, p.jerk, tj, ta, 1)
        out.acceleration = -rise(end - t, p.jerk, tj, ta, 2)
    else:
        out.position = rise(t, p.jerk, tj, ta, 0)
        out.velocity = rise(t, p.jerk, tj, ta, 1)
        out.acceleration = rise(t, p.jerk, tj, ta, 2)


def breaks(p: Any, duration: float) -> Sequence[float]:
    """The borders of the segments."""
    tj, ta, end = jerk_time(p), acceleration_time(p), 2.0 * ramp_time(p) + cruise_time(p)
    first = [tj, ta, ta + tj]
    times = {*first, *(end - t for t in first), end}
    return sorted(t for t in times if 1e-12 < t < duration)


REFERENCE = ReferenceKind(
    "scurve",
    Params,
    profile,
    breaks,
    title="S-curve",
    equation=r"|\dddot\theta_d| \le j_\mathrm{max},\ |\ddot\theta_d| \le a_\mathrm{max},\ "
    r"|\dot\theta_d| \le v_\mathrm{max}",
)
