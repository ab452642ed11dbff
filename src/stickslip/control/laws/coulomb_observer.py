"""Coulomb observer of Friedland and Park: the level of friction, learnt while the axis slides.

It is a disturbance observer that takes the sign of the velocity for known. At rest it keeps its level and learns
nothing.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Learned, Option, Par


class Params(NamedTuple):
    """Nominal machine, how fast it learns, and where."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    sigma2: Annotated[
        float, Par("N·m·s/rad", "sigma_2", "viscous friction, given besides", lower=0.0, default=0.0)
    ]
    corner: Annotated[float, Par("1/s", "g", "how fast the level is learnt", positive=True)]
    deadband: Annotated[float, Par("rad/s", "v_db", "speed up to which nothing is learnt", lower=0.0)]
    smooth: Annotated[
        float, Par("rad/s", "v_eps", "speed up to which the torque rises to the level", positive=True)
    ]
    largest: Annotated[float, Par("N·m", "a_max", "largest level", positive=True)]


class State(NamedTuple):
    """Internal state."""

    level: Annotated[float, Learned("N·m", "a", "level of friction")]
    velocity: Annotated[float, Par("rad/s", "v", "velocity one sample ago")]


def reference(y: Any) -> float:
    """The reference's velocity, rad/s."""
    return y.reference_velocity


def measured(y: Any) -> float:
    """The measured velocity through the slow low-pass, rad/s."""
    return y.slow_velocity


DIRECTION = Choice(
    "direction",
    "driven",
    {"reference": Option(reference), "measured": Option(measured)},
    "reference",
    "the velocity along which the level is given",
)
driven = reference


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    raw = y.residual - p.inertia * (y.velocity - z.velocity) / y.elapsed
    z.velocity = y.velocity
    slow = y.slow_velocity
    if abs(slow) > p.deadband:
        told = math.copysign(1.0, slow) * (raw - p.sigma2 * slow)
        z.level += (1.0 - math.exp(-p.corner * y.elapsed)) * (told - z.level)
        z.level = min(max(z.level, 0.0), p.largest)
    v = driven(y)
    return z.level * min(max(v / p.smooth, -1.0), 1.0) + p.sigma2 * v


CONTROL_LAW = ControlLaw(
    "coulomb_observer", Params, sample, "observer",
    title="Coulomb observer",
    equation=r"\dot a = g(\mathrm{sgn}(v)(T_m - J \dot v - \sigma_2 v) - a),\ T = a\,\mathrm{sat}(v/v_e) + \sigma_2 v",
    source=("friedland1992",),
    example={
        "inertia": 3.8623e-4, "sigma2": 0.018, "corner": 200.0, "deadband": 0.01, "smooth": 1e-3, "largest": 0.6,
    },
    State=State,
    choices=(DIRECTION,),
)  # fmt: skip
