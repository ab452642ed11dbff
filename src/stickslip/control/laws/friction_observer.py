"""Friction observer: a friction law runs on the velocity through a slow low-pass, corrected by the position error.

With the correction its force does not drift from what the loop needs; without, it is a late feedback.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw, friction
from stickslip.core.spec import Par


class Params(NamedTuple):
    """How much of the friction is compensated, and how the error corrects it."""

    gain: Annotated[
        float,
        Par("-", "g", "factor on the law's torque; 1 compensates the whole model", lower=0.0, default=1.0),
    ]
    correction: Annotated[
        float, Par("1/s", "k", "velocity that the law sees besides, over the position error", lower=0.0)
    ]
    sigma2: Annotated[
        float,
        Par(
            "N·m·s/rad",
            "sigma_2",
            "the law's viscous friction, which is not corrected",
            lower=0.0,
            default=0.0,
        ),
    ]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; the velocity holds over the sample."""
    besides = p.correction * y.error
    seen = y.slow_velocity + besides
    return p.gain * (friction(seen, seen, y.elapsed, z.friction, p.friction, u) - p.sigma2 * besides)


CONTROL_LAW = ControlLaw(
    "friction_observer", Params, sample, "observer",
    title="Friction observer",
    equation=r"T = g F(v_f + k e)",
    source=("canudas1995",),
    example={"gain": 0.9, "correction": 1.0},
    holds_friction=True,
)  # fmt: skip
