"""Styles of lines: a controller or law has one colour and one mark in all figures of studies and sweeps.

Lines of controllers are solid, because dashes of an oscillating line look like noise. Marks at a few places distinguish
lines in print without colour, and reveal lines on top of each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

MARKS = "osD^vP>X<*ph"
"""The marks; their index determines the position along the line, so marks of coinciding lines do not overlap."""


@dataclass(frozen=True)
class Style:
    """Colour (Okabe-Ito, safe for the colour-blind), dashes, width (points) and marker of a line.

    Attributes
    ----------
    marker : str
        At every point.
    mark : str
        At a few places along the line, one of `MARKS`.
    hollow : bool
        Whether the mark is white inside.
    """

    colour: str
    dashes: Any = "-"
    width: float = 1.1
    marker: str = ""
    mark: str = ""
    hollow: bool = False


REFERENCE = Style("#000000", (0, (1, 1.5)), 1.3)
LAST = Style("#777777", width=0.6)
"""For names beyond a hundred."""
LAWS = {
    "coulomb": Style("#E69F00", width=0.9, mark="o"),
    "stribeck": Style("#56B4E9", width=0.9, mark="s"),
    "lugre": Style("#009E73", width=0.9, mark="^"),
    "gms": Style("#0072B2", width=0.9, mark="D"),
}
LINEAR = {
    "PD": Style("#777777", width=1.4),
    "PID": Style("#CC79A7", width=0.9, mark="v"),
    "PR": Style("#D55E00", width=0.9, mark=">"),
}
SPARE = ("#D55E00", "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#CC79A7")
"""Colours of other names, in order of use."""
SPARE_MARKS = "P<X*hposD^v>"


def styles_of(names: Sequence[str]) -> dict[str, Style]:
    """Return a style for every controller of a study, all different.

    A law's colour and mark follow from its name, hollow for feedback (``FB-``). Other names get colours in turn, first
    those of no known name, never those of a linear controller, which is in every figure.
    """
    styles: dict[str, Style] = {}
    for name in names:
        if (known := _known_style(name)) and known not in styles.values():
            styles[name] = known
    linear = {style.colour for name, style in styles.items() if name in LINEAR}
    taken = {style.colour for style in styles.values()}
    colours = sorted((c for c in SPARE if c not in linear), key=lambda colour: colour in taken)
    count = len(SPARE_MARKS)
    looks = itertools.product((False, True), range(count), enumerate(colours))
    # Adjacent names differ in colour and mark: steps of five visit all marks.
    spares = (
        Style(colour, width=0.9, mark=SPARE_MARKS[(place + 5 * turn) % count], hollow=hollow)
        for hollow, turn, (place, colour) in looks
    )
    for name in names:
        if name not in styles:
            styles[name] = next((s for s in spares if s not in styles.values()), LAST)
    return {name: styles[name] for name in names}


def style_of(name: str, others: Sequence[str] = ()) -> Style:
    """Return the style of a controller or law among others, by `styles_of`."""
    return styles_of(list(dict.fromkeys([*others, name])))[name]


def _known_style(name: str) -> Style | None:
    """Return the style of a linear controller, or of the law at the end of a name."""
    if name in LINEAR:
        return LINEAR[name]
    kind, _, law = name.rpartition("-")
    style = LAWS.get(law)
    return replace(style, hollow=True) if style and kind == "FB" else style
