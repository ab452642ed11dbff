"""Read text tables in groups of columns: a time column, then the values that were sampled at these times.

TwinCAT Scope (Beckhoff TE13xx, export to CSV) and LabVIEW write rows of keys above the samples and repeat the key
where a group starts: ``Name  ActPos  Name  ActVelo``. Other tools name the columns of times: ``Time  Force  Time
Travel``. A row of such a file is not one instant. A group of slower samples ends earlier: its cells are blank from
then on, or absent if no other group follows.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.readers._cells import cell, moment
from stickslip.readers._names import role_of, words
from stickslip.readers._units import may_be_unit, parse_unit
from stickslip.readers.table_columns import Array, Column

DELIMITERS = ("\t", ";", ",", "|", ":", " ")
NAMES = ("name", "channel name", "channel", "signal", "symbolname")
"""Keys of the rows that name the channels; the first that is present counts."""
UNITS = ("unit", "units", "y_unit_label", "einheit")
OF_SCOPE = ("symbolname", "sampletime[ms]", "sampletime", "netid", "indexgroup", "symbolcomment", "data-type")
"""Keys that only TwinCAT Scope writes."""
KEYS = frozenset(
    (
        *NAMES, *UNITS, *OF_SCOPE, "port", "indexoffset", "symbolbased", "variablesize", "offset", "scalefactor",
        "bitmask", "unit scalefactor", "unit offset", "timestamp", "interval", "start time", "samples", "delta_x", "x0",
    )
)  # fmt: skip
EXPORT = re.compile(r"(?i)start ?time of export|starttime of record")
HEAD = 100
"""Lines in which the rows of keys are searched."""
TICKS = 1e15
"""A time beyond this is a FILETIME: a count of 100 ns since 1601."""
SLOWEST = 0.2
"""s between samples beyond which a time without a unit is in ms: no motion is recorded at less than 5 Hz."""
TIME_WORDS = frozenset(("time", "timestamp", "zeit", "t", "x"))
IN_TIME = re.compile(r"[xt]\d*|x_value")


@dataclass(frozen=True)
class Layout:
    """Layout of a table with rows of keys and groups of columns.

    Attributes
    ----------
    delimiter : str
    starts : tuple of int
        Columns of times, ascending; the first is 0.
    width : int
        Columns.
    rows : mapping of str to list of str
        One cell per column, by the row's key in lower case. A group is left blank if the number of cells does not match
        its columns.
    first : int
        Index of the first line of samples.
    scope : bool
        Whether TwinCAT Scope wrote the file.
    """

    delimiter: str
    starts: tuple[int, ...]
    width: int
    rows: Mapping[str, list[str]]
    first: int
    scope: bool

    def split(self, line: str) -> list[str]:
        """Return the cells of a line of samples."""
        if self.delimiter != " ":
            return _split(line, self.delimiter)
        # A blank cell is a space: two in a row with the separator after it.
        cells = list[str]()
        for text in re.findall(r"[^ ]+(?: |$)|  | $", line):
            cells.append(text.strip())
        return cells


# ---- rows of keys -------------------------------------------------------------------------------------------


def find_layout(lines: Sequence[str]) -> Layout | None:
    """Return the groups of a table with rows of keys, or None if it has none.

    Raises
    ------
    InputError
        If the samples have more cells than the rows of keys have columns.
    """
    head = [(i, line) for i, line in enumerate(lines[:HEAD]) if line.strip()]
    scope = any(EXPORT.match(line.lstrip('"\ufeff')) for _, line in head)
    for delimiter in DELIMITERS:
        rows = [(i, _split(line, delimiter)) for i, line in head]
        keyed = [(i, cells) for i, cells in rows if _key(cells) in KEYS]
        if all(not cells[-1].strip() for _, cells in keyed):
            keyed = [(i, cells[:-1]) for i, cells in keyed]  # a separator ends every line
        known = {_key(cells) for _, cells in keyed}
        scope = scope or (not known.isdisjoint(OF_SCOPE) and len(known) > 1)
        sizes = _sizes(keyed, scope)
        if sizes and (found := _layout(keyed, sizes, delimiter, scope, lines)) is not None:
            return found
    return None


def _sizes(keyed: Sequence[tuple[int, list[str]]], scope: bool) -> tuple[int, ...]:
    """Return the number of channels of each group on which most rows of keys agree; nothing if they form no groups.

    A name or a unit that contains the separator has too many cells in its own row.
    """
    known = {_key(cells) for _, cells in keyed}
    several = Counter(sizes for _, cells in keyed if len(sizes := _sizes_of(cells)) > 1 and min(sizes) > 0)
    if several:
        sizes, count = several.most_common(1)[0]
        return sizes if count > 1 or scope or not known.isdisjoint(NAMES) else ()
    if not scope and (known.isdisjoint(NAMES) or known.isdisjoint(UNITS)):
        return ()
    # A row "Name" above that of the channels names the project.
    channels = max((i for i, cells in keyed if _key(cells) in NAMES), default=0)
    one = Counter(sizes for i, cells in keyed if i >= channels and (sizes := _sizes_of(cells)) > (0,))
    return max(one, key=lambda sizes: (one[sizes], sizes), default=())


def _layout(
    keyed: Sequence[tuple[int, list[str]]],
    sizes: tuple[int, ...],
    delimiter: str,
    scope: bool,
    lines: Sequence[str],
) -> Layout | None:
    """Return the layout of groups of these sizes, or None if no rows of samples follow."""
    width = sum(sizes) + len(sizes)
    starts = tuple(sum(sizes[:g]) + g for g in range(len(sizes)))
    rows = {_key(cells): _aligned(cells, sizes) for _, cells in keyed}
    found = Layout(delimiter, starts, width, rows, 0, scope)
    after = [i for i in range(keyed[-1][0] + 1, len(lines)) if lines[i].strip()]
    first = next((i for i in after if _is_sample(found.split(lines[i]), starts)), None)
    if first is None or not (scope or first == after[0] or len(sizes) > 1):
        return None
    for i in range(first, len(lines)):
        cells = found.split(lines[i])
        if not any(text.strip() for text in cells[width:]):
            continue
        if not scope and len(sizes) == 1:
            return None
        raise InputError(
            f"line {i + 1} has {len(cells)} cells, but the rows of keys above name {width} columns, separated by "
            f"{delimiter!r}; if the decimal mark is the separator, export the file with another separator"
        )
    return replace(found, first=first)


def _sizes_of(cells: Sequence[str]) -> tuple[int, ...]:
    """Return the number of cells between the repetitions of a row's key."""
    at = [j for j, text in enumerate(cells) if text.strip().lower() == _key(cells)]
    return tuple(b - a - 1 for a, b in zip(at, [*at[1:], len(cells)], strict=True))


def _aligned(cells: Sequence[str], sizes: Sequence[int]) -> list[str]:
    """Return a row's cells, one per column; blank in groups where their number does not match."""
    at = [j for j, text in enumerate(cells) if text.strip().lower() == _key(cells)]
    out = list[str]()
    for g, size in enumerate(sizes):
        start = at[g] if g < len(at) else len(cells)
        own = [text.strip() for text in cells[start + 1 : at[g + 1] if g + 1 < len(at) else len(cells)]]
        while len(own) > size and not own[-1]:
            own.pop()
        if len(own) > size:
            own = _joined(own)
        own = own if len(own) <= size else []
        out += ["", *own, *[""] * (size - len(own))]
    return out


def _joined(cells: Sequence[str]) -> list[str]:
    """Return the cells, with the quantity joined to the unit before it: "dV (Voltage)" that a space between cells cut
    in two."""
    out = list[str]()
    for text in cells:
        if out and text.startswith("(") and text != "(None)":
            out[-1] += f" {text}"
        else:
            out.append(text)
    return out


def _split(line: str, delimiter: str) -> list[str]:
    line = line.lstrip("\ufeff")
    return (
        next(csv.reader([line], delimiter=delimiter), list[str]()) if '"' in line else line.split(delimiter)
    )


def _key(cells: Sequence[str]) -> str:
    return cells[0].strip().lower() if cells else ""


def _is_sample(cells: Sequence[str], starts: Sequence[int]) -> bool:
    """Whether the cells of the time columns are numbers or missing values, and at least one is a number."""
    found = [cell(cells[j], ",") for j in starts if j < len(cells)]
    return None not in found and any(value is not None and not math.isnan(value) for value in found)


# ---- columns of times ---------------------------------------------------------------------------------------


def time_columns(header: Sequence[Sequence[str]], values: Array) -> tuple[int, ...]:
    """Return the time columns, by their names and values; empty if all columns share one time."""
    width = values.shape[1]
    for row in reversed(header):
        names = [text.strip() for text in row[:width]]
        if len(row) < width - 1 or not names or not any(names):
            continue
        names += [""] * (width - len(names))
        for starts in (_named_times(names), _companions(names)):
            if len(starts) > 1 and starts[0] == 0 and _are_clocks(values, starts):
                return starts
    return ()


def _named_times(names: Sequence[str]) -> tuple[int, ...]:
    """Return the columns named as times ("time2", "t_pos") that have other columns after them."""
    plain = [role_of(n).role == "time" or bool(IN_TIME.fullmatch(n.lower())) for n in names]
    of_one = [bool(own := words(n)) and not TIME_WORDS.isdisjoint((own[0], own[-1])) for n in names]
    for timed in (plain, of_one):
        apart = not any(a and b for a, b in pairwise(timed))
        if timed[0] and not timed[-1] and apart and (timed is plain or not any(plain)):
            return tuple(j for j, is_time in enumerate(timed) if is_time)
    return ()


def _companions(names: Sequence[str]) -> tuple[int, ...]:
    """Return the columns named as the time of the next one: "ActPos Time", "ActPos"."""
    pairs = list(zip(names[::2], names[1::2], strict=False))
    for name, following in pairs:
        own, other = words(name), words(following)
        if (
            TIME_WORDS.isdisjoint(own)
            or not TIME_WORDS.isdisjoint(other)
            or not set(own) - TIME_WORDS <= set(other)
        ):
            return ()
    return tuple(range(0, 2 * len(pairs), 2)) if len(names) % 2 == 0 else ()


def _are_clocks(values: Array, starts: Sequence[int]) -> bool:
    """Whether no time decreases and all cover a common part of the motion."""
    spans = list[tuple[float, float]]()
    for j in starts:
        times = values[np.isfinite(values[:, j]), j]
        if times.size < 2 or np.any(np.diff(times) < 0.0):
            return False
        spans.append((float(times[0]), float(times[-1])))
    return max(a for a, _ in spans) < min(b for _, b in spans)


# ---- columns with their clocks ------------------------------------------------------------------------------


def keyed_columns(
    layout: Layout, values: Array, clocks: Sequence[int]
) -> tuple[tuple[Column, ...], list[str], list[Finding]]:
    """Return the channels below rows of keys with their groups' clocks, the names of all columns, and findings.

    `clocks` are the columns of times of day.
    """
    units = next((layout.rows[key] for key in UNITS if key in layout.rows), [""] * layout.width)
    names, findings = _names(layout)
    ticks = {j: values[:, j] for j in layout.starts}
    first = [t[np.isfinite(t)][0] for t in ticks.values() if np.isfinite(t).any()]
    origin = min(first, default=0.0)
    times = dict[int, Array]()
    for j in layout.starts:
        if j in clocks:
            times[j] = ticks[j]
        elif origin > TICKS:
            times[j] = (ticks[j] - origin) * 1e-7
        elif layout.scope:
            times[j] = _scope_seconds(ticks[j], _at(layout.rows, "sampletime[ms]", j + 1))
        else:
            times[j] = _stated_seconds(ticks[j], _at(layout.rows, "interval", j + 1), names[j + 1], findings)
    _later_starts(layout, times, findings)
    return _columns(names, [_unit(text) for text in units], layout.starts, values, times), names, findings


def _later_starts(layout: Layout, times: dict[int, Array], findings: list[Finding]) -> None:
    """Count groups that start at 0 from the first start, if the row Timestamp states different dates."""
    starts = {j: moment(_at(layout.rows, "timestamp", j + 1)) for j in layout.starts}
    stated = [s for s in starts.values() if s is not None]
    relative = all(t.size and t[0] == 0.0 for t in times.values())
    if len(stated) < len(starts) or max(stated) == min(stated) or not relative:
        return
    for j, start in starts.items():
        times[j] = times[j] + (start or 0.0) - min(stated)
    message = f"the channels start {max(stated) - min(stated):.6g} s apart, as the row Timestamp states"
    findings.append(Finding("note", "start", message))


def timed_columns(
    names: Sequence[str], units: Sequence[str], starts: Sequence[int], values: Array
) -> tuple[tuple[Column, ...], list[Finding]]:
    """Return the columns of a table with several time columns, each with the clock of its group."""
    times, findings = dict[int, Array](), list[Finding]()
    for j in starts:
        unit = parse_unit(units[j] or role_of(names[j]).unit)
        known = unit is not None and unit.kind == "time"
        factor = unit.factor if unit is not None and known else epoch_unit(values[:, j])
        times[j] = values[:, j] * factor
        if not known and factor == 1.0 and not findings:
            message = f"column {names[j]!r} states no unit: its times were taken in s"
            findings = [
                Finding(
                    "warning",
                    "time-unit",
                    message,
                    remedy=f"if wrong, give {name_option('sample_time', 'SECONDS')}",
                )
            ]
    return _columns(names, units, starts, values, times), findings


def epoch_unit(time: Array) -> float:
    """Return the unit in s of times since 1970, by their size, for dates of 2001 to 2286; 1 for other times."""
    finite = time[np.isfinite(time)]
    size = float(np.median(finite)) if finite.size else 0.0
    return next((f for f, low in ((1e-9, 1e18), (1e-6, 1e15), (1e-3, 1e12)) if low <= size < 10.0 * low), 1.0)


def _columns(
    names: Sequence[str],
    units: Sequence[str],
    starts: Sequence[int],
    values: Array,
    times: Mapping[int, Array],
) -> tuple[Column, ...]:
    out: list[Column] = []
    for start, end in zip(starts, [*starts[1:], values.shape[1]], strict=True):
        known = np.flatnonzero(np.isfinite(times[start]))
        for j in range(start + 1, end):
            own = values[known, j]
            if not np.isnan(own).all():
                out.append(Column(names[j] or f"column {j + 1}", own, units[j], times[start][known]))
    return tuple(out)


def _names(layout: Layout) -> tuple[list[str], list[Finding]]:
    """Return a name for every column, and a finding if names come from another row."""
    rows = [(key, layout.rows[key]) for key in NAMES if key in layout.rows]
    names, findings = [""] * layout.width, list[Finding]()
    for j in range(layout.width):
        if j in layout.starts:
            continue
        found = next(((key, row[j]) for key, row in rows if row[j]), None)
        if found is not None:
            names[j] = found[1]
        if rows and (found is None or found[0] != rows[0][0]) and not findings:
            instead = f"row {found[0]!r}" if found else "the number of their column"
            message = (
                f"names in row {rows[0][0]!r} contain the separator {layout.delimiter!r}: their cells cannot be "
                f"counted, so the channels are named after the {instead}"
            )
            findings.append(
                Finding("note", "renamed", message, remedy="export with a separator no name contains")
            )
    symbols = layout.rows.get("symbolname", [])
    for name in {n for n in names if n and names.count(n) > 1}:
        same = [j for j, n in enumerate(names) if n == name]
        other = [symbols[j] for j in same] if symbols else []
        distinct = len(set(other)) == len(same) and all(other)
        for k, j in enumerate(same):
            names[j] = f"{name} ({other[k]})" if distinct else name if k == 0 else f"{name} ({k + 1})"
    return names, findings


def _scope_seconds(ticks: Array, period_ms: str) -> Array:
    """Return times of TwinCAT Scope in s: ms from the start of the export, or numbers of samples."""
    period, step = cell(period_ms, ","), _step(ticks)
    return ticks * 1e-3 * (float(period) if period and step == 1.0 else 1.0)


def _stated_seconds(ticks: Array, interval: str, name: str, findings: list[Finding]) -> Array:
    """Return times in s: the row Interval states their step in s; otherwise their size decides between s and ms."""
    stated, step = cell(interval, ","), _step(ticks)
    if stated and stated > 0.0 and step > 0.0:
        power = round(math.log10(stated / step))
        return ticks * (10.0**power if power in (-3, -6, -9) else 1.0)
    factor, unit = (1e-3, "ms") if step > SLOWEST else (1.0, "s")
    message = (
        f"the file states no unit of the times of {name!r}: {unit} was assumed, {factor * step:g} s a sample"
    )
    if not any(f.code == "time-unit" for f in findings):
        findings.append(
            Finding(
                "warning",
                "time-unit",
                message,
                remedy=f"if wrong, give {name_option('sample_time', 'SECONDS')}",
            )
        )
    return factor * ticks


def _step(ticks: Array) -> float:
    """Return the usual step of times; NaN if there is none."""
    steps = np.diff(ticks[np.isfinite(ticks)])
    return float(np.median(steps)) if steps.size else math.nan


def _unit(text: str) -> str:
    """Return a unit without the quantity after it: "dV (Voltage)"."""
    bare = re.sub(r"\s*\([^()]*\)$", "", text)
    return bare if may_be_unit(bare) or not may_be_unit(text) else text


def _at(rows: Mapping[str, Sequence[str]], key: str, j: int) -> str:
    return rows[key][j] if key in rows else ""


def scaled_channels(layout: Layout) -> list[Finding]:
    """Return a note on channels with a scale in the file, which does not state whether their values have it already."""
    usual = {"scalefactor": 1.0, "unit scalefactor": 1.0, "offset": 0.0, "unit offset": 0.0}
    names, _ = _names(layout)
    found = [
        f"{names[j]!r} ({key} {text})"
        for j in range(layout.width)
        for key, one in usual.items()
        if j not in layout.starts
        and (text := _at(layout.rows, key, j))
        and cell(text, ",") not in (one, None)
    ]
    if not found:
        return []
    listed = ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
    message = (
        f"{listed}: the file does not state whether the values are scaled already; they were read as they are"
    )
    remedy = f"export with ScaleValues, or give the scale with the unit, such as {name_columns(torque='COLUMN:0.1Nm')}"
    return [Finding("note", "scaled", message, remedy=remedy)]


def project_lines(layout: Layout, lines: Sequence[str]) -> dict[str, float | str]:
    """Return the lines of two to four cells above the channels: project, file, start and end of the export."""
    out = dict[str, float | str]()
    for line in lines[: layout.first]:
        row = [text.strip() for text in _split(line, layout.delimiter)]
        about = _key(row) not in KEYS or (layout.scope and not out)
        if about and 2 <= len(row) <= 4 and row[0] and row[0] != row[-1]:
            out[row[0]] = row[1]
    return out
