"""Model-based feedforward: a friction law runs on the reference velocity; thesis figure 3.3.

Its state depends on time alone. Over a sample the law sees the velocity run from the last reference's to this
one's, or hold this one's.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control_spec import ControlLaw, friction
from stickslip.spec import Choice, Option, Par

__all__ = ["CONTROL_LAW"]


class Params(NamedTuple):
    """How much of the friction is compensated, and when."""

    gain: Annotated[
        float,
        Par("-", "g", "factor on the law's torque; 1 compensates the whole model", lower=0.0, default=1.0),
    ]
    lead: Annotated[
        float, Par("s", "", "time by which the law looks ahead of the reference", lower=0.0, default=0.0)
    ]
    deadband: Annotated[
        float, Par("rad/s", "", "velocity below which the law sees rest", lower=0.0, default=0.0)
    ]


class State(NamedTuple):
    """Internal state."""

    reference_velocity: Annotated[float, Par("rad/s", "", "reference velocity one sample ago")]
    seen: Annotated[float, Par("rad/s", "", "velocity that the law saw one sample ago")]
    running: Annotated[float, Par("-", "", "1 after its first sample")]


def linear(last: float, now: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The velocity runs linearly over the sample; before its first one the law has seen nothing. N·m."""
    if z.running == 0.0 or y.started == 0.0:
        return friction(now, now, 0.0, z.friction, p.friction, u)
    return friction(last, now, y.elapsed, z.friction, p.friction, u)


def held(last: float, now: float, y: Any, z: Any, p: Any, u: Any) -> float:
    """The velocity of this sample holds over the whole sample, N·m."""
    return friction(now, now, y.elapsed, z.friction, p.friction, u)


VELOCITY = Choice(
    "velocity",
    "over_sample",
    {"linear": Option(linear), "held": Option(held)},
    "linear",
    "how the reference velocity runs over a sample",
)
over_sample = linear


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m. A reference at rest stays at rest, however far the law looks ahead."""
    now = y.reference_velocity
    if z.running != 0.0 and y.started != 0.0 and now != 0.0:
        now = now + p.lead * (now - z.reference_velocity) / y.elapsed
    z.reference_velocity = y.reference_velocity
    if abs(now) < p.deadband:
        now = 0.0
    last = z.seen
    z.seen = now
    torque = p.gain * over_sample(last, now, y, z, p, u)
    z.running = 1.0
    return torque


CONTROL_LAW = ControlLaw(
    "friction_feedforward", Params, sample, "feedforward",
    title="Friction feedforward",
    equation=r"T = g F(\dot\theta_d)",
    source=("thesis figure 3.3",),
    example={"gain": 0.9},
    State=State,
    holds_friction=True,
    choices=(VELOCITY,),
)  # fmt: skip
