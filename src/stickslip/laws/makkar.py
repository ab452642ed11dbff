"""Makkar's smooth Stribeck friction: F = g1 (tanh g2 v - tanh g3 v) + g4 tanh g5 v + sigma2 v.

Continuously differentiable everywhere, for controllers that differentiate friction: g4 is the Coulomb torque, g1 + g4
the static torque nearly reached between 1/g2 and 1/g3, sigma2 (the paper's g6) viscous friction. It withstands nothing
at rest: a loaded axis creeps with a slope of g1 (g2 - g3) + g4 g5 + sigma2 (Makkar et al. 2005, thesis [12]).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous


class Params(NamedTuple):
    """Its parameters but the viscous; g1 (tanh g2 v - tanh g3 v) is the Stribeck effect."""

    gamma1: Annotated[
        float, Par("N·m", "gamma_1", "static minus Coulomb torque", lower=0.0, directional=True)
    ]
    gamma2: Annotated[
        float, Par("s/rad", "gamma_2", "slope of the rise of the Stribeck effect", positive=True)
    ]
    gamma3: Annotated[float, Par("s/rad", "gamma_3", "slope of its fall", positive=True)]
    gamma4: Annotated[float, Par("N·m", "gamma_4", "Coulomb torque", lower=0.0, directional=True)]
    gamma5: Annotated[float, Par("s/rad", "gamma_5", "slope of the Coulomb torque at rest", positive=True)]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    stribeck = p.gamma1 * (math.tanh(p.gamma2 * v) - math.tanh(p.gamma3 * v))
    return stribeck + p.gamma4 * math.tanh(p.gamma5 * v) + viscous(v, p)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory."""
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return steady(v, p)


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


def velocity_scale(p: Any) -> float:
    """Velocity over which the torque changes much, rad/s."""
    return 1.0 / max(p.gamma2, p.gamma5)


def check(p: Any) -> str:
    """The Stribeck effect rises before it falls, or it would drive the axis."""
    if p.gamma2 < p.gamma3:
        return f"gamma2 = {p.gamma2:g} s/rad must be at least gamma3 = {p.gamma3:g} s/rad"
    return ""


LAW = Law(
    "makkar",
    Params,
    step,
    title="Makkar's smooth Stribeck friction",
    equation=r"F = \gamma_1(\tanh\gamma_2 v - \tanh\gamma_3 v) + \gamma_4\tanh\gamma_5 v + \sigma_2 v",
    source=("makkar2005",),
    example={
        "gamma1": 0.05, "gamma2": 1000.0, "gamma3": 100.0, "gamma4": 0.285, "gamma5": 1000.0, "sigma2": 0.018,
    },
    rate=rate,
    steady=steady,
    stored=stored,
    check=check,
    velocity_scale=velocity_scale,
    passive="always",
    choices=(VISCOUS,),
)  # fmt: skip
