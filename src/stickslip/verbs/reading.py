"""A log from wherever it is: a file of any known format, a data frame, arrays by name, or a record."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, cast

from numpy.typing import ArrayLike

from stickslip.core.arguments import arguments_checked, insist_on, rules_in, written
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.readers import profiles, remembered
from stickslip.readers.convert import Drive
from stickslip.readers.cut import Cut, cut, parse_rows, unwrapped
from stickslip.readers.in_memory import digest_of, table_in_memory, table_of_signals
from stickslip.readers.reading import joined, open_table, record_of, with_source
from stickslip.readers.table_columns import Table
from stickslip.verbs.kinds import require

Log = str | os.PathLike[str] | Record | Any
"""A path, a `Record`, a data frame, a mapping of arrays, or a structured array."""

SHORT = {"t": "time", "normal_force": "load"}
SIGNALS = (
    "t", "position", "reference", "velocity", "velocity_reference", "torque", "current", "voltage", "supply",
    "friction_torque", "sensor_torque", "compensation_torque", "normal_force", "temperature",
)  # fmt: skip
NUMBERS = (
    "counts_per_rev", "rated_torque", "rated_current", "torque_constant", "force_constant", "gear_ratio", "lead",
    "pole_pairs",
)  # fmt: skip
ARRAYS = (*SIGNALS, "units")
"""What says the signals themselves."""
PART = ("start", "end", "rows", "leave_out", "unwrap")
MOTORS = ("torque_constant", "force_constant")
"""What identification, too, multiplies a current or a voltage by."""
COLUMNS = ("map", "profile", "sample_time", "beside", *(n for n in NUMBERS if n not in MOTORS), "side")
"""What a record that is read already has no use for."""


class Reading(TypedDict, total=False):
    """How a log is read: what `read`, `doctor` and `identify` take besides the log.

    Signals in arrays, shape (n,), in SI units (rad, N·m, s) unless `units` says otherwise: `t`, `position`,
    `reference` (of the position), `velocity`, `velocity_reference`, `torque` (of the motor), `current`, `voltage`,
    `supply`, `friction_torque`, `sensor_torque`, `compensation_torque`, `normal_force`, `temperature`. `units` has the
    same names: ``units={"position": "deg", "torque": "mN·m"}``; a linear axis has "m" and "N".

    Of a file or a data frame: `map` says which column is a channel, ``{"position": "q_deg:deg"}`` (`stickslip.readers.
    read` has all forms), `profile` is a TOML file of such mappings, `sample_time` (s) is for logs without times,
    `beside` a second file of the same motion and clock. `remember` keeps the mapping for the next file with these
    columns in your configuration folder, and uses what is kept there, as the command line does.

    Numbers of the data sheet, where units need them: `counts_per_rev`, `rated_torque` (N·m), `rated_current` (A),
    `torque_constant` (N·m/A) or a linear motor's `force_constant` (N/A), `gear_ratio`, `side` ("motor" or "load"),
    `lead` (m a revolution), `pole_pairs` (for speeds in eRPM).

    Part of the log: `start` and `end` (s), `rows` (first, last; counted from 1, both included, also as "A:B"),
    `leave_out` (such ranges, or "spikes"), `unwrap` (count the position on where it jumps by a turn).
    """

    t: ArrayLike
    position: ArrayLike
    reference: ArrayLike
    velocity: ArrayLike
    velocity_reference: ArrayLike
    torque: ArrayLike
    current: ArrayLike
    voltage: ArrayLike
    supply: ArrayLike
    friction_torque: ArrayLike
    sensor_torque: ArrayLike
    compensation_torque: ArrayLike
    normal_force: ArrayLike
    temperature: ArrayLike
    units: Mapping[str, str]
    map: Mapping[str, str] | Sequence[str]
    profile: str | os.PathLike[str] | None
    sample_time: float | None
    beside: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None
    remember: bool
    counts_per_rev: float | None
    rated_torque: float | None
    rated_current: float | None
    torque_constant: float | None
    force_constant: float | None
    gear_ratio: float | None
    side: Literal["motor", "load"] | None
    lead: float | None
    pole_pairs: float | None
    start: float | None
    end: float | None
    rows: str | tuple[int, int] | None
    leave_out: Sequence[str | tuple[int, int]]
    unwrap: bool


READ_AS = rules_in(written(Reading), globals())
"""What the parts of `Reading` must be."""


@dataclass(frozen=True)
class Opened:
    """A record, the profile that was used, the one that was written, and what is to be said of them; of a file also
    the name and unit of every column that it has, used or not."""

    record: Record
    used: Path | None = None
    written: Path | None = None
    notes: tuple[Finding, ...] = ()
    columns: tuple[tuple[str, str], ...] = ()


@arguments_checked
def read(log: Log | None = None, **reading: Unpack[Reading]) -> Record:
    """Read a log as a record in SI units.

    Parameters
    ----------
    log : path, data frame, mapping of arrays, structured array or Record, optional
        Columns are known by their names and units; `map` says what these do not. Left out where arrays are given by
        name: ``read(t=t, position=q, torque=tau)``.
    **reading
        How: see `stickslip.verbs.reading.Reading`.

    Returns
    -------
    Record
        Channels named as those of simulated records (position, velocity, motor_torque, position_reference, ...). What
        was read from where, and with which factor, is in ``record.meta["reading"]``.

    Raises
    ------
    InputError
        If it cannot be read, columns are missing or ambiguous, or a unit needs a number that nobody gave.
    """
    opened = open_log(log, reading)
    for finding in cast("list[dict[str, Any]]", opened.record.meta.get("reading", {}).get("findings", [])):
        if finding["level"] == "error":
            raise InputError(f"{named(log)}: {finding['message']}; {finding['remedy']}")
    return opened.record


def named(log: Log | None) -> str:
    """What messages call a log."""
    return os.fspath(cast("str", log)) if isinstance(log, (str, os.PathLike)) else "the log"


def doctor_of(log: Log | None) -> str:
    """The call that says all that the doctor finds in a log, for a remedy."""
    name = named(log)
    return "`ss.doctor(...)`" if name == "the log" else f"`stickslip doctor {name}`"


def check_reading(given: Mapping[str, Any]) -> None:
    """Refuse a name that is none of `Reading`, and what is of a wild kind.

    Raises
    ------
    UnknownName, ParameterError
    """
    for name in given:
        if name not in Reading.__annotations__:
            raise UnknownName("argument", name, tuple(Reading.__annotations__))
    insist_on("reading", READ_AS, given)


def open_log(
    log: Log | None, reading: Reading, accept: Callable[[Record], object] = lambda _: None, *, steady: bool = False
) -> Opened:  # fmt: skip
    """As `read`, with what a saved profile had to do with it; ambiguous columns are left among the record's findings.

    With `remember`, what `map` and the numbers say is kept for the next file with these columns, unless `accept` raises
    on the record: what reads it wrongly is not for the next file. With `steady`, rows without times are steady points.

    Raises
    ------
    InputError
    """
    check_reading(reading)
    said = cast("Mapping[str, Any]", reading)
    signals = {SHORT.get(n, n): said[n] for n in SIGNALS if said.get(n) is not None}
    if not signals and (arrays := _arrays_in(log, reading)):
        log, signals = None, arrays
    if signals:
        if log is not None:
            given = [n for n in SIGNALS if said.get(n) is not None]
            raise InputError(f"{', '.join(given)} and a log exclude each other; give one of them")
        return Opened(_part(_of_signals(signals, reading, steady), reading, "the arrays"))
    if reading.get("units"):
        raise InputError("units is for arrays; give the unit of a column in map, such as q:deg")
    if log is None:
        raise InputError("no log; give a path, a data frame, or arrays: t=..., position=..., torque=...")
    if isinstance(log, Record):
        for name in COLUMNS:
            if reading.get(name):
                raise InputError(
                    f"{name} applies to columns of files and frames, not to a Record; leave it out"
                )
        return Opened(_part(log, reading, "the record"))
    if isinstance(log, (str, os.PathLike)):
        return _of_file(Path(cast("str", log)), reading, accept, steady)
    return Opened(_part(_of_data(log, reading, steady), reading, "the log"))


def _arrays_in(log: Any, reading: Reading) -> dict[str, ArrayLike]:
    """The signals of a mapping that has nothing but arguments' names: they mean what the arguments mean."""
    if not isinstance(log, Mapping) or any(reading.get(name) for name in ("map", "profile", "beside")):
        return {}
    arrays = cast("Mapping[Any, ArrayLike]", log)
    known = all(name == "time" or name in SIGNALS for name in arrays) and not {"t", "time"} <= arrays.keys()
    return {SHORT.get(str(n), str(n)): values for n, values in arrays.items()} if known else {}


def _of_signals(signals: Mapping[str, ArrayLike], reading: Reading, steady: bool) -> Record:
    for name in ("map", "profile", "beside"):
        if reading.get(name):
            raise InputError(f"{name} applies to columns of files and frames, not to arrays; leave it out")
    if "time" in signals and (period := reading.get("sample_time")) is not None:
        raise InputError(
            f"t and sample_time = {period:g} exclude each other, since both say when the rows were taken; give one of "
            "them"
        )
    units = {SHORT.get(n, n): unit for n, unit in reading.get("units", {}).items()}
    table, mapping = table_of_signals(signals, units, {channel: n for n, channel in SHORT.items()})
    record = record_of(
        table, mapping, drive=_drive(reading), sample_time=reading.get("sample_time"), steady=steady
    )
    return _with_digest(record, digest_of(table))


def _of_data(data: Any, reading: Reading, steady: bool) -> Record:
    if reading.get("beside"):
        raise InputError("beside joins two files; put the columns of both into one table instead")
    table = table_in_memory(data)
    profile = reading.get("profile")
    kept = profiles.load(Path(profile)) if profile else None
    period = reading.get("sample_time")
    try:
        record = record_of(
            table, reading.get("map", ()), drive=_drive(reading), sample_time=period, profile=kept,
            steady=steady,
        )  # fmt: skip
    except InputError as error:
        raise InputError(f"the log: {error.message}") from None
    return _with_digest(record, digest_of(table))


def _with_digest(record: Record, digest: str) -> Record:
    said: dict[str, Any] = {**record.meta["reading"], "file": "", "sha256": digest}
    return replace(record, meta={**record.meta, "reading": said})


def _of_file(path: Path, reading: Reading, accept: Callable[[Record], object], steady: bool) -> Opened:
    require(path, "record")
    table, period = open_table(path), reading.get("sample_time")
    asked = reading.get("map", ())
    mapping = [f"{k}={v}" for k, v in asked.items()] if isinstance(asked, Mapping) else list(asked)
    if (beside := beside_of(reading, 1)[0]) is not None:
        require(Path(beside), "record")
        table = joined(table, beside, mapping, period)
    profile = Path(given) if (given := reading.get("profile")) else None
    if profile is None and reading.get("remember", False):
        return _as_remembered(path, table, mapping, reading, accept, steady)
    keeps = bool(reading.get("remember", False))
    used = profile if profile and (profile.exists() or not keeps) else None
    kept = profiles.load(used) if used else None
    drive = _drive(reading)
    record = _part(
        record_of(table, mapping, drive=drive, profile=kept, sample_time=period, steady=steady),
        reading,
        str(path),
    )
    written = None
    if keeps and (_tells(mapping, drive, period) or not used):
        accept(record)
        merged = profiles.merged(mapping, drive, period, kept)
        if kept is None or not profiles.alike(merged, kept):
            written = profiles.save(merged, table, profile)
    return Opened(with_source(record, path), used, written, (), named_columns(table))


def _tells(mapping: Sequence[str], drive: Drive, period: float | None) -> bool:
    """Whether anything is said that a profile keeps."""
    return bool(mapping) or drive.known() != {"side": "motor"} or period is not None


def _as_remembered(
    path: Path, table: Table, mapping: Sequence[str], reading: Reading, accept: Callable[[Record], object],
    steady: bool,
) -> Opened:  # fmt: skip
    """A file read by what was said of files with its columns, which is kept for the next one."""
    found, digest = profiles.remembered(table), remembered.digest_of_file(path)
    kept = profiles.load(found) if found else None
    drive, period = _drive(reading), reading.get("sample_time")
    record, notes = _recalled(table, mapping, reading, found, kept, digest, steady)
    # Whoever judges the record has to know of the profile before.
    record = _part(record, reading, str(path))
    said: dict[str, Any] = record.meta["reading"]
    said["findings"] += [note.as_data() for note in notes]
    said["saved_profile"] = str(found) if notes else ""
    written = None
    if _tells(mapping, drive, period):
        accept(record)
        now = remembered.kept_now(kept, record, mapping, drive, period, path, digest)
        if kept is None or not profiles.alike(now, kept):
            written = profiles.save(now, table)
    if written and not notes:
        words = f"how to read files with these columns is kept in the profile {written}"
        notes.append(Finding("note", "profile", words, remedy=remembered.FORGET))
        said["findings"].append(notes[0].as_data())
    said["profile"] = str(found) if found and notes and not written else ""
    return Opened(with_source(record, path), found, written, tuple(notes), named_columns(table))


def _recalled(
    table: Table, mapping: Sequence[str], reading: Reading, found: Path | None, kept: profiles.Profile | None,
    digest: str, steady: bool,
) -> tuple[Record, list[Finding]]:  # fmt: skip
    """The record of a table by what the profile at `found` says of it, and what that did."""
    drive, period, recalled = _drive(reading), reading.get("sample_time"), None
    if found is None or kept is None:
        return record_of(table, mapping, drive=drive, sample_time=period, steady=steady), []
    try:
        given = [n for n in (*NUMBERS, "side", "sample_time") if reading.get(n) is not None]
        recalled = remembered.recall(kept, table, mapping, drive, given, digest)
        record = record_of(
            table, mapping, drive=drive, profile=recalled.profile, sample_time=period, steady=steady
        )
    except InputError as error:
        raise remembered.blamed(error, found, kept, recalled, mapping) from None
    return record, remembered.findings_of(found, recalled, mapping, record)


def columns_of(path: str | os.PathLike[str]) -> tuple[tuple[str, str], ...]:
    """Name and unit of every column of a file, as they stand there: what `map` may name.

    Raises
    ------
    InputError
        If the file cannot be read, or its format is not known.
    """
    return named_columns(open_table(path))


def named_columns(table: Table) -> tuple[tuple[str, str], ...]:
    """Name and unit of every column."""
    return tuple((c.name, c.unit) for c in table.columns)


def _part(record: Record, reading: Reading, name: str) -> Record:
    """The part of a record that is asked for, its position counted on where that is."""
    try:
        return _cut(record, reading)
    except InputError as error:
        raise InputError(f"{name}: {error.message}") from None


def _cut(record: Record, reading: Reading) -> Record:
    if not any(name in reading for name in PART):
        return record
    if reading.get("unwrap"):
        record = unwrapped(record)
    ranges = reading.get("leave_out", ())
    out = tuple(_rows("leave_out", r) for r in ranges if not (isinstance(r, str) and r == "spikes"))
    start, end, rows = reading.get("start"), reading.get("end"), reading.get("rows")
    part = cut(
        record,
        Cut(
            -math.inf if start is None else start,
            math.inf if end is None else end,
            (1.0, math.inf) if rows is None else _rows("rows", rows),
            out,
        ),
    )
    if len(out) < len(ranges):
        from stickslip.identification.doctor.spikes import spike_rows

        part = cut(part, Cut(leave_out=tuple((n, n) for n in spike_rows(part).tolist())))
    return part


def _rows(option: str, given: str | tuple[int, int]) -> tuple[float, float]:
    return parse_rows(option, given if isinstance(given, str) else f"{given[0]}:{given[1]}")


def _drive(reading: Reading) -> Drive:
    said = cast("Mapping[str, Any]", reading)
    given: dict[str, Any] = {n: said[n] for n in (*NUMBERS, "side") if said.get(n) is not None}
    for name, value in given.items():
        if value != value:  # to a `Drive`, NaN is a number that nobody gave
            raise InputError(f"{name_option(name, value)} must be a number greater than 0")
    return Drive(**given)


def beside_of(reading: Reading, count: int) -> list[str | os.PathLike[str] | None]:
    """The second file of every log."""
    given = reading.get("beside")
    every = [given] if isinstance(given, (str, os.PathLike)) else list(given or [])
    if len(every) not in (0, count):
        raise InputError(
            f"{name_option('beside')} is given {len(every)} times for {count} LOGs; give it once for each"
        )
    return list(every) or [None] * count
