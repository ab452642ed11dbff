"""Stribeck friction with the steep slope through zero velocity: F = k v where |k v| <= |s(v)|, else s(v).

Thesis eq. 3.20 (Table 3) with the sliding curve of eq. 2.10, or any other. The slope makes the law continuous,
so that a contact at rest creeps instead of holding: at a torque T it slides with T/k.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Elements, Law, Par
from stickslip.laws._viscous import VISCOUS
from stickslip.laws._viscous import linear as viscous
from stickslip.laws.sliding_curve import CURVE
from stickslip.laws.sliding_curve import stribeck as sliding
from stickslip.laws.sliding_curve import stribeck_scale as sliding_scale


class Params(NamedTuple):
    """Parameters besides the sliding curve's, thesis Table 3."""

    k: Annotated[float, Par("N·m·s/rad", "k", "steep slope through zero velocity", positive=True)]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m; thesis eq. 3.20."""
    s = sliding(v, p) + viscous(abs(v), p)
    if p.k * abs(v) <= s:
        return p.k * v
    if v > 0.0:
        return s
    return -s


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: the law has no memory."""
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m."""
    return steady(v, p)


def stored(z: Any, p: Any) -> float:
    """Energy that the contact could give back, J: none."""
    return 0.0


def modes(p: Any) -> Elements:
    """One rigid element on the curve, behind the steep slope."""
    inf = float("inf")
    return Elements((inf,), (1.0,), inf, p.sigma2, sliding(0.0, p), sliding_scale(p), slope=p.k)


LAW = Law(
    "stribeck",
    Params,
    step,
    title="Stribeck friction with a steep slope",
    equation=r"F = \begin{cases} k v & |k v| \le |s(v)| \\ s(v) & \text{otherwise}\end{cases},\quad "
    r"s(v) = \mathrm{sign}(v)\left(F_C + (F_S - F_C)e^{-|v/v_s|^{\delta_s}}\right) + \sigma_2 v",
    source=("thesis eq. 3.20", "armstrong1994"),
    example={"k": 3.5e4, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01},  # thesis Table 3
    rate=rate,
    steady=steady,
    stored=stored,
    passive="always",
    modes=modes,
    choices=(CURVE, VISCOUS),
)
