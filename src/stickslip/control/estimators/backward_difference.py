"""The difference of the last two measured positions over the time between them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.core.control_spec import ControlLaw


class Params(NamedTuple):
    """It has none."""


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s; 0 in the first sample, where nothing has moved yet."""
    return y.moved / y.elapsed


def delay(p: Any, sample_time: float) -> float:
    """It is the mean velocity of the last sample: half a sample, s."""
    return 0.5 * sample_time


def continuous(p: Any) -> float:
    """In continuous time it is the velocity itself: no corner, rad/s."""
    return math.inf


CONTROL_LAW = ControlLaw(
    "backward_difference", Params, sample, "estimator",
    title="Backward difference",
    equation=r"v_k = (\theta_k - \theta_{k-1}) / T",
    source=("franklin1998",),
    example={},
    delay=delay,
    continuous=continuous,
    linear=True,
)  # fmt: skip
