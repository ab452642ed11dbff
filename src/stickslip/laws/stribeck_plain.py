"""Stribeck friction as it is, with its jump at zero velocity: F = s(v) sign(v) + sigma2 v.

Thesis eq. 2.6 (Figure 2.6) with the sliding curve of eq. 2.10, or any other. At rest the contact withstands s(0); law
``stribeck`` replaces the jump by a steep slope.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from stickslip.core.spec import Law
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE
from stickslip.laws.sliding_curve import stribeck as sliding


class Params(NamedTuple):
    """Nothing besides the parameters of the sliding curve and of the viscous part."""


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 2.6. 0 at rest, where nothing is applied."""
    if v > 0.0:
        return sliding(v, p) + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - sliding(v, p)
    return 0.0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory. At rest the applied one, up to s(0)."""
    if v1 == 0.0:
        return min(max(u.applied, -sliding(0.0, p)), sliding(0.0, p))
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return step(v, v, 0.0, z, p, u)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood at rest, N·m."""
    return sliding(0.0, p)


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


LAW = Law(
    "stribeck_plain",
    Params,
    step,
    title="Stribeck friction with its jump at rest",
    equation=r"F = \mathrm{sign}(v)\left(F_C + (F_S - F_C)e^{-|v/v_s|^{\delta_s}}\right) + \sigma_2 v",
    source=("thesis eq. 2.6", "armstrong1994"),
    example={"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018},  # thesis Table 1
    rate=rate,
    steady=steady,
    holding=holding,
    stored=stored,
    passive="always",
    continuous=False,
    choices=(CURVE, VISCOUS),
)
