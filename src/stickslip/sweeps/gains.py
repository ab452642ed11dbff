"""Which gain of a compensator stands the uncertainty: from the cases of a sweep that varies it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.dataset import read
from stickslip.sweeps.numbers import value_of
from stickslip.sweeps.plan import Sweep
from stickslip.sweeps.sample import Drawn
from stickslip.sweeps.summary import LEAST_CASES

Array = np.ndarray[Any, np.dtype[np.float64]]
GAIN = "controller.gain"
LEAST_BINS, MOST_BINS = 5, 20
"""With fewer than the first, the least percentile says little of where it lies."""
SHARE = LEAST_CASES + 10
"""Cases drawn for a bin, so that enough of them run to their end."""


@dataclass(frozen=True)
class BestGain:
    """What the gain does.

    Attributes
    ----------
    gains, high : array, shape (n,)
        Middles of the bins, or the points of a grid; 95th percentile of the sweep's first metric. Empty where the
        cases are too few (`too_few`).
    gain, least : float
        The recommended gain, with the least 95th percentile, and that percentile.
    width : float
        Of a bin; 0 on a grid.
    """

    gains: Array
    high: Array
    gain: float
    least: float
    width: float


def too_few(drawn: Drawn) -> str:
    """Why its cases recommend no gain, and what to do; empty where they do."""
    if GAIN not in drawn.names:
        return ""
    if drawn.method == "grid":
        each = drawn.cases // drawn.spreads[drawn.names.index(GAIN)].grid.size
        if each >= LEAST_CASES:
            return ""
        return (
            f"no gain is recommended: each gain of the grid has {each} cases, and a 95th percentile takes "
            f"{LEAST_CASES}; give the other numbers more points"
        )
    if drawn.cases >= LEAST_BINS * SHARE:
        return ""
    return (
        f"no gain is recommended: {drawn.cases} cases are too few for the 95th percentile of {LEAST_BINS} ranges of "
        f"gain; take {LEAST_BINS * SHARE} or more"
    )


def recommended(folder: Path, sweep: Sweep, run: PlannedRun) -> BestGain:
    """The gain with the least 95th percentile of the sweep's first metric, in bins of gain or over a grid's points."""
    if too_few(sweep.drawn):
        return BestGain(np.zeros(0), np.zeros(0), math.nan, math.nan, math.nan)
    columns = read(folder, sweep, run, [GAIN, sweep.metrics[0]])
    spread = sweep.drawn.spreads[sweep.drawn.names.index(GAIN)]
    # Drawn may be factors on the run's own gain.
    gain = columns[GAIN] * (float(value_of(run, GAIN)) if spread.factor else 1.0)
    values = columns[sweep.metrics[0]]
    if sweep.drawn.method == "grid":
        middles, place = np.unique(gain, return_inverse=True)
        width = 0.0
    else:
        bins = min(MOST_BINS, gain.size // SHARE)
        edges = np.linspace(float(np.min(gain)), float(np.max(gain)) * (1.0 + 1e-12), bins + 1)
        place = np.clip(np.digitize(gain, edges) - 1, 0, bins - 1)
        middles, width = 0.5 * (edges[:-1] + edges[1:]), float(edges[1] - edges[0])
    kept = [values[(place == i) & np.isfinite(values)] for i in range(middles.size)]
    known = [i for i, some in enumerate(kept) if some.size >= LEAST_CASES]
    if not known:
        return BestGain(np.zeros(0), np.zeros(0), math.nan, math.nan, math.nan)
    gains, high = middles[known], np.array([float(np.percentile(kept[i], 95.0)) for i in known])
    best = int(np.argmin(high))
    return BestGain(gains, high, float(gains[best]), float(high[best]), width)
