"""Run a study over many cases: vary numbers on a grid, by Sobol or Latin points, or within identified intervals.

    stickslip sweep thesis-robustness      included: friction and inertia up to 30 % off, for every compensator
    stickslip sweep my.toml                your own; start from a copy (`stickslip sweep thesis-robustness --print`)

Writes DIR/data/ (.npz files), manifest.json, summary.csv and figures, and with the extra `parquet` all cases in
cases.parquet. Finished blocks are kept: after any interruption the same command resumes.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.sweeps.plan import Sweep

MANY = 1000
"""Number of closed loops above which the duration is estimated in advance."""
SUMMARY = "run a study over many cases, such as uncertain parameters"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Sweep, output, where it runs."""
    parser.add_argument(
        "sweep", metavar="SWEEP", help="thesis-robustness, thesis-gain, or the path of a TOML file"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: sweep-SWEEP)")
    parser.add_argument("--cases", type=int, metavar="N", help="number of cases, instead of the file's")
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="number of parallel blocks (default: one per core)"
    )
    parser.add_argument("--processes", action="store_true", help="use processes instead of threads")
    parser.add_argument(
        "--scheduler", default="", metavar="URL", help="run on a Dask cluster, such as tcp://host:8786"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.add_argument("--no-report", action="store_true", help="write no figures")
    parser.add_argument("--print", action="store_true", help="print the sweep's TOML and run nothing")


def announced(sweep: Sweep, jobs: int) -> Sweep:
    """Print the estimated duration of a long sweep from a few of its cases; these also determine the size of blocks."""
    from stickslip.cli import _output
    from stickslip.sweeps.forecast import block_size, paces_of, seconds_of

    if sweep.cases < MANY:
        return sweep
    _output.say("timing some cases ...")
    paces = paces_of(sweep)
    seconds = _output.duration(seconds_of(sweep, paces) / jobs)
    _output.tell(
        f"stickslip: {sweep.cases} closed loops, about {seconds} on {jobs} core{'s' if jobs > 1 else ''}; --cases "
        "reduces the number; finished blocks are kept"
    )
    return replace(sweep, sizes=tuple(map(block_size, paces)))


def run(args: argparse.Namespace) -> int:
    """Run, print the summary, draw the figures."""
    from stickslip.cli import _output
    from stickslip.core.errors import InputError
    from stickslip.sweeps import execute
    from stickslip.sweeps.plan import load
    from stickslip.verbs.sweep import sweep, sweep_of

    if args.print:
        print(load(args.sweep).source.read_text(encoding="utf-8"), end="")
        return 0
    if args.jobs is not None and args.jobs < 1:
        raise InputError(f"--jobs {args.jobs} must be at least 1; leave it out for one block per core")
    planned = sweep_of(args.sweep, args.cases)
    if planned.left_out:
        _output.warn(f"not varied, as the model's law has no such parameters: {', '.join(planned.left_out)}")
    out: Path = args.out or Path(f"sweep-{planned.name}")
    execute.ready(planned, args.scheduler)
    try:
        planned = announced(planned, args.jobs or os.cpu_count() or 1)
        with _output.progress_bar(planned.name) as progress:
            found = sweep(
                planned, out, jobs=args.jobs or 0, processes=args.processes, scheduler=args.scheduler,
                figures=not args.no_report, progress=progress, tell=_output.warn,
            )  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"finished blocks are kept in {out}; run the same command again to resume"
        ) from None
    if args.json:
        _output.print_json({"folder": str(out), "timings": found.manifest["timings"], "runs": found.rows,
                            "model_estimates_left_out": list(planned.left_out)})  # fmt: skip
    else:
        wall = found.manifest["timings"]["wall_s"]
        _output.print_sweep(found.rows, planned.metrics[0], wall, found.files)
    return 0
