"""Tables in groups of a time column and the values that were sampled then, as TwinCAT Scope exports them.

A metadata row repeats its key where a group begins: ``Name  ActPos  Name  ActVelo``. One row of the file is then not
one instant. Times are in ms since the start of the export, or in ticks of 100 ns since 1601
(Beckhoff, TE13xx "Export in csv": timelines all, or for each sample time).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from stickslip.readers._names import role_of
from stickslip.readers._units import parse_unit
from stickslip.readers.table_columns import Array, Column

KEYS = (
    "name", "symbolname", "symbolcomment", "netid", "port", "indexgroup", "indexoffset", "data-type",
    "sampletime[ms]", "symbolbased", "variablesize", "offset", "scalefactor", "bitmask", "unit",
)  # fmt: skip
TICKS = 1e15
"""A time beyond this is a count of 100 ns since 1601: in 1604."""


def groups(header: Sequence[Sequence[str]], width: int) -> tuple[int, ...] | None:
    """The columns that hold times, or None where the table has one time for all."""
    for row in header:
        cells = [c.strip() for c in row]
        if len(cells) < width or not cells[0]:
            continue
        starts = [i for i, c in enumerate(cells[:width]) if c.lower() == cells[0].lower()]
        scope = cells[0].lower() in KEYS
        timed = role_of(cells[0]).role == "time" or bool(re.fullmatch(r"[xt]\d*", cells[0].lower()))
        if (scope or (timed and len(starts) > 1)) and all(
            b - a > 1 for a, b in zip(starts, [*starts[1:], width], strict=True)
        ):
            return tuple(starts)
    # Times numbered apart: time1, position, time2, velocity.
    for row in header:
        cells = [c.strip() for c in row]
        if len(cells) == width and width >= 4 and width % 2 == 0:
            timed = [role_of(c).role == "time" for c in cells]
            if all(timed[::2]) and not any(timed[1::2]):
                return tuple(range(0, width, 2))
    return None


def columns(header: Sequence[Sequence[str]], starts: tuple[int, ...], values: Array) -> tuple[Column, ...]:
    """The value columns, each with the clock of its group."""
    width = values.shape[1]
    named = _row(header, "name", width) or _row(header, "symbolname", width) or _widest(header, width)
    units, periods = _row(header, "unit", width), _row(header, "sampletime[ms]", width)
    ends = (*starts[1:], values.shape[1])
    out: list[Column] = []
    for start, end in zip(starts, ends, strict=True):
        ticks = values[:, start]
        kept = np.isfinite(ticks)
        last = int(np.flatnonzero(kept)[-1]) + 1 if kept.any() else 0
        clock = _seconds(ticks[:last], _at(periods, start + 1), _at(named, start) if not units else "")
        for j in range(start + 1, end):
            unit = _at(units, j)
            unit = unit if parse_unit(unit) is not None else ""
            out.append(Column(_at(named, j) or f"column {j + 1}", values[:last, j].copy(), unit, clock))
    return tuple(c for c in out if c.values.size and not np.isnan(c.values).all())


def constants(header: Sequence[Sequence[str]]) -> dict[str, float | str]:
    """The lines of two cells above the channels: scope, file, start and end."""
    return {
        row[0].strip(): row[1].strip()
        for row in header
        if 2 <= len(row) <= 4 and row[0].strip() and row[0].strip() != row[-1].strip()
    }


def _seconds(ticks: Array, period_ms: str, label: str) -> Array:
    """Times in s: FILETIME, the unit in the column's name, or ms; a counter of samples is told by the period."""
    if ticks.size and np.nanmax(np.abs(ticks)) > TICKS:
        return (ticks - ticks[0]) * 1e-7
    if (unit := parse_unit(role_of(label).unit)) is not None and unit.kind == "time":
        return ticks * unit.factor
    try:
        period = float(period_ms.replace(",", "."))
    except ValueError:
        period = 0.0
    if period <= 0.0:
        return ticks * 1e-3 if not label or label.lower() in KEYS else ticks
    step = float(np.nanmedian(np.diff(ticks))) if ticks.size > 1 else period
    # Some exports count samples instead of milliseconds.
    return ticks * (period * 1e-3 if step == 1.0 else 1e-3)


def _row(header: Sequence[Sequence[str]], key: str, width: int) -> Sequence[str]:
    """The row of a key, one cell a column: a shorter one is about the scope, as is "Name  Project"."""
    found = [row for row in header if len(row) >= width - 1 and row[0].strip().lower() == key]
    return max(found, key=len) if found else ()


def _widest(header: Sequence[Sequence[str]], width: int) -> Sequence[str]:
    return next((row for row in reversed(header) if len(row) >= width - 1), ())


def _at(row: Sequence[str], i: int) -> str:
    return row[i].strip().strip('"') if i < len(row) else ""
