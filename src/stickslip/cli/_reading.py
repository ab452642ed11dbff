"""Options for reading records, shared by several verbs, and the saved profile."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.core.record import Record
    from stickslip.verbs.reading import Opened, Reading


def add_arguments(parser: argparse.ArgumentParser, *, part: bool = False) -> None:
    """Add --map, --profile and the numbers that units require; with `part` the options for a part of the record."""
    group = parser.add_argument_group("reading")
    group.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="CHANNEL=COLUMN[:UNIT]",
        help=(
            "column and unit of a channel, such as position=q_deg:deg; append @load for the load side "
            "of the gear; CHANNEL=none ignores the channel; a unit may have a factor or a minus sign"
        ),
    )
    group.add_argument(
        "--profile",
        type=Path,
        metavar="FILE.toml",
        help="file that stores the mapping (default: chosen by column names, in your configuration folder)",
    )
    group.add_argument(
        "--sample-time", type=float, metavar="S", help="sample interval, for files without a time column"
    )
    for option, unit, what in (
        ("--counts-per-rev", "N", "encoder counts per revolution"),
        ("--rated-torque", "NM", "rated torque, for torques in percent or per mille"),
        ("--rated-current", "A", "rated current, for currents in percent or per mille"),
        ("--torque-constant", "NM_PER_A", "torque per current"),
        ("--force-constant", "N_PER_A", "force per current of a linear motor"),
        ("--pole-pairs", "N", "pole pairs of the motor, for speeds in eRPM"),
        ("--gear-ratio", "N", "motor revolutions per load revolution"),
        ("--lead", "MM", "travel of a linear axis per revolution of screw, pinion or pulley"),
    ):
        group.add_argument(option, type=float, metavar=unit, help=what)
    group.add_argument(
        "--side",
        choices=("motor", "load"),
        help="side of the gear that the result is about (default motor); "
        "a signal measured on the load's side: --map CHANNEL=COLUMN:UNIT@load",
    )
    if part:
        _add_part(parser.add_argument_group("part of the record"))


def _add_part(group: argparse._ArgumentGroup) -> None:  # type: ignore[reportPrivateUsage]
    """Add --from, --to, --rows, --leave-out, --unwrap and --accept, the options in the doctor's remedies."""
    group.add_argument(
        "--accept", action="append", default=[], metavar="CODE",
        help="treat this error of the doctor as a warning; repeatable",
    )  # fmt: skip
    for option, name, what in (("--from", "start", "from this time on"), ("--to", "end", "up to this time")):
        group.add_argument(option, dest=name, type=float, metavar="S", help=f"use the record {what}, s")
    group.add_argument(
        "--with", dest="beside", action="append", default=[], type=Path, metavar="FILE",
        help="second file of the same motion and clock; its columns are interpolated at the times of LOG; repeat "
        "once per LOG, in the same order",
    )  # fmt: skip
    group.add_argument("--rows", metavar="A:B", help="use rows A to B only, counted from 1")
    group.add_argument(
        "--leave-out", action="append", default=[], metavar="A:B",
        help="leave out rows A to B, or `spikes`; gaps of more than 4 rows split the record; repeatable",
    )  # fmt: skip
    group.add_argument(
        "--unwrap",
        action="store_true",
        help="undo jumps of the position by a turn or counter range",
    )


def read_record(path: Path, args: argparse.Namespace) -> Record:
    """Return the record of a file, for verbs that print no columns; the use of a saved profile is reported on stderr.

    Raises
    ------
    InputError
    """
    import sys

    from stickslip.core.messages import render
    from stickslip.verbs.reading import open_log

    opened = open_log(path, reading_of(args))
    for finding in opened.notes:
        print(f"stickslip: {path}: {render(finding.line())}", file=sys.stderr)
    return opened.record


def reading_of(args: argparse.Namespace) -> Reading:
    """Return how to read from the options; the mapping is saved for the next file with these columns."""
    out: Reading = {
        "map": args.map, "profile": args.profile, "sample_time": args.sample_time, "remember": True,
        "side": args.side, "lead": None if args.lead is None else 1e-3 * args.lead,
        "counts_per_rev": args.counts_per_rev, "rated_torque": args.rated_torque, "gear_ratio": args.gear_ratio,
        "rated_current": args.rated_current, "torque_constant": args.torque_constant,
        "force_constant": args.force_constant, "pole_pairs": args.pole_pairs,
    }  # fmt: skip
    if "leave_out" in args:
        out |= {
            "start": args.start, "end": args.end, "rows": args.rows, "leave_out": args.leave_out,
            "unwrap": args.unwrap, "beside": args.beside,
        }  # fmt: skip
    return out


SHOWN = 8
"""Most unused columns that are listed"""


def print_columns(opened: Opened) -> None:
    """Print the table of channels, columns, units and their sources."""
    record = opened.record
    reading: dict[str, Any] = record.meta["reading"]
    sources = {
        "map": "--map",
        "profile": "profile",
        "file": "unit in the file",
        "name": "unit in the name",
        "drive": "number of the drive",
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
    if unused := [repr(name) for name in reading["unused"]]:
        more = f" and {len(unused) - SHOWN} more" if len(unused) > SHOWN else ""
        print(f"not used: {', '.join(unused[:SHOWN])}{more}")
    span = float(record.time[-1]) - float(record.time[0]) if len(record) > 1 else math.inf
    rate = f", {len(record)} rows" + (f" over {span:.4g} s" if math.isfinite(span) else "")
    print(f"{reading['file']}: {reading['format']}{rate}")
    if opened.used:
        print(f"profile: {opened.used}")
    if opened.written:
        from stickslip.readers import profiles

        named = opened.written.parent != profiles.folder()
        holds = "the next file with these columns is read the same way"
        if not named:
            holds = "the columns mean the same in the next file with their names; numbers of the drive are this file's"
        print(f"profile written: {opened.written} ({holds})")
