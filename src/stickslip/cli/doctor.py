"""Check a record for everything that would impair an identification; one line per finding.

stickslip doctor log.csv
stickslip doctor log.csv --map position=q_deg:deg --map torque=I_act:mA --torque-constant 0.05

Errors make the record unusable (exit code 2), warnings make results uncertain, notes are for information.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _reading

SUMMARY = "check a record before identification"


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, and how to read it."""
    parser.add_argument("file", type=Path, metavar="LOG", help="CSV, MAT, HDF5, Parquet, NumPy, JSON, ...")
    parser.add_argument(
        "--stribeck-velocity",
        type=float,
        metavar="RAD_PER_S",
        help="check that the record has speeds near this one",
    )
    parser.add_argument("--json", action="store_true", help="print columns and findings as JSON")
    _reading.add_arguments(parser, part=True)


def run(args: argparse.Namespace) -> int:
    """Print the columns and the findings; 2 if there is an error."""
    from stickslip.cli import _output
    from stickslip.verbs.doctor import doctor
    from stickslip.verbs.reading import open_log

    opened = open_log(args.file, _reading.reading_of(args))
    found = doctor(opened.record, stribeck_velocity=args.stribeck_velocity, accept=args.accept)
    errors = len(found.errors)
    if args.json:
        reading = {k: v for k, v in opened.record.meta["reading"].items() if k != "findings"}
        _output.print_json(
            {
                **reading,
                "derived": opened.record.meta["derived"],
                "rows": len(opened.record),
                "profile": str(opened.used) if opened.used else None,
                "profile_written": str(opened.written) if opened.written else None,
                "findings": [f.as_data() for f in found.findings],
            }
        )
        return 2 if errors else 0
    _reading.print_columns(opened)
    print()
    print(found)
    return 2 if errors else 0
