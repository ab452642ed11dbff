"""Model-based feedback: a friction law runs on the velocity of the controller's estimator; thesis figure 3.4."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.control.laws._seen import LOW_PASS, OVER_SAMPLE, Seen, compensation, linear, open_pass
from stickslip.control.linear import Compensation
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par


class Params(NamedTuple):
    """How much of the friction is compensated."""

    gain: Annotated[
        float,
        Par("-", "g", "factor on the law's torque; 1 compensates the whole model", lower=0.0, default=1.0),
    ]
    deadband: Annotated[
        float, Par("rad/s", "", "velocity below which the law sees rest", lower=0.0, default=0.0)
    ]


def estimated(y: Any) -> float:
    """The velocity of the controller's estimator, rad/s."""
    return y.velocity


def difference(y: Any) -> float:
    """The difference of the last two measured positions over the time between them, rad/s."""
    return y.moved / y.elapsed


SOURCE = Choice(
    "source",
    "seen_velocity",
    {"estimator": Option(estimated), "difference": Option(difference)},
    "estimator",
    "which velocity the friction law sees",
)
seen_velocity = estimated
low_passed = open_pass
over_sample = linear


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; before its first sample the law has seen nothing."""
    now = low_passed(seen_velocity(y), y, z, p)
    if abs(now) < p.deadband:
        now = 0.0
    last = z.seen
    z.seen = now
    torque = p.gain * over_sample(last, now, y, z, p, u)
    z.running = 1.0
    return torque


def continuous(p: Any) -> Compensation | str:
    """The same in continuous time."""
    return compensation("measured", p)


CONTROL_LAW = ControlLaw(
    "friction_feedback", Params, sample, "observer",
    title="Friction feedback",
    equation=r"T = g F(v)",
    source=("thesis figure 3.4",),
    example={"gain": 0.9},
    State=Seen,
    continuous=continuous,
    holds_friction=True,
    choices=(OVER_SAMPLE, LOW_PASS, SOURCE),
)  # fmt: skip
