"""The motion that `recommend` is given: read as `identify` reads a log, and what is to be said of how it was read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_option, render
from stickslip.core.record import Record
from stickslip.identification.doctor import timing, units
from stickslip.identification.doctor.view import View
from stickslip.identification.motion import REFERENCES, Motion, motion_of
from stickslip.models.model import Reference
from stickslip.readers import profiles, remembered
from stickslip.readers.convert import Drive
from stickslip.readers.derive import positioned
from stickslip.readers.reading import CHANNELS, open_table, record_of
from stickslip.recommendation.course import measured
from stickslip.verbs.kinds import require
from stickslip.verbs.reading import Log, Reading, open_log

FORCES = ("motor_torque", "current", "voltage")
"""Channels beside which a position is what an axis did."""
MOTION = ("time", "position", *REFERENCES)
"""All that is wanted of a motion's log."""
CHECKS = (
    units.assumed,
    timing.scale,
    units.counted,
    units.degrees,
    units.turns,
    units.reference_scale,
    units.too_fast,
)
"""What the doctor looks at: units, by what the numbers themselves say."""
CODES = (
    "unknown-unit",
    "time-unit",
    "no-clock",
    "position-unit",
    "position-reference-unit",
    "reference-scale",
)
PERIODS = 2.0
"""Of a reference that repeats, that are tried: the second is free of the start."""
LAST_BREAK = 1e6
"""s, until which a reference may come to rest."""
SPACING, FEWEST_POINTS, MOST_POINTS = 1e-3, 200, 200_000
"""s between the points of a reference, as samples of a usual drive; at least and at most so many points."""
POINTS = 200
"""Rows of a table of points, from which on nobody has written them down so far apart that they are taken for ms."""


@dataclass(frozen=True)
class Opened:
    """A record of a motion, whether an axis was driven along it, and what is to be said of how it was read."""

    record: Record
    driven: bool
    notes: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Given:
    """How a motion's log is read.

    Attributes
    ----------
    mapping : mapping of str to str, or sequence of str
        Which column is time, position, reference, as `map` of `identify`.
    counts_per_rev : float
        Of the encoder, for positions in counts; 0: not given.
    remember : bool
        Whether the profile kept for files with these columns is used.
    unit : str
        In which the axis moves, rad or m.
    """

    mapping: Mapping[str, str] | Sequence[str] = ()
    counts_per_rev: float = 0.0
    remember: bool = False
    unit: str = "rad"

    @property
    def listed(self) -> list[str]:
        """The mapping as options say it."""
        if isinstance(self.mapping, Mapping):
            return [f"{channel}={column}" for channel, column in self.mapping.items()]
        return list(self.mapping)


def motion_in(log: Log, given: Given = Given()) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a log or of a table of points, and what must be known of how it was read.

    Raises
    ------
    InputError
        If it cannot be read, does not move, or its numbers are certainly in another unit than they are taken in.
    """
    source: Any = log
    path = Path(cast("str", source)) if isinstance(source, (str, os.PathLike)) else None
    name = path.name if path else "the motion given"
    try:
        opened = _opened(path or log, given)
        record = opened.record
        motion = motion_of(record, name)
        notes = list(_units_of(opened, given, path))
    except InputError as error:
        said = render(error.message, motion=True)
        where = "" if name in said else f"{name_option('motion', path)}: " if path else f"{name}: "
        raise InputError(f"{where}{said}") from None
    if measured(motion) and not opened.driven:
        # Times and positions alone, without a torque, are what somebody wants the axis to do.
        motion = replace(motion, source=f"points{motion.source.removeprefix('position')}")
    return motion, tuple(
        render(f"{name_option('motion', name)}: {note.line()}.", motion=True) for note in notes
    )


def motion_along(reference: Reference, duration: float | None) -> Motion:
    """Return the points of a reference over `duration` seconds; None: two periods, or until it rests.

    Raises
    ------
    InputError
        If the duration is out of bounds, or none is given for a reference that neither repeats nor rests.
    """
    if duration is None:
        frequency = float(getattr(reference.parameters, "frequency", 0.0))
        ends = reference.breaks(LAST_BREAK) if frequency == 0.0 else []
        duration = PERIODS / frequency if frequency > 0.0 else max(ends, default=0.0)
        if not duration > 0.0:
            raise InputError(
                f"recommend: {reference!r} neither repeats nor comes to rest; give its duration in s"
            )
    if not 0.0 < duration < math.inf:
        raise InputError(f"recommend: duration = {duration:g} s must be greater than 0 and finite")
    count = min(max(round(duration / SPACING), FEWEST_POINTS), MOST_POINTS)
    time = np.linspace(0.0, duration, count)
    position, velocity, _ = reference.sample(time).T
    return Motion(time, position, velocity, f"{reference!r}, {duration:.4g} s")


def _opened(log: Log | Path, given: Given) -> Opened:
    """The record; by the encoder's counts only where it cannot be read without, or is certainly in counts."""
    counts = given.counts_per_rev
    try:
        opened = _read(log, given, 0.0)
    except InputError:
        if not counts:
            raise
        return _read(log, given, counts)
    view = View(opened.record)
    if counts and any(f.level == "error" for f in units.counted(view)):
        return _read(log, given, counts)
    return opened


def _read(log: Log | Path, given: Given, counts: float) -> Opened:
    """The record, positions in counts of so many a revolution."""
    if not isinstance(log, Path):
        how: dict[str, Any] = {"map": given.mapping} if given.mapping else {}
        how |= {"counts_per_rev": counts} if counts else {}
        record = positioned(open_log(log, cast("Reading", how)).record)
        return Opened(record, bool(set(FORCES) & set(record.channels)))
    try:
        opened = _of_file(log, given, counts)
    except InputError:
        # A torque whose unit needs a number of the drive's is no part of a motion.
        said = {text.partition("=")[0].strip() for text in given.listed}
        none = [f"{role}=none" for role in CHANNELS if role not in MOTION and role not in said]
        return replace(_of_file(log, replace(given, mapping=[*given.listed, *none]), counts), driven=True)
    return opened


def _of_file(path: Path, given: Given, counts: float) -> Opened:
    """The record of a file, by the profile kept for its columns where there is one. Nothing is kept of it."""
    require(path, "record")
    table, mapping = open_table(path), given.listed
    said = Drive(counts_per_rev=counts) if counts else Drive()
    found = profiles.remembered(table) if given.remember else None
    if found is None:
        record, notes = record_of(table, mapping, drive=said), list[Finding]()
    else:
        kept, recalled = profiles.load(found), None
        try:
            numbers = ["counts_per_rev"] if counts else []
            recalled = remembered.recall(kept, table, mapping, said, numbers, remembered.digest_of_file(path))
            record = record_of(table, mapping, drive=said, profile=recalled.profile)
        except InputError as error:
            raise remembered.blamed(error, found, kept, recalled, mapping) from None
        notes = remembered.findings_of(found, recalled, mapping, record)
    record = positioned(record)
    return Opened(record, bool(set(FORCES) & set(record.channels)), tuple(notes))


def _units_of(opened: Opened, given: Given, path: Path | None) -> Iterator[Finding]:
    """What is doubtful about the units of a motion, and what the saved profile did.

    Raises
    ------
    InputError
        If a unit is certainly wrong.
    """
    record = opened.record
    used = next((n for n in REFERENCES if n in record.channels), "position")
    view = View(_motion_alone(record))
    entry = next(
        (c for c in view.record.meta["reading"]["columns"] if c["channel"] == used), dict[str, Any]()
    )
    in_counts = any("counts" in step for step in entry.get("steps", ()))
    if path and view.stated(used) and record.units[used] != given.unit and not in_counts:
        raise InputError(
            f"{path.name}: {view.name(used)!r} is in {record.units[used]}, and the axis moves in {given.unit}; say "
            f"{view.mapped(used, f'FACTOR{given.unit}')}"
        )
    yield from (f for f in opened.notes if f.code != "profile-idle")
    for finding in _doubts(view, opened.driven):
        if finding.level == "error":
            raise InputError(finding.line())
        yield finding
    if entry.get("source") == "drive":
        said = f"{view.name(used)!r} states no unit; it was read as counts, {given.counts_per_rev:g} a revolution"
        yield Finding("note", "counts", said)
    if quiet := [c for c in ("time", used) if not view.stated(c)]:
        taken = ", ".join(f"{view.name(c)!r} as {c} in {'s' if c == 'time' else given.unit}" for c in quiet)
        remedy = f"say them, such as {view.mapped(quiet[-1], 'UNIT')}"
        yield Finding(
            "warning",
            "assumed-unit",
            f"the file states no unit that is known; taken were {taken}",
            "",
            remedy,
        )


def _motion_alone(record: Record) -> Record:
    """The record without what is no part of a motion: its units are of no concern."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    columns = [c for c in reading.get("columns", ()) if c["channel"] in MOTION]
    meta = {**record.meta, "reading": {**reading, "columns": columns}}
    channels = {n: x for n, x in record.channels.items() if n in MOTION}
    return Record(record.time, channels, {n: record.units[n] for n in channels}, meta)


def _doubts(view: View, driven: bool) -> Iterator[Finding]:
    """What the doctor says of the units, where there are rows enough to tell."""
    if view.time.size < timing.FEWEST:
        return
    with np.errstate(all="ignore"):
        for finding in (f for check in CHECKS for f in check(view) if f.code in CODES):
            # Points that somebody wrote down may be far apart; samples of a drive are not.
            few = finding.code == "time-unit" and not driven and view.time.size < POINTS
            yield replace(finding, level="warning") if few else finding
