"""The shift by whole samples with the least residual: a coarse search, then all shifts about the best."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Whole = np.ndarray[Any, np.dtype[np.int64]]


def shifts_looked_at(misfits: Callable[[Whole], Array], reach: int, parts: int) -> tuple[Whole, Array]:
    """Return shifts up to `reach` in either direction, including 0, in ascending order, and their residuals.

    Parameters
    ----------
    misfits : callable
        Returns the residuals of shifts, shape (shifts,).
    parts : int
        Number of parts of `reach` in the coarse search.
    """
    step = max(1, reach // parts)
    coarse: Whole = np.union1d(np.arange(-reach, reach + 1, step), [0, reach])
    near = int(coarse[int(np.argmin(misfits(coarse)))])
    fine: Whole = np.arange(max(near - step + 1, -reach), min(near + step - 1, reach) + 1)
    shifts: Whole = np.union1d(coarse, fine)
    return shifts, misfits(shifts)


def least_between(shifts: Whole, left: Array) -> float:
    """Return the least residual between samples: the minimum of the parabola through the best three."""
    best = int(np.argmin(left))
    if not 0 < best < len(left) - 1 or shifts[best + 1] - shifts[best - 1] != 2:
        return float(left[best])
    before, here, after = (float(x) for x in left[best - 1 : best + 2])
    bend = before - 2.0 * here + after
    return max(here - 0.125 * (after - before) ** 2 / bend, 0.0) if bend > 0.0 else here
