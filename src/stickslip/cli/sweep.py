"""Run a study over many cases: numbers varied on a grid, by Sobol or Latin points, or as an identification doubts them.

    stickslip sweep thesis-robustness      ships: friction and inertia up to 30 % off, for every compensator
    stickslip sweep my.toml                your own; begin with a copy (`stickslip sweep thesis-robustness --print`)

Writes DIR/data/ (a Parquet data set), manifest.json, summary.csv and figures. Finished blocks are kept: after an
interruption, whatever it was, the same command goes on.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.sweep.plan import Sweep

MANY = 1000
"""Closed loops from which it is told beforehand how long they take."""
SUMMARY = "run a study over many cases: which compensator for how much uncertainty"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Sweep, output, where it runs."""
    parser.add_argument(
        "sweep", metavar="SWEEP", help="thesis-robustness, thesis-gain, or the path of a TOML file"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: sweep-SWEEP)")
    parser.add_argument("--cases", type=int, metavar="N", help="another number of cases than the file's")
    parser.add_argument("--jobs", type=int, metavar="N", help="blocks at a time (default: one a core)")
    parser.add_argument("--processes", action="store_true", help="use processes instead of threads")
    parser.add_argument(
        "--scheduler", default="", metavar="URL", help="of Dask, tcp://host:8786: its workers run it"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.add_argument("--no-report", action="store_true", help="leave the figures out")
    parser.add_argument("--print", action="store_true", help="print the sweep's TOML and run nothing")


def announce(sweep: Sweep, jobs: int) -> None:
    """Say before a long sweep starts how long it will take, from a few of its cases."""
    from stickslip.cli import _output
    from stickslip.sweep.forecast import seconds_of

    if sweep.cases < MANY:
        return
    told = ""
    if sweep.device == "cpu":  # What runs elsewhere is not timed here.
        _output.say("timing some cases ...")
        told = f", about {_output.duration(seconds_of(sweep) / jobs)} on {jobs} core{'s' if jobs > 1 else ''}"
    _output.tell(
        f"stickslip: {sweep.cases} closed loops{told}; fewer with --cases, and what is finished is kept"
    )


def run(args: argparse.Namespace) -> int:
    """Run, print the summary, draw the figures."""
    from dataclasses import replace

    from stickslip.capacity import insist_on_jobs
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.sweep import execute
    from stickslip.sweep.gains import too_few
    from stickslip.sweep.plan import MOST_CASES, load
    from stickslip.sweep.summary import summarise, write_summary

    sweep = load(args.sweep)
    if args.print:
        print(sweep.source.read_text(encoding="utf-8"), end="")
        return 0
    if sweep.tuned:
        raise InputError(f"{args.sweep} has a table [tune]; run `stickslip tune {args.sweep}`")
    if args.cases is not None:
        if args.cases < 1:
            raise InputError(f"--cases {args.cases} must be at least 1")
        if sweep.drawn.method == "grid":
            raise InputError(
                f"--cases {args.cases}: {args.sweep} is a grid, whose points make its {sweep.drawn.cases} cases; "
                "change `points` or `values` in it, or its `method` to sobol"
            )
        if args.cases > MOST_CASES:
            raise InputError(f"--cases {args.cases} are too many; keep below {MOST_CASES}")
        sweep = replace(sweep, drawn=replace(sweep.drawn, cases=args.cases))
    if args.jobs is not None and args.jobs < 1:
        raise InputError(f"--jobs {args.jobs} must be at least 1; leave it out for one block a core")
    insist_on_jobs(args.jobs or 1)
    if sweep.left_out:
        _output.warn(f"not varied, as the model's law has no such parameters: {', '.join(sweep.left_out)}")
    out: Path = args.out or Path(f"sweep-{sweep.name}")
    execute.ready(sweep, args.scheduler)
    announce(sweep, args.jobs or os.cpu_count() or 1)
    try:
        with _output.progress_bar(sweep.name) as progress:
            backend = "processes" if args.processes else "threads"
            manifest = execute.run(
                sweep, out, args.jobs or 0, backend, args.scheduler, progress, _output.warn
            )
        rows = summarise(out, sweep)
        if why := too_few(sweep.drawn):
            _output.warn(why)
        written = [write_summary(out, sweep, rows), out / "manifest.json"]
        if not args.no_report:
            from stickslip.report.sweep_pictures import draw

            _output.say("drawing figures ...")
            written += draw(out, sweep)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"finished blocks are kept in {out}; run the same command again to go on"
        ) from None
    if args.json:
        _output.print_json({"folder": str(out), "timings": manifest["timings"], "runs": rows,
                            "model_estimates_left_out": list(sweep.left_out)})  # fmt: skip
    else:
        _output.print_sweep(rows, sweep.metrics[0], manifest["timings"]["wall_s"], written)
    return 0
