"""A motion given by points, joined by cubic Hermite pieces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from stickslip.references import BEFORE
from stickslip.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Points of the motion."""

    time: Annotated[tuple[float, ...], Par("s", "t_i", "times, ascending")]
    position: Annotated[tuple[float, ...], Par("rad", "theta_i", "positions")]
    velocity: Annotated[tuple[float, ...], Par("rad/s", "v_i", "velocities")]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t; held before the first and after the last point."""
    last = len(p.time) - 1
    out.velocity = 0.0
    out.acceleration = 0.0
    if t <= p.time[0]:
        out.position = p.position[0]
        if t == p.time[0]:
            out.velocity = p.velocity[0]
    elif t >= p.time[last] * BEFORE:
        out.position = p.position[last]
    else:
        low = 0
        high = last
        for _ in range(64):
            if high - low <= 1:
                break
            middle = (low + high) // 2
            if p.time[middle] <= t:
                low = middle
            else:
                high = middle
        h = p.time[high] - p.time[low]
        x = (t - p.time[low]) / h
        y = 1.0 - x
        rise = (p.position[high] - p.position[low]) / h
        a = p.velocity[low]
        b = p.velocity[high]
        out.position = (
            y * y * (1.0 + 2.0 * x) * p.position[low]
            + x * x * (3.0 - 2.0 * x) * p.position[high]
            + x * y * h * (y * a - x * b)
        )
        out.velocity = 6.0 * x * y * rise + y * (1.0 - 3.0 * x) * a + x * (3.0 * x - 2.0) * b
        out.acceleration = (6.0 * (y - x) * rise + (6.0 * x - 4.0) * a + (6.0 * x - 2.0) * b) / h


def breaks(p: Any, duration: float) -> Sequence[float]:
    """Every point (the acceleration may jump there) and every zero of the velocity between two points."""
    times = {t for t in p.time if 0.0 < t < duration}
    for i in range(len(p.time) - 1):
        h = p.time[i + 1] - p.time[i]
        rise, a, b = (p.position[i + 1] - p.position[i]) / h, p.velocity[i], p.velocity[i + 1]
        for x in np.roots([3.0 * (a + b) - 6.0 * rise, 6.0 * rise - 4.0 * a - 2.0 * b, a]):
            t = p.time[i] + h * float(x.real)
            if abs(x.imag) < 1e-12 and 1e-9 < x.real < 1.0 - 1e-9 and 0.0 < t < duration:
                times.add(t)
    return sorted(times)


def check(p: Any) -> str:
    """Times ascend."""
    for i in range(1, len(p.time)):
        if p.time[i] <= p.time[i - 1]:
            return f"time[{i}] = {p.time[i]:.9g} s must come after time[{i - 1}] = {p.time[i - 1]:.9g} s"
    return "" if len(p.time) > 1 else "a table needs at least two points"


REFERENCE = ReferenceKind(
    "table",
    Params,
    profile,
    breaks,
    title="Table of points",
    equation=r"\theta_d(t_i) = \theta_i,\ \dot\theta_d(t_i) = v_i",
    check=check,
)
