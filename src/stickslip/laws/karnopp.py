"""Karnopp: below the velocity DV the contact counts as at rest and gives back the applied torque, up to s(0).

Thesis 2.2.3; Karnopp 1985. Outside the band F = s(v) sign(v) + sigma2 v. An axis in the band does not move; its
momentum gathers what the friction does not balance, until it reaches J DV (momentum form). The applied torque F_E
is an input of the law: an engine knows it, a prescribed motion is given it (``u.applied``), a compensator has
none and returns 0 in the band.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE
from stickslip.laws.sliding_curve import stribeck as sliding


class Params(NamedTuple):
    """Parameters besides those of the sliding curve and of the viscous part."""

    dv: Annotated[
        float, Par("rad/s", "DV", "velocity below which the contact counts as at rest", positive=True)
    ]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; 0 in the band, where nothing is applied."""
    if v >= p.dv:
        return sliding(v, p) + viscous(v, p)
    if v <= -p.dv:
        return viscous(v, p) - sliding(v, p)
    return 0.0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory."""
    if abs(v1) < p.dv:
        return min(max(u.applied, -sliding(0.0, p)), sliding(0.0, p))
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return step(v, v, 0.0, z, p, u)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood in the band, N·m."""
    return sliding(0.0, p)


def rest_band(p: Any) -> float:
    """Velocity below which the contact counts as at rest, rad/s."""
    return p.dv


LAW = Law(
    "karnopp",
    Params,
    step,
    title="Karnopp",
    equation=r"F = \begin{cases} \mathrm{sign}(F_E)\,\min(|F_E|, s(0)) & |v| < DV \\"
    r" s(v)\,\mathrm{sign}(v) + \sigma_2 v & \text{otherwise}\end{cases}",
    source=("thesis 2.2.3", "karnopp1985"),
    example={"dv": 1e-3, "fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018},  # thesis Table 1
    rate=rate,
    steady=steady,
    holding=holding,
    rest_band=rest_band,
    passive="nothing is applied in the band (what is applied there may push against the motion)",
    continuous=False,
    choices=(CURVE, VISCOUS),
)
