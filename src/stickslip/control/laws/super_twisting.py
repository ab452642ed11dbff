"""Super-twisting: a sliding mode of second order, whose torque is continuous.

In samples its integral still switches by inertia x gain x sample time. The implicit form solves the sample for the
error at its end, does not chatter, and leaves friction a standing error inside a layer of sample time² x gain.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par

ROOT, INTEGRAL = 1.5, 1.1
"""Levant's gains: 1.5 sqrt(L) on the root, 1.1 L in the integral."""


class Params(NamedTuple):
    """Surface, and how fast a disturbance may change."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    slope: Annotated[float, Par("1/s", "lambda", "slope of the sliding surface", positive=True)]
    rate: Annotated[
        float, Par("rad/s³", "L", "bound of the disturbance's rate over the inertia", positive=True)
    ]


class State(NamedTuple):
    """Internal state."""

    integral: Annotated[float, Par("rad/s²", "w", "integral of the sign")]


def signed_root(x: float) -> float:
    """sqrt|x| with the sign of x."""
    return math.copysign(math.sqrt(abs(x)), x)


def kept(w: float, y: Any, p: Any) -> float:
    """The integral within what the torque limit can give, rad/s²."""
    return min(max(w, -y.torque_limit / p.inertia), y.torque_limit / p.inertia)


def explicit(off: float, y: Any, z: Any, p: Any) -> float:
    """Acceleration by the error of this sample, rad/s²; advances the integral."""
    switch = 0.0
    if off > 0.0:
        switch = 1.0
    if off < 0.0:
        switch = -1.0
    z.integral = kept(z.integral + y.elapsed * INTEGRAL * p.rate * switch, y, p)
    return ROOT * math.sqrt(p.rate) * signed_root(off) + z.integral


def implicit(off: float, y: Any, z: Any, p: Any) -> float:
    """Acceleration by the error that the sample will end with, rad/s²; advances the integral."""
    time = y.elapsed
    k1 = ROOT * math.sqrt(p.rate)
    k2 = INTEGRAL * p.rate
    ahead = off - time * z.integral
    layer = time * time * k2
    switch = ahead / layer
    end = 0.0
    if abs(ahead) > layer:
        switch = math.copysign(1.0, ahead)
        root = 0.5 * (math.sqrt(time * time * k1 * k1 + 4.0 * (abs(ahead) - layer)) - time * k1)
        end = math.copysign(root * root, ahead)
    z.integral = kept(z.integral + time * k2 * switch, y, p)
    return k1 * signed_root(end) + z.integral


FORM = Choice(
    "form",
    "pulled",
    {"explicit": Option(explicit), "implicit": Option(implicit)},
    "explicit",
    "the error by which it switches: of this sample, or of its end",
)
pulled = explicit


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    rate = y.reference_velocity - y.velocity
    off = rate + p.slope * y.error
    return p.inertia * (pulled(off, y, z, p) + p.slope * rate)


def take_over(missing: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The integral takes it, up to the torque limit."""
    before = z.integral
    z.integral = kept(before + missing / p.inertia, y, p)
    return missing - p.inertia * (z.integral - before)


CONTROL_LAW = ControlLaw(
    "super_twisting", Params, sample, "loop",
    title="Super-twisting",
    equation=r"T = J_n (1.5 \sqrt{L |s|}\,\mathrm{sgn}\,s + w + \lambda \dot e),\quad \dot w = 1.1 L\,\mathrm{sgn}\,s",
    source=("levant1998",),
    example={"inertia": 3.8623e-4, "slope": 60.0, "rate": 2e4},
    State=State,
    take_over=take_over,
    choices=(FORM,),
)  # fmt: skip
