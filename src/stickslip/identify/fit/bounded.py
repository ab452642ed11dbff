"""Least squares within bounds, of few columns that are not collinear: SciPy's takes longer to import than to solve."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

ITERATIONS = 100
"""Numbers that are let go from their bounds, one after another, at most."""
FLAT = 1e-12
"""Of the largest product of a column and the target: a slope this small draws nothing away from a bound."""


def within_bounds(columns: Array, target: Array, lower: Array, upper: Array) -> Array:
    """Least squares within bounds by an active set (Stark and Parker 1995), `ITERATIONS` changes of it at most.

    Parameters
    ----------
    columns : array, shape (n, m)
    target : array, shape (n,)
    lower, upper : array, shape (m,)

    Returns
    -------
    array, shape (m,)
        Inside the bounds; the best so far where the iterations did not suffice.
    """
    size: Array = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    low, high = lower * size, upper * size
    # Rotated onto the span of the columns and the target: what is solved again and again is no taller than wide.
    both: Array = np.asarray(np.linalg.qr(np.column_stack([columns / size, target]), "r"), dtype=np.float64)
    a, b = both[:, :-1], both[:, -1]
    first = np.linalg.lstsq(a, b, rcond=None)[0]
    x: Array = np.asarray(np.clip(first, low, high), dtype=np.float64)
    free = (low < first) & (first < high)
    flat = FLAT * float(np.max(np.abs(a.T @ b), initial=0.0))
    stuck, let_go = np.zeros(x.size, dtype=np.bool_), -1
    for _ in range(ITERATIONS):
        before = x
        x, free = descended(a, b, x, free, low, high)
        # One that rounding sends back to its bound at once stays there until another moves.
        stuck &= bool(np.array_equal(x, before))
        stuck[let_go] |= let_go >= 0 and not free[let_go]
        slope = a.T @ (b - a @ x)
        drawn = ~free & ~stuck & np.where(slope > 0.0, x < high, x > low) & (np.abs(slope) > flat)
        if not np.any(drawn):
            break
        let_go = int(np.argmax(np.where(drawn, np.abs(slope), -1.0)))
        free[let_go] = True
    return np.clip(x / size, lower, upper)


def descended(a: Array, b: Array, x: Array, free: Mask, low: Array, high: Array) -> tuple[Array, Mask]:
    """The least squares of the free numbers, those on the way that meet a bound held there; and which are free."""
    x, free = x.copy(), free.copy()
    while np.any(free):
        goal = np.linalg.lstsq(a[:, free], b - a[:, ~free] @ x[~free], rcond=None)[0]
        way, inside = goal - x[free], (low[free] <= goal) & (goal <= high[free])
        if np.all(inside):
            x[free] = goal
            break
        bound = np.where(way > 0.0, high[free], low[free])
        share = np.where(inside, np.inf, (bound - x[free]) / np.where(way == 0.0, 1.0, way))
        place = int(np.argmin(share))
        x[free] = np.clip(x[free] + max(float(share[place]), 0.0) * way, low[free], high[free])
        at = int(np.flatnonzero(free)[place])
        x[at], free[at] = bound[place], False
    return x, free
