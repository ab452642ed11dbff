"""Differences between repeated runs of each controller, at every time and in total; thesis 4.4, figures 4.52 to
4.56."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from stickslip.analyse.spectrum import channel_of
from stickslip.core.errors import InputError
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class Repeated:
    """Superposed runs of one controller.

    Attributes
    ----------
    name, channel, unit : str
    time : array, shape (n,)
        s, from the start of every run.
    runs : array, shape (m, n)
        The channel of every run; positions from the start of its reference, if there is one.
    starts : array, shape (m,)
        The positions at which the references start; zeros without a reference and for other channels.
    mean, spread, low, high : array, shape (n,)
        Over the runs, at every time: mean, standard deviation (of a sample of m), minimum, maximum.
    """

    name: str
    channel: str
    unit: str
    time: Array
    runs: Array
    starts: Array
    mean: Array
    spread: Array
    low: Array
    high: Array

    @property
    def rms_spread(self) -> float:
        """RMS over time of the standard deviation."""
        return math.sqrt(float(np.mean(self.spread**2)))

    @property
    def greatest_range(self) -> float:
        """Largest difference of two runs at one time."""
        return float(np.max(self.high - self.low))

    @property
    def relative(self) -> float:
        """`rms_spread` relative to half the peak-to-peak value of the mean; infinite if the mean is constant."""
        half = 0.5 * float(np.ptp(self.mean))
        return self.rms_spread / half if half > 0.0 else math.inf

    @property
    def alikeness(self) -> float:
        """Smallest correlation of two runs: 1 if all have the same shape."""
        moving = [run for run in self.runs if np.ptp(run) > 0.0]
        if len(moving) < 2:
            return math.nan
        return min(float(np.corrcoef(a, b)[0, 1]) for a, b in combinations(moving, 2))

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, without the curves."""
        return {
            "controller": self.name, "channel": self.channel, "unit": self.unit, "runs": len(self.runs),
            "rms_spread": self.rms_spread, "greatest_range": self.greatest_range, "relative": self.relative,
            "least_correlation": self.alikeness, "range_of_starts": float(np.ptp(self.starts)),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        apart = float(np.ptp(self.starts))
        starts = f"; each from its own start, which differ by {apart:.3g} {self.unit}" if apart > 0.0 else ""
        return [
            f"{self.name}: {len(self.runs)} runs, {self.channel}: spread {self.rms_spread:.3g} {self.unit} RMS "
            f"({100 * self.relative:.3g} % of the amplitude), largest range {self.greatest_range:.3g} {self.unit}, "
            f"smallest correlation {self.alikeness:.4f}{starts}"
        ]


def repeatability(groups: Mapping[str, Sequence[Record]], channel: str = "position") -> list[Repeated]:
    """Superpose the runs of every controller.

    Parameters
    ----------
    groups : mapping of str to sequence of Record
        Runs of the same motion, by controller; at least two each. Times count from the start of each run, positions
        from the start of its reference, if there is one. The common length of the runs is compared.
    channel : str
        As for `stickslip.analyse.spectrum.spectrum`.

    Raises
    ------
    InputError
        If a controller has only one run, or a record lacks the channel.
    """
    return [_repeated(name, records, channel) for name, records in groups.items()]


def _repeated(name: str, records: Sequence[Record], channel: str) -> Repeated:
    if len(records) < 2:
        raise InputError(
            f"repeatability: {name!r} has {len(records)} run; give at least two of the same motion"
        )
    clocks = [record.time - record.time[0] for record in records]
    length = min(float(clock[-1]) for clock in clocks)
    spacing = max(float(np.median(np.diff(clock))) for clock in clocks)
    if not (length > 0.0 and spacing > 0.0):
        raise InputError(f"repeatability: the runs of {name!r} have no length; check their times")
    time = np.arange(math.floor(length / spacing * (1.0 + 1e-9)) + 1, dtype=np.float64) * spacing
    signals = [channel_of(record, channel) for record in records]
    starts = np.array([_start_of(record, channel) for record in records])
    runs = np.array([np.interp(time, c, values) for c, (values, _) in zip(clocks, signals, strict=True)])
    runs -= starts[:, None]
    if not np.all(np.isfinite(runs)):
        raise InputError(f"repeatability: {channel} of {name!r} has gaps; check the records")
    spread: Array = np.asarray(runs.std(axis=0, ddof=1), dtype=np.float64)
    mean = np.asarray(runs.mean(axis=0), dtype=np.float64)
    return Repeated(
        name, channel, signals[0][1], time, runs, starts, mean, spread, runs.min(axis=0), runs.max(axis=0)
    )  # fmt: skip


def _start_of(record: Record, channel: str) -> float:
    """Return the commanded start from which a run's positions count; 0 if the record has no reference."""
    counts = channel in ("position", "position_reference") and "position_reference" in record.channels
    return float(record["position_reference"][0]) if counts else 0.0
