"""Friction that is built up again behind a reversal or stop: over which way, as certain sliding shows it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

REBUILT, SHORT, MARGIN = -0.15, 0.6, 2.5
"""Friction this far below the level, in parts of it, is still being rebuilt after a reversal; the part of the rows that
may be left out for that; and how much farther they are left out."""
FEWEST = 3
"""Rows at about the same way, to say anything."""


def rebuilding_way(records: Sequence[SlidingRows], skew: float) -> float:
    """Way after a reversal or stop over which friction is still being built up again, rad (m).

    Pre-sliding, play and wind-up all leave friction below its level there, whatever their law. Both directions are
    left. Of a pendulum the weight lacks, too, so that more is left out: where it turns, a coarse position says least.
    """
    fixed, gone = stacked(records, "fixed"), stacked(records, "gone")
    most = [
        float(np.quantile(gone[fixed[:, 2] * side > 0.0], SHORT))
        for side in (-1.0, 1.0)
        if np.any(fixed[:, 2] * side > 0.0)
    ]
    last, _ = lacking_until(records, skew)
    return min(MARGIN * last, *most)


def rebuilt_within(records: Sequence[SlidingRows], skew: float, known: Sequence[float] = ()) -> float:
    """Way after a reversal or stop within which friction is there again, rad (m): the last at which it lacks, or the
    first that is seen; infinite where no level shows.

    `known` are cycles a radian (m) of a torque over the position beside it: a pendulum's weight.
    """
    return max(lacking_until(records, skew, known))


def lacking_until(
    records: Sequence[SlidingRows], skew: float, known: Sequence[float] = ()
) -> tuple[float, float]:
    """The way after a reversal or stop at which friction lacks last, 0 where it never does, and the first that is seen,
    rad (m)."""
    fixed, gone = stacked(records, "fixed"), stacked(records, "gone")
    torque = np.concatenate([r.torque(skew) for r in records])
    middle = float(np.median(gone))
    far = gone >= middle
    columns = np.column_stack([fixed, *(np.concatenate([r.around(k) for r in records]) for k in known)])
    values = np.linalg.lstsq(columns[far], torque[far], rcond=1e-9)[0]
    level = float(values[2])
    if level <= 0.0 or middle <= 0.0:
        return 0.0, math.inf
    lacking = (torque - columns @ values) * fixed[:, 2] / level
    edges = np.geomspace(max(float(gone.min()), 1e-9 * middle), middle, 25)
    last, first = 0.0, middle
    for low, high in itertools.pairwise(edges.tolist()):
        inside = (gone >= low) & (gone < high)
        if np.count_nonzero(inside) < FEWEST:
            continue
        first = min(first, high)
        if np.median(lacking[inside]) < REBUILT:
            last = high
    return last, first
