"""Knocker: short pulses of torque in the direction in which the loop's torque has moved since the last one.

Made for valves under a PI controller that stick: the integral moves slowly, and a pulse on it breaks the valve away
before it has wound up. Where the loop's torque rests no pulse is given.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """The pulses."""

    torque: Annotated[float, Par("N·m", "a", "torque of a pulse", positive=True)]
    samples: Annotated[
        float, Par("-", "h_k", "samples from pulse to pulse, 2 to 5 widths", lower=2.0, whole=True)
    ]
    width: Annotated[float, Par("-", "tau", "samples of a pulse", lower=1.0, whole=True)]
    least: Annotated[
        float,
        Par("N·m", "", "change of the torque up to which no pulse is given", lower=0.0, default=0.0),
    ]


class State(NamedTuple):
    """Internal state."""

    passed: Annotated[float, Par("-", "k", "samples since the last pulse began")]
    sign: Annotated[float, Par("-", "", "its direction; 0: it was left out")]
    torque: Annotated[float, Par("N·m", "T_c", "torque of the loop when it began")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    if z.passed >= p.samples:
        z.passed = 0.0
    if z.passed == 0.0:
        change = y.commanded - z.torque  # no pulse is in it: the last one has ended
        z.sign = 0.0
        if change > p.least:
            z.sign = 1.0
        if change < -p.least:
            z.sign = -1.0
        z.torque = y.commanded
    torque = 0.0
    if z.passed < p.width:
        torque = p.torque * z.sign
    z.passed += 1.0
    return torque


def check(p: Any) -> str:
    """A pulse ends before the next one begins."""
    return "" if p.width < p.samples else f"width = {p.width:g} must be less than samples = {p.samples:g}"


CONTROL_LAW = ControlLaw(
    "knocker", Params, sample, "observer",
    title="Knocker",
    equation=r"T = a\,\mathrm{sgn}(T_c(t) - T_c(t_p)),\quad t_p \le t < t_p + \tau",
    source=("hagglund2002",),
    example={"torque": 0.2, "samples": 10.0, "width": 2.0, "least": 1e-3},
    State=State,
    check=check,
)  # fmt: skip
