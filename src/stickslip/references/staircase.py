"""Equal steps, one after the other, each through the filter of the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Par, ReferenceKind
from stickslip.references import BEFORE


class Params(NamedTuple):
    """Parameters of the staircase."""

    height: Annotated[float, Par("rad", "h", "height of one step")]
    dwell: Annotated[float, Par("s", "t_d", "time from step to step", positive=True)]
    steps: Annotated[float, Par("-", "n", "number of steps", lower=1.0)]
    tau: Annotated[
        float, Par("s", "tau", "time constant of the filter; 0 for ideal steps", lower=0.0, default=0.0)
    ]


def profile(t: float, p: Any, out: Any) -> None:
    """Write position, velocity and acceleration at time t: the sum of the steps begun so far."""
    out.position = 0.0
    out.velocity = 0.0
    out.acceleration = 0.0
    begun = math.floor(t / p.dwell / BEFORE) + 1.0
    if begun > p.steps:
        begun = p.steps
    for i in range(int(begun)):
        since = t - i * p.dwell
        if p.tau > 0.0:
            x = since / p.tau
            decay = math.exp(-x)
            out.position += p.height * (1.0 - (1.0 + x) * decay)
            out.velocity += p.height * x * decay / p.tau
            out.acceleration += p.height * (1.0 - x) * decay / (p.tau * p.tau)
        else:
            out.position += p.height


def breaks(p: Any, duration: float) -> Sequence[float]:
    """The begin of every step."""
    count = min(p.steps, math.ceil(min(duration / p.dwell, 1e6)))
    return [i * p.dwell for i in range(1, int(count)) if i * p.dwell < duration]


def check(p: Any) -> str:
    """The number of steps is a whole one."""
    if p.steps != int(p.steps):
        return f"steps = {p.steps:g} must be a whole number"
    return ""


REFERENCE = ReferenceKind(
    "staircase",
    Params,
    profile,
    breaks,
    title="Staircase",
    equation=r"\theta_d = \sum_{i=0}^{n-1} h\,\sigma(t - i t_d)",
    check=check,
)
