"""The plain sinusoid about zero: theta_d = A sin 2 pi f t.

Its velocity jumps at the start, from rest to 2 pi f A; `sine`, theta_d = A (1 - cos 2 pi f t), starts from rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Parameters of the sinusoid."""

    amplitude: Annotated[float, Par("rad", "A", "amplitude; the motion spans from -A to A")]
    frequency: Annotated[float, Par("Hz", "f", "frequency", positive=True)]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t."""
    w = 2.0 * math.pi * p.frequency
    s = math.sin(w * t)
    out.position = p.amplitude * s
    out.velocity = p.amplitude * w * math.cos(w * t)
    out.acceleration = -p.amplitude * w * w * s


def breaks(p: Any, duration: float) -> Sequence[float]:
    """Turning points, a quarter period after the start and every half period from there."""
    count = math.ceil(2.0 * p.frequency * duration + 0.5)
    return [t for i in range(count) if (t := (2 * i + 1) / (4.0 * p.frequency)) < duration]


REFERENCE = ReferenceKind(
    "plain_sine", Params, profile, breaks, title="Plain sinusoid", equation=r"\theta_d = A\sin 2\pi f t"
)
