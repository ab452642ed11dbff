"""What a law that compensates friction sees of a velocity: as it is, or through a second-order Butterworth low-pass.

Bilinear transform with the corner prewarped (Oppenheim and Schafer, section 7.1), as of
`stickslip.control.estimators.butterworth_difference`; the corner stays below half the sample rate.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.control.linear import Compensation
from stickslip.core.control_spec import friction
from stickslip.core.spec import Choice, Option, Par

MOST = 0.99 * math.pi
"""Largest corner times sample time that the low-pass is designed with."""


class Seen(NamedTuple):
    """What is remembered of the velocity."""

    seen: Annotated[float, Par("rad/s", "", "velocity that the law saw one sample ago")]
    running: Annotated[float, Par("-", "", "1 after its first sample")]
    in_1: Annotated[float, Par("rad/s", "", "low-pass: input one sample ago")]
    in_2: Annotated[float, Par("rad/s", "", "low-pass: input two samples ago")]
    out_1: Annotated[float, Par("rad/s", "", "low-pass: output one sample ago")]
    out_2: Annotated[float, Par("rad/s", "", "low-pass: output two samples ago")]


class Corner(NamedTuple):
    """Parameter of the low-pass."""

    corner: Annotated[float, Par("1/s", "omega_c", "corner", positive=True)]


def open_pass(x: float, y: Any, z: Any, p: Any) -> float:
    """The velocity as it is, rad/s."""
    return x


def butterworth(x: float, y: Any, z: Any, p: Any) -> float:
    """The velocity through the low-pass, rad/s."""
    g = math.tan(0.5 * min(p.corner * y.elapsed, MOST))
    scale = 1.0 / (1.0 + math.sqrt(2.0) * g + g * g)
    new = g * g * scale * (x + 2.0 * z.in_1 + z.in_2)
    new = new - 2.0 * (g * g - 1.0) * scale * z.out_1 - (1.0 - math.sqrt(2.0) * g + g * g) * scale * z.out_2
    z.in_2 = z.in_1
    z.in_1 = x
    z.out_2 = z.out_1
    z.out_1 = new
    return new


LOW_PASS = Choice(
    "low_pass",
    "low_passed",
    {"none": Option(open_pass), "butterworth": Option(butterworth, Corner, example={"corner": 600.0})},
    "none",
    "low-pass on the velocity that the friction law sees",
)


def compensation(velocity: str, p: Any) -> Compensation | str:
    """The law in continuous time; a sentence where a parameter acts on samples."""
    acts = [name for name in ("lead", "deadband") if getattr(p, name, 0.0) != 0.0]
    acts += ["substeps"] if hasattr(p, "substeps") else []
    return f"{acts[0]} acts on samples" if acts else Compensation(velocity, p.gain, getattr(p, "corner", 0.0))


def linear(last: float, now: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The velocity runs linearly over the sample; before its first one the law has seen nothing. N·m."""
    if z.running == 0.0 or y.started == 0.0:
        return friction(now, now, 0.0, z.friction, p.friction, u)
    return friction(last, now, y.elapsed, z.friction, p.friction, u)


def held(last: float, now: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The velocity of this sample holds over the whole sample, N·m."""
    return friction(now, now, y.elapsed, z.friction, p.friction, u)


class Steps(NamedTuple):
    """Parameter of the division."""

    substeps: Annotated[
        float, Par("-", "", "steps into which a sample is divided", lower=1.0, upper=1000.0, whole=True)
    ]


def in_steps(last: float, now: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """As linear, in several steps: the error of a step falls with them. N·m."""
    before = last
    elapsed = y.elapsed
    if z.running == 0.0 or y.started == 0.0:
        before = now
        elapsed = 0.0
    first = before
    for i in range(1, int(p.substeps)):
        after = first + (now - first) * (float(i) / p.substeps)
        friction(before, after, elapsed / p.substeps, z.friction, p.friction, u)
        before = after
    return friction(before, now, elapsed / p.substeps, z.friction, p.friction, u)


OVER_SAMPLE = Choice(
    "velocity",
    "over_sample",
    {
        "linear": Option(linear),
        "held": Option(held),
        "in_steps": Option(in_steps, Steps, example={"substeps": 4.0}),
    },
    "linear",
    "how the velocity runs over a sample",
)
