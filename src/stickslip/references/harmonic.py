"""A drift and a sinusoid: theta_d = v t + A sin(2 pi f t + phase).

Covers the velocity profiles of thesis eqs. 3.16, 3.17, 3.21 and 3.22.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Parameters of the motion."""

    amplitude: Annotated[float, Par("rad", "A", "amplitude of the position")]
    frequency: Annotated[float, Par("Hz", "f", "frequency", positive=True)]
    phase: Annotated[float, Par("rad", "phi", "phase", default=0.0)]
    velocity: Annotated[float, Par("rad/s", "v", "mean velocity", default=0.0)]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t."""
    w = 2.0 * math.pi * p.frequency
    s = math.sin(w * t + p.phase)
    out.position = p.velocity * t + p.amplitude * s
    out.velocity = p.velocity + p.amplitude * w * math.cos(w * t + p.phase)
    out.acceleration = -p.amplitude * w * w * s


def breaks(p: Any, duration: float) -> Sequence[float]:
    """Times at which the velocity passes through zero: cos(w t + phase) = -v / (A w)."""
    w = 2.0 * math.pi * p.frequency
    if p.amplitude == 0.0 or abs(p.velocity) >= abs(p.amplitude) * w:
        return []
    angle = math.acos(-p.velocity / (p.amplitude * w))
    first = p.phase / (2.0 * math.pi)
    turns = range(math.floor(first) - 1, math.ceil(p.frequency * duration + first) + 2)
    times = [(sign * angle - p.phase + 2.0 * math.pi * n) / w for n in turns for sign in (-1.0, 1.0)]
    return sorted(t for t in times if 1e-12 < t < duration)


REFERENCE = ReferenceKind(
    "harmonic",
    Params,
    profile,
    breaks,
    title="Drift and sinusoid",
    equation=r"\theta_d = v t + A\sin(2\pi f t + \varphi)",
)
