"""Back and forth from rest: theta_d = A (1 - cos 2 pi f t), from 0 to 2 A; thesis eqs. 3.23 and 3.24.

The plain sinusoid, A sin 2 pi f t, is `plain_sine`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Parameters of the sinusoid."""

    amplitude: Annotated[float, Par("rad", "A", "amplitude; the motion A (1 - cos) spans from 0 to 2 A")]
    frequency: Annotated[float, Par("Hz", "f", "frequency", positive=True)]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t."""
    w = 2.0 * math.pi * p.frequency
    c = math.cos(w * t)
    out.position = p.amplitude * (1.0 - c)
    out.velocity = p.amplitude * w * math.sin(w * t)
    out.acceleration = p.amplitude * w * w * c


def breaks(p: Any, duration: float) -> Sequence[float]:
    """Turning points, every half period."""
    return [i / (2.0 * p.frequency) for i in range(1, math.ceil(2.0 * p.frequency * duration))]


REFERENCE = ReferenceKind(
    "sine", Params, profile, breaks, title="Sinusoid from rest", equation=r"\theta_d = A(1-\cos 2\pi f t)"
)
