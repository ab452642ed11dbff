"""A comparison as text: tables of changes, results of both tests, notes and verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from stickslip.identification.compare.levels import Change

if TYPE_CHECKING:
    from stickslip.identification.compare.change import Comparison

HEAD = ("first", "second", "unit", "change, 95 % interval")
USUAL = (26, 11, 11, 12, 34)
LEAST = 1e-6
"""Least p-value that is printed: a smaller one depends on how normal the estimates are in their tails."""


def lines(result: Comparison) -> Iterator[str]:
    """Yield the lines that `stickslip compare` prints."""
    widths = widths_of([*result.changes, *result.levels])
    if result.changes:
        yield f"{row(('parameter', *HEAD), widths)} p (Holm)"
    for c in result.changes:
        yield f"{row(cells(c), widths)} {chance(c.p):<9}{'changed' if c.changed else ''}".rstrip()
    if result.levels:
        yield f"{'' if not result.changes else chr(10)}{row(('torque', *HEAD), widths)}"
    for c in result.levels:
        yield f"{row(cells(c), widths)} {'':<9}{'changed' if c.changed else ''}".rstrip()
    yield ""
    if not math.isnan(result.p):
        yield f"friction parameters together: p {equal_to(result.p)}"
    yield (
        f"sliding curve: largest difference is {result.largest:.2g} times what the intervals explain "
        f"(p at most {result.curve_p:.1g})"
    )
    yield from result.notes
    yield result.summary


def cells(c: Change) -> tuple[str, ...]:
    """Return name, both values, unit, and the change in per cent or, if that is not meaningful, in the unit."""
    return c.name, f"{c.first:.5g}", f"{c.second:.5g}", c.unit, c.words()[len(c.name) + 1 :]


def widths_of(changes: Sequence[Change]) -> tuple[int, ...]:
    """Return the widths of all columns: the usual ones, or wider to keep columns apart."""
    return tuple(
        max([usual, *(len(cell) + 1 for cell in column)])
        for usual, column in zip(USUAL, zip(*map(cells, changes), strict=True), strict=False)
    )


def row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a line of a table."""
    name, first, second, unit, by = (
        f"{cell:{side}{width}}" for cell, side, width in zip(cells, "<>><<", widths, strict=True)
    )
    return f"{name}{first}{second}  {unit}{by}"


def chance(p: float) -> str:
    """Return a p-value as text, or its bound below `LEAST`; "-" if there is none."""
    if math.isnan(p):
        return "-"
    return f"< {LEAST:g}" if p < LEAST else f"{p:.2g}"


def equal_to(p: float) -> str:
    """Return a p-value as text with its relation."""
    return chance(p) if p < LEAST else f"= {chance(p)}"
