"""Compact smooth windows: weak-form values and derivatives of sampled signals.

Both sides of an equation of motion are multiplied by a window and summed. A derivative is moved to the window by
partial integration, so that no measured signal is differentiated (Shinbrot 1957; Messenger and Bortz 2021).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.int64]]

POWER = 6
"""Exponent of the window (1 - x²)^POWER: smooth enough for a bounded sixth derivative at its ends."""
LEAST_SAMPLES = 6
"""Least samples in half of a window for sums to approximate its integrals."""
GATHERED = 2**20
"""Samples that `apply_at` copies at a time (8 MiB); affects memory, not results."""


def window_weights(half: float, period: float, orders: Sequence[int], late: float = 0.0) -> Array:
    """Return sample weights for windowed derivatives about a centre, exact on polynomials.

    Parameters
    ----------
    half : float
        Half of the window's length, s.
    period : float
        Sample period, s.
    orders : sequence of int
        Orders of the derivatives; 0 is the windowed value.
    late : float
        Delay of the window relative to its centre, s.

    Returns
    -------
    array, shape (len(orders), 2 m + 1)
        An order-k row is exact on polynomials up to degree k + 1.
    """
    return _weights(half, period, tuple(orders), late)


@lru_cache(maxsize=256)
def _weights(half: float, period: float, orders: tuple[int, ...], late: float) -> Array:
    m = math.ceil((half + abs(late)) / period)
    offset = (np.arange(-m, m + 1) * period - late) / half
    x = np.clip(offset, -1.0, 1.0)
    window = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** POWER
    inside = np.where(np.abs(offset) < 1.0, (1.0 - x**2) ** 2, 0.0)
    out: list[Array] = []
    for k in orders:
        w = (-1.0) ** k * (window.deriv(k) if k else window)(x)
        w *= period / (_area() * half ** (k + 1))
        powers = offset[None, :] ** np.arange(k + 2)[:, None]
        wanted = np.zeros(k + 2)
        wanted[k] = math.factorial(k) / half**k
        basis = powers * inside
        out.append(w + np.linalg.solve(powers @ basis.T, wanted - powers @ w) @ basis)
    return np.array(out)


@lru_cache(maxsize=1)
def _area() -> float:
    """Return the integral of the window over [-1, 1]."""
    x, w = np.polynomial.legendre.leggauss(POWER + 1)
    return float(np.sum(w * (1.0 - x * x) ** POWER))


def unblurred_weights(half: float, period: float) -> Array:
    """Return weights for velocity and acceleration of the motion itself, not its window mean, shape (2, 2 m + 1).

    The window's second moment, half² / (2 POWER + 3), blurs a signal by half of it times its second derivative, which
    is subtracted.
    """
    w = window_weights(half, period, (1, 2, 3, 4))
    return np.asarray(w[:2] - w[2:] * half**2 / (2.0 * (2 * POWER + 3)))


def apply_at(series: Array, centres: Rows, weights: Array) -> Array:
    """Apply windows to a series, shape (n,), about some samples; return shape (centres,) or (centres, orders)."""
    m = weights.shape[-1] // 2
    view = np.lib.stride_tricks.sliding_window_view(series, 2 * m + 1)
    together = max(1, GATHERED // (2 * m + 1))
    starts = range(0, max(1, centres.size), together)
    return np.concatenate([view[centres[i : i + together] - m] @ weights.T for i in starts])
