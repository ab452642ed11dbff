"""Select a part of a record (times, rows, rows left out), and unwrap positions.

Rows count the samples of the file from 1. The rows kept are in ``record.meta["reading"]["kept_rows"]``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import Record, encoder_step

Array = np.ndarray[Any, np.dtype[np.float64]]

BRIDGED = 4
"""Rows that may be left out without splitting the record: filters interpolate across them."""
FEWEST = 50
"""Fewest rows of a usable piece."""
JUMP, ALONE, COUNTS = 20.0, 3.0, 10.0
"""Smallest jump of a position: multiples of the usual change per row, of the neighbouring rows (an axis needs several
rows to accelerate), and of the encoder's step."""
RANGE = 0.8
"""Share of the whole travel beyond which a change in one row is not motion: the counter restarts."""
TURNS, NEARLY = (2.0 * math.pi, 360.0), 0.05
"""One turn, in rad and degrees, and the tolerance of a jump by it."""
SNAP = 0.01


@dataclass(frozen=True, slots=True)
class Cut:
    """Selection of rows: within the times and rows, and not left out.

    Attributes
    ----------
    start, end : float
        s, in the record's time; both included.
    rows : (int, int)
        First and last row, from 1; both included.
    leave_out : tuple of (int, int)
        Rows left out, first and last.
    """

    start: float = -math.inf
    end: float = math.inf
    rows: tuple[float, float] = (1, math.inf)
    leave_out: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for name, value in (("start", self.start), ("end", self.end)):
            if math.isnan(value):
                raise InputError(f"{name_option(name, value)} must be a time in s")
        if not self.start < self.end:
            raise InputError(
                f"{name_option('start', f'{self.start:g}')} s must lie before "
                f"{name_option('end', f'{self.end:g}')} s"
            )

    @property
    def words(self) -> str:
        """Return references to the options that select the rows."""
        said = {
            "start": self.start != -math.inf, "end": self.end != math.inf,
            "rows": self.rows != (1, math.inf), "leave_out": bool(self.leave_out),
        }  # fmt: skip
        return ", ".join(name_option(name) for name, given in said.items() if given)


def parse_rows(option: str, text: str) -> tuple[float, float]:
    """Read ``A:B``, ``A:``, ``:B`` or ``A``: rows from 1, both ends included.

    Raises
    ------
    InputError
        If the text has another form, or the rows are in reverse order.
    """
    first, colon, last = text.partition(":")
    try:
        low = int(first) if first.strip() else 1
        high = (int(last) if last.strip() else math.inf) if colon else low
    except ValueError:
        low, high = 0, 0
    if not text.strip(" :") or low < 1 or high < low:
        raise InputError(
            f"{name_option(option)} {text!r} must be rows A:B counted from 1, such as "
            f"{name_option(option, '2001:8000')}"
        )
    return low, high


def cut(record: Record, asked: Cut) -> Record:
    """Return the requested rows as one record.

    Raises
    ------
    InputError
        If fewer than 20 rows remain, or the record does not have the requested rows.
    """
    if asked == Cut():
        return record
    count = len(record)
    number = np.arange(1, count + 1)
    for option, (low, high) in [("rows", asked.rows), *(("leave_out", r) for r in asked.leave_out)]:
        if low > count:
            raise InputError(f"{name_option(option)} begins at row {low:g}, but the record has {count} rows")
        if count < high < math.inf:
            raise InputError(
                f"{name_option(option)} ends at row {high:g}, but the record has {count} rows; give {low:g}: "
                "for all up to its end"
            )
    keep = (number >= asked.rows[0]) & (number <= asked.rows[1])
    for low, high in asked.leave_out:
        keep &= (number < low) | (number > high)
    if math.isfinite(asked.start) or math.isfinite(asked.end):
        with np.errstate(invalid="ignore"):
            keep &= (record.time >= asked.start) & (record.time <= asked.end)
    left = int(np.count_nonzero(keep))
    if left < 20:
        known = record.time[np.isfinite(record.time)]
        span = f" from t = {known[0]:.6g} to {known[-1]:.6g} s" if known.size else ""
        raise InputError(
            f"{left} of {count} rows are left by {asked.words}, too few to look at; the record has rows 1:{count}{span}"
        )
    return record if left == count else taken(record, keep)


def pieces(record: Record) -> tuple[list[Record], list[Finding]]:
    """Split the record where another run starts or more than `BRIDGED` rows were left out; also return findings about
    short pieces.

    Raises
    ------
    InputError
        If no piece is long enough.
    """
    rows = file_rows(record)
    starts: list[int] = record.meta.get("reading", {}).get("runs", [])
    numpy: Any = np
    runs = numpy.searchsorted(starts, rows, side="right")
    holes = numpy.flatnonzero((np.diff(rows) > BRIDGED + 1) | (numpy.diff(runs) != 0)) + 1
    if not holes.size:
        return [record], []
    index = np.arange(len(record))
    parts = np.split(index, holes)
    whole = [p for p in parts if p.size >= FEWEST]
    if not whole:
        raise InputError(f"no piece of {FEWEST} rows or more is left between the rows that were left out")
    said: list[Finding] = []
    for p in parts:
        if p.size < FEWEST:
            message = (
                f"rows {rows[p[0]]}:{rows[p[-1]]} are too few between what was left out; they are not used"
            )
            said.append(Finding("note", "short-piece", message))
    return [taken(record, np.isin(index, p)) for p in whole], said


def file_rows(record: Record) -> Any:
    """Return the number of every row in its file, from 1."""
    kept: list[list[int]] = record.meta.get("reading", {}).get("kept_rows", [])
    if not kept:
        return np.arange(1, len(record) + 1)
    ranges: list[Any] = [np.arange(a, b + 1) for a, b in kept]
    return np.concatenate(ranges)


def range_words(rows: Any, most: int = 20) -> str:
    """Return row numbers as A:B, separated by commas; more than `most` runs are counted."""
    runs = _runs(rows)
    shown = [f"{a}" if a == b else f"{a}:{b}" for a, b in runs[:most]]
    return ", ".join(shown) + (f" and {len(runs) - most} more runs" if len(runs) > most else "")


def _runs(rows: Any) -> list[list[int]]:
    """Return runs of consecutive numbers: first and last."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [[int(r[0]), int(r[-1])] for r in runs if r.size]


def taken(record: Record, keep: Any) -> Record:
    """Return the rows of a mask with their numbers in the file."""
    rows = file_rows(record)[keep]
    meta = dict(record.meta)
    meta["reading"] = {**meta.get("reading", {}), "kept_rows": _runs(rows)}
    channels = {name: values[keep] for name, values in record.channels.items()}
    return Record(record.time[keep], channels, record.units, meta)


# ---- positions that start anew -------------------------------------------------------------------------------


def unwrapped(record: Record) -> Record:
    """Return the record with its position unwrapped where it jumps by a turn or by the range of its counter.

    The reference is unwrapped in the same way. ``record.meta["derived"]`` states the period.

    Raises
    ------
    InputError
        Without a position, or if it does not jump.
    """
    if "position" not in record.channels:
        raise InputError(
            f"{name_option('unwrap', True)} needs a position; say which column it is with "
            f"{name_columns(position='COLUMN')}"
        )
    period = _period(record)
    if period == 0.0:
        raise InputError(
            f"{name_option('unwrap')}: the position nowhere jumps by a turn or the range of its counter; leave it out"
        )
    channels, unit = dict(record.channels), record.units["position"]
    for name in ("position", "position_reference"):
        if name in channels and record.units[name] == unit:
            channels[name] = _counted_on(channels[name], period)
    said = {
        **record.meta.get("derived", {}),
        "position": f"counted on where it jumps by {period:.6g} {unit}",
    }
    return replace(record, channels=channels, meta={**record.meta, "derived": said})


def jumps(position: Array) -> tuple[Any, Array]:
    """Return the jumps of a position that are not motion: the rows before them, and their size in addition to the
    motion.

    Parameters
    ----------
    position : array, shape (n,)
        Without missing values and without spikes.
    """
    steps = np.diff(position)
    if np.count_nonzero(steps) < 20:  # it hardly moves: its travel is one encoder count
        return np.empty(0, dtype=int), np.empty(0)
    padded = np.pad(steps, 2, mode="edge")
    beside = np.stack([padded[k : k + steps.size] for k in (0, 1, 3, 4)])
    size: Array = np.abs(steps - np.median(beside, axis=0))
    least = COUNTS * encoder_step(position)
    alone = np.abs(steps) > ALONE * np.max(np.abs(beside), axis=0)
    far = size > max(JUMP * float(np.percentile(size, 95)), least, 1e-12)
    anew = np.abs(steps) > max(RANGE * float(np.ptp(position)), least, 1e-12)
    # Fast motion hides the usual step of a position that restarts every turn, but not the turn.
    turned = np.any([np.abs(size / turn - 1.0) < NEARLY for turn in TURNS], axis=0) & (size > least)
    at = np.flatnonzero((alone & (far | turned)) | anew)
    return at, size[at]


def _period(record: Record) -> float:
    """Return the period after which the position restarts, in its unit; 0 if it does not."""
    _, sizes = jumps(record["position"][np.isfinite(record["position"])])
    if not sizes.size:
        return 0.0
    size = float(np.median(sizes))
    return next((known for known in _known_periods(record) if abs(size / known - 1.0) < SNAP), size)


def _known_periods(record: Record) -> list[float]:
    """Return the known periods: a turn on either side of the gear, and counters of common sizes."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    drive: dict[str, Any] = reading.get("drive", {})
    column: dict[str, Any] = next(
        (c for c in reading.get("columns", []) if c["channel"] == "position"), {"factor": 1.0}
    )
    counters = [float(column["factor"]) * 2.0**bits for bits in (8, 10, 12, 14, 16, 18, 20, 24, 32)]
    if record.units["position"] != "rad":
        return counters
    ratio = float(drive.get("gear_ratio", 1.0))
    turns = [2.0 * math.pi * f for f in dict.fromkeys((1.0, ratio, 1.0 / ratio))]
    return [*turns, *(counters if "counts_per_rev" in drive else [])]


def _counted_on(values: Array, period: float) -> Array:
    out = values.copy()
    good = np.isfinite(values)
    steps = np.diff(values[good])
    out[good] = values[good] - np.concatenate(([0.0], np.cumsum(period * np.round(steps / period))))
    return out
