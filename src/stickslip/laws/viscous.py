"""Viscous friction alone: F = sigma2 v (thesis eq. 2.3), or F = F_v2 |v|^delta sign(v) (eq. 2.4).

Figure 2.4 b. The nonlinear form is the choice ``viscous = "power"`` with sigma2 = 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from stickslip.core.spec import Law
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous


class Params(NamedTuple):
    """Nothing besides the viscous part's parameters."""


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    return viscous(v, p)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory."""
    return viscous(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return viscous(v, p)


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


LAW = Law(
    "viscous",
    Params,
    step,
    title="Viscous friction",
    equation=r"F = \sigma_2 v",
    source=("thesis eqs. 2.3, 2.4", "armstrong1994"),
    example={"sigma2": 0.018},  # thesis Table 2
    rate=rate,
    steady=steady,
    stored=stored,
    passive="always",
    choices=(VISCOUS,),
)
