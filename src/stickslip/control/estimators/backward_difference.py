"""The difference of the last two measured positions over the time between them."""

from __future__ import annotations

from typing import Any, NamedTuple

from stickslip.control_spec import ControlLaw

__all__ = ["CONTROL_LAW"]


class Params(NamedTuple):
    """It has none."""


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s; 0 in the first sample, where nothing has moved yet."""
    return y.moved / y.elapsed


def delay(p: Any, sample_time: float) -> float:
    """It is the mean velocity of the last sample: half a sample, s."""
    return 0.5 * sample_time


CONTROL_LAW = ControlLaw(
    "backward_difference", Params, sample, "estimator",
    title="Backward difference",
    equation=r"v_k = (\theta_k - \theta_{k-1}) / T",
    source=("franklin1998",),
    example={},
    delay=delay,
    linear=True,
)  # fmt: skip
