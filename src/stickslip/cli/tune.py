"""Choose bandwidth, gain and filter of a controller for a machine whose parameters are uncertain.

    stickslip tune my.toml

The file is that of a sweep (`stickslip sweep thesis-robustness --print > my.toml`) with few cases, the runs to tune,
and tables of the settings at its end:

    only = ["signed", "low", "nominal", "FF-gms"]
    cases = 64                # every setting runs all of them
    percentile = 95

    [tune."controller.bandwidth_hz"]
    range = [10.0, 60.0]
    [tune."controller.gain"]
    range = [0.5, 1.1]

The result is the setting with the lowest 95th percentile of the first metric over all cases; the second metric shows
what that setting costs. Writes DIR/...-tuned.json, ...-tried.csv and figures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

SUMMARY = "tune a controller for an uncertain machine"
STOPPING = "finishing the current setting; press Ctrl-C again to abort"


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, output."""
    parser.add_argument("tune", metavar="TUNE.toml", help="a sweep with a table [tune]")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: tune-NAME)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--no-report", action="store_true", help="write no figures")


def run(args: argparse.Namespace) -> int:
    """Search, print the settings, draw the trade-off."""
    from stickslip.cli import _output
    from stickslip.studies.files import claim_folder
    from stickslip.studies.study import interrupts_between_runs
    from stickslip.sweeps.checked_numbers import unvaried_lines
    from stickslip.verbs.tune import tune, tuning_of, written

    sweep = tuning_of(args.tune)
    if sweep.left_out:
        _output.warn(f"not varied, as the model's law has no such parameters: {', '.join(sweep.left_out)}")
    for line in unvaried_lines(sweep):
        _output.warn(line)
    out: Path = claim_folder(args.out or Path(f"tune-{sweep.name}"), sweep.name, "tune")
    found: list[dict[str, Any]] = []
    for planned in sweep.runs:
        try:
            with _output.progress_bar(planned.key) as progress, interrupts_between_runs(STOPPING) as check:
                (tuned,) = tune(replace(sweep, runs=[planned]), progress=_stopped_by(progress, check))
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"the settings tried for {planned.key} are not kept; run the same command again to start over"
            ) from None
        files = written(out, sweep, tuned, figures=not args.no_report)
        data = tuned.as_dict()
        found.append(data)
        if not args.json:
            _output.print_tuned(tuned, files)
    if args.json:
        _output.print_json(found)
    return 0


def _stopped_by(
    progress: Callable[[int, int], None], check: Callable[[], None]
) -> Callable[[int, int], None]:
    """Show the progress, and let Ctrl-C end the search between two settings."""

    def settings(tried: int, about: int) -> None:
        progress(tried, about)
        check()

    return settings
