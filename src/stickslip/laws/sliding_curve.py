"""Sliding curves s(v): the torque at constant velocity, without its viscous part.

A law that slides calls its curve ``sliding(v, p)``; which one that is, is a choice of the law, and the curve
brings its own parameters along. s is positive; the law supplies the sign. Eqs. 4.4 and 4.5 of the thesis contain
viscous terms; these are `stickslip.laws._viscous`, which every law adds outside of s, so that bristles and elements
relax towards the part of friction that they carry.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Choice, Option, Par

GRID = (0.0, *(10.0 ** (0.02 * i) for i in range(-200, 251)))
"""Multiples of the velocity scale at which a curve is looked at as a whole."""


@functools.lru_cache(maxsize=64)  # checks and conditions ask for the same again
def extremes(curve: Callable[[float, Any], float], p: Any, scale: float) -> tuple[float, float]:
    """Smallest and largest value of a curve, N·m, on velocities up to 1e5 times its scale (rad/s)."""
    values = [curve(x * scale, p) for x in GRID]
    return min(values), max(values)


def positive_everywhere(curve: Callable[[float, Any], float], p: Any, scale: float) -> str:
    """A complaint where a curve is not positive."""
    for x in GRID:
        if not curve(x * scale, p) > 0.0:
            return f"s(v) = {curve(x * scale, p):.3g} N·m at v = {x * scale:.3g} rad/s; a sliding curve is positive"
    return ""


def decay(x: float) -> float:
    """exp(-x) of x >= 0: where it is 0 in double precision it is not computed, as underflow takes twice its time."""
    if x > 746.0:
        return 0.0
    return math.exp(-x)


# ---- eq. 2.10 ------------------------------------------------------------------------------------------------


class Stribeck(NamedTuple):
    """Parameters of the Stribeck curve, thesis eq. 2.10.

    fs may lie below fc (thesis Table 9): friction then rises with the velocity, without a Stribeck effect, and who
    makes such a model is told (`rising`).
    """

    fs: Annotated[float, Par("N·m", "F_S", "static (break-away) torque", positive=True, directional=True)]
    fc: Annotated[float, Par("N·m", "F_C", "Coulomb torque", positive=True, directional=True)]
    vs: Annotated[float, Par("rad/s", "v_s", "Stribeck velocity", positive=True, directional=True)]
    delta_s: Annotated[
        float,
        Par(
            "-", "delta_s", "Stribeck shape factor", positive=True, upper=20.0, default=2.0, directional=True
        ),
    ]


def stribeck_scale(p: Any) -> float:
    """The Stribeck velocity, rad/s."""
    return p.vs


def stribeck(v: float, p: Any) -> float:
    """s(v) = F_C + (F_S - F_C) exp(-|v/v_s|^delta_s), N·m; thesis eq. 2.10."""
    x = abs(v / p.vs)
    if p.delta_s == 2.0:
        return p.fc + (p.fs - p.fc) * decay(x * x)
    # exp(-40) of ten times F_C is less than half of its last digit: nothing is left to add.
    if x > 40.0 and p.delta_s >= 1.0 and abs(p.fs - p.fc) < 10.0 * p.fc:
        return p.fc
    return p.fc + (p.fs - p.fc) * decay(x**p.delta_s)


def rising(p: Any) -> str:
    """A remark where the static torque lies below the Coulomb torque, in either direction."""
    for end, where in (("", ""), ("_negative", " for v < 0")):
        fs, fc = getattr(p, f"fs{end}", None), getattr(p, f"fc{end}", None)
        if fs is not None and fc is not None and fs < fc:
            return (
                f"fs = {fs:g} N·m lies below fc = {fc:g} N·m{where}, so that friction rises with the velocity and "
                "has no Stribeck effect; exchange them if that is not meant"
            )
    return ""


# ---- eq. 4.4 -------------------------------------------------------------------------------------------------


class DoubleExponential(NamedTuple):
    """Parameters of the curve of thesis eq. 4.4."""

    alpha0: Annotated[float, Par("N·m", "alpha_0", "common torque level", directional=True)]
    alpha1: Annotated[float, Par("N·m", "alpha_1", "static torque above the common level", directional=True)]
    alpha2: Annotated[float, Par("N·m", "alpha_2", "Coulomb torque above the common level", directional=True)]
    v1: Annotated[float, Par("rad/s", "v_1", "first Stribeck velocity", positive=True, directional=True)]
    v2: Annotated[float, Par("rad/s", "v_2", "second Stribeck velocity", positive=True, directional=True)]


def double_exponential(v: float, p: Any) -> float:
    """s(v) = alpha_0 + alpha_1 exp(-|v|/v_1) + alpha_2 (1 - exp(-|v|/v_2)), N·m; thesis eq. 4.4."""
    return p.alpha0 + p.alpha1 * math.exp(-abs(v) / p.v1) - p.alpha2 * math.expm1(-abs(v) / p.v2)


# ---- eq. 4.5 -------------------------------------------------------------------------------------------------


class DoubleStribeck(NamedTuple):
    """Parameters of the curve of thesis eq. 4.5."""

    beta0: Annotated[float, Par("N·m", "beta_0", "common torque level", directional=True)]
    beta1: Annotated[float, Par("N·m", "beta_1", "static torque above the common level", directional=True)]
    beta2: Annotated[float, Par("N·m", "beta_2", "Coulomb torque above the common level", directional=True)]
    beta3: Annotated[
        float, Par("-", "beta_3", "first shape factor", positive=True, upper=20.0, directional=True)
    ]
    beta4: Annotated[
        float, Par("-", "beta_4", "second shape factor", positive=True, upper=20.0, directional=True)
    ]
    v1: Annotated[float, Par("rad/s", "v_1", "first Stribeck velocity", positive=True, directional=True)]
    v2: Annotated[float, Par("rad/s", "v_2", "second Stribeck velocity", positive=True, directional=True)]


def double_stribeck(v: float, p: Any) -> float:
    """s(v) = beta_0 + beta_1 exp(-|v/v_1|^beta_3) + beta_2 (1 - exp(-|v/v_2|^beta_4)), N·m; thesis eq. 4.5."""
    falling = math.exp(-(abs(v / p.v1) ** p.beta3))
    # expm1 takes three times as long, for digits that the sum with beta_0 does not keep.
    rising = 1.0 - math.exp(-(abs(v / p.v2) ** p.beta4))
    return p.beta0 + p.beta1 * falling + p.beta2 * rising


# ---- a table of points ---------------------------------------------------------------------------------------


class Points(NamedTuple):
    """Parameters of a curve through points."""

    curve_velocity: Annotated[
        tuple[float, ...],
        Par("rad/s", "v_j", "velocity of point j, from 0 up", lower=0.0, directional=True, per="point"),
    ]
    curve_torque: Annotated[
        tuple[float, ...],
        Par("N·m", "s_j", "torque of point j", positive=True, directional=True, per="point"),
    ]


def joined_slope(h0: float, d0: float, h1: float, d1: float) -> float:
    """Slope at a point between two intervals of widths h and slopes d: 0 at a turning point, else between both.

    Weighted harmonic mean of Fritsch and Butland (1984): the cubic then stays between its points.
    """
    if d0 * d1 <= 0.0:
        return 0.0
    w0 = 2.0 * h1 + h0
    w1 = h1 + 2.0 * h0
    return (w0 + w1) / (w0 / d0 + w1 / d1)


def first_slope(h0: float, d0: float, h1: float, d1: float) -> float:
    """Slope at the first point, of the parabola through three points; limited as the others are."""
    slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1)
    if slope * d0 <= 0.0:
        return 0.0
    if d0 * d1 <= 0.0 and abs(slope) > 3.0 * abs(d0):
        return 3.0 * d0
    return slope


def through_points(v: float, p: Any) -> float:
    """s(v) as the monotone cubic through the points, N·m; constant beyond the last one."""
    x = abs(v)
    last = len(p.curve_velocity) - 1
    for i in range(last):
        if x < p.curve_velocity[i + 1]:
            h = p.curve_velocity[i + 1] - p.curve_velocity[i]
            d = (p.curve_torque[i + 1] - p.curve_torque[i]) / h
            end = 0.0
            begin = d
            if i < last - 1:
                h2 = p.curve_velocity[i + 2] - p.curve_velocity[i + 1]
                d2 = (p.curve_torque[i + 2] - p.curve_torque[i + 1]) / h2
                end = joined_slope(h, d, h2, d2)
                begin = first_slope(h, d, h2, d2)
            if i > 0:
                h0 = p.curve_velocity[i] - p.curve_velocity[i - 1]
                d0 = (p.curve_torque[i] - p.curve_torque[i - 1]) / h0
                begin = joined_slope(h0, d0, h, d)
            t = (x - p.curve_velocity[i]) / h
            bend = begin - d + (begin + end - 2.0 * d) * -t
            return p.curve_torque[i] + h * t * (d + (1.0 - t) * bend)
    return p.curve_torque[last]


def check_points(p: Any) -> str:
    """The velocities ascend from 0."""
    v = p.curve_velocity
    if v[0] != 0.0:
        return f"curve_velocity starts with {v[0]:g} rad/s; give the torque at 0 first"
    for i in range(1, len(v)):
        if v[i] <= v[i - 1]:
            return f"curve_velocity[{i}] = {v[i]:g} rad/s does not lie above the one before; sort the points"
    return ""


def scale_of_points(p: Any) -> float:
    """The velocity over which the steepest part changes by the range of the curve, rad/s; 0 for a constant one."""
    v, s = p.curve_velocity, p.curve_torque
    span = max(s) - min(s)
    slopes = [abs((s[i + 1] - s[i]) / (v[i + 1] - v[i])) for i in range(len(v) - 1)]
    return span / max(slopes) if span > 0.0 else 0.0


CURVE = Choice(
    "curve",
    replaces="sliding",
    options={
        "stribeck": Option(stribeck, Stribeck, remark=rising, velocity_scale=stribeck_scale),
        "double_exponential": Option(
            double_exponential,
            DoubleExponential,
            example={"alpha0": 0.1, "alpha1": 0.235, "alpha2": 0.185, "v1": 0.01, "v2": 0.015},
            check=lambda p: positive_everywhere(double_exponential, p, min(p.v1, p.v2)),
            velocity_scale=lambda p: min(p.v1, p.v2),
        ),
        "double_stribeck": Option(
            double_stribeck,
            DoubleStribeck,
            example={  # thesis Table 10
                "beta0": 80.7454,
                "beta1": -80.4742,
                "beta2": -80.5930,
                "beta3": 0.7884,
                "beta4": 0.7871,
                "v1": 0.1755,
                "v2": 0.1758,
            },
            check=lambda p: positive_everywhere(double_stribeck, p, min(p.v1, p.v2)),
            velocity_scale=lambda p: min(p.v1, p.v2),
        ),
        "table": Option(
            through_points,
            Points,
            example={
                "curve_velocity": [0.0, 0.003, 0.006, 0.01, 0.02, 0.03],
                "curve_torque": [0.335, 0.3307, 0.3199, 0.3034, 0.2859, 0.285],
            },
            check=check_points,
            velocity_scale=scale_of_points,
        ),
    },
    default="stribeck",
    meaning="sliding curve s(v): thesis eqs. 2.10, 4.4, 4.5, or a table of points",
)
