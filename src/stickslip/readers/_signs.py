"""Decide which of point and comma is the decimal sign of a text table, and which separates thousands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, field

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding

SIGNS = (".", ",")
NUMBER = re.compile(r"[-+]?[\d.,]*\d[\d.,]*(?:[eE][-+]?\d+)?")
GROUPS = {s: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:{re.escape(s)}\d{{3}})+") for s in SIGNS}
"""Integers with thousands separators; with a single sign it may also be a number with three decimals."""


@dataclass
class _Seen:
    """Evidence about a sign in a column: the first cell in which it is the decimal sign, and the first in which it may
    be or is a thousands separator."""

    decimal: dict[str, str] = field(default_factory=dict[str, str])
    maybe: dict[str, str] = field(default_factory=dict[str, str])
    between: dict[str, str] = field(default_factory=dict[str, str])
    beside: set[str] = field(default_factory=set[str])
    """Thousands separators in cells that also have the other sign as decimal sign, so these cells are unambiguous."""

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
    """Return the columns with thousands separators, by index, and findings.

    Only one of point and comma is the decimal sign. If one of them certainly is in some cell, the other separates
    thousands in every column whose cells all allow it; other columns are unchanged.

    Parameters
    ----------
    rows : iterable of sequence of str
        Cells.
    width : int
        Columns.
    words : set of int
        Columns with words.

    Raises
    ------
    InputError
        If the two cannot be distinguished.
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
