"""Model-based feedforward: a friction law runs on the reference velocity; thesis figure 3.3.

Its state depends on time alone. Over a sample the law sees the velocity run from the last reference's to this
one's, or hold this one's.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.laws._seen import LOW_PASS, OVER_SAMPLE, compensation, linear, open_pass
from stickslip.control.linear import Compensation
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


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
    in_1: Annotated[float, Par("rad/s", "", "low-pass: input one sample ago")]
    in_2: Annotated[float, Par("rad/s", "", "low-pass: input two samples ago")]
    out_1: Annotated[float, Par("rad/s", "", "low-pass: output one sample ago")]
    out_2: Annotated[float, Par("rad/s", "", "low-pass: output two samples ago")]


low_passed = open_pass
over_sample = linear


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m. A reference at rest stays at rest, however far the law looks ahead."""
    now = y.reference_velocity
    if z.running != 0.0 and y.started != 0.0 and now != 0.0:
        now = now + p.lead * (now - z.reference_velocity) / y.elapsed
    z.reference_velocity = y.reference_velocity
    now = low_passed(now, y, z, p)
    if abs(now) < p.deadband:
        now = 0.0
    last = z.seen
    z.seen = now
    torque = p.gain * over_sample(last, now, y, z, p, u)
    z.running = 1.0
    return torque


def continuous(p: Any) -> Compensation | str:
    """The same in continuous time."""
    return compensation("reference", p)


CONTROL_LAW = ControlLaw(
    "friction_feedforward", Params, sample, "feedforward",
    title="Friction feedforward",
    equation=r"T = g F(\dot\theta_d)",
    source=("thesis figure 3.3",),
    example={"gain": 0.9},
    State=State,
    continuous=continuous,
    holds_friction=True,
    choices=(OVER_SAMPLE, LOW_PASS),
)  # fmt: skip
