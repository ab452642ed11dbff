"""Robust adaptive control of Lee and Kim: a switching torque k_0 + k_1 |v| whose levels grow with the error.

Inside a boundary layer of half width delta nothing is learnt, and (k_0 + k_1 |v|) / delta is a gain on the velocity
error, which sample time and delay bound: what friction leaves there is an error of delta / lambda. The levels only
grow; a leak and bounds, which the paper does not have, hold them.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Kept, Learned, Par


class Params(NamedTuple):
    """Surface, layer, how fast the levels grow and up to where."""

    inertia: Annotated[
        float, Par("kg·m²", "J_n", "nominal inertia, where the learnt one starts", positive=True)
    ]
    slope: Annotated[float, Par("1/s", "lambda", "slope of the sliding surface", positive=True)]
    damping: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the distance to the layer", lower=0.0)]
    layer: Annotated[float, Par("rad/s", "delta", "half the width of the boundary layer", positive=True)]
    inertia_rate: Annotated[
        float, Par("N·m·s⁴/rad³", "eta_1", "how fast the inertia is learnt; 0: not", lower=0.0, default=0.0)
    ]
    level_rate: Annotated[float, Par("N·m/rad", "eta_2", "how fast the level is learnt", lower=0.0)]
    speed_rate: Annotated[
        float, Par("N·m·s²/rad³", "eta_3", "how fast the level's rise with speed is learnt", lower=0.0)
    ]
    leak: Annotated[float, Par("1/s", "l", "how fast the levels are forgotten", lower=0.0, default=0.02)]
    most_inertia: Annotated[float, Par("-", "", "largest inertia, over J_n", positive=True, default=10.0)]
    most_level: Annotated[float, Par("N·m", "", "largest level", positive=True)]
    most_speed: Annotated[float, Par("N·m·s/rad", "", "largest rise of the level with speed", positive=True)]


class State(NamedTuple):
    """Internal state."""

    inertia: Annotated[float, Learned("kg·m²", "m", "inertia")]
    level: Annotated[float, Learned("N·m", "k_0", "level of the switching torque")]
    rise: Annotated[float, Learned("N·m·s/rad", "k_1", "its rise with speed")]
    known: Annotated[float, Kept("-", "", "1 once there is an inertia")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; Lee and Kim's eqs. 8 to 16."""
    if z.known == 0.0:
        z.inertia = p.inertia
        z.known = 1.0
    rate = y.reference_velocity - y.velocity
    s = rate + p.slope * y.error
    inside = min(max(s / p.layer, -1.0), 1.0)
    outside = s - p.layer * inside
    speed = abs(y.velocity)
    virtual_acceleration = y.reference_acceleration + p.slope * rate
    torque = z.inertia * virtual_acceleration + p.damping * outside + (z.level + z.rise * speed) * inside
    kept = math.exp(-p.leak * y.elapsed)
    grown = z.inertia + y.elapsed * p.inertia_rate * outside * virtual_acceleration
    z.inertia = min(max(grown, 0.0), p.most_inertia * p.inertia)
    z.level = min(kept * z.level + y.elapsed * p.level_rate * abs(outside), p.most_level)
    z.rise = min(kept * z.rise + y.elapsed * p.speed_rate * abs(outside) * speed, p.most_speed)
    return torque


CONTROL_LAW = ControlLaw(
    "robust_adaptive", Params, sample, "loop",
    title="Robust adaptive control (Lee and Kim)",
    equation=r"T = m(\ddot\theta_d + \lambda \dot e) + k_d s_\Delta + (k_0 + k_1 |v|)\,\mathrm{sat}(s/\delta),\quad "
    r"s_\Delta = s - \delta\,\mathrm{sat}(s/\delta)",
    source=("leekim1995",),
    example={
        "inertia": 3.8623e-4, "slope": 62.83, "damping": 0.0971, "layer": 0.5, "level_rate": 20.0,
        "speed_rate": 20.0, "most_level": 1.0, "most_speed": 1.0,
    },
    State=State,
    adapts=True,
)  # fmt: skip
