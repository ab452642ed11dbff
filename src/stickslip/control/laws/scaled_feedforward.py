"""Feedforward whose friction is scaled by one number that is learnt while the axis slides: load, wear, temperature.

A disturbance observer of its own gives the friction torque; over what the law says at the reference velocity it is the
scale. Near a reversal, at rest and at the torque limit it learns nothing, so that an hour at rest leaves it alone.
Alone it does not move an axis that sticks, and one that sticks teaches nothing: it stands over an integral or a
disturbance observer.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw, friction, friction_steady
from stickslip.core.spec import Kept, Learned, Par


class Params(NamedTuple):
    """Nominal machine, how fast it learns, and within what."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    gain: Annotated[
        float,
        Par("-", "g", "factor on the scaled torque; 1 compensates the whole model", lower=0.0, default=1.0),
    ]
    sigma2: Annotated[
        float,
        Par(
            "N·m·s/rad", "sigma_2", "the law's viscous friction, which is not scaled", lower=0.0, default=0.0
        ),
    ]
    corner: Annotated[float, Par("1/s", "g_A", "corner of the disturbance observer", positive=True)]
    rate: Annotated[float, Par("1/s", "gamma", "how fast the scale is learnt", positive=True)]
    slowest: Annotated[float, Par("rad/s", "v_g", "speed up to which nothing is learnt", lower=0.0)]
    lowest: Annotated[float, Par("-", "", "smallest scale", positive=True, default=0.3)]
    highest: Annotated[float, Par("-", "", "largest scale", positive=True, default=2.0)]


class State(NamedTuple):
    """Internal state."""

    scale: Annotated[float, Learned("-", "theta", "friction over that of the law")]
    variance: Annotated[float, Kept("-", "", "mean square of what the scale is off in a sample")]
    known: Annotated[float, Kept("-", "", "1 once there is a scale")]
    disturbance: Annotated[float, Par("N·m", "d_A", "observed friction torque")]
    velocity: Annotated[float, Par("rad/s", "v", "velocity one sample ago")]
    share: Annotated[float, Par("-", "", "1 - exp(-g_A T), by which the observer moves in a sample")]
    share_at: Annotated[float, Par("-", "g_A T", "corner times sample time that it holds for")]
    pace: Annotated[float, Par("-", "", "1 - exp(-gamma T), by which the scale moves in a sample")]
    pace_at: Annotated[float, Par("-", "gamma T", "rate times sample time that it holds for")]


def slides(y: Any, p: Any) -> float:
    """1 where reference and axis slide in one direction below the torque limit."""
    fast = min(abs(y.reference_velocity), abs(y.slow_velocity))
    if fast > p.slowest and y.reference_velocity * y.slow_velocity > 0.0 and abs(y.applied) < y.torque_limit:
        return 1.0
    return 0.0


def keep_shares(y: Any, z: Any, p: Any) -> None:
    """Compute the two shares where their arguments change: exponentials cost as much as the rest of the law."""
    x = p.corner * y.elapsed
    if x != z.share_at:
        z.share_at = x
        z.share = 1.0 - math.exp(-x)
    x = p.rate * y.elapsed
    if x != z.pace_at:
        z.pace_at = x
        z.pace = 1.0 - math.exp(-x)


def learn(y: Any, z: Any, p: Any) -> None:
    """Observe the friction; move the scale towards what this sample says of it."""
    raw = y.applied - p.inertia * (y.velocity - z.velocity) / y.elapsed
    z.velocity = y.velocity
    keep_shares(y, z, p)
    z.disturbance += z.share * (raw - z.disturbance)
    if slides(y, p) != 0.0:
        expected = abs(friction_steady(y.reference_velocity, p.friction)) - p.sigma2 * abs(
            y.reference_velocity
        )
        if expected > 0.0:
            found = math.copysign(1.0, y.reference_velocity) * (z.disturbance - p.sigma2 * y.slow_velocity)
            off = found / expected - z.scale
            z.scale = min(max(z.scale + z.pace * off, p.lowest), p.highest)
            z.variance += z.pace * (min(off * off, p.highest * p.highest) - z.variance)


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque by the scale that the last sample left, N·m; the reference velocity holds over the sample."""
    if z.known == 0.0:
        z.scale = 1.0
        z.known = 1.0
    v = y.reference_velocity
    viscous = p.sigma2 * v
    torque = friction(v, v, y.elapsed, z.friction, p.friction, u)
    given = p.gain * (z.scale * (torque - viscous) + viscous)
    learn(y, z, p)
    return given


def deviation_of_scale(z: Any, p: Any, sample_time: float) -> float:
    """Standard deviation of the scale, -; -1 where it is not told, as at a bound.

    The scale is a low-pass of what samples say, whose white noise has passed the observer's.
    """
    if z.variance <= 0.0 or z.scale <= p.lowest or z.scale >= p.highest:
        return -1.0
    stays = math.exp(-p.rate * sample_time)
    alike = math.exp(-p.corner * sample_time)
    left = (1.0 - stays) / (1.0 + stays) * (1.0 + stays * alike) / (1.0 - stays * alike)
    return math.sqrt(z.variance * left)


def check(p: Any) -> str:
    """The bounds of the scale hold 1, where it starts."""
    if not p.lowest <= 1.0 <= p.highest:
        return f"lowest = {p.lowest:g} and highest = {p.highest:g} must lie on either side of 1"
    return ""


CONTROL_LAW = ControlLaw(
    "scaled_feedforward", Params, sample, "feedforward",
    title="Feedforward with adapted scale",
    equation=r"T = g\,(\theta\,(F(\dot\theta_d) - \sigma_2 \dot\theta_d) + \sigma_2 \dot\theta_d),\quad "
    r"\dot\theta = \gamma\left(\frac{(d_A - \sigma_2 v)\,\mathrm{sgn}\,\dot\theta_d}{s(\dot\theta_d)} - \theta\right)",
    source=("canudas1997",),
    example={
        "inertia": 3.8623e-4, "gain": 0.9, "sigma2": 0.018, "corner": 200.0, "rate": 5.0, "slowest": 0.015,
    },
    State=State,
    check=check,
    deviations={"scale": deviation_of_scale},
    holds_friction=True,
    adapts=True,
)  # fmt: skip
