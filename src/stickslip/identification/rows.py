"""Rows of the regression: the equation of motion seen through windows of three widths inside strokes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.identification.experiment import Experiment
from stickslip.identification.strokes import (
    SlidingRecord,
    TooLittleSliding,
    narrowest_half,
    sliding_record,
)
from stickslip.identification.windows import apply_at, window_weights
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.int64]]
Series = Callable[[SlidingRecord], Array]
"""Function that returns columns, shape (samples,) or (samples, k), of a record's smooth motion."""

WIDTHS = 3
"""Number of window widths, each twice as long as the one before: a rigid axis gives the same result in all."""
OVERLAP = 3.0
"""Rows per half window."""
FEWEST = 12
"""Fewest rows of one width that are worth a regression: twice its plain parameters."""
MOST = 10_000
"""Most rows of one width and record: more rows add no information."""
LATEST = 8
"""Greatest delay of the torque's column, samples, if it is not stated."""
USUAL = 0.98
"""Quantile that represents the largest velocity, acceleration and jerk."""
RARE = 1e-3
"""Least value of that, as a part of the maximum."""


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of one record and one width.

    Attributes
    ----------
    record : SlidingRecord
    width : int
        Index of the width; 0 is the narrowest.
    half : float
        Half of the window's length, s.
    centres : array of int, shape (n,)
        Samples at the windows' centres.
    """

    record: SlidingRecord
    width: int
    half: float
    centres: Integers

    def windowed(self, series: Array, order: int = 0) -> Array:
        """Return the windowed series, or its derivative of that order, shape (n, k)."""
        return np.asarray(self.operator(order) @ series)

    def operator(self, order: int) -> Any:
        """Return the sparse matrix that windows a series, shape (n, samples)."""
        kept: dict[int, Any] = self.__dict__.setdefault("kept", {})
        if order not in kept:
            from scipy.sparse import csr_matrix

            weights = window_weights(self.half, self.record.period, (order,))[0]
            m = weights.size // 2
            offsets: Integers = np.arange(-m, m + 1, dtype=np.int64)
            columns = (self.centres[:, None] + offsets[None, :]).ravel()
            ends = np.arange(self.centres.size + 1) * weights.size
            shape = (self.centres.size, self.record.time.size)
            kept[order] = csr_matrix((np.tile(weights, self.centres.size), columns, ends), shape=shape)
        return kept[order]

    def torque(self, skew: float, order: int = 0) -> Array:
        """Return the windowed drive torque or its derivative of that order, for a column delayed by `skew` s."""
        weights = window_weights(self.half, self.record.period, (order,), skew)
        edge = math.ceil(abs(skew) / self.record.period) + 1
        padded = np.pad(self.record.drive, edge, mode="edge")
        return apply_at(padded, self.centres + edge, weights)[:, 0]


@dataclass(frozen=True, eq=False)
class Samples(Block):
    """Every sample of a record, without windows."""

    def windowed(self, series: Array, order: int = 0) -> Array:
        """Return the series itself."""
        return series


@dataclass(frozen=True, eq=False)
class SlidingRows:
    """All rows of all records.

    Attributes
    ----------
    blocks : tuple of Block
    sources : tuple of SlidingRecord
        One for each experiment, including those without rows.
    velocity, acceleration, jerk, snap, pop : array, shape (n,)
        Windowed derivatives of the position, of order 1, 2, 3, 4 and 6.
    slopes : bool
        Whether `see` returns time derivatives instead of values.
    """

    blocks: tuple[Block, ...]
    sources: tuple[SlidingRecord, ...]
    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array
    pop: Array
    slopes: bool = False

    @property
    def records(self) -> tuple[SlidingRecord, ...]:
        """The records that have rows, in their order."""
        return tuple(dict.fromkeys(b.record for b in self.blocks))

    @property
    def rates(self) -> SlidingRows:
        """The same rows with `slopes`: `see` returns time derivatives."""
        return replace(self, slopes=True)

    @cached_property
    def kept(self) -> dict[str, Any]:
        """Cache of results that depend on the rows only."""
        return {}

    def see(self, series: Series) -> Array:
        """Return columns of the smooth motion through all windows, shape (n, k)."""
        made = {id(r): series(r) for r in self.records}
        order = 1 if self.slopes else 0
        return np.concatenate([_columns(b.windowed(made[id(b.record)], order)) for b in self.blocks])

    def torque(self, skew: float) -> Array:
        """Return the windowed torque that acted, shape (n,)."""
        loss = np.concatenate([np.full(b.centres.size, b.record.loss) for b in self.blocks])
        return np.concatenate([b.torque(skew) for b in self.blocks]) - loss * self.velocity

    def at_centres(self, series: Series) -> Array:
        """Return a series at the windows' centres, shape (n,)."""
        return np.concatenate([series(b.record)[b.centres] for b in self.blocks])

    @cached_property
    def sign(self) -> Array:
        """Direction of motion."""
        return self.at_centres(lambda r: r.sign)

    @cached_property
    def stroke(self) -> Integers:
        """Number of every row's stroke."""
        return np.concatenate([b.record.stroke[b.centres] for b in self.blocks])

    @cached_property
    def position(self) -> Array:
        """Position at the centres, rad (m), from the record's own zero."""
        return self.at_centres(lambda r: r.position + r.origin)

    @cached_property
    def block(self) -> Integers:
        """Number of every row's block: rows of one record and width share their noise."""
        return np.concatenate([np.full(b.centres.size, i) for i, b in enumerate(self.blocks)])

    @cached_property
    def band(self) -> Array:
        """Width of every row: -1 in the narrowest windows, 0 in the middle ones, 1 in the widest."""
        return np.concatenate([np.full(b.centres.size, b.width - 1.0) for b in self.blocks])

    @cached_property
    def period(self) -> float:
        """Longest sample period of the records, s."""
        return max(r.period for r in self.records)

    @cached_property
    def fastest(self) -> float:
        """Speed that is hardly exceeded, rad/s (m/s)."""
        return max(r.fastest for r in self.records)

    @cached_property
    def slowest(self) -> float:
        """Speed that 99 % of the rows exceed, rad/s (m/s)."""
        return float(np.quantile(np.abs(self.velocity), 0.01))

    @cached_property
    def middle(self) -> float:
        """Middle of all positions, rad (m)."""
        return 0.5 * (self._lowest + self._highest)

    @cached_property
    def range(self) -> float:
        """Range of all positions, rad (m)."""
        return self._highest - self._lowest

    @cached_property
    def _lowest(self) -> float:
        return min(float(r.position.min()) + r.origin for r in self.records)

    @cached_property
    def _highest(self) -> float:
        return max(float(r.position.max()) + r.origin for r in self.records)

    def place(self, record: SlidingRecord) -> Array:
        """Return a record's positions, scaled from -1 to 1 over the range of all records, shape (samples,)."""
        return (record.position + record.origin - self.middle) / max(0.5 * self.range, 1e-300)

    @cached_property
    def largest(self) -> tuple[float, float, float]:
        """Usual largest speed, acceleration and jerk."""
        every = (self.velocity, self.acceleration, self.jerk)
        # If few rows accelerate, a quantile of all rows would miss them.
        sizes = [max(float(np.quantile(np.abs(x), USUAL)), RARE * float(np.max(np.abs(x)))) for x in every]
        return sizes[0] or 1.0, sizes[1] or 1.0, sizes[2] or 1.0


def _columns(x: Array) -> Array:
    return x[:, None] if x.ndim == 1 else x


def sliding_rows(experiments: Sequence[Experiment], axis: ServoAxis) -> SlidingRows:
    """Apply windows to the strokes of some records.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal.
    axis : ServoAxis

    Raises
    ------
    TooLittleSliding
        If no stroke is long enough for rows of any width.
    """
    half = max(narrowest_half(t) for t in experiments)
    blocks, sources, first = list[Block](), list[SlidingRecord](), 0
    for t in experiments:
        record = sliding_record(t, axis, half, first)
        sources.append(record)
        first = max(first, int(record.stroke.max()) + 1)
        blocks += [b for k in range(WIDTHS) if (b := _block(record, k, half * 2.0**k)).centres.size >= FEWEST]
    if not blocks:
        longest = max(
            (j - i) * t.period
            for t in experiments
            for i, j in sliding_record(t, axis, half).strokes or [(0, 0)]
        )
        raise TooLittleSliding(
            f"too little gross sliding: the longest motion in one direction lasts {longest:.3g} s, windows "
            f"{2.0 * half:.2g} s; record longer motion in one direction, a finer position, or rows more often"
        )
    derivatives = np.concatenate([
        apply_at(b.record.position, b.centres, window_weights(b.half, b.record.period, (1, 2, 3, 4, 6))) for b in blocks
    ])  # fmt: skip
    return SlidingRows(tuple(blocks), tuple(sources), *derivatives.T)


def _block(record: SlidingRecord, width: int, half: float) -> Block:
    """Return the rows of one width whose windows are inside strokes."""
    m = window_weights(half, record.period, (0,)).shape[1] // 2
    sliding = sum(j - i for i, j in record.strokes)
    hop = max(1, int(half / record.period / OVERLAP), sliding // MOST)
    centres: list[Integers] = [np.arange(i + m + 1, j - m - 1, hop) for i, j in record.strokes]
    kept: Integers = np.concatenate(centres) if centres else np.zeros(0, dtype=np.int64)
    inside = (kept >= m) & (kept < record.time.size - m)
    return Block(record, width, half, kept[inside].astype(np.int64))


def sample_rows(rows: SlidingRows, record: SlidingRecord) -> SlidingRows:
    """Return all samples of a record as rows on the scales of other rows, for columns that `SlidingRows.see` makes."""
    every = np.arange(record.time.size)
    still = np.zeros(every.size)
    own = SlidingRows(
        (Samples(record, 0, 0.0, every),), (record,), record.velocity, record.acceleration, still, still, still
    )  # fmt: skip
    own.__dict__.update({n: getattr(rows, n) for n in ("fastest", "middle", "range", "largest", "period")})
    return own
