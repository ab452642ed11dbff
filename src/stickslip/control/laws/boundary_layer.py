"""Sliding mode of first order with a boundary layer, inside which it is a stiff PD."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """Surface and layer. Torque over layer is a gain on the velocity error, bounded by sample time and delay."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    slope: Annotated[float, Par("1/s", "lambda", "slope of the sliding surface", positive=True)]
    torque: Annotated[float, Par("N·m", "K", "switching torque, larger than the friction", positive=True)]
    layer: Annotated[float, Par("rad/s", "varphi", "half the width of the boundary layer", positive=True)]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    rate = y.reference_velocity - y.velocity
    s = rate + p.slope * y.error
    return p.inertia * p.slope * rate + p.torque * min(max(s / p.layer, -1.0), 1.0)


CONTROL_LAW = ControlLaw(
    "boundary_layer", Params, sample, "loop",
    title="Sliding mode with a boundary layer",
    equation=r"T = J_n \lambda \dot e + K\,\mathrm{sat}(s/\varphi),\quad s = \dot e + \lambda e",
    source=("slotine1991",),
    example={"inertia": 3.8623e-4, "slope": 62.83, "torque": 0.45, "layer": 0.5},
)  # fmt: skip
