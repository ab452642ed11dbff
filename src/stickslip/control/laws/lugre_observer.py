"""LuGre observer: a bristle runs on the measured velocity, corrected by the position error.

dz/dt = v + k e - sigma0 |v| z / s(v), and sigma0 z + sigma2 v is given: no delay as of a feedback, but a positive
feedback of the stiffness sigma0 where the contact sticks. It is stable there for gain sigma0 below the contact's own
stiffness only, and one count of the encoder must bend the bristle by much less than F_C / sigma0. sigma1 dz/dt is in
samples the difference of an exactly integrated z, noise with an encoder: it is left out unless sigma1 is given.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par
from stickslip.laws.sliding_curve import CURVE
from stickslip.laws.sliding_curve import stribeck as sliding


class Params(NamedTuple):
    """Parameters besides the sliding curve's."""

    sigma0: Annotated[float, Par("N·m/rad", "sigma_0", "stiffness of the observer's bristle", positive=True)]
    sigma1: Annotated[
        float,
        Par("N·m·s/rad", "sigma_1", "micro-viscous damping; 0 leaves it out", lower=0.0, default=0.0),
    ]
    sigma2: Annotated[float, Par("N·m·s/rad", "sigma_2", "viscous friction", lower=0.0, default=0.0)]
    gain: Annotated[
        float,
        Par("-", "g", "factor on the observed torque; 1 compensates the whole", lower=0.0, default=1.0),
    ]
    correction: Annotated[
        float, Par("1/s", "k", "velocity that the bristle sees besides, over the position error", lower=0.0)
    ]
    most: Annotated[
        float, Par("-", "", "largest deflection, over that at break-away", positive=True, default=1.0)
    ]


class State(NamedTuple):
    """Internal state."""

    z: Annotated[float, Par("rad", "z", "observed deflection of the bristles")]


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; the velocity holds over the sample."""
    seen = y.velocity + p.correction * y.error
    relaxed = p.sigma0 * abs(y.velocity) / sliding(y.velocity, p) * y.elapsed
    share = 1.0
    if relaxed >= 1e-9:
        share = -math.expm1(-relaxed) / relaxed
    largest = p.most * sliding(0.0, p) / p.sigma0
    before = z.z
    z.z = min(max(z.z * math.exp(-relaxed) + seen * y.elapsed * share, -largest), largest)
    damped = p.sigma1 * (z.z - before) / y.elapsed
    return p.gain * (p.sigma0 * z.z + damped + p.sigma2 * y.velocity)


CONTROL_LAW = ControlLaw(
    "lugre_observer", Params, sample, "observer",
    title="LuGre observer",
    equation=r"\dot z = v + k e - \sigma_0 \frac{|v|}{s(v)} z,\quad T = g\,(\sigma_0 z + \sigma_1 \dot z + \sigma_2 v)",
    source=("canudas1995",),
    example={
        "sigma0": 500.0, "sigma2": 0.018, "gain": 1.0, "correction": 1.0, "fs": 0.335, "fc": 0.285, "vs": 0.01,
    },
    State=State,
    choices=(CURVE,),
)  # fmt: skip
