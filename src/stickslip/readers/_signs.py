"""Points and commas in one table of text: which of them is the decimal sign, and which stands between thousands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, field

from stickslip.errors import InputError
from stickslip.finding import Finding

SIGNS = (".", ",")
NUMBER = re.compile(r"[-+]?[\d.,]*\d[\d.,]*(?:[eE][-+]?\d+)?")
GROUPS = {s: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:{re.escape(s)}\d{{3}})+") for s in SIGNS}
"""Whole numbers with a sign between their thousands; one with a single sign may have three decimals, too."""


@dataclass
class _Seen:
    """What the cells of a column show of a sign: the first in which it is the decimal sign, and the first in which it
    may stand between thousands, or does."""

    decimal: dict[str, str] = field(default_factory=dict[str, str])
    maybe: dict[str, str] = field(default_factory=dict[str, str])
    between: dict[str, str] = field(default_factory=dict[str, str])
    beside: set[str] = field(default_factory=set[str])
    """Signs that stand between thousands in a cell with the other, as its decimal sign: that cell tells itself."""

    def look(self, text: str) -> None:
        """Take a cell into account."""
        if not NUMBER.fullmatch(text):
            return
        held = sorted((s for s in SIGNS if s in text), key=text.rindex)
        if len(held) == 2:
            if text.count(held[1]) == 1:
                self.decimal.setdefault(held[1], text)
                self.beside.add(held[0])
        elif held and GROUPS[held[0]].fullmatch(text):
            (self.maybe if text.count(held[0]) == 1 else self.between).setdefault(held[0], text)
        elif held and text.count(held[0]) == 1:
            self.decimal.setdefault(held[0], text)

    @property
    def held(self) -> set[str]:
        """The signs in it."""
        return {*self.decimal, *self.maybe, *self.between, *self.beside}


def between_thousands(
    rows: Iterable[Sequence[str]], width: int, words: Set[int]
) -> tuple[dict[int, str], list[Finding]]:
    """The columns with a sign between thousands, by index, and what is to be said of them.

    Points and commas are not both decimal signs: where one of them certainly is in some cell, the other stands between
    thousands wherever every cell can be read so. A column whose cells cannot is left as it is.

    Parameters
    ----------
    rows : iterable of sequence of str
        Cells.
    width : int
        Columns.
    words : set of int
        Columns that hold words.

    Raises
    ------
    InputError
        If nothing tells the two apart.
    """
    seen = [_Seen() for _ in range(width)]
    for row in rows:
        for j, text in enumerate(row[:width]):
            if j not in words and ("." in text or "," in text):
                seen[j].look(text.strip().strip('"').strip())
    if len(set[str]().union(*(column.held for column in seen))) < 2:
        return {}, []
    certain = {s: column.decimal[s] for column in seen for s in SIGNS if s in column.decimal}
    out: dict[int, str] = {}
    findings: list[Finding] = []
    for j, column in enumerate(seen):
        for sign, other in (SIGNS, SIGNS[::-1]):
            text = column.maybe.get(sign) or column.between.get(sign)
            if sign in column.decimal:
                if other in column.decimal:
                    raise _mixed(column.decimal[sign], j, column.decimal[other])
            elif text and other in certain and sign not in certain:
                out[j] = sign
                findings.append(_said(j, text, sign, certain[other]))
            elif sign in column.maybe:
                example = certain.get(other) or next(c.maybe[other] for c in seen if other in c.maybe)
                raise _mixed(column.maybe[sign], j, example)
    return out, findings


def _said(column: int, text: str, sign: str, decimal: str) -> Finding:
    name = "points" if sign == "." else "commas"
    message = (
        f"{text!r} in column {column + 1} was read as {text.replace(sign, '')}: {name} stand between thousands, since "
        f"{decimal!r} has the decimal sign"
    )
    return Finding(
        "note", "thousands", message, remedy="write the file without signs between thousands if it is not so"
    )


def _mixed(text: str, column: int, other: str) -> InputError:
    return InputError(
        f"{text!r} in column {column + 1} and {other!r} have a point and a comma, and nothing tells which is the "
        "decimal sign; write the file with one decimal sign and none between thousands"
    )
