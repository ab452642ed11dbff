"""Exports of a linear axis: what targets write in N·m, rad and kg·m² is in N, m and kg for an axis along a line.

Numbers stay as they are. Files with declared units (FMI) and with joint types (MJCF, URDF) are written for the axis by
their targets (`Job.linear`); here the units in the words of all other files follow.
"""

from __future__ import annotations

from collections.abc import Mapping

from stickslip.export.job import Check, Export
from stickslip.identify.on_a_line import UNITS, words

TURN = "the axis is linear: a turn in these files stands for 2π m"
STANDS_FOR = "the axis is linear: N·m, rad and kg·m² in these files stand for N, m and kg"
ROTARY_ONLY = ("bam",)
"""Targets whose actuators turn: their numbers keep the meaning that the target gives them."""
VECTORS = ".csv"
"""Golden vectors keep the names of their columns, by which programs find them."""


def is_linear(content: Mapping[str, object]) -> bool:
    """Whether the content of a model's file says that the axis moves along a line."""
    return content.get("motion") == "linear"


def along_a_line(export: Export, target: str, own: str) -> Export:
    """The same files with the units of a linear axis in their words; or a note where the target knows rotary actuators
    only, or the export's `own` name is that of a unit."""
    notes = tuple(words(note) for note in export.notes)
    if target in ROTARY_ONLY or UNITS.fullmatch(own):
        return Export(export.files, (*notes, STANDS_FOR))
    files = {name: _text(name, content) for name, content in export.files.items()}
    turns = any("whole turns" in content for content in files.values() if isinstance(content, str))
    return Export(files, (*notes, TURN) if turns else notes)


def tried(check: Check | None) -> Check | None:
    """What a check found, with the units of a linear axis."""
    return None if check is None else Check(check.passed, words(check.text), check.numbers)


def _text(name: str, content: str | bytes) -> str | bytes:
    if isinstance(content, bytes) or name.endswith(VECTORS):
        return content
    return words(content)
