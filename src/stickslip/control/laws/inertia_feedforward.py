"""The torque that accelerates the inertia along the reference, and a constant torque in addition."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """What is given."""

    inertia: Annotated[float, Par("kg·m²", "J", "inertia", lower=0.0)]
    offset: Annotated[
        float, Par("N·m", "T_0", "constant torque against positive motion, as by gravity", default=0.0)
    ]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    return p.inertia * y.reference_acceleration + p.offset


def accelerating(y: Any, z: Any, p: Any, u: Any) -> float:
    """The part that is no compensation, N·m."""
    return p.inertia * y.reference_acceleration


CONTROL_LAW = ControlLaw(
    "inertia_feedforward", Params, sample, "feedforward",
    title="Inertia feedforward",
    equation=r"T = J \ddot\theta_d + T_0",
    source=("thesis eq. 3.1",),
    example={"inertia": 3.8623e-4},
    accelerating=accelerating,
)  # fmt: skip
