"""Numbers of the plain inverse dynamics by the names of an axis's estimates."""

from __future__ import annotations

import math

from stickslip.binding import NEGATIVE
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.number import QUANTILE

PLAIN = {"inertia": "inertia", "fc": "fc", "sigma2": "fv", "offset": "offset"}
"""Numbers of a model in which its torque is linear, and their names in the plain inverse dynamics."""


def plain_value(name: str, inverse: InverseDynamics | None) -> tuple[float, float] | None:
    """Value and half-width of the plain inverse dynamics, where it has that number."""
    own = PLAIN.get(name, "")
    if inverse is None or not inverse.has(own):
        return None
    return inverse[own], QUANTILE * float(inverse.robust_std[inverse.names.index(own)])


def plain_each_way(name: str, inverse: InverseDynamics | None) -> tuple[float, float] | None:
    """The same where friction has parameters of its own in each direction, of which the plain inverse dynamics tells
    inertia and levels: those are Coulomb's torque with the constant one and without it."""
    level, constant = (plain_value(n, inverse) for n in ("fc", "offset"))
    if not name.startswith("fc") or level is None or constant is None:
        return plain_value(name, inverse) if name == "inertia" else None
    side = -1.0 if name.endswith(NEGATIVE) else 1.0
    return level[0] + side * constant[0], math.hypot(level[1], constant[1])
