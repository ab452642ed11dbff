"""Dual observer: a LuGre law whose scale, damping and viscous friction are learned, with an observer for each use of z.

LuGre's torque is theta sigma0 z - sigma1 h z + (sigma1 + sigma2) v with h = sigma0 |v| / s(v): the deflection z, which
nobody measures, stands in it twice with unknown factors, so that one observer cannot serve both. Two run,

dz0/dt = v - h z0 + k0 s,  dz1/dt = v - h z1 - k1 h s,  s = de/dt + lambda e,

and the factors follow the gradients: d theta/dt = gamma0 sigma0 z0 s, d sigma1/dt = gamma1 (v - h z1) s,
d sigma2/dt = gamma2 v s. With the measured velocity, in continuous time and with a loop that damps s, the energy
J s^2 / 2 plus the squares of all errors never rises (Tan and Kanellakopoulos 1999; theta alone is the adaptive law of
Canudas de Wit and Lischinsky 1997). In samples the reference velocity is the quieter choice.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Kept, Learned, Option, Par
from stickslip.laws.sliding_curve import CURVE
from stickslip.laws.sliding_curve import stribeck as sliding


class Params(NamedTuple):
    """Parameters besides the sliding curve's: nominal law, pace of observers and factors, bounds."""

    sigma0: Annotated[float, Par("N·m/rad", "sigma_0", "nominal stiffness of the bristle", positive=True)]
    sigma1: Annotated[
        float, Par("N·m·s/rad", "sigma_1", "micro-viscous damping at the start", lower=0.0, default=0.0)
    ]
    sigma2: Annotated[
        float, Par("N·m·s/rad", "sigma_2", "viscous friction at the start", lower=0.0, default=0.0)
    ]
    slope: Annotated[float, Par("1/s", "lambda", "weight of the position error in s", positive=True)]
    k0: Annotated[float, Par("-", "k_0", "correction of the first observer", lower=0.0, default=0.0)]
    k1: Annotated[float, Par("s", "k_1", "correction of the second", lower=0.0, default=0.0)]
    rate0: Annotated[float, Par("1/(N·m·rad)", "gamma_0", "how fast the scale is learnt", lower=0.0)]
    rate1: Annotated[
        float, Par("N·m·s²/rad³", "gamma_1", "how fast the damping is learnt", lower=0.0, default=0.0)
    ]
    rate2: Annotated[
        float, Par("N·m·s²/rad³", "gamma_2", "how fast viscous friction is learnt", lower=0.0, default=0.0)
    ]
    highest: Annotated[float, Par("-", "", "largest scale", lower=1.0, default=2.0)]
    most1: Annotated[float, Par("N·m·s/rad", "", "largest damping", lower=0.0, default=1.0)]
    most2: Annotated[float, Par("N·m·s/rad", "", "largest viscous friction", lower=0.0, default=1.0)]


class State(NamedTuple):
    """Internal state."""

    z0: Annotated[float, Par("rad", "z_0", "deflection of the first observer")]
    z1: Annotated[float, Par("rad", "z_1", "deflection of the second")]
    scale: Annotated[
        float, Learned("-", "theta", "stiffness, and with it the sliding curve, over the nominal one")
    ]
    damping: Annotated[float, Learned("N·m·s/rad", "sigma_1", "micro-viscous damping")]
    viscous: Annotated[float, Learned("N·m·s/rad", "sigma_2", "viscous friction")]
    known: Annotated[float, Kept("-", "", "1 once there are factors")]


def reference(y: Any) -> float:
    """The reference's velocity, rad/s."""
    return y.reference_velocity


def measured(y: Any) -> float:
    """The measured velocity, rad/s."""
    return y.velocity


VELOCITY = Choice(
    "velocity",
    "velocity_of",
    {"reference": Option(reference), "measured": Option(measured)},
    "reference",
    "velocity on which the bristles run",
)
velocity_of = reference


def start(z: Any, p: Any) -> None:
    """The factors at the start, within their bounds."""
    z.scale = 1.0
    z.damping = min(p.sigma1, p.most1)
    z.viscous = min(p.sigma2, p.most2)
    z.known = 1.0


def learn(v: float, h: float, s: float, y: Any, z: Any, p: Any) -> None:
    """The next factors."""
    scale = z.scale + y.elapsed * p.rate0 * p.sigma0 * z.z0 * s
    z.scale = min(max(scale, 0.0), p.highest)
    damping = z.damping + y.elapsed * p.rate1 * (v - h * z.z1) * s
    z.damping = min(max(damping, 0.0), p.most1)
    viscous = z.viscous + y.elapsed * p.rate2 * v * s
    z.viscous = min(max(viscous, 0.0), p.most2)


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m; the velocity holds over the sample, and nothing is learnt while the reference rests."""
    if z.known == 0.0:
        start(z, p)
    v = velocity_of(y)
    s = y.reference_velocity - y.velocity + p.slope * y.error
    h = p.sigma0 * abs(v) / sliding(v, p)
    relaxed = h * y.elapsed
    share = 1.0
    if relaxed >= 1e-9:
        share = -math.expm1(-relaxed) / relaxed
    if y.reference_velocity == 0.0:
        s = 0.0
    largest = sliding(0.0, p) / p.sigma0
    kept = math.exp(-relaxed)
    z.z0 = min(max(z.z0 * kept + (v + p.k0 * s) * y.elapsed * share, -largest), largest)
    z.z1 = min(max(z.z1 * kept + (v - p.k1 * h * s) * y.elapsed * share, -largest), largest)
    learn(v, h, s, y, z, p)
    return z.scale * p.sigma0 * z.z0 + z.damping * (v - h * z.z1) + z.viscous * v


CONTROL_LAW = ControlLaw(
    "dual_observer", Params, sample, "observer",
    title="Dual observer (adaptive LuGre)",
    equation=r"T = \theta\sigma_0 z_0 + \hat\sigma_1 (v - h z_1) + \hat\sigma_2 v,\quad "
    r"\dot z_0 = v - h z_0 + k_0 s,\quad \dot z_1 = v - h z_1 - k_1 h s",
    source=("tan1999", "canudas1997"),
    example={
        "sigma0": 3.5e4, "sigma1": 0.0, "sigma2": 0.018, "slope": 62.83, "rate0": 100.0, "fs": 0.335, "fc": 0.285,
        "vs": 0.01,
    },
    State=State,
    choices=(CURVE, VELOCITY),
    adapts=True,
)  # fmt: skip
