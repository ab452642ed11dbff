"""The viscous part of a law: what it adds to its sliding curve, ``viscous(v, p)``.

Kept apart from the sliding curve: bristles and elements do not carry it.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Choice, Option, Par


class Linear(NamedTuple):
    """Parameter of linear viscous friction, thesis eq. 2.3."""

    sigma2: Annotated[
        float,
        Par(
            "N·m·s/rad",
            "sigma_2",
            "viscous friction coefficient",
            lower=0.0,
            default=0.0,
            directional=True,
        ),
    ]


def linear(v: float, p: Any) -> float:
    """sigma_2 v, N·m; thesis eq. 2.3."""
    return p.sigma2 * v


class Power(NamedTuple):
    """Parameters of nonlinear viscous friction, thesis eqs. 2.4, 4.4 and 4.5.

    sigma2 may be negative here: the fit of thesis Table 10 is, and the sum of both terms counts.
    """

    sigma2: Annotated[
        float, Par("N·m·s/rad", "sigma_2", "linear viscous coefficient", default=0.0, directional=True)
    ]
    fv2: Annotated[
        float,
        Par("N·m·(s/rad)^δ", "F_v2", "nonlinear viscous coefficient", lower=0.0, directional=True),
    ]
    delta_v: Annotated[
        float,
        Par("-", "delta", "viscous shape factor", positive=True, upper=20.0, default=2.0, directional=True),
    ]


def power(v: float, p: Any) -> float:
    """sigma_2 v + F_v2 |v|^delta sign(v), N·m; thesis eq. 2.4 beside 2.3, and the viscous terms of 4.4 and 4.5."""
    if v < 0.0:
        return p.sigma2 * v - p.fv2 * (-v) ** p.delta_v
    return p.sigma2 * v + p.fv2 * v**p.delta_v


VISCOUS = Choice(
    "viscous",
    replaces="viscous",
    options={
        "linear": Option(linear, Linear),
        "power": Option(
            power, Power, example={"fv2": 0.01, "delta_v": 1.5}, passive=False, keeps_elements=False
        ),
    },
    default="linear",
    meaning="viscous friction: thesis eqs. 2.3, 2.4 (with 2.3 beside it, as in 4.4 and 4.5)",
)
