"""Check a record for everything that would spoil an identification, one line a finding.

stickslip doctor log.csv
stickslip doctor log.csv --map position=q_deg:deg --map torque=I_act:mA --torque-constant 0.05

Errors make the record unusable (exit code 2), warnings make results doubtful, notes are good to know.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _reading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stickslip.finding import Finding
    from stickslip.identify.doctor import Diagnosis

SUMMARY = "check a record before anything is identified from it"


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, and how to read it."""
    parser.add_argument("file", type=Path, metavar="LOG", help="CSV, MAT, HDF5, Parquet, NumPy, JSON, ...")
    parser.add_argument(
        "--stribeck-velocity", type=float, metavar="RAD_PER_S", help="whether the record has speeds near it"
    )
    parser.add_argument("--json", action="store_true", help="print columns and findings as JSON")
    _reading.add_arguments(parser, part=True)


def run(args: argparse.Namespace) -> int:
    """Print the columns and the findings; 2 if there is an error."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.identify.doctor import examine
    from stickslip.readers.cut import pieces

    if args.stribeck_velocity is not None and not 0.0 < args.stribeck_velocity < float("inf"):
        raise InputError(f"--stribeck-velocity {args.stribeck_velocity:g} must be greater than 0")
    opened = _reading.open_record(args.file, args, beside=_reading.beside_of(args, 1)[0])
    parts, short = pieces(opened.record)
    every = [examine(part, stribeck_velocity=args.stribeck_velocity, accept=args.accept) for part in parts]
    findings = _merged(every, short)
    errors = sum(f.level == "error" for f in findings)
    if args.json:
        reading = {k: v for k, v in opened.record.meta["reading"].items() if k != "findings"}
        _output.print_json(
            {
                **reading,
                "derived": opened.record.meta["derived"],
                "rows": len(opened.record),
                "profile": str(opened.used) if opened.used else None,
                "profile_written": str(opened.written) if opened.written else None,
                "findings": [f.as_data() for f in findings],
            }
        )
        return 2 if errors else 0
    _reading.print_columns(opened)
    print()
    for finding in findings:
        print(f"{finding.level:<8}{finding.code:<24}{finding.line()}")
    print(f"{errors} errors, {sum(f.level == 'warning' for f in findings)} warnings")
    return 2 if errors else 0


def _merged(every: Sequence[Diagnosis], more: Sequence[Finding]) -> list[Finding]:
    """What was found in the pieces of a record; with the rows of the piece where it is not true of all."""
    from stickslip.finding import sorted_findings
    from stickslip.readers.cut import file_rows, range_words

    said: dict[Finding, None] = {}
    for diagnosis in every:
        rows = f"rows {range_words(file_rows(diagnosis.record), 3)}"
        for finding in diagnosis.findings:
            everywhere = all(finding in other.findings for other in every)
            said[finding if finding.where or everywhere else replace(finding, where=rows)] = None
    return sorted_findings([*said, *more])
