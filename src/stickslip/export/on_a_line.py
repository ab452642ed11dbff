"""Exports of a linear axis: targets write N·m, rad and kg·m², whatever the axis; along a line these are N, m and kg."""

from __future__ import annotations

from collections.abc import Mapping

from stickslip.export.job import Check, Export
from stickslip.identify.on_a_line import UNITS, words

WORDED = ("c99", "arduino", "python", "matlab", "st", "linuxcnc")
"""Targets whose files have units in comments and words alone: others declare units that simulators compute with."""
TURN = "the axis is linear: a turn in these files stands for 2π m"
VECTORS = ".csv"
"""Golden vectors keep the names of their columns, by which programs find them."""


def is_linear(content: Mapping[str, object]) -> bool:
    """Whether the content of a model's file says that the axis moves along a line."""
    return content.get("motion") == "linear"


def along_a_line(export: Export, target: str, own: str) -> Export:
    """The same files with the units of a linear axis in their words; or a note where the target has its own units, or
    the export's `own` name is that of a unit."""
    notes = tuple(words(note) for note in export.notes)
    if target not in WORDED or UNITS.fullmatch(own):
        said = "the axis is linear: N·m, rad and kg·m² in these files stand for N, m and kg"
        return Export(export.files, (*notes, said))
    files = {name: _text(name, content) for name, content in export.files.items()}
    turns = any("turn" in content for content in files.values() if isinstance(content, str))
    return Export(files, (*notes, TURN) if turns else notes)


def tried(check: Check | None) -> Check | None:
    """What a check found, with the units of a linear axis."""
    return None if check is None else Check(check.passed, words(check.text), check.numbers)


def _text(name: str, content: str | bytes) -> str | bytes:
    if isinstance(content, bytes) or name.endswith(VECTORS):
        return content
    return words(content)
