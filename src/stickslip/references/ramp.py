"""A ramp at constant velocity, which may end in a hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind
from stickslip.references import BEFORE


class Params(NamedTuple):
    """Parameters of the ramp."""

    velocity: Annotated[float, Par("rad/s", "v", "velocity")]
    end: Annotated[
        float, Par("s", "t_e", "time at which the ramp ends and holds", positive=True, default=1e9)
    ]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t."""
    out.acceleration = 0.0
    if t < p.end * BEFORE:
        out.position = p.velocity * t
        out.velocity = p.velocity
    else:
        out.position = p.velocity * p.end
        out.velocity = 0.0


def breaks(p: Any, duration: float) -> Sequence[float]:
    """The end of the ramp."""
    return [p.end] if p.end < duration and math.isfinite(p.end) else []


REFERENCE = ReferenceKind(
    "ramp", Params, profile, breaks, title="Ramp", equation=r"\theta_d = v\,\min(t, t_e)"
)
