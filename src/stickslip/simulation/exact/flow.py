"""The exact flow of the axis between events, and the cubic pieces that force it.

While no mode changes, the loop reads J x'' + D x' + K x = p(t) with constant J, D, K and a cubic p. Its solution
is a cubic (the particular solution) plus a 2x2 matrix exponential of what is left. All eigenvalues are served:
complex, real, and growing ones of negative stiffness (feedback of a model stiffer than the contact).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import kernel

Matrix = tuple[float, float, float, float]
Cubic = tuple[float, float, float, float]
UNMOVED: Matrix = (1.0, 0.0, 0.0, 1.0)


class Linear(NamedTuple):
    """J x'' + D x' + K x, with what its flow needs."""

    inertia: float
    damping: float
    stiffness: float
    decay: float
    """D / 2J, 1/s"""
    square: float
    """K / J, 1/s²"""
    discriminant: float
    """K/J - (D/2J)²: positive where the pair is complex"""
    frequency: float
    """square root of its magnitude, rad/s"""
    compliance: float
    """1 / K"""
    mobility: float
    """1 / sqrt(J |K|)"""


@kernel(exact=False)
def linear(inertia: float, damping: float, stiffness: float) -> Linear:
    """Prepare the flow of one set of modes."""
    decay = 0.5 * damping / inertia
    square = stiffness / inertia
    discriminant = square - decay * decay
    return Linear(
        inertia, damping, stiffness, decay, square, discriminant, math.sqrt(abs(discriminant)), 1.0 / stiffness,
        1.0 / math.sqrt(inertia * abs(stiffness)),
    )  # fmt: skip


@kernel(exact=False, inline=True)
def flow(lin: Linear, x: float) -> Matrix:
    """Matrix that takes (position, velocity) of the free system over the time x."""
    if lin.discriminant > 0.0:
        e = math.exp(-lin.decay * x)
        c = math.cos(lin.frequency * x)
        s = math.sin(lin.frequency * x) / lin.frequency
    else:
        e = 1.0
        slow = math.exp((lin.frequency - lin.decay) * x)
        fast = math.exp(-(lin.frequency + lin.decay) * x)
        c = 0.5 * (slow + fast)
        s = 0.5 * (slow - fast) / lin.frequency if lin.frequency * x > 1e-7 else x * slow
    return e * (c + lin.decay * s), e * s, -e * lin.square * s, e * (c - lin.decay * s)


KEPT = np.dtype(
    [
        # How position and velocity follow from those before; the step over half of which, s.
        *((name, np.float64) for name in ("pp", "pv", "vp", "vv", "step")),
        # Of modes.
        ("generation", np.int64),
    ]
)
"""A flow that is kept as long as the modes are."""


@kernel(exact=False, inline=True)
def kept_flow(lin: Linear, kept: Any, generation: int, x: float) -> Matrix:
    """The flow over x, computed once for every set of modes: ``kept`` belongs to one x."""
    if kept.generation != generation:
        kept.pp, kept.pv, kept.vp, kept.vv = flow(lin, x)
        kept.generation = generation
    return kept.pp, kept.pv, kept.vp, kept.vv


@kernel(exact=False)
def twice(m: Matrix) -> Matrix:
    """The square of a flow: twice the time."""
    return (
        m[0] * m[0] + m[1] * m[2],
        m[1] * (m[0] + m[3]),
        m[2] * (m[0] + m[3]),
        m[3] * m[3] + m[1] * m[2],
    )


@kernel(exact=False)
def particular(lin: Linear, p0: float, p1: float, p2: float, p3: float) -> Cubic:
    """The cubic c(x) with J c'' + D c' + K c = p(x)."""
    inverse = lin.compliance
    c3 = p3 * inverse
    c2 = (p2 - 3.0 * lin.damping * c3) * inverse
    c1 = (p1 - 2.0 * lin.damping * c2 - 6.0 * lin.inertia * c3) * inverse
    c0 = (p0 - lin.damping * c1 - 2.0 * lin.inertia * c2) * inverse
    return c0, c1, c2, c3


@kernel(exact=False)
def free_motion(m: Matrix, position: float, velocity: float) -> tuple[float, float]:
    """Apply a flow."""
    return m[0] * position + m[1] * velocity, m[2] * position + m[3] * velocity


@kernel(exact=False, inline=True)
def moved(c: Cubic, m: Matrix, x: float, position: float, velocity: float) -> tuple[float, float]:
    """Position and velocity at x: the cubic, and the free motion that starts from (position, velocity)."""
    return (
        c[0] + x * (c[1] + x * (c[2] + x * c[3])) + m[0] * position + m[1] * velocity,
        c[1] + x * (2.0 * c[2] + x * 3.0 * c[3]) + m[2] * position + m[3] * velocity,
    )


@kernel(exact=False)
def acceleration(lin: Linear, c: Cubic, x: float, position: float, velocity: float) -> float:
    """Acceleration at x, where the motion is at (position, velocity)."""
    free_position = position - (c[0] + x * (c[1] + x * (c[2] + x * c[3])))
    free_velocity = velocity - (c[1] + x * (2.0 * c[2] + x * 3.0 * c[3]))
    return 2.0 * c[2] + 6.0 * c[3] * x - lin.square * free_position - 2.0 * lin.decay * free_velocity


@kernel(exact=False)
def hermite(y0: float, d0: float, y1: float, d1: float, h: float, x: float) -> float:
    """Cubic through two values and slopes over [0, h], at x."""
    s = x / h
    r = 1.0 - s
    return r * r * (1.0 + 2.0 * s) * y0 + s * s * (3.0 - 2.0 * s) * y1 + s * r * h * (r * d0 - s * d1)


@kernel(exact=False)
def hermite_slope(y0: float, d0: float, y1: float, d1: float, h: float, x: float) -> float:
    """Slope of `hermite` at x."""
    s = x / h
    r = 1.0 - s
    return 6.0 * s * r * (y1 - y0) / h + r * (r - 2.0 * s) * d0 + s * (s - 2.0 * r) * d1


@kernel(exact=False)
def upper_terms(y0: float, d0: float, y1: float, d1: float, inverse: float) -> tuple[float, float]:
    """Quadratic and cubic coefficients of `hermite`; ``inverse`` is 1/h."""
    slope = (y1 - y0) * inverse
    return (3.0 * slope - 2.0 * d0 - d1) * inverse, (d0 + d1 - 2.0 * slope) * inverse * inverse


@kernel(exact=False, inline=True)
def relaxed(
    goal_mid: float, goal_end: float, s0: float, d0: float, a_mid: float, a_end: float, h: float
) -> tuple[float, float, float]:
    """Advance dS/dt = goal - a S by Lobatto IIIA of fourth order; goal and decay a are given at mid and end.

    Returns S in the middle and at the end, and its slope at the end.
    """
    right_mid = s0 + h / 24.0 * (5.0 * d0 + 8.0 * goal_mid - goal_end)
    right_end = s0 + h / 6.0 * (d0 + 4.0 * goal_mid + goal_end)
    m11 = 1.0 + h * a_mid / 3.0
    m12 = -h * a_end / 24.0
    m21 = 2.0 * h * a_mid / 3.0
    m22 = 1.0 + h * a_end / 6.0
    inverse = 1.0 / (m11 * m22 - m12 * m21)
    s_mid = (right_mid * m22 - m12 * right_end) * inverse
    s_end = (m11 * right_end - m21 * right_mid) * inverse
    return s_mid, s_end, goal_end - a_end * s_end
