"""Feedforward whose Coulomb torque, viscous friction and offset are learnt by least squares while the axis slides.

Recursive least squares with forgetting on the torque that a disturbance observer sees; the regressors pass through
the same low-pass, so that its lag does not bias them. Near a reversal, at rest and at the torque limit nothing is
learnt, and the trace of the covariance is bounded: without either, it wanders and ends in no number within an hour.
Coulomb torque and offset cannot be distinguished before the first reversal.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw, friction
from stickslip.core.spec import Kept, Learned, Par

FULL = 0.999
"""Of the largest trace: a covariance that has been cut back tells nothing."""


class Params(NamedTuple):
    """Nominal machine, how fast it forgets, and within what it learns."""

    inertia: Annotated[float, Par("kg·m²", "J_n", "nominal inertia", positive=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque of the law", positive=True)]
    sigma2: Annotated[float, Par("N·m·s/rad", "sigma_2", "viscous friction of the law", positive=True)]
    gain: Annotated[
        float,
        Par("-", "g", "factor on the torque without its offset; 1 compensates all", lower=0.0, default=1.0),
    ]
    corner: Annotated[float, Par("1/s", "g_A", "corner of the disturbance observer", positive=True)]
    forgetting: Annotated[
        float, Par("-", "", "weight of a sample one sample later", positive=True, upper=1.0, default=0.999)
    ]
    speed: Annotated[
        float, Par("rad/s", "v_0", "speed by which the viscous regressor is divided", positive=True)
    ]
    slowest: Annotated[float, Par("rad/s", "v_g", "speed up to which nothing is learnt", lower=0.0)]
    trace: Annotated[float, Par("-", "", "largest trace of the covariance", positive=True, default=3.0)]
    lowest: Annotated[
        float, Par("-", "", "smallest Coulomb torque, over that of the law", positive=True, default=0.3)
    ]
    highest: Annotated[
        float, Par("-", "", "largest Coulomb torque, over that of the law", positive=True, default=2.0)
    ]
    most_viscous: Annotated[
        float, Par("-", "", "largest viscous friction, over that of the law", positive=True, default=5.0)
    ]
    most_offset: Annotated[
        float, Par("-", "", "largest offset, over the law's Coulomb torque", lower=0.0, default=0.3)
    ]


class State(NamedTuple):
    """Internal state."""

    coulomb: Annotated[float, Learned("N·m", "F_C", "Coulomb torque")]
    viscous: Annotated[float, Learned("N·m", "", "viscous torque at the speed v_0")]
    offset: Annotated[float, Learned("N·m", "", "torque that does not depend on the direction")]
    p11: Annotated[float, Kept("-", "P_11", "covariance of the Coulomb torque")]
    p12: Annotated[float, Kept("-", "P_12", "of Coulomb and viscous torque")]
    p13: Annotated[float, Kept("-", "P_13", "of Coulomb torque and offset")]
    p22: Annotated[float, Kept("-", "P_22", "of the viscous torque")]
    p23: Annotated[float, Kept("-", "P_23", "of viscous torque and offset")]
    p33: Annotated[float, Kept("-", "P_33", "of the offset")]
    variance: Annotated[float, Kept("N²·m²", "", "mean square of the torque left over")]
    known: Annotated[float, Kept("-", "", "1 once there are values")]
    disturbance: Annotated[float, Par("N·m", "d_A", "observed friction torque")]
    direction: Annotated[float, Par("-", "", "direction through the low-pass")]
    pace: Annotated[float, Par("-", "", "velocity over v_0 through the low-pass")]
    ones: Annotated[float, Par("-", "", "1 through the low-pass")]
    velocity: Annotated[float, Par("rad/s", "v", "velocity one sample ago")]


def slides(y: Any, p: Any) -> float:
    """1 where reference and axis slide in one direction below the torque limit."""
    fast = min(abs(y.reference_velocity), abs(y.slow_velocity))
    if fast > p.slowest and y.reference_velocity * y.slow_velocity > 0.0 and abs(y.applied) < y.torque_limit:
        return 1.0
    return 0.0


def begin(z: Any, p: Any) -> None:
    """The values of the law, and nothing known of how good they are."""
    z.coulomb = p.fc
    z.viscous = p.sigma2 * p.speed
    z.p11 = 1.0
    z.p22 = 1.0
    z.p33 = 1.0
    z.known = 1.0


def observe(y: Any, z: Any, p: Any) -> None:
    """The friction torque and the regressors through one low-pass."""
    raw = y.applied - p.inertia * (y.velocity - z.velocity) / y.elapsed
    z.velocity = y.velocity
    weight = 1.0 - math.exp(-p.corner * y.elapsed)
    direction = 0.0
    if y.reference_velocity != 0.0:
        direction = math.copysign(1.0, y.reference_velocity)
    z.disturbance += weight * (raw - z.disturbance)
    z.direction += weight * (direction - z.direction)
    z.pace += weight * (y.velocity / p.speed - z.pace)
    z.ones += weight * (1.0 - z.ones)


def bounded(z: Any, p: Any) -> None:
    """Values within their bounds, the covariance within its trace."""
    z.coulomb = min(max(z.coulomb, p.lowest * p.fc), p.highest * p.fc)
    z.viscous = min(max(z.viscous, 0.0), p.most_viscous * p.sigma2 * p.speed)
    z.offset = min(max(z.offset, -p.most_offset * p.fc), p.most_offset * p.fc)
    trace = z.p11 + z.p22 + z.p33
    if trace > p.trace:
        smaller = p.trace / trace
        z.p11 *= smaller
        z.p12 *= smaller
        z.p13 *= smaller
        z.p22 *= smaller
        z.p23 *= smaller
        z.p33 *= smaller


def learn(y: Any, z: Any, p: Any) -> None:
    """One step of recursive least squares."""
    g1 = z.p11 * z.direction + z.p12 * z.pace + z.p13 * z.ones
    g2 = z.p12 * z.direction + z.p22 * z.pace + z.p23 * z.ones
    g3 = z.p13 * z.direction + z.p23 * z.pace + z.p33 * z.ones
    whole = p.forgetting + z.direction * g1 + z.pace * g2 + z.ones * g3
    left = z.disturbance - (z.direction * z.coulomb + z.pace * z.viscous + z.ones * z.offset)
    z.coulomb += g1 / whole * left
    z.viscous += g2 / whole * left
    z.offset += g3 / whole * left
    z.p11 = (z.p11 - g1 * g1 / whole) / p.forgetting
    z.p12 = (z.p12 - g1 * g2 / whole) / p.forgetting
    z.p13 = (z.p13 - g1 * g3 / whole) / p.forgetting
    z.p22 = (z.p22 - g2 * g2 / whole) / p.forgetting
    z.p23 = (z.p23 - g2 * g3 / whole) / p.forgetting
    z.p33 = (z.p33 - g3 * g3 / whole) / p.forgetting
    most = y.torque_limit * y.torque_limit
    z.variance += (1.0 - p.forgetting) * (min(left * left, most) - z.variance)
    bounded(z, p)


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque by the values that the last sample left, N·m; the reference velocity holds over the sample."""
    if z.known == 0.0:
        begin(z, p)
    v = y.reference_velocity
    torque = friction(v, v, y.elapsed, z.friction, p.friction, u) - p.sigma2 * v
    given = p.gain * (z.coulomb / p.fc * torque + z.viscous / p.speed * v) + z.offset
    observe(y, z, p)
    if slides(y, p) != 0.0:
        learn(y, z, p)
    return given


def deviation(value: float, lowest: float, highest: float, p_ii: float, z: Any, p: Any, time: float) -> float:
    """By the covariance, where it and the value are within their bounds: of white noise that has passed the low-pass.

    Neighbouring residuals are alike; the weights of old ones are in P once, and squared in the error.
    """
    if z.variance <= 0.0 or z.p11 + z.p22 + z.p33 >= FULL * p.trace or value <= lowest or value >= highest:
        return -1.0
    alike = math.exp(-p.corner * time)
    one = z.variance * (1.0 + alike) / (1.0 - alike) / (1.0 + p.forgetting)
    return math.sqrt(one * max(p_ii, 0.0))


def deviation_of_coulomb(z: Any, p: Any, sample_time: float) -> float:
    """Standard deviation of the Coulomb torque, N·m; -1 where it is not told."""
    return deviation(z.coulomb, p.lowest * p.fc, p.highest * p.fc, z.p11, z, p, sample_time)


def deviation_of_viscous(z: Any, p: Any, sample_time: float) -> float:
    """Standard deviation of the viscous torque at the speed v_0, N·m; -1 where it is not told."""
    return deviation(z.viscous, 0.0, p.most_viscous * p.sigma2 * p.speed, z.p22, z, p, sample_time)


def deviation_of_offset(z: Any, p: Any, sample_time: float) -> float:
    """Standard deviation of the offset, N·m; -1 where it is not told."""
    return deviation(z.offset, -p.most_offset * p.fc, p.most_offset * p.fc, z.p33, z, p, sample_time)


CONTROL_LAW = ControlLaw(
    "least_squares_feedforward", Params, sample, "feedforward",
    title="Feedforward with recursive least squares",
    equation=r"T = g\left(\frac{\hat F_C}{F_C}(F(\dot\theta_d) - \sigma_2 \dot\theta_d) + "
    r"\hat\sigma_2 \dot\theta_d\right) + \hat T_0",
    source=("astrom1995adaptive",),
    example={
        "inertia": 3.8623e-4, "fc": 0.285, "sigma2": 0.018, "gain": 0.9, "corner": 200.0, "speed": 0.1,
        "slowest": 0.015,
    },
    State=State,
    holds_friction=True,
    adapts=True,
    deviations={
        "coulomb": deviation_of_coulomb, "viscous": deviation_of_viscous, "offset": deviation_of_offset,
    },
)  # fmt: skip
