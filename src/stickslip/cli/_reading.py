"""What the verbs that read records share: the options that say how, and the profile that is kept."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli._kinds import require

if TYPE_CHECKING:
    from collections.abc import Callable

    from stickslip.finding import Finding
    from stickslip.readers import Drive
    from stickslip.readers.profiles import Profile
    from stickslip.record import Record

__all__ = ["Opened", "add_arguments", "open_record", "print_columns", "read_record"]

FORGET = "delete that file to forget it"


@dataclass(frozen=True)
class Opened:
    """A record, the profile that was used, the one that was written, and what is to be said of them."""

    record: Record
    used: Path | None
    written: Path | None
    notes: tuple[Finding, ...] = ()

    @property
    def tells_numbers(self) -> bool:
        """Whether a saved profile, which nobody named, brings numbers of the drive into the result."""
        return any(f.code == "profile" and " = " in f.message for f in self.notes)


def add_arguments(parser: argparse.ArgumentParser, *, part: bool = False) -> None:
    """--map, --profile and the numbers that units need; with `part` what takes a part of the record."""
    group = parser.add_argument_group("reading")
    group.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="CHANNEL=COLUMN[:UNIT]",
        help=(
            "which column is a channel, and its unit, such as position=q_deg:deg; @load behind it: on the "
            "load's side of the gear; CHANNEL=none leaves it out; a unit may have a factor or a minus"
        ),
    )
    group.add_argument(
        "--profile",
        type=Path,
        metavar="FILE.toml",
        help="where the mapping is kept (default: by the file's columns, in your configuration folder)",
    )
    group.add_argument(
        "--sample-time", type=float, metavar="S", help="distance of the samples, for files without times"
    )
    for option, unit, what in (
        ("--counts-per-rev", "N", "encoder counts a revolution"),
        ("--rated-torque", "NM", "for torques in percent or per mille"),
        ("--rated-current", "A", "for currents in percent or per mille"),
        ("--torque-constant", "NM_PER_A", "torque = current x this"),
        ("--gear-ratio", "N", "revolutions of the motor for one of the load"),
        ("--lead", "MM", "mm that a linear axis moves for one revolution: of a screw, a pinion, a pulley"),
    ):
        group.add_argument(option, type=float, metavar=unit, help=what)
    group.add_argument(
        "--side", choices=("motor", "load"), help="side of the gear that the record is about (default motor)"
    )
    if part:
        _add_part(parser.add_argument_group("part of the record"))


def _add_part(group: argparse._ArgumentGroup) -> None:  # type: ignore[reportPrivateUsage]
    """--from, --to, --rows, --leave-out, --unwrap, --accept: what the doctor's remedies ask for."""
    group.add_argument(
        "--accept", action="append", default=[], metavar="CODE",
        help="this error of the doctor, such as torque-sign, counts as a warning: you know better; repeatable",
    )  # fmt: skip
    for option, name, what in (("--from", "start", "from this time on"), ("--to", "end", "up to this time")):
        group.add_argument(option, dest=name, type=float, metavar="S", help=f"look at the record {what}, s")
    group.add_argument(
        "--with", dest="beside", action="append", default=[], type=Path, metavar="FILE",
        help="a second file of the same motion and clock, such as the torque's; its columns are interpolated at the "
        "times of LOG; with several LOGs once for each, in their order",
    )  # fmt: skip
    group.add_argument("--rows", metavar="A:B", help="look at these rows, counted from 1, both included")
    group.add_argument(
        "--leave-out", action="append", default=[], metavar="A:B",
        help="leave these rows out, or `spikes`; where more than 4 in a row go, what stands before and behind them is "
        "taken as two records; repeatable",
    )  # fmt: skip
    group.add_argument(
        "--unwrap",
        action="store_true",
        help="count the position on where it jumps by a turn or its counter's range",
    )


def read_record(
    path: Path, args: argparse.Namespace, accept: Callable[[Record], object] = lambda _: None
) -> Record:
    """As `open_record`, for verbs that show no columns: stderr says where a saved profile had a part in it.

    Raises
    ------
    InputError
    """
    import sys

    opened = open_record(path, args, accept)
    for finding in opened.notes:
        print(f"stickslip: {path}: {finding.line()}", file=sys.stderr)
    return opened.record


def open_record(
    path: Path,
    args: argparse.Namespace,
    accept: Callable[[Record], object] = lambda _: None,
    beside: Path | None = None,
) -> Opened:
    """Read a file as the options say, with the profile of its layout; keep what `--map` and the others say, unless
    `accept` raises on the record: what reads it wrongly is not for the next file.

    `beside` is a second file of the same motion, whose columns are taken along.

    What a profile has done that the options do not say is among the record's findings.

    Raises
    ------
    InputError
        As `stickslip.readers.read`, but that ambiguous columns are left among the record's findings.
    """
    from stickslip.errors import InputError
    from stickslip.readers import profiles
    from stickslip.readers.reading import joined, open_table, record_of, with_source

    require(path, "record")
    table = open_table(path)
    if beside is not None:
        require(beside, "record")
        table = joined(table, beside, args.map, args.sample_time)
    used = args.profile if args.profile and args.profile.exists() else profiles.remembered(table)
    used = used if args.profile is None or used == args.profile else None
    kept = profiles.load(used) if used else None
    drive = _drive(args)
    record = record_of(table, args.map, drive=drive, profile=kept, sample_time=args.sample_time)
    if "leave_out" in args:
        try:
            record = part_of(record, args)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    written = None
    if (
        args.map
        or drive.known() != {"side": "motor"}
        or args.sample_time is not None
        or (args.profile and not used)
    ):
        accept(record)
        merged = profiles.merged(args.map, drive, args.sample_time, kept)
        if kept is None or not profiles.alike(merged, kept):
            written = profiles.save(replace(merged, seen=profiles.sizes(record)), table, args.profile)
    notes: tuple[Finding, ...] = ()
    if args.profile is None:
        said = profiles.merged(args.map, drive, args.sample_time, None)
        notes = profile_notes(used, kept, said, written)
        if kept and not written:
            notes += tuple(profiles.misfits(kept, record, said.drive.known()))
        record.meta["reading"]["findings"] += [note.as_data() for note in notes]
        record.meta["reading"]["profile"] = str(used) if used and notes and not written else ""
    return Opened(with_source(record, path), used, written, notes)


def beside_of(args: argparse.Namespace, count: int) -> list[Path | None]:
    """The file of `--with` for every LOG."""
    from stickslip.errors import InputError

    if len(args.beside) not in (0, count):
        raise InputError(f"--with is given {len(args.beside)} times for {count} LOGs; give it once for each")
    return list(args.beside) or [None] * count


def part_of(record: Record, args: argparse.Namespace) -> Record:
    """The part of a record that the options name, its position counted on if they say so."""
    import math

    from stickslip.readers.cut import Cut, cut, parse_rows, unwrapped

    if args.unwrap:
        record = unwrapped(record)
    out = tuple(parse_rows("--leave-out", text) for text in args.leave_out if text != "spikes")
    start = -math.inf if args.start is None else args.start
    end = math.inf if args.end is None else args.end
    rows = (1.0, math.inf) if args.rows is None else parse_rows("--rows", args.rows)
    part = cut(record, Cut(start, end, rows, out))
    if "spikes" in args.leave_out:
        from stickslip.identify.doctor.spikes import spike_rows

        part = cut(part, Cut(leave_out=tuple((n, n) for n in spike_rows(part).tolist())))
    return part


def profile_notes(
    used: Path | None, kept: Profile | None, said: Profile, written: Path | None
) -> tuple[Finding, ...]:
    """That a profile which nobody named now says more than the options, and that one was written."""
    from stickslip.finding import Finding

    notes: list[Finding] = []
    if kept:
        now, before = said.drive.known(), kept.drive.known()
        more = [f"{role}={text}" for role, text in kept.mapping.items() if role not in said.mapping]
        more += [f"{name} = {value}" for name, value in before.items() if name not in now]
        more += ["side = load"] if (before["side"], now["side"]) == ("load", "motor") else []
        if kept.sample_time is not None and said.sample_time is None:
            more.append(f"sample_time = {kept.sample_time:g} s")
        if more:
            words = f"read by the saved profile {used}, which says {', '.join(more)}"
            notes.append(Finding("note", "profile", words, remedy=FORGET))
    if written and not notes:
        words = f"how to read files with these columns is kept in the profile {written}"
        notes.append(Finding("note", "profile", words, remedy=FORGET))
    return tuple(notes)


def _drive(args: argparse.Namespace) -> Drive:
    from stickslip.errors import InputError
    from stickslip.readers import Drive

    names = (
        "counts_per_rev",
        "rated_torque",
        "rated_current",
        "torque_constant",
        "gear_ratio",
        "side",
        "lead",
    )
    given = {n: getattr(args, n) for n in names if getattr(args, n) is not None}
    for name, value in given.items():
        if value != value:  # to a `Drive`, NaN is a number that nobody gave
            raise InputError(f"--{name.replace('_', '-')} {value} must be a number greater than 0")
    if "lead" in given:
        given["lead"] *= 1e-3
    return Drive(**given)


def print_columns(opened: Opened) -> None:
    """The table of channels, columns, units, and who says so."""
    record = opened.record
    reading: dict[str, Any] = record.meta["reading"]
    sources = {
        "map": "--map",
        "profile": "profile",
        "file": "unit in the file",
        "name": "unit in the name",
        "assumed": "unit assumed",
    }
    rows = [
        (c["channel"], repr(c["column"]), c["unit"], sources[c["source"]], "; ".join(c.get("steps", [])))
        for c in reading["columns"]
    ]
    rows += [
        (channel, how, record.units[channel], "derived", "")
        for channel, how in record.meta["derived"].items()
    ]
    head = ("channel", "column", "unit", "by", "")
    widths = [max(len(r[i]) for r in [head, *rows]) for i in range(4)]
    for line in (head, *rows):
        print("  ".join(f"{cell:<{width}}" for cell, width in zip(line, [*widths, 0], strict=True)).rstrip())
    span = float(record.time[-1]) - float(record.time[0]) if len(record) > 1 else math.inf
    rate = f", {len(record)} rows" + (f" over {span:.4g} s" if math.isfinite(span) else "")
    print(f"{reading['file']}: {reading['format']}{rate}")
    if opened.used:
        print(f"profile: {opened.used}")
    if opened.written:
        print(f"profile written: {opened.written} (the next file with these columns is read alike)")
