"""A comparison as text: the tables of changes, what both tests say, the notes and the verdict."""

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
"""A chance below it depends on how normal the estimates are, far out."""


def lines(result: Comparison) -> Iterator[str]:
    """What `stickslip compare` prints."""
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
    """Name, both values, unit, and the change in per cent or, where that has no meaning, in the unit."""
    return c.name, f"{c.first:.5g}", f"{c.second:.5g}", c.unit, c.words()[len(c.name) + 1 :]


def widths_of(changes: Sequence[Change]) -> tuple[int, ...]:
    """Of all columns: as usual, or wider, so that none touches the next."""
    return tuple(
        max([usual, *(len(cell) + 1 for cell in column)])
        for usual, column in zip(USUAL, zip(*map(cells, changes), strict=True), strict=False)
    )


def row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """A line of a table."""
    name, first, second, unit, by = (
        f"{cell:{side}{width}}" for cell, side, width in zip(cells, "<>><<", widths, strict=True)
    )
    return f"{name}{first}{second}  {unit}{by}"


def chance(p: float) -> str:
    """A chance, or the bound below which its value tells nothing; "-" where there is none."""
    if math.isnan(p):
        return "-"
    return f"< {LEAST:g}" if p < LEAST else f"{p:.2g}"


def equal_to(p: float) -> str:
    """The same behind a letter."""
    return chance(p) if p < LEAST else f"= {chance(p)}"
