"""Read a file as a record: detect the format, choose the columns, convert the units."""

from __future__ import annotations

import hashlib
import importlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.config import refuse_endless
from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.core.resources import insist_on_memory, size_text
from stickslip.readers import profiles
from stickslip.readers._choose import Choice, choose, meant, parse_mapping
from stickslip.readers._names import ROLES
from stickslip.readers._tool_columns import with_tool
from stickslip.readers.convert import Drive, convert, times_of
from stickslip.readers.limits import insist_on_columns, size_of
from stickslip.readers.table_columns import Format, Table

FORMATS = (
    "record_file",
    "mat",
    "hdf5",
    "parquet",
    "numpy_arrays",
    "mdf",
    "tdms",
    "rosbag",
    "wpilog",
    "ulog",
    "json_samples",
    "codesys_trace",
    "csv_text",
)
"""Modules of the formats, tried in this order; text is last, because anything may be text."""
TIMES_OF_A_TEXT = 4.0
"""Memory that a text of numbers uses while it is read, in multiples of its size."""
CHANNELS = ROLES
"""Channels that the columns of a file may be."""
PER_MILLE = re.compile(r"(?i)(?<![0-9a-f])60(?:77|b2)(?![0-9a-f])")
"""Objects of CiA 402 (IEC 61800-7-201) in thousandths of the rated torque: actual torque, torque offset."""

PARTS = ("nanosec", "nanosecs", "nsec", "nsecs")
"""Names of the nanoseconds in a ROS time stamp."""
COUNT_RATE = re.compile(r"(?i)(?<![0-9a-f])60(?:6b|6c|ff)(?![0-9a-f])")
"""Its velocities, in counts per second where nothing else is set."""


def formats() -> list[Format]:
    """Return all registered formats."""
    return [importlib.import_module(f"stickslip.readers.{name}").FORMAT for name in FORMATS]


def open_table(path: str | os.PathLike[str]) -> Table:
    """Read a file's columns without conversion.

    Raises
    ------
    InputError
        If the file cannot be read, or its format is not known.
    """
    source = Path(path)
    refuse_endless(source)
    try:
        head = b"" if source.is_dir() else _head(source)
        if not head and not source.is_dir():
            raise InputError(f"{source} is empty; give a file with samples")
        known = formats()
        found = next((f for f in known if f.recognise(head, source)), None)
        if found is None:
            if source.is_dir():
                raise InputError(f"{source} is a folder, and no ROS bag; give a file in it")
            titles = ", ".join(f.title for f in known)
            raise InputError(f"{source} is in no format that is known; formats are {titles}")
        size = size_of(source)
        insist_on_memory(TIMES_OF_A_TEXT * size, f"{source}: {size_text(size)}", "read a part of it")
        with np.errstate(all="ignore"):
            table = found.read(source)
    except InputError as error:
        if "\n" not in str(error):
            raise
        # Some libraries describe a damaged file in several lines of text.
        raise InputError(" ".join(str(error).split())) from None
    except FileNotFoundError:
        raise InputError(f"no file {source}; check the path") from None
    except (OSError, MemoryError) as error:
        raise InputError(
            f"{source} cannot be read ({getattr(error, 'strerror', None) or error}); give another file"
        ) from None
    if not table.columns:
        raise InputError(f"{source} holds no columns of numbers; give a file with samples over time")
    insist_on_columns(source, len(table.columns))
    return with_tool(_with_whole_stamps(table))


def _with_whole_stamps(table: Table) -> Table:
    """Return the table with the seconds and nanoseconds of each ROS time stamp in one column."""
    columns = {c.name: c for c in table.columns}
    for name, seconds in list(columns.items()):
        match = re.fullmatch(r"(.+?)[._]s(?:ec)?(s?)", name)
        parts = [f"{match[1]}{sep}{word}" for sep in "._" for word in PARTS] if match else []
        rest = next((columns[part] for part in parts if part in columns), None)
        if (
            match is None
            or rest is None
            or rest.clock is not seconds.clock
            or rest.values.shape != seconds.values.shape
        ):
            continue
        whole = replace(seconds, name=match[1], values=seconds.values + 1e-9 * rest.values, unit="s")
        columns = {
            (whole if c is seconds else c).name: whole if c is seconds else c
            for c in columns.values()
            if c is not rest
        }
    return replace(table, columns=tuple(columns.values()))


def _head(source: Path) -> bytes:
    with source.open("rb") as file:
        return file.read(4096)


def read(
    path: str | os.PathLike[str],
    mapping: Mapping[str, str] | Sequence[str] = (),
    *,
    drive: Drive | None = None,
    profile: str | os.PathLike[str] | None = None,
    sample_time: float | None = None,
) -> Record:
    """Read a file of any known format as a record in SI units.

    Columns that the mapping does not name are guessed from their names and units. Sources, factors and findings are in
    ``record.meta["reading"]``, computed channels in ``record.meta["derived"]``.

    Parameters
    ----------
    path : path
    mapping : mapping of str to str, or sequence of str
        ``{"position": "q_deg:deg"}`` or ``["position=q_deg:deg"]``: a channel, its column, its unit. A unit may have a
        factor ("0.25 um"); "@load" after it marks a signal on the load side of the gear; "none" ignores the channel.
    drive : Drive
        Counts per revolution, rated torque, torque constant, gear ratio.
    profile : path
        A profile that `stickslip.readers.profiles.save` wrote; the arguments above have priority.
    sample_time : float
        s, for files without times.

    Returns
    -------
    Record
        Channels named as those of simulated records (position, velocity, motor_torque, position_reference, ...).

    Raises
    ------
    InputError
        If the file cannot be read, columns are missing or ambiguous, or a unit requires a number that is missing.
    """
    table = open_table(path)
    kept = profiles.load(Path(profile)) if profile is not None else None
    record = record_of(table, mapping, drive=drive, profile=kept, sample_time=sample_time)
    for finding in cast("list[dict[str, Any]]", record.meta["reading"]["findings"]):
        if finding["level"] == "error":
            raise InputError(f"{path}: {finding['message']}; {finding['remedy']}")
    return with_source(record, Path(path))


def record_of(
    table: Table,
    mapping: Mapping[str, str] | Sequence[str] = (),
    *,
    drive: Drive | None = None,
    profile: profiles.Profile | None = None,
    sample_time: float | None = None,
    steady: bool = False,
) -> Record:
    """Return the record of a table; with `steady`, rows without times are steady points (see `convert`).

    Errors among the findings about its columns are left to the caller.

    Raises
    ------
    InputError
        As `read`.
    """
    said = meant(table, parse_mapping(mapping))
    before = meant(table, profile.mapping) if profile else {}
    kept = {role: column for role, column in before.items() if role not in said}
    choices, findings = choose(table, {**kept, **said})
    choices = [_from_profile(c) if c.role in kept and c.source == "map" else c for c in choices]
    settings = profiles.merged([], drive or Drive(), sample_time, profile).drive
    remembered = sample_time is None and profile is not None and profile.sample_time is not None
    period = profile.sample_time if profile and remembered else sample_time
    # Numbers of damaged files may overflow; they become infinite, and the doctor finds them.
    with np.errstate(all="ignore"):
        record = convert(
            table, told(choices, table, settings), settings, period, [*table.findings, *findings],
            steady=steady,
        )  # fmt: skip
    said_of_it = cast("list[dict[str, Any]]", record.meta["reading"]["findings"])
    for finding in said_of_it if remembered else ():
        if finding["code"] == "time-overruled":
            finding["remedy"] = (
                "the profile says sample_time: if the column is right, delete that line from its file"
            )
    return record


def told(choices: Sequence[Choice], table: Table, drive: Drive) -> list[Choice]:
    """Return the choices with units of integers that follow from the drive's numbers: counts if counts per revolution
    are given."""
    columns = {c.name: c for c in table.columns}
    known = drive.known()
    out: list[Choice] = []
    for choice in choices:
        unit = ""
        if choice.role in ("position", "position_reference") and "counts_per_rev" in known:
            unit = "counts"
        elif choice.role in ("velocity", "velocity_reference") and "counts_per_rev" in known:
            unit = "counts/s" if COUNT_RATE.search(choice.column) else ""
        elif "rated_torque" in known and PER_MILLE.search(choice.column):
            unit = "permille"
        if unit and not choice.unit and _whole(columns[choice.column].values):
            choice = replace(choice, unit=unit, source="drive")
        out.append(choice)
    return out


def _whole(values: np.ndarray) -> bool:
    """Whether all values are integers, and not all equal."""
    finite = values[np.isfinite(values)]
    return bool(finite.size and np.ptp(finite) > 0.0 and np.all(finite == np.round(finite)))


def joined(
    table: Table, path: str | os.PathLike[str], mapping: Sequence[str] = (), sample_time: float | None = None
) -> Table:
    """Return the table with the columns of a second file of the same motion, which keep their own times.

    Both have the same zero of time. The file's name is appended to columns whose names exist already.

    Parameters
    ----------
    table : Table
    path : path
        Of the second file.
    mapping : sequence of str
        As in `read`; entries for other columns belong to the table.
    sample_time : float
        s, for files without times.

    Raises
    ------
    InputError
        If the second file cannot be read, or has no times.
    """
    source, other = Path(path), open_table(path)
    own = {c.name.lower() for c in other.columns}
    mine = [m for m in mapping if m.partition("=")[2].partition("@")[0].rpartition(":")[0].lower() in own
            or m.partition("=")[2].lower() in own]  # fmt: skip
    try:
        # Only its times are needed here; its columns are assigned together with all others.
        choices, _ = choose(other, parse_mapping(mine))
        named = next((c.column for c in choices if c.role == "time"), "")
        clock, origin = times_of(other, choices, sample_time)
    except InputError as error:
        raise InputError(f"{source}: {error.message}") from None
    taken = {c.name for c in table.columns}
    columns = [
        replace(
            c,
            name=c.name if c.name not in taken else f"{c.name} ({source.name})",
            clock=c.clock if c.clock is not None else clock + origin,
        )
        for c in other.columns
        if c.name != named and (c.clock is not None or c.values.size == clock.size)
    ]
    return replace(table, columns=(*table.columns, *columns), findings=(*table.findings, *other.findings))


def with_source(record: Record, path: Path) -> Record:
    """Return the record with its file's name and SHA-256 in meta."""
    meta = dict(record.meta)
    digest = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    meta["reading"] = {**meta["reading"], "file": str(path), "sha256": digest}
    return Record(record.time, record.channels, record.units, meta)


def _from_profile(choice: Choice) -> Choice:
    return Choice(choice.role, choice.column, choice.unit, "profile", choice.side)
