"""Sliding mode with a boundary layer: T = J (a_d + lambda (v_d - v)) + K sat(s / phi), s = (v_d - v) + lambda e."""

from typing import Annotated, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    inertia: Annotated[float, Par("kg·m²", "J", "nominal inertia", positive=True)]
    slope: Annotated[float, Par("1/s", "lambda", "slope of the sliding surface", positive=True)]
    torque: Annotated[float, Par("N·m", "K", "switching torque, larger than the friction", positive=True)]
    layer: Annotated[float, Par("rad/s", "phi", "half the width of the boundary layer", positive=True)]


def sample(y, z, p, u):
    """Torque, N·m."""
    rate = y.reference_velocity - y.velocity
    s = rate + p.slope * y.error
    equivalent = p.inertia * (y.reference_acceleration + p.slope * rate)
    return equivalent + p.torque * min(max(s / p.layer, -1.0), 1.0)


CONTROL_LAW = ControlLaw(
    "sliding_mode", Params, sample, "loop",
    title="Sliding mode with a boundary layer",
    equation=r"T = J (\ddot\theta_d + \lambda \dot e) + K\,\mathrm{sat}(s / \varphi),\quad s = \dot e + \lambda e",
    source=("own",),
    example={"inertia": 3.8623e-4, "slope": 62.8, "torque": 0.45, "layer": 0.5},
)  # fmt: skip
