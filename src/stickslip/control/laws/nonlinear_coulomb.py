"""Nonlinear controller on Coulomb friction: where proportional torque is too small to break away, it is filled up.

A PD sticks where its gain times the error is below break-away. There the torque along the error's sign is raised to one
above break-away; farther away nothing is added. It needs the largest friction and no model of it.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    """Up to which torque, over which gain, and where it begins."""

    torque: Annotated[float, Par("N·m", "T_h", "torque that surely breaks the axis away", positive=True)]
    gain: Annotated[float, Par("N·m/rad", "k_p", "proportional gain of the loop", positive=True)]
    layer: Annotated[
        float,
        Par("rad", "e_l", "error from which it is given whole; torque over it is a gain", positive=True),
    ]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    size = abs(y.error)
    missing = max(p.torque - p.gain * size, 0.0)
    return math.copysign(missing * min(size / p.layer, 1.0), y.error)


CONTROL_LAW = ControlLaw(
    "nonlinear_coulomb", Params, sample, "observer",
    title="Nonlinear Coulomb controller",
    equation=r"T = \mathrm{sat}(e/e_l)\,\max(T_h - k_p |e|, 0)",
    source=("southward1991", "thesis chapter 1"),
    example={"torque": 0.4, "gain": 6.099, "layer": 5e-3},
)  # fmt: skip
