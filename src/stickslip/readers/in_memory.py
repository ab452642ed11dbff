"""Read signals from memory: arrays by name, a mapping of arrays, a data frame, a structured array."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.reprs import is_masked, unmasked
from stickslip.core.type_rules import with_article
from stickslip.readers._flatten import table_of
from stickslip.readers._names import ALIASES, KINDS
from stickslip.readers._tool_columns import with_tool
from stickslip.readers._units import SI, parse_unit
from stickslip.readers.convert import LINEAR
from stickslip.readers.table_columns import Column, Table

Array = np.ndarray[Any, np.dtype[np.float64]]

FORMAT = "arrays"


def table_of_signals(
    signals: Mapping[str, Any], units: Mapping[str, str], arguments: Mapping[str, str]
) -> tuple[Table, dict[str, str]]:
    """Return a column for every signal, and the mapping of channels to columns.

    Parameters
    ----------
    signals : mapping of str to array_like, shape (n,)
        By channel, or its short name (torque, reference, ...).
    units : mapping of str to str
        By the same names; default SI, for a linear axis (m, N) if another signal is linear.
    arguments : mapping of str to str
        Name of a signal in messages, if it differs.

    Raises
    ------
    InputError
        If a signal is not a vector of numbers, lengths differ, or a unit is given for an unknown signal.
    """
    columns: list[Column] = []
    for name, values in signals.items():
        said = arguments.get(name, name)
        numbers = numbers_of(said, values, dates=name == "time")
        if numbers.ndim != 1:
            raise InputError(f"{said} has shape {numbers.shape}; give one number a sample, shape (n,)")
        columns.append(Column(name, numbers))
    lengths = {c.name: c.values.size for c in columns}
    if not any(lengths.values()):
        raise InputError(
            f"{arguments.get(columns[0].name, columns[0].name)} is empty; give one number a sample"
        )
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{arguments.get(name, name)} {size}" for name, size in lengths.items())
        raise InputError(f"the arrays differ in length ({listed}); give one number a sample in each")
    listed = ", ".join(arguments.get(name, name) for name in signals)
    for name in units:
        if name not in signals:
            raise InputError(f"units names {arguments.get(name, name)!r}, which is none of {listed}")
    stated = [parse_unit(unit) for unit in units.values()]
    linear = any(unit is not None and unit.kind in LINEAR.values() for unit in stated)
    channels: dict[str, str] = {}
    for name in signals:
        role = ALIASES.get(name, name)
        kind = KINDS[role][0]
        channels[role] = f"{name}:{units.get(name) or SI[LINEAR.get(kind, kind) if linear else kind]}"
    # A missing channel must not be guessed from the name of another.
    left_out = {role: "none" for role in KINDS if role not in channels}
    return Table(FORMAT, tuple(columns)), channels | left_out


def numbers_of(name: str, values: Any, dates: bool = False) -> Array:
    """Return a signal's numbers; if `dates` are allowed, dates and time differences in s from the first.

    Raises
    ------
    InputError
        If they are not numbers.
    """
    try:
        given = with_dates(values)
        if given.dtype.kind in "mM" and dates:
            return _seconds(given, given[~np.isnat(given)][:1])
        if given.dtype.kind not in "bcmM":
            return np.asarray(given, dtype=np.float64)
    except OverflowError:
        raise InputError(f"{name} has a number beyond 1.8e308, which no signal has; correct it") from None
    except (TypeError, ValueError):
        pass
    kind = (
        "of dates, which only the time may be" if _are_dates(values) and not dates else "no array of numbers"
    )
    raise InputError(f"{name} is {kind}; give one number a sample")


def with_dates(values: Any) -> np.ndarray[Any, Any]:
    """Return an array; dates of Python, of pandas and with a time zone become those of NumPy (UTC).

    Raises
    ------
    TypeError, ValueError
        If masked values are neither numbers nor dates.
    """
    if getattr(getattr(values, "dtype", None), "tz", None) is not None:
        values = array_of(values)
    given = unmasked(values)
    if given.dtype != object or given.ndim != 1 or not _are_dates(given):
        return given
    return np.array([_date(date) for date in given], dtype="datetime64[ns]")


def _are_dates(values: Any) -> bool:
    """Whether the first value that is not missing is a date."""
    try:
        given = np.asarray(values)
    except ValueError:  # lists of different lengths, or one that contains itself
        return False
    if given.dtype.kind in "mM":
        return True
    first = next((v for v in given.ravel() if v is not None), None) if given.dtype == object else None
    return isinstance(first, (datetime, np.datetime64))


def _date(value: Any) -> Any:
    """Return a date of NumPy; NaT if missing."""
    if value is None:
        return np.datetime64("NaT")
    if getattr(value, "tzinfo", None) is not None:
        value = value.astimezone(UTC).replace(tzinfo=None)
    return value.to_datetime64() if hasattr(value, "to_datetime64") else np.datetime64(value, "ns")


def _seconds(dates: np.ndarray[Any, Any], first: Any) -> Array:
    """Return dates or time differences in s from the first; NaN if missing.

    Raises
    ------
    TypeError
        For a number of steps without a unit of time.
    """
    if np.datetime_data(dates.dtype)[0] == "generic":
        raise TypeError("a time without a unit")
    span = (dates - first).astype("timedelta64[ns]")
    return np.where(np.isnat(span), np.nan, span.astype(np.int64) * 1e-9)


def table_in_memory(data: Any) -> Table:
    """Return the columns of a mapping of arrays, a data frame or a structured array; their names determine the
    channels.

    Raises
    ------
    InputError
        If it has no columns of numbers.
    """
    if getattr(data, "ndim", None) == 0:
        data = data.item()  # an array around one object
    if getattr(data, "ndim", 0) == 1 and getattr(getattr(data, "dtype", None), "names", None) is None:
        raise InputError(
            f"log: an array of {len(data)} numbers has no column names; give the signals by name: t=..., "
            "position=..., torque=..."
        )
    tree = data
    if hasattr(data, "columns") and hasattr(data, "to_numpy"):
        refuse_the_same_name([str(name) for name in data.columns])
        tree = {str(name): array_of(data[name]) for name in data.columns}
        if name := name_of(data.index):
            tree = {name: array_of(data.index), **tree}
    elif is_masked(data) and data.dtype.names:
        tree = {name: data[name] for name in data.dtype.names}
    if isinstance(tree, Mapping):
        tree = {str(name): _plain(x) for name, x in cast("Mapping[Any, Any]", tree).items()}
    table = table_of(FORMAT, tree)
    if not table.columns:
        raise InputError(
            f"log: {with_article(type(data).__name__)} without columns of numbers is no log; give a path, a data "
            "frame, a mapping of arrays, a Record, or arrays by name (t=..., position=..., torque=...)"
        )
    return with_tool(table)


def refuse_the_same_name(names: Sequence[str]) -> None:
    """Refuse two columns of the same name.

    Raises
    ------
    InputError
    """
    twice = next((name for name in names if names.count(name) > 1), "")
    if twice:
        raise InputError(
            f"log: {names.count(twice)} columns are called {twice!r}; leave out all but one, or rename them"
        )


def name_of(index: Any) -> str:
    """Return the name of a data frame's index: dates are times even without a name; a plain row number is ignored."""
    if index.name is not None:
        return str(index.name)
    return "time" if index.dtype.kind in "mM" else ""


def array_of(column: Any) -> Any:
    """Return a column as a NumPy array; dates with a time zone remain dates."""
    if getattr(column.dtype, "tz", None) is not None:
        column = getattr(column, "dt", column).tz_convert(None)
    return column.to_numpy()


def _plain(values: Any) -> Any:
    """Return arrays of any library as NumPy arrays, dates in s since 1970; anything else unchanged."""
    if not hasattr(values, "__array__"):
        first: Any = next(iter(cast("list[Any]", values)), None) if isinstance(values, list) else None
        dated = isinstance(first, (datetime, np.datetime64))
        return _seconds(with_dates(values), np.datetime64(0, "s")) if dated else cast("Any", values)
    numbers = with_dates(values)
    return _seconds(numbers, np.datetime64(0, "s")) if numbers.dtype.kind == "M" else numbers


def digest_of(table: Table) -> str:
    """Return the SHA-256 of all columns, which identifies the source of a result."""
    digest = hashlib.sha256()
    for column in table.columns:
        digest.update(column.name.encode() + b"\0" + np.ascontiguousarray(column.values).tobytes())
    return digest.hexdigest()
