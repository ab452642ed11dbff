"""The difference of measured positions through a first-order low-pass, exact for an input that holds over a sample."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """The low-pass."""

    corner: Annotated[float, Par("1/s", "omega_c", "corner", positive=True)]


class State(NamedTuple):
    """Internal state."""

    velocity: Annotated[float, Par("rad/s", "v", "filtered velocity")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity, rad/s."""
    raw = y.moved / y.elapsed
    z.velocity = raw + math.exp(-p.corner * y.elapsed) * (z.velocity - raw)
    return z.velocity


def delay(p: Any, sample_time: float) -> float:
    """Half a sample of the difference, and that of the low-pass, s."""
    kept = math.exp(-p.corner * sample_time)
    return sample_time * (0.5 + kept / (1.0 - kept))


def continuous(p: Any) -> float:
    """In continuous time it is this low-pass: its corner, rad/s."""
    return float(p.corner)


CONTROL_LAW = ControlLaw(
    "filtered_difference", Params, sample, "estimator",
    title="Filtered difference",
    equation=r"v_k = a v_{k-1} + (1 - a) (\theta_k - \theta_{k-1}) / T,\quad a = e^{-\omega_c T}",
    source=("franklin1998",),
    example={"corner": 1000.0},
    State=State,
    delay=delay,
    continuous=continuous,
    linear=True,
)  # fmt: skip
