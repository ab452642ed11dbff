"""A comparison as text: the tables of changes, what both tests say, the notes and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from stickslip.identify.compare.levels import Change

if TYPE_CHECKING:
    from stickslip.identify.compare.change import Comparison

LEAST = 1e-6
"""A chance below it depends on how normal the estimates are, far out."""


def lines(result: Comparison) -> Iterator[str]:
    """What `stickslip compare` prints."""
    if result.changes:
        yield f"{head('parameter')} p (Holm)"
    for c in result.changes:
        yield f"{row(c)} {chance(c.p):<9}{'changed' if c.changed else ''}".rstrip()
    if result.levels:
        yield f"{'' if not result.changes else chr(10)}{head('torque')}"
    for c in result.levels:
        yield row(c)
    yield ""
    if not math.isnan(result.p):
        yield f"friction parameters together: p {equal_to(result.p)}"
    yield (
        f"sliding curve: largest difference is {result.largest:.2g} times what the intervals explain "
        f"(p at most {result.curve_p:.1g})"
    )
    yield from result.notes
    yield result.summary


def head(what: str) -> str:
    """Of a table of changes."""
    return f"{what:<26}{'first':>11}{'second':>11}  {'unit':<11} {'change, 95 % interval':<34}"


def row(c: Change) -> str:
    """Both values, and the change in per cent or, where that has no meaning, in the unit."""
    by = c.words()[len(c.name) + 1 :]
    return f"{c.name:<26}{c.first:>11.5g}{c.second:>11.5g}  {c.unit:<11} {by:<34}"


def chance(p: float) -> str:
    """A chance, or the bound below which its value tells nothing; "-" where there is none."""
    if math.isnan(p):
        return "-"
    return f"< {LEAST:g}" if p < LEAST else f"{p:.2g}"


def equal_to(p: float) -> str:
    """The same behind a letter."""
    return chance(p) if p < LEAST else f"= {chance(p)}"
