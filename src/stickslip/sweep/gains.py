"""Which gain of a compensator stands the uncertainty: from the cases of a sweep that varies it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.study.plan import PlannedRun
from stickslip.sweep.dataset import read
from stickslip.sweep.plan import Sweep
from stickslip.sweep.summary import LEAST_CASES

__all__ = ["GAIN", "Recommended", "recommended"]

Array = np.ndarray[Any, np.dtype[np.float64]]
GAIN = "controller.gain"
BINS = 20
REVERSALS = "reversals_beyond_reference_per_s"
HUNTS = 1.0
"""Reversals per second beyond the reference's own, from which an axis hunts."""


@dataclass(frozen=True)
class Recommended:
    """What the gain does.

    Attributes
    ----------
    gains, high, hunting : array, shape (n,)
        Middles of the bins; 95th percentile of the sweep's first metric; share of the cases that hunt (empty where the
        sweep does not have the reversals).
    gain, least : float
        The recommended gain, with the least 95th percentile, and that percentile.
    """

    gains: Array
    high: Array
    hunting: Array
    gain: float
    least: float


def recommended(folder: Path, sweep: Sweep, run: PlannedRun) -> Recommended:
    """The gain with the least 95th percentile of the sweep's first metric, in bins of gain."""
    counts = REVERSALS in sweep.metrics
    columns = read(folder, sweep, run, [GAIN, sweep.metrics[0], *([REVERSALS] if counts else [])])
    gain, values = columns[GAIN], columns[sweep.metrics[0]]
    edges = np.linspace(float(np.min(gain)), float(np.max(gain)) * (1.0 + 1e-12), BINS + 1)
    place = np.clip(np.digitize(gain, edges) - 1, 0, BINS - 1)
    middles, high, hunting = list[float](), list[float](), list[float]()
    for i in range(BINS):
        kept = (place == i) & np.isfinite(values)
        if np.count_nonzero(kept) < LEAST_CASES:
            continue
        middles.append(0.5 * float(edges[i] + edges[i + 1]))
        high.append(float(np.percentile(values[kept], 95.0)))
        if counts:
            hunting.append(float(np.mean(columns[REVERSALS][kept] > HUNTS)))
    best = int(np.argmin(high)) if high else -1
    return Recommended(
        np.array(middles), np.array(high), np.array(hunting),
        middles[best] if high else math.nan, high[best] if high else math.nan,
    )  # fmt: skip
