"""Coulomb with viscous friction: F = F_C sign(v) + sigma2 v.

Thesis eqs. 2.1, 2.3 and 3.19 (Table 2). At rest the contact withstands F_C; called with the velocity known, as
a compensator is, it returns 0 there, which is sign(0) of eq. 2.2.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Elements, Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous


class Params(NamedTuple):
    """Parameters besides the viscous part's, thesis Table 2."""

    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", lower=0.0, directional=True)]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 3.19."""
    if v > 0.0:
        return p.fc + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - p.fc
    return 0.0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory."""
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return steady(v, p)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood at rest, N·m."""
    return p.fc


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


def modes(p: Any) -> Elements:
    """One rigid element that slips at F_C at once."""
    inf = float("inf")
    return Elements((inf,), (1.0,), inf, p.sigma2, p.fc, 0.0, constant_curve=True)


LAW = Law(
    "coulomb",
    Params,
    step,
    title="Coulomb with viscous friction",
    equation=r"F = F_C\,\mathrm{sign}(v) + \sigma_2 v",
    source=("thesis eq. 3.19", "armstrong1994"),
    example={"fc": 0.285, "sigma2": 0.018},  # thesis Table 2
    rate=rate,
    steady=steady,
    passive="always",
    holding=holding,
    modes=modes,
    choices=(VISCOUS,),
    stored=stored,
    rate_independent=True,
    continuous=False,
)
