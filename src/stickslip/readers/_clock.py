"""Determine the sample times of a table: from its time column, its stated rate, or the clocks of its columns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.readers._choose import Choice
from stickslip.readers._column_groups import epoch_unit
from stickslip.readers._stated_period import stated_period
from stickslip.readers._units import parse_unit
from stickslip.readers.table_columns import Array, Column, Table

PERIODS = (
    "dt",
    "ts",
    "sampletime",
    "sample_time",
    "sampling_time",
    "deltat",
    "delta_t",
    "delta_x",
    "period",
    "increment",
    "abtastzeit",
    "tsample",
    "sampling_period",
)
RATES = (
    "fs",
    "samplerate",
    "sample_rate",
    "sampling_rate",
    "rate_hz",
    "abtastrate",
    "sampling_frequency",
    "f_s",
)

COUNTERS, NEAR = (16, 24, 32), 4.0
"""Bits of a time counter, and its tolerance at an overflow, in steps."""
FIRST = ("position", "velocity", "motor_torque")
"""Channels whose times become those of the record, in order of preference."""
MOST_FILLED, UNEVEN, EVEN = 0.9, 0.5, 0.95
"""A column is sampled slower than the others if at most `MOST_FILLED` of the rows between its first and last value have
one, and if `EVEN` of its steps are within `UNEVEN` of the median step. Lost samples are not evenly spaced."""
LONGEST_NAME = 60
"""Characters of a column's name that an error quotes."""
EFFORTS = {"motor_torque", "friction_torque", "sensor_torque", "current"}
"""Channels from which the torque at a constant velocity follows."""
SAME = 0.01
"""Relative difference between a stated period and the time column that is not reported."""


class NoTimes(InputError):
    """A table whose rows have no times."""


def time_of(
    table: Table, by_role: dict[str, Choice], columns: dict[str, Column], sample_time: float | None
) -> tuple[Array, float, list[Finding]]:
    """Return the record's times in s, the time subtracted from them, and findings."""
    found: list[Finding] = []
    first = next(
        (columns[by_role[r].column] for r in (*FIRST, *by_role) if r in by_role and r != "time"),
        None,
    )
    if sample_time is not None:
        if not (math.isfinite(sample_time) and sample_time > 0.0):
            raise InputError(f"sample_time = {sample_time:g} must be greater than 0 s")
        if first is None:
            raise InputError(
                f"no column is known to be a channel; say which with {name_columns(position='COLUMN:UNIT')}"
            )
        if (choice := by_role.pop("time", None)) is not None:
            found += _overruled(choice, columns[choice.column].values, sample_time)
        return np.arange(first.values.size, dtype=np.float64) * sample_time, 0.0, found
    period = _period_of(table)
    if (
        "time" in by_role
        and period is not None
        and not np.isfinite(columns[by_role["time"].column].values).any()
    ):
        del by_role["time"]
    if "time" in by_role:
        choice = by_role["time"]
        time = _counted_on(columns[choice.column].values, choice, found)
        unit = parse_unit(choice.unit)
        factor = unit.factor if unit is not None else epoch_unit(time)
        if unit is None and factor != 1.0:
            found.append(
                Finding(
                    "note",
                    "time-unit",
                    f"time {choice.column!r} counts from 1970 in steps of {factor:g} s, by its size",
                )
            )
        return _from_start(time, factor, found)
    if first is not None and first.clock is not None:
        return _from_start(first.clock, 1.0, found)
    if period is not None and first is not None:
        name, step = period
        stated = f"{name} = {table.constants[name]:g}"
        made = f"there is no column of times; they were made from {stated}, as {step:g} s a sample"
        found.append(
            Finding(
                "warning", "time-made", made, remedy=f"if wrong, give {name_option('sample_time', 'SECONDS')}"
            )
        )
        return np.arange(first.values.size, dtype=np.float64) * step, 0.0, found
    if first is None:
        raise InputError(
            f"no column is known to be a channel among {_some(table)}; say which is which, "
            f"such as {name_columns(time='COLUMN:s', position='COLUMN:deg')}{_of_tool(table)}"
        )
    raise NoTimes(
        f"no column of times among {_some(table)}; say which with {name_columns(time='COLUMN:UNIT')}, or give "
        f"{_by_header(table)}{_as_steady(by_role)}"
    )


def _period_of(table: Table) -> tuple[str, float] | None:
    """Return the constant of a table that states the sampling period or rate, and the period in s."""
    for name, value in table.constants.items():
        key = name.rsplit(".", 1)[-1].lower()
        if isinstance(value, float) and math.isfinite(value) and value > 0.0 and key in (*PERIODS, *RATES):
            return name, value if key in PERIODS else 1.0 / value
    return None


def _of_tool(table: Table) -> str:
    """Return the notes on the tool that wrote the table, to end an error."""
    return "".join(f"; {f.message}; {f.remedy}" for f in table.findings if f.code == "tool")


def _as_steady(by_role: Mapping[str, Choice]) -> str:
    """Return the requirements of a table of steady points, to end an error; empty if this cannot be one."""
    if may_be_steady(by_role):
        return f"; a table of constant velocities and their torques is for {name_option('method', 'sliding')}"
    parts = {"velocity": "velocity" in by_role, "torque": bool(by_role.keys() & EFFORTS)}
    if "position" in by_role and all(parts.values()):
        return (
            f"; if its rows are steady points ({name_option('method', 'sliding')}), say "
            f"{name_columns(position='none')}"
        )
    if "position" in by_role or not any(parts.values()):
        return ""
    lacking = next(name for name, known in parts.items() if not known)
    return (
        f"; for a table of steady points ({name_option('method', 'sliding')}) give "
        f"{name_columns(**{lacking: 'COLUMN:UNIT'})}"
    )


def may_be_steady(by_role: Mapping[str, Choice]) -> bool:
    """Whether rows without times may be steady points: they have a velocity and an effort, and no position."""
    return "velocity" in by_role and "position" not in by_role and bool(by_role.keys() & EFFORTS)


def _by_header(table: Table) -> str:
    """Return the option for the period, with the value from the header."""
    if (found := stated_period(table.constants)) is None:
        return name_option("sample_time", "SECONDS")
    name, text, period = found
    return f"{name_option('sample_time', f'{period:.6g}')}, as the header says ({name}: {text})"


def times_of(table: Table, choices: Sequence[Choice], sample_time: float | None) -> tuple[Array, float]:
    """Return a table's times in s from their origin, and that origin in s.

    Raises
    ------
    InputError
        If it has none.
    """
    columns = {c.name: c for c in table.columns}
    # Any column determines the number of samples.
    by_role = {c.role: c for c in choices} or {
        "position": Choice("position", table.columns[0].name, "", "assumed")
    }
    time, origin, _ = time_of(table, by_role, columns, sample_time)
    return time, origin


def _some(table: Table) -> str:
    names = [c.name or "one without a name" for c in table.columns]
    names = [name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..." for name in names]
    return ", ".join(names[:12]) + (", ..." if len(names) > 12 else "") if names else "none at all"


def _overruled(choice: Choice, time: Array, sample_time: float) -> list[Finding]:
    """Return the finding that a stated rate replaces a time column that differs; none if both agree or the unit of the
    column is unknown (a counter)."""
    unit, rows = parse_unit(choice.unit), np.flatnonzero(np.isfinite(time))
    if unit is None or rows.size < 2:
        return []
    # Not the median step: that of whole milliseconds at 4 kHz is 0.
    own = unit.factor * float(time[rows[-1]] - time[rows[0]]) / float(rows[-1] - rows[0])
    if abs(own - sample_time) <= SAME * sample_time:
        return []
    said = (
        f"sample_time = {sample_time:g} s takes the place of the column of times {choice.column!r}, whose rows are "
        f"{own:g} s apart"
    )
    return [
        Finding(
            "warning",
            "time-overruled",
            said,
            remedy=f"leave {name_option('sample_time')} out if the column is right",
        )
    ]


def _counted_on(time: Array, choice: Choice, found: list[Finding]) -> Array:
    """Unwrap the times of a counter that overflows at a power of two; return others unchanged."""
    known = np.flatnonzero(np.isfinite(time))
    ticks: Array = time[known]
    steps = np.diff(ticks)
    anew = steps < 0.0
    if not np.any(anew) or np.any(ticks != np.round(ticks)) or np.min(ticks) < 0.0:
        return time
    usual = float(np.median(steps[~anew])) if not np.all(anew) else 0.0
    for bits in COUNTERS:
        size = 2.0**bits
        if np.max(ticks) < size and np.all(np.abs(steps[anew] + size - usual) <= NEAR * usual):
            out = time.copy()
            out[known[1:]] += size * np.cumsum(anew)
            times = int(np.count_nonzero(anew))
            often = "once" if times == 1 else f"{times} times"
            said = f"time {choice.column!r} is a counter of {bits} bits and starts anew {often}: it was counted on"
            found.append(Finding("note", "time-wrap", said))
            return out
    return time


def _from_start(time: Array, factor: float, found: list[Finding]) -> tuple[Array, float, list[Finding]]:
    """Return times in s; large ones, such as dates, from the first sample."""
    finite = time[np.isfinite(time)]
    origin = float(finite[0]) if finite.size else 0.0
    if abs(origin * factor) < 1e6:
        origin = 0.0
    return (time - origin) * factor, origin * factor, found


def restated(
    columns: dict[str, Column], by_role: dict[str, Choice], sample_time: float | None
) -> dict[str, Column]:
    """Return the columns with their clocks in the unit in which the first channel has this sample time, s."""
    first = next(
        (columns[by_role[r].column] for r in (*FIRST, *by_role) if r in by_role and r != "time"), None
    )
    if sample_time is None or first is None or first.clock is None or first.clock.size < 2:
        return columns
    step = float(np.median(np.diff(first.clock)))
    factor, start = (sample_time / step if step > 0.0 else 1.0), float(first.clock[0])
    return {
        name: column if column.clock is None else replace(column, clock=(column.clock - start) * factor)
        for name, column in columns.items()
    }


def on_own_clocks(
    columns: dict[str, Column], by_role: dict[str, Choice], time: Array, origin: float
) -> tuple[dict[str, Column], Array]:
    """Give the columns of a table clocks of their own if some are blank in most rows, since they are sampled slower.

    Returns
    -------
    columns : dict of str to Column
    time : array
        The record's times: those of the first channel among position, velocity and torque, which is not interpolated.
    """
    rows = {
        role: columns[choice.column]
        for role, choice in by_role.items()
        if role != "time" and columns[choice.column].clock is None
        and columns[choice.column].values.size == time.size
    }  # fmt: skip
    slower = {column.name for column in rows.values() if _is_slower(column.values, time)}
    first = next((rows[role] for role in (*FIRST, *rows) if role in rows), None)
    if first is None or not slower:
        return columns, time
    out = dict(columns)
    for column in rows.values():
        if column.name in slower:
            known = np.isfinite(column.values) & np.isfinite(time)
            out[column.name] = replace(column, values=column.values[known], clock=time[known] + origin)
        elif first.name in slower:
            out[column.name] = replace(column, clock=time + origin)
    clock = out[first.name].clock
    return out, time if clock is None else clock - origin


def _is_slower(values: Array, time: Array) -> bool:
    """Whether a column is blank between evenly spaced samples, because other columns have more samples."""
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    if known.size < 3 or known.size > MOST_FILLED * (known[-1] - known[0] + 1):
        return False
    steps = np.diff(time[known])
    usual = float(np.median(steps))
    return bool(np.mean(np.abs(steps - usual) <= UNEVEN * usual) >= EVEN)


def on_clock(column: Column, time: Array, origin: float, role: str) -> tuple[Array, list[Finding]]:
    """Interpolate the column at the record's times."""
    if column.clock is None:
        if column.values.size != time.size:
            raise InputError(f"{role}: column {column.name!r} has {column.values.size} values, time has {time.size}; "
                             "map columns of one table, or leave it out with "
                             f"{name_columns(**{role: 'none'})}")  # fmt: skip
        return column.values, []
    own = column.clock - origin
    if own.shape == time.shape and np.allclose(own, time, rtol=0.0, atol=1e-9, equal_nan=True):
        return column.values, []
    good = np.isfinite(own) & np.isfinite(column.values)
    if np.count_nonzero(good) < 2:
        return np.full(time.shape, np.nan), []
    order = np.argsort(own[good], kind="stable")
    values = np.interp(time, own[good][order], column.values[good][order], left=math.nan, right=math.nan)
    text = (
        f"{role} ({column.name!r}), sampled every {_period(own[good])}, was interpolated linearly at the record's "
        f"times, every {_period(time)}"
    )
    return values, [Finding("note", "resampled", text)]


def _period(times: Array) -> str:
    """Return the usual step of times, with its unit."""
    step = float(np.median(np.diff(times))) if times.size > 1 else math.nan
    return f"{1e3 * step:.4g} ms"
