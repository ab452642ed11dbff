"""Flatten nested data (structures, groups, lists of samples) into columns and constants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.readers._cells import moment
from stickslip.readers.limits import MAX_COLUMNS, insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Column, Table

MAX_DEPTH = 12
MAX_WIDTH = 64
"""A matrix with more columns than this is an image or a map, not signals."""
MAX_PARTS = 10 * MAX_COLUMNS
"""Groups, arrays and single values of a tree."""
NAMES = ("name", "Name", "label", "blockName", "Label")
VALUES = ("values", "Values", "data", "Data", "value")
TIMES = ("time", "Time", "t", "timestamp")


class _Layout:
    """Collects the columns and constants of a tree; `source` is its file, None for data in memory."""

    def __init__(self, source: Path | None) -> None:
        self._source = source
        self._within: set[int] = set()
        """The containers around the current value, by identity."""
        self._parts = 0
        self.columns: list[Column] = []
        self.constants: dict[str, float | str] = {}
        self.findings: list[Finding] = []
        self.unread: dict[str, str] = {}

    def walk(self, name: str, value: Any, depth: int = 0) -> None:
        """Flatten one value under a name.

        Raises
        ------
        InputError
            If a container contains itself, or there are too many parts or columns.
        """
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise InputError(
                f"{self._source or 'log'} has more than {MAX_PARTS} groups and single values; give only "
                "the columns that you need"
            )
        if isinstance(value, (str, bytes, bool, int, float)):
            self._lay_out(name, value, depth)
            return
        if id(value) in self._within:
            raise InputError(
                f"{self._source or 'log'}: {name!r} contains itself; give columns of plain numbers"
            )
        self._within.add(id(value))
        try:
            self._lay_out(name, value, depth)
        finally:
            self._within.discard(id(value))

    def _lay_out(self, name: str, value: Any, depth: int) -> None:
        if depth > MAX_DEPTH:
            self._skipped(name, f"is nested deeper than {MAX_DEPTH} levels")
        elif isinstance(value, Mapping):
            self._mapping(name, cast("Mapping[Any, Any]", value), depth)
        elif isinstance(value, (str, bytes)):
            self.constants[name] = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        elif isinstance(value, (list, tuple)):
            self._list(name, cast("Sequence[Any]", value), depth)
        elif isinstance(value, np.ndarray):
            self._array(name, cast("np.ndarray[Any, Any]", value), depth)
        elif isinstance(value, (bool, int, float, np.number, np.bool_)):
            self.constants[name] = as_number(value)

    def _mapping(self, name: str, value: Mapping[Any, Any], depth: int) -> None:
        before = len(self.columns)
        label = next((str(value[k]) for k in NAMES if isinstance(value.get(k), str) and value[k]), "")
        inner = next((k for k in VALUES if k in value and not np.isscalar(value[k])), None)
        if label and inner is not None:
            unit = next(
                (str(value[k]) for k in ("unit", "Unit", "units") if isinstance(value.get(k), str)), ""
            )
            self.walk(_join(name, label), value[inner], depth + 1)
            self._give_unit(before, unit)
        else:
            for key, item in value.items():
                self.walk(_join(name, str(key)), item, depth + 1)

    def _give_unit(self, before: int, unit: str) -> None:
        self.columns[before:] = [
            Column(c.name, c.values, c.unit or unit, c.clock) for c in self.columns[before:]
        ]

    def _list(self, name: str, value: Sequence[Any], depth: int) -> None:
        if not value:
            return
        if all(isinstance(item, Mapping) for item in value):
            samples = cast("Sequence[Mapping[str, Any]]", value)
            few = len(samples) <= MAX_WIDTH
            if any(_labelled(s) for s in samples) or (few and any(_has_signals(s) for s in samples)):
                for i, sample in enumerate(samples):
                    self.walk(_join(name, "" if _labelled(sample) else str(i)), sample, depth + 1)
            else:
                self._samples(name, samples)
            return
        if any(isinstance(item, (Mapping, list, tuple, np.ndarray)) for item in value):
            self._ragged(name, value, depth)
            return
        numbers = as_numbers(value)
        if numbers is not None and _unit_of(value[:1]):
            self._add(Column(name, numbers, "s"))
        elif numbers is None:
            self._skipped(name, "holds no numbers")
            self.unread[name] = str(value[0])[:30]
        else:
            self._array(name, numbers, depth)

    def _ragged(self, name: str, value: Sequence[Any], depth: int) -> None:
        rows = [_row(item) for item in value]
        whole = [r for r in rows if r is not None]
        if len(whole) == len(rows) and len({r.size for r in whole}) == 1:
            self._array(name, np.stack(whole), depth)
            return
        for i, item in enumerate(value[:MAX_WIDTH]):
            self.walk(_join(name, str(i)), item, depth + 1)

    def _samples(self, name: str, samples: Sequence[Mapping[str, Any]]) -> None:
        """Flatten a list of samples, each a mapping: one column per key."""
        flat = [_flat(sample) for sample in samples]
        keys = dict.fromkeys(key for sample in flat for key in sample)
        insist_on_columns(self._source or "log", len(keys))
        if self._source is not None:
            # If every sample has other keys, the table has far more cells than the file has numbers.
            insist_on_values(self._source, len(keys) * len(flat))
        for key in keys:
            values = [as_number(sample.get(key)) for sample in flat]
            words = [s[key] for s in flat if isinstance(s.get(key), str)]
            if all(math.isnan(v) for v in values) and words:
                self.unread[key] = words[0][:30]
                continue
            # The name of the list does not describe a signal.
            self._add(Column(key, np.array(values), _unit_of(words)))

    def _array(self, name: str, value: np.ndarray[Any, Any], depth: int) -> None:
        if value.dtype.names:
            for field in value.dtype.names:
                self.walk(_join(name, field), value[field], depth + 1)
            return
        if value.dtype == object:
            self._list(name, value.ravel().tolist(), depth + 1)
            return
        numbers = _numeric(value)
        if numbers is None:
            if value.size == 1:
                self.constants[name] = str(value.ravel()[0])
            else:
                self._skipped(name, f"holds {value.dtype}, not numbers")
                self.unread[name] = str(value.ravel()[0])[:30] if value.size else ""
            return
        numbers = np.squeeze(numbers)
        if numbers.ndim == 0:
            self.constants[name] = float(numbers)
        elif numbers.ndim == 1:
            if numbers.size:
                self._add(Column(name, numbers))
        elif numbers.ndim == 2:
            self._matrix(name, numbers)
        else:
            self._skipped(name, f"has shape {value.shape}; only vectors and matrices are signals")

    def _matrix(self, name: str, value: np.ndarray[Any, Any]) -> None:
        rows = value if value.shape[0] >= value.shape[1] else value.T
        if rows.shape[1] > MAX_WIDTH:
            self._skipped(name, f"has {rows.shape[1]} columns; at most {MAX_WIDTH} are read")
            return
        for i in range(rows.shape[1]):
            self._add(Column(f"{name}[{i}]" if name else f"column {i + 1}", np.ascontiguousarray(rows[:, i])))

    def _add(self, column: Column) -> None:
        self.columns.append(column)
        insist_on_columns(self._source or "log", len(self.columns))

    def _skipped(self, name: str, why: str) -> None:
        self.findings.append(Finding("note", "not-read", f"{name or 'the file'!r} {why}; it was left out"))


def table_of(
    format_name: str, tree: Any, source: Path | None = None, findings: Sequence[Finding] = ()
) -> Table:
    """Flatten a tree of mappings, lists and arrays.

    If two or more of its groups have their own time, the columns of each group get it as their clock.

    Raises
    ------
    InputError
        If a container contains itself, or there are more columns or values than are read from the file `source`.
    """
    layout = _Layout(source)
    layout.walk("", tree)
    said = (*findings, *layout.findings)
    return Table(format_name, _with_clocks(layout.columns), layout.constants, said, layout.unread)


def _with_clocks(columns: list[Column]) -> tuple[Column, ...]:
    clocks = {_group(c.name): c for c in columns if c.name.rsplit(".", 1)[-1] in TIMES}
    if len(clocks) < 2:
        return tuple(columns)
    out: list[Column] = []
    for column in columns:
        # The nearest group above the column that has a time of the same length.
        group, clock = _group(column.name), None
        while clock is None:
            found = clocks.get(group)
            if found is not None and found.values.size == column.values.size:
                clock = found
            if not group:
                break
            group = _group(group)
        if clock is not column:
            out.append(Column(column.name, column.values, column.unit, clock.values if clock else None))
    return tuple(out)


def _group(name: str) -> str:
    return name.rsplit(".", 1)[0] if "." in name else ""


def _join(group: str, name: str) -> str:
    return f"{group}.{name}" if group and name else group or name


def _labelled(sample: Mapping[str, Any]) -> bool:
    return any(isinstance(sample.get(k), str) for k in NAMES) and any(
        not np.isscalar(sample.get(k)) for k in VALUES if k in sample
    )


def _has_signals(sample: Mapping[str, Any]) -> bool:
    """Whether one of its values is too long for a vector within one sample."""
    lists: list[Any] = [v for v in sample.values() if isinstance(v, (list, np.ndarray))]
    return any(np.size(v) > MAX_WIDTH and np.ndim(v) > 0 for v in lists if not _is_uneven(v))


def _is_uneven(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(i, (list, Mapping)) for i in cast("list[Any]", value))


def _flat(
    sample: Mapping[str, Any], prefix: str = "", depth: int = 0, within: frozenset[int] = frozenset()
) -> dict[str, Any]:
    """Return one sample without nesting: names of mappings joined by dots, elements of vectors as [i]."""
    out: dict[str, Any] = {}
    if id(sample) in within:
        raise InputError(f"log: {prefix!r} contains itself; give columns of plain numbers")
    for key, value in sample.items():
        name = _join(prefix, str(key))
        if isinstance(value, Mapping) and depth < MAX_DEPTH:
            out |= _flat(cast("Mapping[str, Any]", value), name, depth + 1, within | {id(sample)})
        elif isinstance(value, (list, tuple)):
            items = {f"{name}[{i}]": item for i, item in enumerate(cast("Sequence[Any]", value)[:MAX_WIDTH])}
            for part, item in items.items():
                if isinstance(item, Mapping) and depth < MAX_DEPTH:
                    out |= _flat(cast("Mapping[str, Any]", item), part, depth + 1, within | {id(sample)})
                else:
                    out[part] = item
        else:
            out[name] = value
    return out


def as_number(value: Any) -> float:
    """Return a value as a float, a date in s since 1970; NaN for anything else."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        try:
            return float(cast("Any", value))
        except OverflowError:  # an integer beyond the range of floats
            return math.copysign(math.inf, 1 if cast("Any", value) > 0 else -1)
        except TypeError:
            return math.nan
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            date = moment(value.strip())
            return math.nan if date is None else date
    return math.nan


def _unit_of(values: Sequence[Any]) -> str:
    """Return seconds if the first value is the text of a date or of a time of day, else no unit."""
    first = values[0] if values else None
    return "s" if isinstance(first, str) and moment(first.strip()) is not None else ""


def as_numbers(values: Sequence[Any]) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return a flat sequence as floats, with NaN for entries that are no numbers; None without any number."""
    numbers = np.array([as_number(v) for v in values], dtype=np.float64)
    return None if numbers.size and np.isnan(numbers).all() and not _all_nan(values) else numbers


def _all_nan(values: Sequence[Any]) -> bool:
    return all(isinstance(v, (float, np.floating)) for v in values)


def _row(item: Any) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return one row of a matrix that is written as lists."""
    if isinstance(item, np.ndarray):
        array = cast("np.ndarray[Any, Any]", item)
        return _numeric(array) if array.ndim == 1 else None
    if isinstance(item, (list, tuple)):
        return as_numbers(cast("Sequence[Any]", item))
    return None


def _numeric(value: np.ndarray[Any, Any]) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return an array of numbers as floats, times of NumPy in s; None for anything else."""
    if value.dtype.kind in "biuf":
        return value.astype(np.float64)
    if value.dtype.kind in "mM":
        ticks = value.astype("datetime64[ns]" if value.dtype.kind == "M" else "timedelta64[ns]")
        seconds = ticks.astype(np.int64) * 1e-9
        return np.where(np.isnat(ticks), np.nan, seconds)
    return None
