"""A motion given by points, joined by cubic Hermite pieces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from stickslip.core.spec import Par, ReferenceKind
from stickslip.references import BEFORE


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
    time, position, velocity = np.asarray(p.time), np.asarray(p.position), np.asarray(p.velocity)
    h, low, high = np.diff(time), velocity[:-1], velocity[1:]
    rise = np.diff(position) / h
    roots = _roots(3.0 * (low + high) - 6.0 * rise, 6.0 * rise - 4.0 * low - 2.0 * high, low)
    inside = (roots > 1e-9) & (roots < 1.0 - 1e-9)
    times = np.concatenate([time, (time[:-1] + h * roots)[inside]])
    return np.unique(times[(times > 0.0) & (times < duration)]).tolist()


def _roots(a: Any, b: Any, c: Any) -> Any:
    """Real roots of a x² + b x + c = 0, shape (2, n); not a number where there is none, nearly double ones as double.

    All pieces at once: a table of hundreds of points is laid out anew for every case of a sweep.
    """
    root = b * b - 4.0 * a * c
    # Rounding moves a double root off the real axis by as little as this.
    root = np.sqrt(np.where(root >= -((2e-12 * a) ** 2), np.maximum(root, 0.0), np.nan))
    # The sum without cancellation, and the other root by their product; a = 0 leaves one root.
    q = -0.5 * (b + np.copysign(root, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.array([q / a, c / q])


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
