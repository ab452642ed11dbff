"""Friction that changes slowly with time (an axis that warms up, grease that spreads), as certain sliding shows it.

Two columns, of level and of slope, times the time from the middle of the record: every other number is then that of the
middle. A record that goes first one way and then the other, or whose moves become faster, confounds such a drift with
the constant torque, or with viscous friction, and beside these columns their intervals hold that. Where no drift shows,
a small one may be there all the same, and takes part as what no law holds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.sliding_rows import DIRECTION, Signals, SlidingRows
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

DRIFTS_BY = 0.05
"""Of friction at the first row, that a drift is worth a warning from."""
MAY_DRIFT = 0.05
"""Part of Fc by which its level may drift over a record, or depart from an even drift, unseen: a standard deviation."""
MEAN_SQUARE = 1.0 / 12.0
"""Of the time from the middle of a record, in parts of it."""
THIRD, OTHER_MOTION = 1.0 / 3.0, 3.0
"""Of a record, that is an end of it; times the acceleration, or that over the speed, at one end that it is at the other
in another motion: what friction and inertia are not, springs among it, then looks like a drift (a sweep)."""
DRIFTS = ("drift_fc", "drift_sigma2", "drift")
"""By how much level, slope, and friction at the usual speed grow from the first row of a record to its last."""


def drift_columns(records: Sequence[SlidingRows]) -> Array:
    """Direction and velocity, times the time from the middle of the record in parts of it, shape (n, 2)."""
    both = np.column_stack([stacked(records, "fixed")[:, DIRECTION], stacked(records, "speed")])
    return np.asarray(both * late_in(records)[:, None], dtype=np.float64)


def drift_unseen(records: Sequence[SlidingRows], drifting: bool) -> Array:
    """The column of a drift of friction's level that may be there unseen, shape (n,); beside an even one (`drifting`)
    that of a drift which is fast at first and slow in the end."""
    late = late_in(records)
    return np.asarray(
        stacked(records, "fixed")[:, DIRECTION] * (late * late - MEAN_SQUARE if drifting else late)
    )


def late_in(records: Sequence[SlidingRows]) -> Array:
    """Time from the middle of each record, in parts of the longest one, shape (n,)."""
    longest = max(length_of(r.signals) for r in records)
    return np.concatenate([(r.time - r.signals.middle) / longest for r in records])


def drift_rows(records: Sequence[SlidingRows], core: int, place: int) -> dict[str, Array]:
    """The numbers of a drift as combinations of columns' coefficients, its two from `place` on, shape (core,) each."""
    unit = np.eye(core)
    level, slope = unit[place], unit[place + 1]
    return dict(zip(DRIFTS, (level, slope, level + usual_speed(records) * slope), strict=True))


def usual_speed(records: Sequence[SlidingRows]) -> float:
    """Median speed of certain sliding, rad/s (m/s)."""
    return float(np.median(np.abs(stacked(records, "speed"))))


def drift_torque(numbers: Mapping[str, Number], records: Sequence[SlidingRows]) -> Array:
    """What friction's drift adds to the torque in the middle of a record, N·m (N), shape (n,); 0 where none is told."""
    if "drift" not in numbers:
        return np.zeros(sum(r.time.size for r in records))
    return np.asarray(drift_columns(records) @ np.array([numbers[n].value for n in DRIFTS[:2]]))


def same_motion(records: Sequence[SlidingRows]) -> bool:
    """Whether the motion is as quick, and of the same frequencies, where the record ends as where it begins."""
    late, fixed = late_in(records), stacked(records, "fixed")
    first, last = late < THIRD - 0.5, late > 0.5 - THIRD
    if not (np.any(first) and np.any(last)):
        return False
    (a, v), (b, w) = (np.sqrt(np.mean(fixed[end, :DIRECTION] ** 2, axis=0)).tolist() for end in (first, last))
    rates = a / max(v, 1e-300), b / max(w, 1e-300)
    return all(max(pair) <= OTHER_MOTION * min(pair) for pair in ((a, b), rates))


def length_of(signals: Signals) -> float:
    """From the first row of a record to its last, s."""
    return float(signals.time[-1] - signals.time[0])


class Drift(NamedTuple):
    """Growth of friction at the usual speed from the first row to the last, in parts of its value at the first row,
    with its 95 % interval."""

    share: float
    low: float
    high: float

    def __str__(self) -> str:
        way, sizes = (
            ("falls", (-self.high, -self.low)) if self.share < 0.0 else ("rises", (self.low, self.high))
        )
        least, most = (100.0 * size for size in sizes)
        span = f"{least:.2g} to {most:.2g} %" if math.isfinite(most) else f"at least {least:.2g} %"
        return f"{way} by {100.0 * abs(self.share):.2g} % (95 % interval {span})"


def drift_of(numbers: Mapping[str, Number], records: Sequence[SlidingRows]) -> Drift | None:
    """Return the drift of friction over a record; None if its interval contains 0."""
    if "drift" not in numbers:
        return None
    drift, middle = numbers["drift"], numbers["fc"].value + usual_speed(records) * numbers["sigma2"].value

    def share(grown: float) -> float:
        """Growth in parts of the value at the first row, which it lowers itself."""
        first = middle - 0.5 * grown
        return grown / first if first > 0.0 else math.inf

    half = QUANTILE * drift.std
    found = Drift(share(drift.value), share(drift.value - half), share(drift.value + half))
    known = math.isfinite(found.share) and middle > 0.0
    return found if known and (found.low > 0.0 or found.high < 0.0) else None
