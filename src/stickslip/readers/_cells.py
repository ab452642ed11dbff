"""Decode text files and parse their cells: decimal commas, thousands, truth values, dates and times of day."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from stickslip.readers.table_columns import Array

NO_VALUE = frozenset(
    (
        "",
        "nan",
        "n/a",
        "na",
        "#n/a",
        "null",
        "none",
        "-",
        "--",
        "nat",
        "-nan",
        "nan(ind)",
        "-nan(ind)",
        "1.#qnan",
        "?",
    )
)
TRUTH = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "wahr": 1.0, "falsch": 0.0}
THOUSANDS = {
    ".": re.compile(r"([-+]?\d{1,3}(?:[,'\u00a0\u202f]\d{3})+)\.(\d*)"),
    ",": re.compile(r"([-+]?\d{1,3}(?:[.'\u00a0\u202f]\d{3})+),(\d*)"),
}
"""Numbers with thousands separators, by their decimal sign."""
OF_DAY = re.compile(r"([01]?\d|2[0-3]):([0-5]\d):([0-5]\d)(?:[.,](\d+)|[;:](\d{1,3}))?")
"""Hours, minutes, seconds; a fraction of them, or separate milliseconds (Studio 5000: ``10:15:22;122``)."""
IN_TWO = re.compile(r"(?<![\d:])((?:[01]?\d|2[0-3]):[0-5]\d:[0-5]\d),(\d{3})(?=,)")
"""A time of day whose milliseconds are cut off by a comma that also separates cells."""
DAY = 86400.0


def decoded(path: Path) -> str:
    """Return the text of a file, in UTF-8, UTF-16 or Latin-1."""
    data = path.read_bytes()
    try:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return data.decode("utf-16")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Every byte is valid in Latin-1; Windows-1252 differs only in characters that no number uses.
        return data.decode("latin-1")


def cell(text: str, decimal: str) -> float | None:
    """Return the number in a cell, NaN for a missing value, None for anything else."""
    word = text.strip().strip('"').strip()
    if (match := THOUSANDS[decimal].fullmatch(word)) is not None:
        word = re.sub(r"[^0-9+-]", "", match[1]) + "." + match[2]
    elif decimal == "," and "," in word:
        word = word.replace(",", ".") if "." not in word else ""
        if not word:
            return None
    try:
        return float(word) if "_" not in word else None
    except ValueError:
        pass
    lower = word.lower()
    if lower in NO_VALUE:
        return math.nan
    if lower in TRUTH:
        return TRUTH[lower]
    return moment(word)


def moment(word: str) -> float | None:
    """Return a date with time in s since 1970, or a time of day in s since midnight."""
    if (match := OF_DAY.fullmatch(word)) is not None:
        seconds = float(f"{match[3]}.{match[4] or 0}") + 1e-3 * int(match[5] or 0)
        return 3600.0 * int(match[1]) + 60.0 * int(match[2]) + seconds
    if len(word) < 16 or not word[:4].isdigit():
        return None
    try:
        moment = datetime.fromisoformat(word)
    except ValueError:
        return None
    try:
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError, OSError):
        return None


def clocks_whole(lines: Sequence[str]) -> Sequence[str]:
    """Return the lines with a point before the milliseconds if a comma splits every time: the header has one cell
    fewer."""
    first = next((i for i, line in enumerate(lines) if IN_TWO.search(line)), 0)
    above = next((line for line in reversed(lines[:first]) if line.strip()), "")
    if not above or lines[first].count(",") != above.count(",") + 1:
        return lines
    rows = [line for line in lines[first : first + 100] if line.strip()]
    if sum(bool(IN_TWO.search(line)) for line in rows) < 0.8 * len(rows):
        return lines
    return [IN_TWO.sub(r"\1.\2", line, count=1) for line in lines]


def over_midnight(values: Array, daily: bool | None) -> Array:
    """Return a column; times of day continue after midnight."""
    if not daily:
        return np.ascontiguousarray(values)
    known = np.flatnonzero(np.isfinite(values))
    days = np.cumsum(np.diff(values[known], prepend=values[known[:1]]) < -0.5 * DAY)
    out = values.copy()
    out[known] += DAY * days
    return out
