"""Dither: a square wave of torque that keeps the contact moving. It heats the motor for as long as it runs.

Given only where the axis stands off its reference, it ends with the error that it is there for.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par


class Params(NamedTuple):
    """The wave."""

    torque: Annotated[float, Par("N·m", "A", "amplitude", positive=True)]
    samples: Annotated[
        float, Par("-", "N", "samples of a period, the first half of them positive", lower=2.0, whole=True)
    ]


class State(NamedTuple):
    """Internal state."""

    passed: Annotated[float, Par("-", "k", "samples since the period began")]


def always(y: Any, p: Any) -> float:
    """The share of the wave that is given: all of it."""
    return 1.0


class Where(NamedTuple):
    """Parameters of a wave that is given where it is needed."""

    error: Annotated[float, Par("rad", "e_p", "error from which it is given whole", positive=True)]
    speed: Annotated[float, Par("rad/s", "v_p", "speed from which nothing is given", positive=True)]


def stuck(y: Any, p: Any) -> float:
    """The share of the wave that is given: it falls with the error, and with the speed."""
    return min(abs(y.error) / p.error, 1.0) * min(max(1.0 - abs(y.slow_velocity) / p.speed, 0.0), 1.0)


GIVEN = Choice(
    "given",
    "share",
    {"always": Option(always), "stuck": Option(stuck, Where, example={"error": 2e-3, "speed": 0.02})},
    "always",
    "where the wave is given: everywhere, or where the axis stands off its reference",
)
share = always


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    torque = p.torque
    if z.passed >= 0.5 * p.samples:
        torque = -p.torque
    z.passed += 1.0
    if z.passed >= p.samples:
        z.passed = 0.0
    return share(y, p) * torque


def check(p: Any) -> str:
    """A period is an even number of samples: the mean is 0."""
    if p.samples % 2.0 != 0.0:
        return f"samples = {p.samples:g} must be even"
    return ""


CONTROL_LAW = ControlLaw(
    "dither", Params, sample, "feedforward",
    title="Dither",
    equation=r"T = \pm A",
    source=("armstrong1994",),
    example={"torque": 0.2, "samples": 4.0},
    State=State,
    check=check,
    choices=(GIVEN,),
)  # fmt: skip
