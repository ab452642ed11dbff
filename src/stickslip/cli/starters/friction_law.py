"""Smoothed Coulomb friction: F = F_C tanh(v / v_t) + sigma2 v. A law to begin from.

Save it as NAME.py, give the law that name at the end, and try it: `stickslip law NAME.py --check`. Use it wherever a
law is named: ss.Model("NAME.py", fc=0.3, vt=1e-3), law = "NAME.py" in a TOML file.

Functions are plain Python with numbers, `if`, `for i in range(n)` and functions of `math` (the scalar subset). A law
reads its parameters, and writes its state `z` and local names alone. What every function is called with:
help("stickslip.core.spec"); more, laws with memory too, in docs/howto/own_law.md and CONTRIBUTING.md in the source of
the package.
"""

import math
from typing import Annotated, Any, NamedTuple

from stickslip import Law, Par


class Params(NamedTuple):
    """Unit, symbol, meaning and bounds of every parameter."""

    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True)]
    vt: Annotated[float, Par("rad/s", "v_t", "velocity over which the sign is smoothed", positive=True)]
    sigma2: Annotated[
        float, Par("N·m·s/rad", "sigma_2", "viscous friction coefficient", lower=0.0, default=0.0)
    ]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m."""
    return p.fc * math.tanh(v / p.vt) + p.sigma2 * v


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of a step of dt seconds from velocity v0 to v1, rad/s; N·m."""
    return steady(v1, p)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; a law with a state writes its rate into dz."""
    return steady(v, p)


LAW = Law(
    "friction_law",
    Params,
    step,
    title="Smoothed Coulomb friction",
    equation=r"F = F_C \tanh(v/v_t) + \sigma_2 v",
    source=(),
    example={"fc": 0.285, "vt": 1e-3, "sigma2": 0.018},
    rate=rate,
    steady=steady,
    passive="always",
    velocity_scale=lambda p: p.vt,
)
