"""Luenberger observer of position and velocity on the measured position alone; both poles at one place.

It predicts with a constant velocity and corrects with the position measured in this sample (current observer).
A stationary Kalman filter for a random acceleration has this form too.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """The poles."""

    corner: Annotated[float, Par("1/s", "omega_o", "both poles, as of a continuous observer", positive=True)]


class State(NamedTuple):
    """Internal state."""

    ahead: Annotated[float, Par("rad", "", "estimated minus measured position")]
    velocity: Annotated[float, Par("rad/s", "v", "estimated velocity")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s."""
    pole = math.exp(-p.corner * y.elapsed)
    z.ahead += y.elapsed * z.velocity - y.moved
    error = -z.ahead
    z.ahead += (1.0 - pole * pole) * error
    z.velocity += (1.0 - pole) * (1.0 - pole) / y.elapsed * error
    return z.velocity


def delay(p: Any, sample_time: float) -> float:
    """At low frequency, s."""
    pole = math.exp(-p.corner * sample_time)
    return sample_time * ((1.0 + pole) / (1.0 - pole) - 0.5)


CONTROL_LAW = ControlLaw(
    "luenberger", Params, sample, "estimator",
    title="Luenberger observer",
    equation=r"\hat x_k = \hat x_{k|k-1} + l (\theta_k - \hat\theta_{k|k-1})",
    source=("franklin1998",),
    example={"corner": 1000.0},
    State=State,
    delay=delay,
    linear=True,
)  # fmt: skip
