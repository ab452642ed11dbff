"""Sliding curves s(v): the torque at constant velocity, without its linear viscous part.

A law that slides calls its curve ``sliding(v, p)``; which one that is, is a choice of the law, and the curve
brings its own parameters along. s is positive; the law supplies the sign.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.spec import Choice, Option, Par

__all__ = ["CURVE", "Stribeck", "check_levels", "stribeck"]


class Stribeck(NamedTuple):
    """Parameters of the Stribeck curve, thesis eq. 2.10."""

    fs: Annotated[float, Par("N·m", "F_S", "static (break-away) torque", positive=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True)]
    vs: Annotated[float, Par("rad/s", "v_s", "Stribeck velocity", positive=True)]
    delta_s: Annotated[
        float, Par("-", "delta_s", "Stribeck shape factor", positive=True, upper=20.0, default=2.0)
    ]


def stribeck(v: float, p: Any) -> float:
    """s(v) = F_C + (F_S - F_C) exp(-|v/v_s|^delta_s), N·m; thesis eq. 2.10."""
    x = abs(v / p.vs)
    if p.delta_s == 2.0:
        return p.fc + (p.fs - p.fc) * math.exp(-x * x)
    return p.fc + (p.fs - p.fc) * math.exp(-(x**p.delta_s))


def check_levels(p: Any) -> str:
    """Static torque must not lie below Coulomb torque."""
    if p.fs < p.fc:
        return f"fs = {p.fs:g} N·m lies below fc = {p.fc:g} N·m; static torque is at least Coulomb torque"
    return ""


CURVE = Choice(
    "curve", replaces="sliding", options={"stribeck": Option(stribeck, Stribeck)}, default="stribeck"
)
