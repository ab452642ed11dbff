"""Runge-Kutta-Chebyshev steps for motions ruled by one fast decay: a bristle that follows its steady value.

A law like LuGre relaxes with sigma0 |v| / s(v), up to 4e4 /s while the axis slides slowly changing: explicit steps
of high order are then limited by stability alone. The second-order formula of Sommeijer, Shampine and Verwer
(RKC: an explicit solver for parabolic PDEs, J. Comput. Appl. Math. 88, 1998) is stable along the negative real axis
to about 0.65 stages², so that a few stages go much further.
"""

from __future__ import annotations

import math

from stickslip.jit import kernel, pointer
from stickslip.simulation.adaptive.hybrid import rates
from stickslip.simulation.adaptive.layout import Loop

DAMPING = 2.0 / 13.0
MARGIN = 1.3
"""Over the decay rate last seen: it changes while the step is used."""


@kernel()
def stages_for(h: float, decay: float) -> int:
    """Number of stages that keep a step of h stable against a decay rate (1/s)."""
    return max(2, 1 + int(math.sqrt(1.0 + 1.54 * MARGIN * h * decay)))


@kernel()
def chebyshev(loop: Loop, t: float, h: float, count: int) -> None:
    """One step of `count` stages from y to ``end``; row 0 of the rates holds those at its start, row 6 its end's.

    ``middle`` and ``error`` are scratch.
    """
    n, y, k, older, newer = loop.case.states, loop.y, loop.rates, loop.middle, loop.error
    inner = pointer(k, n)
    w0 = 1.0 + DAMPING / (count * count)
    # Chebyshev polynomials at w0 and their two derivatives by recurrence, first for the last stage ...
    t0, t1, d0, d1, s0, s1 = 1.0, w0, 0.0, 1.0, 0.0, 0.0
    for _ in range(2, count + 1):
        t0, t1, d0, d1, s0, s1 = (
            t1, 2.0 * w0 * t1 - t0, d1, 2.0 * (t1 + w0 * d1) - d0, s1, 4.0 * d1 + 2.0 * w0 * s1 - s0,
        )  # fmt: skip
    w1 = d1 / s1
    # ... then along the stages. b_0 = b_1 = b_2.
    second = 1.0 / (4.0 * w0 * w0)
    b_older, b_newer = second, second
    t0, t1, d0, d1, s0, s1 = 1.0, w0, 0.0, 1.0, 0.0, 0.0
    weight = second * w1
    for j in range(n):
        older[j] = y[j]
        newer[j] = y[j] + h * weight * k[j]
    # Time of a stage over h.
    at_older, at_newer = 0.0, weight
    for _ in range(2, count + 1):
        a_newer = 1.0 - b_newer * t1
        t0, t1, d0, d1, s0, s1 = (
            t1, 2.0 * w0 * t1 - t0, d1, 2.0 * (t1 + w0 * d1) - d0, s1, 4.0 * d1 + 2.0 * w0 * s1 - s0,
        )  # fmt: skip
        b = s1 / (d1 * d1)
        mu, nu = 2.0 * b * w0 / b_newer, -b / b_older
        step = 2.0 * b * w1 / b_newer
        rates(loop, t + at_newer * h, newer, inner)
        for j in range(n):
            rise = mu * (newer[j] - y[j]) + nu * (older[j] - y[j]) + step * h * (inner[j] - a_newer * k[j])
            older[j] = newer[j]
            newer[j] = y[j] + rise
        at = mu * at_newer + nu * at_older + step * (1.0 - a_newer)
        at_older, at_newer = at_newer, at
        b_older, b_newer = b_newer, b
    for j in range(n):
        loop.end[j] = newer[j]
    rates(loop, t + h, loop.end, pointer(k, 6 * n))


@kernel()
def chebyshev_error(loop: Loop, h: float) -> None:
    """Estimate of the local error, third order."""
    n, k = loop.case.states, loop.rates
    for j in range(n):
        loop.error[j] = 0.8 * (loop.y[j] - loop.end[j]) + 0.4 * h * (k[j] + k[6 * n + j])
