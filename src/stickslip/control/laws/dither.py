"""Dither: a square wave of torque that keeps the contact moving. It heats the motor for as long as it runs."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control_spec import ControlLaw
from stickslip.spec import Par

__all__ = ["CONTROL_LAW"]


class Params(NamedTuple):
    """The wave."""

    torque: Annotated[float, Par("N·m", "A", "amplitude", positive=True)]
    samples: Annotated[
        float, Par("-", "N", "samples of a period, the first half of them positive", lower=2.0)
    ]


class State(NamedTuple):
    """Internal state."""

    passed: Annotated[float, Par("-", "k", "samples since the period began")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    torque = p.torque
    if z.passed >= 0.5 * p.samples:
        torque = -p.torque
    z.passed += 1.0
    if z.passed >= p.samples:
        z.passed = 0.0
    return torque


def check(p: Any) -> str:
    """A period is an even number of samples: the mean is 0."""
    if p.samples % 2.0 != 0.0:
        return f"samples = {p.samples:g} must be an even whole number"
    return ""


CONTROL_LAW = ControlLaw(
    "dither", Params, sample, "feedforward",
    title="Dither",
    equation=r"T = \pm A",
    source=("armstrong1994",),
    example={"torque": 0.2, "samples": 4.0},
    State=State,
    check=check,
)  # fmt: skip
