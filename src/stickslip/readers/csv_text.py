"""Read text tables: delimiter, decimal comma, header and units are detected, as are TwinCAT Scope's time and value
columns."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.readers import _column_groups
from stickslip.readers._cells import OF_DAY, cell, clocks_whole, decoded, moment, over_midnight
from stickslip.readers._column_groups import Layout
from stickslip.readers._names import role_of
from stickslip.readers._signs import between_thousands
from stickslip.readers._stated_period import is_period
from stickslip.readers._units import may_be_unit
from stickslip.readers.limits import LONGEST_LINE, MAX_COLUMNS, insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Array, Column, Format, Table

DIALECTS = (
    ("\t", "."),
    ("\t", ","),
    (";", "."),
    (";", ","),
    (",", "."),
    ("|", "."),
    (" ", "."),
    (" ", ","),
    (",", ","),
)
"""Delimiter and decimal sign, in order of preference; a comma may be both if cells are in quotes."""
SAMPLE = 400
"""Lines from which the dialect is detected."""
SAMPLED, FEWEST = 2_000_000, 20
"""Characters of these lines, and number of lines that are used at any length."""
USUAL = 0.8
"""Share of the lines in which a numeric column has a number; the rest are header and footer"""
IN_SECONDS = re.compile(r"^([-+.\deE]+) sec(?=[,;\t])")
"""A duration in the first cell, as MATLAB writes timetables."""
LABELLED = re.compile(
    r"([A-Za-z_][^:;,\t]*?)\s*[:=]\s*([-+]?\.?\d[\d.eE+-]*|nan|-?inf)(?:\s*[,;\t]\s*|\s+|$)"
)
LABELLED_ROW = re.compile(rf"\s*(?:{LABELLED.pattern})+")
"""A cell "label:value", and a row of them."""
COMMENT = re.compile(r"^\s*(?:#|%|//|!)+\s*")


@dataclass(frozen=True)
class Dialect:
    """How lines are split, and where the data start."""

    delimiter: str
    decimal: str
    width: int
    start: int
    words: frozenset[int] = frozenset()
    """Columns of words, such as the state of the drive"""

    def split(self, line: str) -> list[str]:
        """Return the cells of a line."""
        if self.delimiter == " ":
            return line.split()
        if '"' in line:
            try:
                return next(csv.reader([line], delimiter=self.delimiter), list[str]())
            except csv.Error:
                pass
        return line.split(self.delimiter)


def recognise(head: bytes, path: Path) -> bool:
    """Accept text: any file that no other format claims and that has no binary zeros (except UTF-16 after its mark)."""
    return bool(head) and (head[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\x00" not in head)


def read(path: Path) -> Table:
    """Every column of a text table."""
    lines = decoded(path).splitlines()
    _insist_on_short_lines(path, lines)
    lines = clocks_whole(_without_labels([IN_SECONDS.sub(r"\1", line) for line in lines]))
    try:
        layout = _column_groups.find_layout(lines)
        return _plain(path, lines) if layout is None else _in_groups(path, lines, layout)
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None


def _in_groups(path: Path, lines: Sequence[str], layout: Layout) -> Table:
    """Read a table with rows of keys above groups of a time and its channels."""
    insist_on_columns(path, layout.width)
    body = [layout.split(line) for line in lines[layout.first :] if line.strip()]
    insist_on_values(path, len(body) * layout.width)
    some = body[:SAMPLE] + body[-SAMPLE:]
    columns = [[row[j] for row in some if j < len(row)] for j in range(layout.width)]
    decimal = max(
        (".", ","), key=lambda sign: sum(_is_number(cell(c, sign)) for cells in columns for c in cells)
    )
    words = {
        j: next(c.strip() for c in cells if c.strip())
        for j, cells in enumerate(columns)
        if j not in layout.starts
        and any(c.strip() for c in cells)
        and not any(_is_number(cell(c, decimal)) for c in cells)
    }
    dialect = Dialect("\t", decimal, layout.width, layout.first, frozenset(words))
    rows, footer = _without_footer(["\t".join(cells) for cells in body], dialect)
    padded = _padded(body[: len(rows)], dialect)
    values, odd = _values(rows, dialect) if padded is None else (padded, [])
    clocks = [j for j in layout.starts if j in _clocks(rows, dialect)]
    channels, names, renamed = _column_groups.keyed_columns(layout, values, clocks)
    # The rows after the slower channels have ended are shorter.
    findings = [
        *footer,
        *(f for f in odd if f.code != "short-row"),
        *renamed,
        *_column_groups.scaled_channels(layout),
    ]
    unread = {names[j] or f"column {j + 1}": text[:30] for j, text in words.items()}
    if unread:
        findings.append(_left_out(unread))
    return Table("csv", channels, _column_groups.project_lines(layout, lines), tuple(findings), unread)


def _padded(body: Sequence[Sequence[str]], dialect: Dialect) -> Array | None:
    """Return the cells as numbers, NaN if blank or absent; None if any may be something else."""
    decimal, other = dialect.decimal, {".": ",", ",": "."}[dialect.decimal]
    if any(other in c for row in body for c in row):  # a thousands separator
        return None
    none = ["nan"] * dialect.width
    text = [
        [c.replace(decimal, ".") if c and not c.isspace() else "nan" for c in row] + none[len(row) :]
        for row in body
    ]
    try:
        return np.array([row[: dialect.width] for row in text]).astype(np.float64)
    except ValueError:
        return None


def _plain(path: Path, lines: Sequence[str]) -> Table:
    """Read a table with one row of names."""
    dialect = _sniff(lines)
    insist_on_columns(path, dialect.width)
    above = [line for line in lines[: dialect.start] if line.strip()]
    header = [dialect.split(COMMENT.sub("", line)) for line in above]
    body = [line for line in lines[dialect.start :] if line.strip()]
    body, findings = _without_headers(body, above, dialect)
    body, footer = _without_footer(body, dialect)
    insist_on_values(path, len(body) * dialect.width)
    values, odd = _values(body, dialect)
    findings += [*footer, *odd]
    header, increments = _without_increments(header, dialect)
    named, unnamed = _beside_numbers(header, values, dialect)
    findings += unnamed
    names, units = _names(named, dialect.width)
    clocks = _clocks(body, dialect)
    constants = {**_constants(header, dialect), **increments}
    if starts := _column_groups.time_columns(named, values):
        # The groups of slower channels end earlier.
        findings = [f for f in findings if f.code != "short-row" or dialect.delimiter == " "]
        units = ["s" if j in clocks else unit for j, unit in enumerate(units)]
        columns, assumed = _column_groups.timed_columns(names, units, starts, values)
        findings += assumed
        return Table("csv", columns, constants, tuple(findings))
    if values.shape[1] and np.isnan(values[:, -1]).all() and not names[-1]:
        values = values[:, :-1]  # a delimiter ends every line
    # A column of dates is the time whatever its name, unless another column is named time.
    only = clocks if len(clocks) == 1 and not any(role_of(name).role == "time" for name in names) else {}
    columns = tuple(
        Column(
            name or f"column {i + 1}",
            over_midnight(values[:, i], clocks.get(i)),
            "s" if i in clocks else unit,
            channel="time" if i in only else "",
        )
        for i, (name, unit) in enumerate(zip(names[: values.shape[1]], units, strict=False))
        if i not in dialect.words
    )
    unread = _unread(names, body, dialect)
    if unread:
        findings.append(_left_out(unread))
    return Table("csv", columns, constants, tuple(findings), unread)


def _left_out(unread: Mapping[str, str]) -> Finding:
    left = ", ".join(f"{name!r} (first {first!r})" for name, first in unread.items())
    return Finding("note", "words", f"left out as they hold words, not numbers: {left}")


def _unread(names: Sequence[str], body: Sequence[str], dialect: Dialect) -> dict[str, str]:
    """Return name and first cell of the columns of words."""
    first = dialect.split(body[0]) if body else []
    return {
        names[i] or f"column {i + 1}": first[i].strip()[:30] for i in sorted(dialect.words) if i < len(first)
    }


def _without_labels(lines: list[str]) -> list[str]:
    """Return a table with one row of names if every cell has its label: "speed:1.2,current:0.3", as Arduinos print."""
    cut = [LABELLED.findall(line) if LABELLED_ROW.fullmatch(line) else [] for line in lines]
    labels = Counter(tuple(label for label, _ in cells) for cells in cut if cells)
    usual, count = labels.most_common(1)[0] if labels else ((), 0)
    if count < USUAL * sum(bool(line.strip()) for line in lines):
        return lines
    rows = [
        ";".join(value for _, value in cells) if tuple(label for label, _ in cells) == usual else line
        for cells, line in zip(cut, lines, strict=True)
    ]
    return [";".join(usual), *rows]


# ---- lines to cells -----------------------------------------------------------------------------------------


def _insist_on_short_lines(path: Path, lines: Sequence[str]) -> None:
    """Refuse lines that are too long for a row of a table.

    Raises
    ------
    InputError
    """
    longest = max(range(len(lines)), key=lambda i: len(lines[i]), default=0)
    if lines and len(lines[longest]) > LONGEST_LINE:
        raise InputError(
            f"{path}: line {longest + 1} has {len(lines[longest])} characters; at most {LONGEST_LINE} are read: give "
            f"one row of at most {MAX_COLUMNS} columns a line"
        )


def _sniff(lines: Sequence[str]) -> Dialect:
    """Return the dialect in which most of the first lines are rows of numbers of equal width."""
    filled = [(i, line) for i, line in enumerate(lines) if line.strip()]
    longest = max((len(line) for _, line in filled), default=0)
    count = min(SAMPLE, max(FEWEST, SAMPLED // (longest + 1)))
    sample = filled if len(filled) <= count else filled[: count // 2] + filled[-count // 2 :]
    best, score = None, 0.0
    for delimiter, decimal in DIALECTS:
        trial = Dialect(delimiter, decimal, 0, 0)
        cut = [trial.split(line) for _, line in sample]
        rows = [_is_row(cells, decimal) for cells in cut]
        if not any(rows):
            continue
        width, explained = _width(cut, rows)
        # A second column counts more than the last few rows.
        merit = explained * min(width, 3)
        if merit > score * 1.001:
            best, score = Dialect(delimiter, decimal, width, 0), merit
    if best is None:
        best = _sniff_among_words(filled, sample)
        if best is None:
            raise InputError(
                "the file holds no table of numbers; give a file with one row of numbers a sample"
            )
        return best
    return replace(best, start=_start(best, filled))


def _start(dialect: Dialect, filled: Sequence[tuple[int, str]]) -> int:
    """Return the index of the first line of samples: below the names, rows may lack cells or have signs for none."""
    cut = [dialect.split(line) for _, line in filled[:SAMPLE]]
    full = next((k for k, cells in enumerate(cut) if _is_full(cells, dialect)), None)
    if full is None:
        return next(i for i, line in filled if _is_full(dialect.split(line), dialect))
    first = full
    while (
        first and any(c.strip() for c in cut[first - 1]) and not _has_words(cut[first - 1], dialect.decimal)
    ):
        first -= 1
    named = first > 0 and abs(len(cut[first - 1]) - dialect.width) <= 1
    return filled[first if named else full][0]


def _is_full(cells: Sequence[str], dialect: Dialect) -> bool:
    return len(cells) == dialect.width and _is_row(cells, dialect.decimal)


def _has_words(cells: Sequence[str], decimal: str) -> bool:
    return any(cell(text, decimal) is None for text in cells)


def _width(cut: Sequence[Sequence[str]], rows: Sequence[bool]) -> tuple[int, int]:
    """Return the number of columns, and how many rows of numbers they explain.

    The row of names above the first row of numbers has a cell for every column; rows may lack the last cells, as after
    the end of slower channels. Without such a row, most rows have the width.
    """
    widths = Counter(len(cells) for cells, is_row in zip(cut, rows, strict=True) if is_row)
    widest, first = max(widths), rows.index(True)
    if first and len(cut[first]) == widest and len(cut[first - 1]) in (widest - 1, widest, widest + 1):
        return widest, sum(widths.values())
    width = max(widths, key=lambda w: (widths[w], w))
    return width, widths[width]


def _sniff_among_words(
    filled: Sequence[tuple[int, str]], sample: Sequence[tuple[int, str]]
) -> Dialect | None:
    """Return the dialect in which at least two columns have numbers, and others words, in nearly every line."""
    best, score = None, 0
    for delimiter, decimal in DIALECTS:
        trial = Dialect(delimiter, decimal, 0, 0)
        rows = [trial.split(line) for _, line in sample]
        widths = [len(row) for row in rows]
        width = max(set(widths), key=widths.count, default=0)
        found = [[cell(text, decimal) for text in row] for row in rows if len(row) == width]
        due = [j for j in range(width) if sum(row[j] is not None for row in found) >= USUAL * len(found)]
        full = sum(2 * sum(_is_number(row[j]) for row in found) >= len(found) for j in due)
        if full >= 2 and len(found) * min(full, 3) > score:
            score = len(found) * min(full, 3)
            best = Dialect(delimiter, decimal, width, 0, frozenset(range(width)).difference(due))
    start = next((i for i, line in filled if best is not None and _numbers_where_due(best, line)), None)
    return None if best is None or start is None else replace(best, start=start)


def _numbers_where_due(dialect: Dialect, line: str) -> bool:
    """Whether a line has numbers or missing values in every column that is not one of words."""
    cells = dialect.split(line)
    found = [cell(text, dialect.decimal) for j, text in enumerate(cells) if j not in dialect.words]
    return len(cells) == dialect.width and None not in found and any(map(_is_number, found))


def _is_number(value: float | None) -> bool:
    return value is not None and not math.isnan(value)


def _is_row(cells: Sequence[str], decimal: str) -> bool:
    """Whether at least one cell is a number and none is a word."""
    found = [cell(text, decimal) for text in cells]
    return None not in found and any(map(_is_number, found))


def _without_headers(
    body: list[str], above: Sequence[str], dialect: Dialect
) -> tuple[list[str], list[Finding]]:
    """Return the rows without repeated header lines, as in concatenated files."""
    # Missing values above the first number are samples: without a clock their number matters.
    known = {
        line.strip() for line in above if None in [cell(c, dialect.decimal) for c in dialect.split(line)]
    }
    again = [i for i, line in enumerate(body) if line.strip() in known]
    if not again:
        return body, []
    often = "once" if len(again) == 1 else f"{len(again)} times"
    said = (
        f"a line of the header stands again among the rows, {often}; it was left out: {body[again[0]][:40]!r}"
    )
    kept = [line for line in body if line.strip() not in known]
    return kept, [Finding("note", "repeated-header", said, f"before row {again[0] + 1}")]


def _without_footer(body: list[str], dialect: Dialect) -> tuple[list[str], list[Finding]]:
    """Return the rows without the text at the end of some exports."""
    end = len(body)
    while end and all(cell(c, dialect.decimal) is None for c in dialect.split(body[end - 1]) if c.strip()):
        end -= 1
    if end == len(body) or body[end].strip() == "EOF":
        return body[:end], []
    return body[:end], [
        Finding(
            "note",
            "trimmed-footer",
            f"{len(body) - end} lines of text after the data were left out: {body[end][:40]!r}",
        )
    ]


# ---- cells to numbers ---------------------------------------------------------------------------------------


def _clocks(body: Sequence[str], dialect: Dialect) -> dict[int, bool]:
    """Return columns of dates or times of day, by their first cell, and whether they restart at midnight."""
    first = [c.strip().strip('"').strip() for c in dialect.split(body[0])] if body else []
    told = {i: bool(OF_DAY.fullmatch(c)) for i, c in enumerate(first) if ":" in c and moment(c) is not None}
    return {i: daily for i, daily in told.items() if i not in dialect.words}


def _values(body: Sequence[str], dialect: Dialect) -> tuple[Array, list[Finding]]:
    """Return the rows as numbers, shape (n, width); NaN for cells without one.

    Raises
    ------
    InputError
        If it has both points and commas, and the decimal sign cannot be determined.
    """
    if dialect.decimal == "," and any("." in line for line in body):
        cells = (dialect.split(line) for line in body)
        between, findings = between_thousands(cells, dialect.width, dialect.words)
        if between:
            values, odd = _values_one_by_one(body, dialect, between)
            return values, [*findings, *odd]
    if dialect.decimal == "." or dialect.delimiter != ",":
        text = "\n".join(body)
        if dialect.decimal == ",":
            text = text.replace(",", ".")
        try:
            values = np.loadtxt(io.StringIO(text), delimiter=None if dialect.delimiter == " " else dialect.delimiter,
                                ndmin=2, comments=None)  # fmt: skip
            if values.shape == (len(body), dialect.width):
                return values, []
        except (ValueError, IndexError):
            pass
    return _values_one_by_one(body, dialect)


def _values_one_by_one(
    body: Sequence[str], dialect: Dialect, between: Mapping[int, str] | None = None
) -> tuple[Array, list[Finding]]:
    """Parse cell by cell; `between` has the thousands separators of some columns."""
    between = between or {}
    values = np.full((len(body), dialect.width), np.nan)
    short, long, words = list[int](), list[int](), list[tuple[int, int, str]]()
    for i, line in enumerate(body):
        cells = dialect.split(line)
        if len(cells) < dialect.width:
            short.append(i)
            if dialect.delimiter == " ":
                continue  # it is unknown which cells are missing
        elif any(c.strip() for c in cells[dialect.width :]):
            long.append(i)
        for j, text in enumerate(cells[: dialect.width]):
            if j in dialect.words:
                continue
            value = cell(text.replace(between[j], "") if j in between else text, dialect.decimal)
            if value is None:
                words.append((i, j, text.strip()))
            else:
                values[i, j] = value
    findings: list[Finding] = []

    def warn(code: str, message: str, row: int) -> None:
        findings.append(Finding("warning", code, message, f"row {row + 1}", "correct or delete these rows"))

    if short:
        rest = "the rest was taken as missing"
        if dialect.delimiter == " ":
            rest = "which are missing cannot be known between blanks, so these rows count as missing"
        said = f"{len(short)} rows have fewer than {dialect.width} cells; {rest}"
        warn("short-row", said, short[0])
    if long:
        warn(
            "long-row",
            f"{len(long)} rows have more than {dialect.width} cells; what is beyond was left out",
            long[0],
        )
    if words:
        row, column, text = words[0]
        said = f"{len(words)} cells are no numbers and count as missing, first {text[:30]!r} in column {column + 1}"
        warn("not-a-number", said, row)
    return values, findings


# ---- names and units ----------------------------------------------------------------------------------------


def _names(header: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    """Return names and units of the columns, from the last header rows of about that width."""
    rows = [[c.strip().strip('"').strip() for c in row] for row in header]
    rows = [row if any(row[width:]) else row[: max(width, 1)] for row in rows]
    rows = [
        row for row in rows if abs(len(row) - width) <= 1 and sum(bool(c) for c in row) >= max(1, width - 2)
    ]
    units = [""] * width
    keyed = next(
        (row for row in rows if row[0].lower() in _column_groups.UNITS and _all_units(row[1:])), None
    )
    if keyed is not None and len(rows) > 1:
        rows.remove(keyed)
        units = ["", *(_bare(c) for c in _fitted(keyed, width)[1:])]
    elif len(rows) > 1 and _all_units(rows[-1]):
        units = [_bare(c) for c in _fitted(rows.pop(), width)]
    names = _fitted(rows[-1], width) if rows else [""] * width
    return _distinct(names), units


def _without_increments(
    header: Sequence[Sequence[str]], dialect: Dialect
) -> tuple[list[Sequence[str]], dict[str, float | str]]:
    """Remove the numbers from the row below the names, as written by oscilloscopes: "X,CH1,Increment" above
    "Sequence,Volt,2e-3"."""
    rows = list(header)
    if len(rows) < 2:
        return rows, {}
    names, below = (_fitted([text.strip() for text in row], dialect.width) for row in rows[-2:])
    numbers = {name: cell(text, dialect.decimal) for name, text in zip(names, below, strict=True)}
    found = {
        name: number
        for name, number in numbers.items()
        if name and number is not None and not math.isnan(number)
    }
    if not found or not all(names) or any(cell(name, dialect.decimal) is not None for name in names):
        return rows, {}
    units = [text if may_be_unit(text) else "" for text in below]
    words = [text if text and not unit and name not in found else name
             for name, text, unit in zip(names, below, units, strict=True)]  # fmt: skip
    return [*rows[:-2], words, units], {**found}


def _beside_numbers(
    header: Sequence[Sequence[str]], values: Array, dialect: Dialect
) -> tuple[list[Sequence[str]], list[Finding]]:
    """Return the header; its names move by one if the first column numbers or labels the rows and has no name.

    Raises
    ------
    InputError
        If there is one name fewer than columns, and it is unknown which column has none.
    """
    rows, width = list(header), dialect.width
    short = [i for i, row in enumerate(rows) if len(row) == width - 1 and any(role_of(c).role for c in row)]
    if not short or any(len(row) == width for row in rows) or np.isnan(values[:, -1]).all():
        return rows, []
    first = values[:, 0]
    if not (0 in dialect.words or np.isnan(first).all() or np.all(np.diff(first) == 1.0)):
        names = ", ".join(rows[short[-1]][:3])
        raise InputError(
            f"the row of names ({names}, ...) has {width - 1} cells, the rows below have {width}; add the name of "
            "the column that has none"
        )
    message = (
        "the first column has no name, since it numbers or labels the rows; the names are those of the others"
    )
    rows = [["", *row] if len(row) == width - 1 else row for row in rows]
    return rows, [Finding("note", "row-numbers", message)]


def _all_units(row: Sequence[str]) -> bool:
    """Whether a row has only units or blanks, and at least one unit."""
    told = [_bare(c) for c in row]
    real = [c for c in told if c not in ("", "-", "1")]
    return bool(real) and all(may_be_unit(c) for c in real)


def _bare(text: str) -> str:
    return re.sub(r"^[\[(<{]\s*|\s*[\])>}]$", "", text.strip())


def _fitted(row: Sequence[str], width: int) -> list[str]:
    return [*row[:width], *[""] * (width - len(row))]


def _distinct(names: Sequence[str]) -> list[str]:
    seen: dict[str, int] = {}
    out: list[str] = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if not name or seen[name] == 1 else f"{name} ({seen[name]})")
    return out


def _constants(header: Sequence[Sequence[str]], dialect: Dialect) -> dict[str, float | str]:
    """Return the lines like "key: value" above the table."""
    out: dict[str, float | str] = {}
    for row in header:
        cells = [c.strip() for c in row if c.strip()]
        if len(cells) == 1 and re.match(r"[^:=]{1,40}[:=]\s*\S", cells[0]):
            key, value = re.split(r"[:=]", cells[0], maxsplit=1)
        elif (len(cells) == 2 and dialect.width != 2) or (len(cells) > 2 and len({*cells[1:]}) == 1):
            key, value = cells[:2]
        elif len(cells) == 3 and is_period(f"{cells[1]} {cells[2]}"):
            key, value = cells[0], f"{cells[1]} {cells[2]}"
        else:
            continue
        number = cell(value, dialect.decimal)
        out[key.strip().rstrip(":")] = value.strip() if number is None or math.isnan(number) else number
    return out


FORMAT = Format(
    "csv",
    "text (CSV, TSV, TwinCAT Scope, LabVIEW)",
    (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".lvm"),
    recognise,
    read,
)
