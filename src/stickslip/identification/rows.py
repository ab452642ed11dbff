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
"""Makes columns, shape (samples,) or (samples, k), of a record's smooth motion."""

WIDTHS = 3
"""Windows, each twice as long as the one before: what differs between them is no rigid axis."""
OVERLAP = 3.0
"""Rows per half window."""
FEWEST = 12
"""Rows of one width that are worth a regression: twice its plain parameters."""
MOST = 10_000
"""Rows of one width and record: of a long record more tell no more."""
LATEST = 8
"""Samples by which the torque's column may lie off at most, where its delay is not stated."""
USUAL = 0.98
"""Quantile that stands for the largest velocity, acceleration and jerk."""
RARE = 1e-3
"""Part of the very largest, that it is at least."""


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of one record and one width.

    Attributes
    ----------
    record : SlidingRecord
    width : int
        0 is the narrowest.
    half : float
        s
    centres : array of int, shape (n,)
        Samples about which the windows lie.
    """

    record: SlidingRecord
    width: int
    half: float
    centres: Integers

    def windowed(self, series: Array, order: int = 0) -> Array:
        """Windowed series, or its derivative of that order, shape (n, k)."""
        return np.asarray(self.operator(order) @ series)

    def operator(self, order: int) -> Any:
        """Sparse matrix that windows a series, shape (n, samples)."""
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
        """Windowed drive torque or its derivative of that order, its column `skew` s behind the torque that acted."""
        weights = window_weights(self.half, self.record.period, (order,), skew)
        edge = math.ceil(abs(skew) / self.record.period) + 1
        padded = np.pad(self.record.drive, edge, mode="edge")
        return apply_at(padded, self.centres + edge, weights)[:, 0]


@dataclass(frozen=True, eq=False)
class Samples(Block):
    """Every sample of a record, seen as it is."""

    def windowed(self, series: Array, order: int = 0) -> Array:
        """The series itself."""
        return series


@dataclass(frozen=True, eq=False)
class SlidingRows:
    """All rows of all records.

    Attributes
    ----------
    blocks : tuple of Block
    sources : tuple of SlidingRecord
        One for each experiment, those without rows too.
    velocity, acceleration, jerk, snap, pop : array, shape (n,)
        Windowed derivatives of the position, of order 1, 2, 3, 4 and 6.
    slopes : bool
        Whether `see` gives time derivatives instead of values.
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
        """The same rows, of which columns are seen as their time derivatives."""
        return replace(self, slopes=True)

    @cached_property
    def kept(self) -> dict[str, Any]:
        """What was made of the rows and is asked for again."""
        return {}

    def see(self, series: Series) -> Array:
        """Columns of the smooth motion through all windows, shape (n, k)."""
        made = {id(r): series(r) for r in self.records}
        order = 1 if self.slopes else 0
        return np.concatenate([_columns(b.windowed(made[id(b.record)], order)) for b in self.blocks])

    def torque(self, skew: float) -> Array:
        """Windowed torque that acted, shape (n,)."""
        loss = np.concatenate([np.full(b.centres.size, b.record.loss) for b in self.blocks])
        return np.concatenate([b.torque(skew) for b in self.blocks]) - loss * self.velocity

    def at_centres(self, series: Series) -> Array:
        """A series at the windows' centres, shape (n,)."""
        return np.concatenate([series(b.record)[b.centres] for b in self.blocks])

    @cached_property
    def sign(self) -> Array:
        """Direction of motion."""
        return self.at_centres(lambda r: r.sign)

    @cached_property
    def stroke(self) -> Integers:
        """Number of a row's stroke."""
        return np.concatenate([b.record.stroke[b.centres] for b in self.blocks])

    @cached_property
    def position(self) -> Array:
        """Position at the centres, rad (m), from the record's own zero."""
        return self.at_centres(lambda r: r.position + r.origin)

    @cached_property
    def block(self) -> Integers:
        """Number of a row's block: rows of one record and width share their noise."""
        return np.concatenate([np.full(b.centres.size, i) for i, b in enumerate(self.blocks)])

    @cached_property
    def band(self) -> Array:
        """-1 in the narrowest windows, 0 in the middle ones, 1 in the widest."""
        return np.concatenate([np.full(b.centres.size, b.width - 1.0) for b in self.blocks])

    @cached_property
    def period(self) -> float:
        """The longest one from sample to sample, s."""
        return max(r.period for r in self.records)

    @cached_property
    def fastest(self) -> float:
        """Speed that is hardly exceeded, rad/s (m/s)."""
        return max(r.fastest for r in self.records)

    @cached_property
    def slowest(self) -> float:
        """Speed that 1 % of the rows stay below, rad/s (m/s)."""
        return float(np.quantile(np.abs(self.velocity), 0.01))

    @cached_property
    def middle(self) -> float:
        """Middle of all positions, rad (m)."""
        return 0.5 * (self._lowest + self._highest)

    @cached_property
    def range(self) -> float:
        """Length of all positions, rad (m)."""
        return self._highest - self._lowest

    @cached_property
    def _lowest(self) -> float:
        return min(float(r.position.min()) + r.origin for r in self.records)

    @cached_property
    def _highest(self) -> float:
        return max(float(r.position.max()) + r.origin for r in self.records)

    def place(self, record: SlidingRecord) -> Array:
        """Position of a record's samples, from -1 at the one end of all to 1 at the other, shape (samples,)."""
        return (record.position + record.origin - self.middle) / max(0.5 * self.range, 1e-300)

    @cached_property
    def largest(self) -> tuple[float, float, float]:
        """Usual largest speed, acceleration and jerk."""
        every = (self.velocity, self.acceleration, self.jerk)
        # Where hardly a row accelerates, those that do are the usual ones.
        sizes = [max(float(np.quantile(np.abs(x), USUAL)), RARE * float(np.max(np.abs(x)))) for x in every]
        return sizes[0] or 1.0, sizes[1] or 1.0, sizes[2] or 1.0


def _columns(x: Array) -> Array:
    return x[:, None] if x.ndim == 1 else x


def sliding_rows(experiments: Sequence[Experiment], axis: ServoAxis) -> SlidingRows:
    """See the strokes of some records through windows.

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
    """Rows of one width whose windows lie inside strokes."""
    m = window_weights(half, record.period, (0,)).shape[1] // 2
    sliding = sum(j - i for i, j in record.strokes)
    hop = max(1, int(half / record.period / OVERLAP), sliding // MOST)
    centres: list[Integers] = [np.arange(i + m + 1, j - m - 1, hop) for i, j in record.strokes]
    kept: Integers = np.concatenate(centres) if centres else np.zeros(0, dtype=np.int64)
    inside = (kept >= m) & (kept < record.time.size - m)
    return Block(record, width, half, kept[inside].astype(np.int64))


def sample_rows(rows: SlidingRows, record: SlidingRecord) -> SlidingRows:
    """All samples of one record as rows on the scales of others: for columns that `SlidingRows.see` makes."""
    every = np.arange(record.time.size)
    still = np.zeros(every.size)
    own = SlidingRows(
        (Samples(record, 0, 0.0, every),), (record,), record.velocity, record.acceleration, still, still, still
    )  # fmt: skip
    own.__dict__.update({n: getattr(rows, n) for n in ("fastest", "middle", "range", "largest", "period")})
    return own
