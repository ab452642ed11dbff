"""The difference of measured positions through a second-order Butterworth low-pass.

Bilinear transform with the corner prewarped (Oppenheim and Schafer, section 7.1); the corner stays below half
the sample rate.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par

MOST = 0.99 * math.pi
"""Largest corner times sample time that the low-pass is designed with."""


class Params(NamedTuple):
    """The low-pass."""

    corner: Annotated[float, Par("1/s", "omega_c", "corner", positive=True)]


class State(NamedTuple):
    """Internal state."""

    velocity_1: Annotated[float, Par("rad/s", "", "filtered velocity one sample ago")]
    velocity_2: Annotated[float, Par("rad/s", "", "filtered velocity two samples ago")]
    raw_1: Annotated[float, Par("rad/s", "", "difference one sample ago")]
    raw_2: Annotated[float, Par("rad/s", "", "difference two samples ago")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s."""
    raw = y.moved / y.elapsed
    g = math.tan(0.5 * min(p.corner * y.elapsed, MOST))
    new = g * g * (raw + 2.0 * z.raw_1 + z.raw_2)
    new -= 2.0 * (g * g - 1.0) * z.velocity_1 + (1.0 - math.sqrt(2.0) * g + g * g) * z.velocity_2
    new = new / (1.0 + math.sqrt(2.0) * g + g * g)
    z.velocity_2 = z.velocity_1
    z.velocity_1 = new
    z.raw_2 = z.raw_1
    z.raw_1 = raw
    return new


def delay(p: Any, sample_time: float) -> float:
    """Half a sample of the difference, and that of the low-pass, s."""
    return 0.5 * sample_time * (1.0 + math.sqrt(2.0) / math.tan(0.5 * min(p.corner * sample_time, MOST)))


CONTROL_LAW = ControlLaw(
    "butterworth_difference", Params, sample, "estimator",
    title="Difference through a Butterworth low-pass",
    equation=r"v = \frac{\omega_c^2}{s^2 + \sqrt 2 \omega_c s + \omega_c^2} \frac{\theta_k - \theta_{k-1}}{T}",
    source=("oppenheim1999",),
    example={"corner": 1000.0},
    State=State,
    delay=delay,
    linear=True,
)  # fmt: skip
