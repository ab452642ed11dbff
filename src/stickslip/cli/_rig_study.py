"""`stickslip study thesis-rig`: runs, verdicts, report."""

from __future__ import annotations

import argparse
from pathlib import Path

__all__ = ["run"]


def run(args: argparse.Namespace) -> int:
    """Run chapter 4's experiments, print the verdicts, write the report."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.report.rig_report import verdict_table, write_rig_report
    from stickslip.study.rig_study import RigView, run_rig_study
    from stickslip.thesis.rig_verdicts import judged_over, main_share

    if args.print:
        raise InputError("--print: thesis-rig has no file of its own; see `stickslip study --help`")
    if args.seeds < 0 or args.jobs < 1:
        raise InputError(f"--seeds {args.seeds} must be 0 or more, --jobs {args.jobs} at least 1")
    out: Path = args.out or Path("study-thesis-rig")
    only = [part.strip() for part in args.only.split(",")] if args.only is not None else []
    with _output.progress_bar("thesis-rig") as progress:
        result = run_rig_study(
            out, only=only, seeds=args.seeds, ablation=not args.no_ablation, jobs=args.jobs, progress=progress
        )  # fmt: skip
    judged = judged_over(RigView(result), result.variants)
    report = None if args.no_report else write_rig_report(result)
    if args.json:
        _output.print_json(
            {
                "folder": str(result.folder), "report": str(report) if report else None,
                "statements": verdict_table(judged), "main": main_share(judged),
            }
        )  # fmt: skip
        return 0
    for row in verdict_table(judged):
        if row["word"] != "not run":
            share = f"  ({row['share']} starts)" if row["share"] else ""
            print(f"{row['word']:<14} {row['id']:<28} {row['text']}{share}")
    print()
    for text, (held, of) in main_share(judged).items():
        print(f"{held} of {of}  {text}")
    counts = [sum(j.holds is value for j in judged) for value in (True, False)]
    print(
        f"{counts[0]} statements hold, {counts[1]} do not; {len(result.runs)} runs, {result.manifest['wall_s']:.1f} s"
    )
    for path in (result.folder / "metrics.csv", result.folder / "manifest.json", report):
        if path:
            print(path)
    return 0
