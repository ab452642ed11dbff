"""Static with Coulomb and viscous friction: F_S holds at rest, F_C sign(v) + sigma2 v opposes motion.

Thesis eqs. 2.1, 2.3 and 2.5, Figures 2.4 d (sigma2 = 0) and 2.4 e; with fc = 0 stiction alone. At rest the torque is
the applied one up to F_S; it drops to F_C as soon as the contact moves.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous


class Params(NamedTuple):
    """Parameters besides the viscous part's, thesis eqs. 2.1 and 2.5."""

    fs: Annotated[float, Par("N·m", "F_S", "static (break-away) torque", positive=True, directional=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", lower=0.0, directional=True)]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; 0 at rest, where nothing is applied."""
    if v > 0.0:
        return p.fc + viscous(v, p)
    if v < 0.0:
        return viscous(v, p) - p.fc
    return 0.0


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory. At rest that of eq. 2.5."""
    if v1 == 0.0:
        return min(max(u.applied, -p.fs), p.fs)
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return step(v, v, 0.0, z, p, u)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood at rest, N·m."""
    return p.fs


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


def check(p: Any) -> str:
    """A contact that slides with more torque than it holds could not break away."""
    if p.fs < p.fc:
        return f"fs = {p.fs:g} N·m lies below fc = {p.fc:g} N·m; a contact at rest holds at least what sliding takes"
    return ""


LAW = Law(
    "static",
    Params,
    step,
    title="Static with Coulomb and viscous friction",
    equation=r"F = \begin{cases} F_E & v = 0,\ |F_E| < F_S \\ F_S\,\mathrm{sign}(F_E) & v = 0,\ |F_E| \ge F_S \\"
    r" F_C\,\mathrm{sign}(v) + \sigma_2 v & v \ne 0\end{cases}",
    source=("thesis eqs. 2.1, 2.3, 2.5", "armstrong1994"),
    example={"fs": 0.335, "fc": 0.285, "sigma2": 0.018},  # thesis Table 1
    rate=rate,
    steady=steady,
    holding=holding,
    stored=stored,
    check=check,
    passive="always",
    rate_independent=True,
    continuous=False,
    choices=(VISCOUS,),
)
