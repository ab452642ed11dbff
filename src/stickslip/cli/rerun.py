"""Run a finished study or sweep again from its manifest, and check that every metric is the same."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "repeat a study or sweep from its manifest and compare"


def arguments(parser: argparse.ArgumentParser) -> None:
    """The folder."""
    parser.add_argument(
        "folder",
        type=Path,
        metavar="DIR",
        help="folder written by `stickslip study` or `stickslip sweep`, or its manifest.json",
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="number of parallel runs (default 1)"
    )


def run(args: argparse.Namespace) -> int:
    """Print what differs; 1 if anything does."""
    if args.folder.name == "manifest.json" and args.folder.is_file():
        args.folder = args.folder.parent
    from stickslip.cli import _output
    from stickslip.core.errors import InputError
    from stickslip.core.resources import insist_on_jobs
    from stickslip.studies.rerun import rerun as rerun_study
    from stickslip.sweeps.rerun import is_sweep
    from stickslip.sweeps.rerun import rerun as rerun_sweep

    if args.jobs < 1:
        raise InputError(f"--jobs {args.jobs} must be at least 1; give the number of parallel runs")
    insist_on_jobs(args.jobs)
    sweep = is_sweep(args.folder)
    rerun = rerun_sweep if sweep else rerun_study
    with _output.progress_bar("rerun") as progress:
        found = rerun(args.folder, args.jobs, progress)
    for line in found.notes:
        print(line)
    for line in found.differences[:20]:
        print(line)
    if found.differences:
        print(f"{len(found.differences)} metrics differ, by {found.largest:.1e} of their value at most")
        return 1
    print(f"{found.runs} {'cases' if sweep else 'runs'}, {found.metrics} metrics: all identical")
    return 0
