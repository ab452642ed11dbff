"""Stationary Kalman filter of position and velocity for an axis whose acceleration is random from sample to sample.

Its gains have a closed form in the tracking index, the acceleration over a sample squared in parts of the noise of
the position.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """What is believed of the motion and of the encoder."""

    acceleration: Annotated[
        float,
        Par(
            "rad/s²", "sigma_a", "random acceleration of the axis, RMS, constant over a sample", positive=True
        ),
    ]
    noise: Annotated[
        float,
        Par("rad", "sigma_n", "noise of the measured position, RMS; of counts 0.29 of one", positive=True),
    ]


class State(NamedTuple):
    """Internal state."""

    ahead: Annotated[float, Par("rad", "", "estimated minus measured position")]
    velocity: Annotated[float, Par("rad/s", "v", "estimated velocity")]


def distance(p: Any, time: float) -> float:
    """By how much the double root of the filter's error lies inside the unit circle."""
    index = p.acceleration * time * time / p.noise
    return 2.0 * index / (math.sqrt(index * index + 8.0 * index) + index)


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s."""
    s = distance(p, y.elapsed)
    z.ahead += y.elapsed * z.velocity - y.moved
    error = -z.ahead
    z.ahead += s * (2.0 - s) * error
    z.velocity += 2.0 * s * s / y.elapsed * error
    return z.velocity


def delay(p: Any, sample_time: float) -> float:
    """At low frequency, s."""
    s = distance(p, sample_time)
    return sample_time * ((2.0 - s) / (2.0 * s) - 0.5)


CONTROL_LAW = ControlLaw(
    "kalman", Params, sample, "estimator",
    title="Stationary Kalman filter",
    equation=r"\hat x_k = \hat x_{k|k-1} + l(\sigma_a T^2 / \sigma_n) (\theta_k - \hat\theta_{k|k-1})",
    source=("kalata1984",),
    example={"acceleration": 200.0, "noise": 2.8e-5},
    State=State,
    delay=delay,
    linear=True,
)  # fmt: skip
