"""Friction learnt as a sum of functions of the reference velocity, by the gradient of the error.

dW_i/dt = Gamma_i (phi_i(v_d) s - sigma_l W_i) with s = de/dt + lambda e; the torque is the sum of W_i phi_i. The
functions are those of Makkar's smooth Stribeck curve, two straight lines a direction, a polynomial, or Gaussians, over
the angle too. While the reference stands still nothing is given and nothing is learnt.

Gamma phi'phi acts like an integral gain on s: what sample time and delay leave of stability bounds it. A leak
(sigma-modification) and a bound hold the weights.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Learned, Option, Par

TURN = 2.0 * math.pi  # rad


class Params(NamedTuple):
    """Pace, leak and bound of the weights."""

    rate: Annotated[
        tuple[float, ...],
        Par("N·m/rad", "Gamma_i", "how fast weight i is learnt, one per function", positive=True),
    ]
    slope: Annotated[float, Par("1/s", "lambda", "weight of the position error in s", positive=True)]
    leak: Annotated[float, Par("rad/(N·m·s)", "sigma_l", "leak of the weights", lower=0.0, default=0.05)]
    largest: Annotated[float, Par("N·m", "", "largest weight", positive=True)]


class State(NamedTuple):
    """Internal state."""

    weight: Annotated[tuple[float, ...], Learned("N·m", "W_i", "weight of function i")]


def learnt(weight: float, rate: float, value: float, s: float, y: Any, p: Any) -> float:
    """The next weight of a function that has that value, N·m."""
    grown = weight + y.elapsed * rate * (value * s - p.leak * weight)
    return min(max(grown, -p.largest), p.largest)


# ---- the functions -----------------------------------------------------------------------------------------------


class Makkar(NamedTuple):
    """Parameters of Makkar's functions."""

    steep: Annotated[
        float, Par("s/rad", "gamma_2", "slope of the rise, and of the sign, at rest", positive=True)
    ]
    wide: Annotated[float, Par("s/rad", "gamma_3", "slope of the fall of the Stribeck effect", positive=True)]
    speed: Annotated[
        float, Par("rad/s", "v_0", "speed by which the viscous function is divided", positive=True)
    ]


def makkar(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Torque by tanh(g2 v) - tanh(g3 v), tanh(g2 v) and v / v0, N·m."""
    torque = 0.0
    for i in range(len(p.rate)):
        value = v / p.speed
        if i == 0:
            value = math.tanh(p.steep * v) - math.tanh(p.wide * v)
        if i == 1:
            value = math.tanh(p.steep * v)
        z.weight[i] = learnt(z.weight[i], p.rate[i], value, s, y, p)
        torque += value * z.weight[i]
    return torque


def three(p: Any) -> str:
    """Makkar's functions are three."""
    return "" if len(p.rate) == 3 else f"rate has {len(p.rate)} values; Makkar's functions are 3"


class Lines(NamedTuple):
    """Parameters of the two lines."""

    corner: Annotated[float, Par("rad/s", "v_c", "speed at which the two lines meet", positive=True)]
    smooth: Annotated[float, Par("rad/s", "v_eps", "speed up to which the level rises", positive=True)]
    speed: Annotated[float, Par("rad/s", "v_0", "speed by which the slope is divided", positive=True)]


def lines(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Torque by level and slope of the line on which v lies, N·m; those of the other lines leak."""
    first = 0
    if abs(v) > p.corner:
        first = 2
    if v < 0.0:
        first = first + 4
    torque = 0.0
    for i in range(len(p.rate)):
        value = 0.0
        if i == first:
            value = min(max(v / p.smooth, -1.0), 1.0)
        if i == first + 1:
            value = v / p.speed
        z.weight[i] = learnt(z.weight[i], p.rate[i], value, s, y, p)
        torque += value * z.weight[i]
    return torque


def eight(p: Any) -> str:
    """Two weights a line, two lines a direction."""
    return "" if len(p.rate) == 8 else f"rate has {len(p.rate)} values; two lines a direction have 8"


class Polynomial(NamedTuple):
    """Parameters of the polynomial."""

    smooth: Annotated[float, Par("rad/s", "v_eps", "speed up to which the level rises", positive=True)]
    top: Annotated[
        float,
        Par("rad/s", "v_0", "speed by which speeds are divided; beyond it the powers hold", positive=True),
    ]


def polynomial(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Torque by sign(v) (|v| / v0)^i, N·m."""
    side = min(max(v / p.smooth, -1.0), 1.0)
    share = min(abs(v) / p.top, 1.0)
    power = 1.0
    torque = 0.0
    for i in range(len(p.rate)):
        value = side * power
        z.weight[i] = learnt(z.weight[i], p.rate[i], value, s, y, p)
        torque += value * z.weight[i]
        power = power * share
    return torque


class Gaussians(NamedTuple):
    """Parameters of the Gaussians."""

    centre: Annotated[
        tuple[float, ...],
        Par("-", "c_i", "centre of Gaussian i, on an axis from -1 to 1", lower=-2.0, upper=2.0),
    ]
    width: Annotated[float, Par("-", "", "width of the Gaussians on that axis", positive=True)]
    fine: Annotated[
        float,
        Par("rad/s", "v_0", "speed up to which the axis is linear; above it is logarithmic", positive=True),
    ]
    top: Annotated[float, Par("rad/s", "", "speed that lies at 1 on the axis", positive=True)]


def arsinh(x: float) -> float:
    """The inverse of sinh, exact near 0."""
    size = abs(x)
    return math.copysign(math.log1p(size + size * size / (1.0 + math.sqrt(1.0 + size * size))), x)


def gaussians(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Torque by Gaussians of the logarithm of the velocity, N·m."""
    place = arsinh(v / p.fine) / arsinh(p.top / p.fine)
    torque = 0.0
    for i in range(len(p.rate)):
        off = (place - p.centre[i]) / p.width
        value = math.exp(-off * off)
        z.weight[i] = learnt(z.weight[i], p.rate[i], value, s, y, p)
        torque += value * z.weight[i]
    return torque


class OverAngle(NamedTuple):
    """Parameters of the Gaussians besides those over the velocity."""

    centre: Annotated[
        tuple[float, ...],
        Par("-", "c_i", "centre of Gaussian i over the velocity, from -1 to 1", lower=-2.0, upper=2.0),
    ]
    angle: Annotated[tuple[float, ...], Par("rad", "a_i", "its centre over the angle")]
    width: Annotated[float, Par("-", "", "width of the Gaussians over the velocity", positive=True)]
    reach: Annotated[float, Par("rad", "", "width of the Gaussians over the angle", positive=True)]
    fine: Annotated[
        float,
        Par("rad/s", "v_0", "speed up to which the axis is linear; above it is logarithmic", positive=True),
    ]
    top: Annotated[float, Par("rad/s", "", "speed that lies at 1 on the axis", positive=True)]


def over_angle(v: float, s: float, y: Any, z: Any, p: Any) -> float:
    """Torque by Gaussians of the logarithm of the velocity and of the reference's angle, N·m."""
    place = arsinh(v / p.fine) / arsinh(p.top / p.fine)
    torque = 0.0
    for i in range(len(p.rate)):
        off = (place - p.centre[i]) / p.width
        away = (TURN * y.turns + (y.position - p.angle[i]) + y.error) / p.reach
        value = math.exp(-off * off - away * away)
        z.weight[i] = learnt(z.weight[i], p.rate[i], value, s, y, p)
        torque += value * z.weight[i]
    return torque


TENTHS = [0.1 * i for i in range(-10, 11)]
GRID = {
    "rate": [12.0] * 20, "centre": [-0.8, -0.4, 0.0, 0.4, 0.8] * 4, "angle": [0.25 * (i // 5) for i in range(20)],
    "width": 0.4, "reach": 0.25, "fine": 1e-3, "top": 0.35,
}  # fmt: skip
GAUSSIANS = {"rate": [12.0] * len(TENTHS), "centre": TENTHS, "width": 0.1, "fine": 1e-3, "top": 0.35}

FUNCTIONS = Choice(
    "functions",
    "torque_of",
    {
        "makkar": Option(
            makkar,
            Makkar,
            example={"rate": [12.0] * 3, "steep": 1000.0, "wide": 100.0, "speed": 0.1},
            check=three,
        ),
        "lines": Option(
            lines,
            Lines,
            example={"rate": [12.0] * 8, "corner": 0.02, "smooth": 1e-3, "speed": 0.1},
            check=eight,
        ),
        "polynomial": Option(
            polynomial, Polynomial, example={"rate": [12.0] * 4, "smooth": 1e-3, "top": 0.35}
        ),
        "gaussians": Option(gaussians, Gaussians, example=GAUSSIANS),
        "gaussians_over_angle": Option(over_angle, OverAngle, example=GRID),
    },
    "makkar",
    "of which functions of the velocity friction is the sum",
)
torque_of = makkar


# ---- the law -----------------------------------------------------------------------------------------------------


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    v = y.reference_velocity
    if v == 0.0:
        return 0.0
    return torque_of(v, v - y.velocity + p.slope * y.error, y, z, p)


CONTROL_LAW = ControlLaw(
    "adaptive_friction", Params, sample, "observer",
    title="Adaptive friction",
    equation=r"T = \sum_i W_i\,\phi_i(\dot\theta_d),\quad "
    r"\dot W_i = \Gamma_i\,(\phi_i\,(\dot e + \lambda e) - \sigma_l W_i)",
    source=("makkar2005", "slotine1991"),
    example={"slope": 62.83, "leak": 0.05, "largest": 1.0},
    State=State,
    choices=(FUNCTIONS,),
    adapts=True,
)  # fmt: skip
