"""Rows of certain sliding by stroke: what counts as one observation, and how long what is left remembers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.identify.regression.sliding_rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.int64]]

PIECE = 0.25
"""s: length of a piece that counts as one observation, at least."""
MOST_LAGS = 300
FADED = 0.05  # correlation that counts as none


def stacked(records: Sequence[SlidingRows], name: str) -> Array:
    """One attribute of the rows of all records."""
    return np.concatenate([getattr(r, name) for r in records])


def strokes_of(records: Sequence[SlidingRows]) -> Places:
    """The stretch of sliding of every row, counted through all records."""
    first = np.cumsum([0, *(int(r.stroke[-1]) + 1 for r in records[:-1])])
    return np.concatenate([r.stroke + f for r, f in zip(records, first, strict=True)])


def pieces_of(stroke: Places, rows: int) -> Places:
    """The strokes cut into pieces of so many rows: what counts as one observation."""
    begins = np.flatnonzero(np.concatenate([[True], np.diff(stroke) != 0]))
    within = np.arange(stroke.size) - np.repeat(begins, np.diff([*begins.tolist(), stroke.size]))
    return np.cumsum(within % max(1, rows) == 0) - 1


def rows_in(seconds: float, records: Sequence[SlidingRows]) -> int:
    """Rows of the densest record in so many seconds."""
    return max(1, round(seconds / min(r.spacing for r in records)))


def memory_of(residual: Array, stroke: Places) -> float:
    """Rows over which a residual is correlated within a stroke: what the variance of a mean is greater by."""
    power, total = float(residual @ residual), 1.0
    if power <= 0.0:
        return total
    for lag in range(1, min(MOST_LAGS, residual.size - 1)):
        same = stroke[lag:] == stroke[:-lag]
        share = float(np.sum((residual[lag:] * residual[:-lag])[same])) / power
        if share < FADED:
            break
        total += 2.0 * share
    return total
