"""What a torque column of few counts leaves unsure.

At constant velocity the torque is constant, and rounded to the same count for as long as that lasts: the error does not
average out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.identify.fit.smooth import seen_at
from stickslip.identify.regression.sliding_rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.int64]]

FLAT = 0.02
"""Counts by which what a window sees lies off one, at most, where it sees that count alone: elsewhere noise or motion
carries the torque over several, and rounding averages out."""
ALIKE = 2.0
"""Times the variance of independent errors: a count for one direction and that for the other are rounded alike."""


def rounded_sums(records: Sequence[SlidingRows], columns: Array) -> Array:
    """Sums of the columns, shape (n, p), over the rows that see one count each, times the standard deviation of its
    error, N·m (N); shape (counts, p)."""
    sums: list[Array] = []
    first = 0
    for r in records:
        last = first + r.time.size
        rows, counts = rows_of_one_count(r)
        if rows.size:
            _, cell = np.unique(counts, return_inverse=True)
            total = np.zeros((int(cell.max()) + 1, columns.shape[1]))
            np.add.at(total, cell, columns[first + rows])
            sums.append(r.signals.count * np.sqrt(ALIKE / 12.0) * total)
        first = last
    return np.concatenate(sums) if sums else np.zeros((0, columns.shape[1]))


def rows_of_one_count(r: SlidingRows) -> tuple[Places, Places]:
    """The rows whose window sees a single count of the torque, and which."""
    if r.signals.count <= 0.0:
        none = np.zeros(0, dtype=np.int64)
        return none, none
    torque = seen_at(r.signals.drive, r.window.weights(0), r.places) / r.signals.count
    counts = np.rint(torque)
    rows = np.flatnonzero(np.abs(torque - counts) < FLAT)
    return rows.astype(np.int64), counts[rows].astype(np.int64)
