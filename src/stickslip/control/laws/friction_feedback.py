"""Model-based feedback: a friction law runs on the velocity of the controller's estimator; thesis figure 3.4."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control_spec import ControlLaw, friction
from stickslip.spec import Par

__all__ = ["CONTROL_LAW"]


class Params(NamedTuple):
    """How much of the friction is compensated."""

    gain: Annotated[
        float,
        Par("-", "g", "factor on the law's torque; 1 compensates the whole model", lower=0.0, default=1.0),
    ]
    deadband: Annotated[
        float, Par("rad/s", "", "velocity below which the law sees rest", lower=0.0, default=0.0)
    ]


class State(NamedTuple):
    """Internal state."""

    seen: Annotated[float, Par("rad/s", "", "velocity that the law saw one sample ago")]
    running: Annotated[float, Par("-", "", "1 after its first sample")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; before its first sample the law has seen nothing."""
    now = y.velocity
    if abs(now) < p.deadband:
        now = 0.0
    last = z.seen
    elapsed = y.elapsed
    if z.running == 0.0 or y.started == 0.0:
        last = now
        elapsed = 0.0
    z.seen = now
    z.running = 1.0
    return p.gain * friction(last, now, elapsed, z.friction, p.friction, u)


CONTROL_LAW = ControlLaw(
    "friction_feedback", Params, sample, "observer",
    title="Friction feedback",
    equation=r"T = g F(v)",
    source=("thesis figure 3.4",),
    example={"gain": 0.9},
    State=State,
    holds_friction=True,
)  # fmt: skip
