"""The ringing over a window of a segment in closed form: its integrals, and the high-pass of the velocity.

The free motion p'' = -D p' - W p (time over the window's length) rings many times where an element sticks. Its
moments follow from integrating the equation by parts, its mean squares from its energy (Lyapunov's equation), so that a
window need not resolve it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import HIGH_PASS
from stickslip.simulation.exact.flow import Linear

Five = tuple[float, float, float, float, float]


class Ringing(NamedTuple):
    """The free motion p over a window of length 1, and q = dp/ds."""

    damping: float
    square: float
    p0: float
    q0: float
    p1: float
    q1: float
    p_moments: Five
    """Integrals of s^k p, k = 0 to 4."""
    q_moments: Five
    pp: float
    pq: float
    qq: float
    """Integrals of p², p q and q²."""


@kernel(exact=False, inline=True)
def has_closed_form(lin: Linear, width: float) -> bool:
    """Whether the integrals over windows of this width lose no more than a few digits to cancellation."""
    damping = 2.0 * lin.decay * width
    square = lin.square * width * width
    pole = HIGH_PASS * width
    if square < 0.01 or damping < 1e-5 or damping > 30.0 * square or pole < 0.03:
        return False
    # The high-pass must not share a pole with the motion.
    both = square + pole * pole
    return abs(both - damping * pole) > 1e-3 * both


@kernel(exact=False, inline=True)
def ringing(lin: Linear, width: float, p0: float, v0: float, p1: float, v1: float) -> Ringing:
    """The ringing from (p0, v0) to (p1, v1), position in rad and velocity in rad/s, over a window of `width` s."""
    d = 2.0 * lin.decay * width
    w = lin.square * width * width
    inverse = 1.0 / w
    q0 = v0 * width
    q1 = v1 * width
    rise = p1 - p0
    # q' = -d q - w p, times s^k and by parts.
    i0 = -(q1 - q0 + d * rise) * inverse
    j1 = p1 - i0
    i1 = -(q1 - rise + d * j1) * inverse
    j2 = p1 - 2.0 * i1
    i2 = -(q1 - 2.0 * j1 + d * j2) * inverse
    j3 = p1 - 3.0 * i2
    i3 = -(q1 - 3.0 * j2 + d * j3) * inverse
    j4 = p1 - 4.0 * i3
    i4 = -(q1 - 4.0 * j3 + d * j4) * inverse
    pq = 0.5 * (p1 * p1 - p0 * p0)
    qq = 0.5 * (q0 * q0 - q1 * q1 + w * (p0 * p0 - p1 * p1)) / d
    pp = (qq - d * pq - (p1 * q1 - p0 * q0)) * inverse
    return Ringing(d, w, p0, q0, p1, q1, (i0, i1, i2, i3, i4), (rise, j1, j2, j3, j4), pp, pq, qq)


@kernel(exact=False, inline=True)
def at_nodes(m: Five) -> Five:
    """Weights of five equally spaced nodes in the integral of their quartic times what has these moments."""
    return (
        m[0] + (-25.0 * m[1] + 70.0 * m[2] - 80.0 * m[3] + 32.0 * m[4]) / 3.0,
        (48.0 * m[1] - 208.0 * m[2] + 288.0 * m[3] - 128.0 * m[4]) / 3.0,
        -12.0 * m[1] + 76.0 * m[2] - 128.0 * m[3] + 64.0 * m[4],
        (16.0 * m[1] - 112.0 * m[2] + 224.0 * m[3] - 128.0 * m[4]) / 3.0,
        (-3.0 * m[1] + 22.0 * m[2] - 48.0 * m[3] + 32.0 * m[4]) / 3.0,
    )


@kernel(exact=False, inline=True)
def quartic(nodes: Any, row: int) -> Five:
    """Coefficients of the quartic in s = 0 to 1 through a row of nodes."""
    a = nodes[row]
    b = nodes[row + 1]
    c = nodes[row + 2]
    d = nodes[row + 3]
    e = nodes[row + 4]
    return (
        a,
        (-25.0 * a + 48.0 * b - 36.0 * c + 16.0 * d - 3.0 * e) / 3.0,
        (70.0 * a - 208.0 * b + 228.0 * c - 112.0 * d + 22.0 * e) / 3.0,
        (-80.0 * a + 288.0 * b - 384.0 * c + 224.0 * d - 48.0 * e) / 3.0,
        (32.0 * a - 128.0 * b + 192.0 * c - 128.0 * d + 32.0 * e) / 3.0,
    )


@kernel(exact=False, inline=True)
def value(c: Five, s: float) -> float:
    """A quartic at s."""
    return c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * c[4])))


@kernel(exact=False, inline=True)
def overlap(nodes: Any, row: int, weights: Five) -> float:
    """Integral of a row's quartic times what the weights are of."""
    total = 0.0
    for i in range(5):
        total += weights[i] * nodes[row + i]
    return total


@kernel(exact=False)
def high_passed(velocity: Five, ring: Ringing, width: float, rings: bool, low: float) -> tuple[float, float]:
    """Integral over a window of (v - y)², y the 50 Hz low-pass that starts at `low`; and y at the end.

    z = v - y obeys z' + k z = v'. It is a cubic where v is a quartic, a multiple of p and q where v is q, and what
    makes it start at v(0) - low decays.
    """
    k = HIGH_PASS * width
    z3 = 4.0 * velocity[4] / k
    z2 = 3.0 * (velocity[3] - z3) / k
    z1 = 2.0 * (velocity[2] - z2) / k
    z0 = (velocity[1] - z1) / k
    begin = velocity[0]
    end = velocity[0] + velocity[1] + velocity[2] + velocity[3] + velocity[4]
    total = z0 * z0 + z1 * z1 / 3.0 + 0.2 * z2 * z2 + z3 * z3 / 7.0
    total += z0 * (z1 + 2.0 / 3.0 * z2 + 0.5 * z3) + z1 * (0.5 * z2 + 0.4 * z3) + z2 * z3 / 3.0
    decayed = math.exp(-k)
    e0 = (1.0 - decayed) / k
    e1 = (e0 - decayed) / k
    e2 = (2.0 * e1 - decayed) / k
    e3 = (3.0 * e2 - decayed) / k
    cross = z0 * e0 + z1 * e1 + z2 * e2 + z3 * e3
    first = z0
    last = z0 + z1 + z2 + z3
    if rings:
        share = 1.0 / ((ring.square + k * k - ring.damping * k) * width)
        a = -k * ring.square * share
        b = (ring.square - ring.damping * k) * share
        p = ring.p_moments
        q = ring.q_moments
        total += a * a * ring.pp + 2.0 * a * b * ring.pq + b * b * ring.qq
        total += 2.0 * a * (z0 * p[0] + z1 * p[1] + z2 * p[2] + z3 * p[3])
        total += 2.0 * b * (z0 * q[0] + z1 * q[1] + z2 * q[2] + z3 * q[3])
        # Integrals of p and q times exp(-k s), from the ends of both products.
        f = decayed * ring.p1 - ring.p0
        g = decayed * ring.q1 - ring.q0
        inverse = 1.0 / (ring.square + k * (k + ring.damping))
        cross += a * -((k + ring.damping) * f + g) * inverse
        cross += b * (ring.square * f - k * g) * inverse
        first += a * ring.p0 + b * ring.q0
        last += a * ring.p1 + b * ring.q1
        begin += ring.q0 / width
        end += ring.q1 / width
    c = begin - low - first
    total += 2.0 * c * cross + c * c * 0.5 * (1.0 - decayed * decayed) / k
    return total * width, end - last - c * decayed
