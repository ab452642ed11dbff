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
MOST_BINS = 20


@dataclass(frozen=True)
class Recommended:
    """What the gain does.

    Attributes
    ----------
    gains, high : array, shape (n,)
        Middles of the bins; 95th percentile of the sweep's first metric.
    gain, least : float
        The recommended gain, with the least 95th percentile, and that percentile.
    """

    gains: Array
    high: Array
    gain: float
    least: float


def recommended(folder: Path, sweep: Sweep, run: PlannedRun) -> Recommended:
    """The gain with the least 95th percentile of the sweep's first metric, in bins of gain."""
    columns = read(folder, sweep, run, [GAIN, sweep.metrics[0]])
    gain, values = columns[GAIN], columns[sweep.metrics[0]]
    bins = max(1, min(MOST_BINS, gain.size // (LEAST_CASES + 10)))
    edges = np.linspace(float(np.min(gain)), float(np.max(gain)) * (1.0 + 1e-12), bins + 1)
    place = np.clip(np.digitize(gain, edges) - 1, 0, bins - 1)
    middles, high = list[float](), list[float]()
    for i in range(bins):
        kept = (place == i) & np.isfinite(values)
        if np.count_nonzero(kept) < LEAST_CASES:
            continue
        middles.append(0.5 * float(edges[i] + edges[i + 1]))
        high.append(float(np.percentile(values[kept], 95.0)))
    if not high:
        return Recommended(np.zeros(0), np.zeros(0), math.nan, math.nan)
    best = int(np.argmin(high))
    return Recommended(np.array(middles), np.array(high), middles[best], high[best])
