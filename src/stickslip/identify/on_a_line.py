"""Results of a linear axis: methods count in N·m and rad, whatever the record; along a line these are N and m."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stickslip.identify.estimate import Identification, Picture
from stickslip.machines.servo import ServoAxis

LINEAR = ServoAxis(motion="linear")
UNITS = re.compile(r"(?<![A-Za-z0-9_.])([mµk]?)(N[·*.]m|kg[·*.]m(?:²|\^2|2)|rad)(?![A-Za-z0-9_]|\.[A-Za-z])")
"""A unit in a sentence, a label or a comment, perhaps with a prefix, also in ASCII's letters; no part of an identifier
or of a file's name."""
ALONG = {"N": "N", "k": "kg", "r": "m"}
"""What it is along a line, by its first letter."""


def along_a_line(found: Identification) -> Identification:
    """The same numbers with the units of a linear axis, in words and pictures too; ``rms_Nm`` is then ``rms_N``.

    A result that knows its axis (`Identification.details`, ``axis``) has its pictures right already.
    """
    found = worded(found)
    estimates = tuple(replace(e, unit=LINEAR.unit(e.unit)) for e in found.estimates)
    found = replace(found, estimates=estimates, misfit=in_newtons(found.misfit))
    if isinstance(found.details.get("axis"), ServoAxis):
        return found
    details: dict[str, Any] = {**found.details, "axis": LINEAR}
    if "comparison" in details:
        details["comparison"] = {name: in_newtons(cells) for name, cells in details["comparison"].items()}
    return replace(found, details=details, pictures=tuple(picture(p) for p in found.pictures))


def worded(found: Identification) -> Identification:
    """The same with verdicts, notes and what to measure next in the units of a linear axis."""
    return replace(
        found, estimates=tuple(replace(e, verdict=words(e.verdict)) for e in found.estimates),
        notes=tuple(words(n) for n in found.notes), measure_next=tuple(words(n) for n in found.measure_next),
    )  # fmt: skip


def in_newtons(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers by names that end with their unit."""
    return {f"{k.removesuffix('_Nm')}_N" if k.endswith("_Nm") else k: v for k, v in numbers.items()}


def words(text: str) -> str:
    """A sentence or a label."""
    return UNITS.sub(lambda found: found[1] + ALONG[found[2][0]], text)


def picture(p: Picture) -> Picture:
    """Its words."""
    return replace(
        p, title=words(p.title), message=words(p.message), x_label=words(p.x_label), y_label=words(p.y_label),
        traces=tuple(replace(t, label=words(t.label)) for t in p.traces),
    )  # fmt: skip
