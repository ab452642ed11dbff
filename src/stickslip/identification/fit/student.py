"""Quantiles of Student's distribution, replacing those of `scipy.special`, whose import is slow."""

from __future__ import annotations

import math

SETTLED = 1e-15
"""Relative change at which a fraction or a root has converged."""
TERMS = 300
"""Most terms of the fraction, and most steps of the root."""
NORMAL = 1e6
"""Degrees of freedom above which it is the normal distribution, to a millionth."""


def student_quantile(freedom: float, probability: float = 0.975) -> float:
    """Return the quantile of Student's distribution for a probability of more than a half.

    Parameters
    ----------
    freedom : float
        Degrees of freedom, 0.5 or more; infinite for the normal distribution.
    probability : float
        Above 0.5, below 1.
    """
    if math.isnan(freedom):
        return math.nan
    n = min(freedom, NORMAL)
    tail = 1.0 - probability
    low, high = 0.0, 1.0
    while above(high, n) > tail:
        low, high = high, 2.0 * high
    x = high
    for _ in range(TERMS):
        # Newton's method, kept between the known bounds.
        gap = above(x, n) - tail
        low, high = (x, high) if gap > 0.0 else (low, x)
        following = x + gap / density(x, n)
        following = following if low < following < high else 0.5 * (low + high)
        if abs(following - x) <= SETTLED * x:
            return following
        x = following
    return x


def density(t: float, n: float) -> float:
    """Return the density of Student's distribution with n degrees of freedom."""
    log = math.lgamma(0.5 * (n + 1.0)) - math.lgamma(0.5 * n) - 0.5 * (n + 1.0) * math.log1p(t * t / n)
    return math.exp(log) / math.sqrt(n * math.pi)


def above(t: float, n: float) -> float:
    """Return the probability above t > 0, half the incomplete beta function (``abramowitz1964``, 26.7.1)."""
    x = n / (n + t * t)
    a, b = 0.5 * n, 0.5
    log = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    if x < (a + 1.0) / (a + b + 2.0):
        return 0.5 * math.exp(log) * fraction(a, b, x) / a
    return 0.5 - 0.5 * math.exp(log) * fraction(b, a, 1.0 - x) / b


def fraction(a: float, b: float, x: float) -> float:
    """Return the continued fraction of the incomplete beta function (``abramowitz1964``, 26.5.8), by Lentz's method."""
    c, d = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0))
    found = d
    for m in range(1, TERMS):
        for numerator in (
            m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0)),
        ):
            d, c = 1.0 / (1.0 + numerator * d), 1.0 + numerator / c
            found *= c * d
        if abs(c * d - 1.0) <= SETTLED:
            break
    return found
