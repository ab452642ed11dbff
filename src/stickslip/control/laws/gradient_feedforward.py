"""Feedforward whose gain follows the gradient of the error: dg/dt = gamma s F, with s = de/dt + lambda e.

It is an integral action through the friction law, so that it learns while the axis sticks, too, and its gain is no
estimate of the friction.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw, friction
from stickslip.core.spec import Kept, Learned, Par


class Params(NamedTuple):
    """Start, pace and bound."""

    gain: Annotated[float, Par("-", "g_0", "gain at the start", lower=0.0, default=0.9)]
    rate: Annotated[float, Par("1/(N·m·rad)", "gamma", "how fast the gain is learnt", positive=True)]
    slope: Annotated[float, Par("1/s", "lambda", "weight of the position error in s", positive=True)]
    highest: Annotated[float, Par("-", "", "largest gain", positive=True, default=2.0)]


class State(NamedTuple):
    """Internal state."""

    learnt: Annotated[float, Learned("-", "g", "gain")]
    known: Annotated[float, Kept("-", "", "1 once there is a gain")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; the reference velocity holds over the sample."""
    if z.known == 0.0:
        z.learnt = p.gain
        z.known = 1.0
    v = y.reference_velocity
    torque = friction(v, v, y.elapsed, z.friction, p.friction, u)
    s = v - y.velocity + p.slope * y.error
    given = z.learnt * torque
    z.learnt = min(max(z.learnt + y.elapsed * p.rate * s * torque, 0.0), p.highest)
    return given


def check(p: Any) -> str:
    """The gain starts within its bound."""
    if p.gain > p.highest:
        return f"gain = {p.gain:g} must be at most highest = {p.highest:g}"
    return ""


CONTROL_LAW = ControlLaw(
    "gradient_feedforward", Params, sample, "feedforward",
    title="Feedforward with gradient gain",
    equation=r"T = g F(\dot\theta_d),\quad \dot g = \gamma\,(\dot e + \lambda e)\,F(\dot\theta_d)",
    source=("slotine1991",),
    example={"gain": 0.9, "rate": 100.0, "slope": 60.0},
    State=State,
    check=check,
    holds_friction=True,
    adapts=True,
)  # fmt: skip
