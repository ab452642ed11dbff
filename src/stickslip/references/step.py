"""A step, as it is or through a critically damped second-order filter.

theta_d = A (1 - (1 + t/tau) exp(-t/tau)); with tau = 0 the ideal step at t = 0. The thesis gives its step only
as a picture (figure 3.17); with an ideal step every feedforward run is the PD run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind


class Params(NamedTuple):
    """Parameters of the step."""

    amplitude: Annotated[float, Par("rad", "A", "height of the step")]
    tau: Annotated[
        float, Par("s", "tau", "time constant of the filter; 0 for an ideal step", lower=0.0, default=0.0)
    ]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t."""
    out.position = p.amplitude
    out.velocity = 0.0
    out.acceleration = 0.0
    if p.tau > 0.0:
        x = t / p.tau
        decay = math.exp(-x)
        out.position = p.amplitude * (1.0 - (1.0 + x) * decay)
        out.velocity = p.amplitude * x * decay / p.tau
        out.acceleration = p.amplitude * (1.0 - x) * decay / (p.tau * p.tau)


def breaks(p: Any, duration: float) -> Sequence[float]:
    """Where the velocity becomes too small for a number, 745 tau about: a feedforward of its sign ends there."""
    low, high = 600.0 * p.tau, 800.0 * p.tau
    if not 0.0 < low < duration or p.amplitude == 0.0:
        return []
    for _ in range(60):
        t = 0.5 * (low + high)
        x = t / p.tau
        if p.amplitude * x * math.exp(-x) / p.tau != 0.0:
            low = t
        else:
            high = t
    return [high] if high < duration else []


REFERENCE = ReferenceKind(
    "step",
    Params,
    profile,
    breaks,
    title="Step",
    equation=r"\theta_d = A\left(1-(1+t/\tau)e^{-t/\tau}\right)",
)
