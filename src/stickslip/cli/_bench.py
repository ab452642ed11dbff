"""`stickslip study compensators`: runs, decision table, report."""

from __future__ import annotations

import argparse
from pathlib import Path


def run(args: argparse.Namespace) -> int:
    """Run the bench, print the best compensator for each condition, write the report."""
    from stickslip.cli import _output
    from stickslip.report.bench_report import write_bench_report
    from stickslip.studies.bench import path_of, run_bench
    from stickslip.studies.bench_decision import choices, standings

    if args.print:
        print(path_of(args.study).read_text(encoding="utf-8"), end="")
        return 0
    name = Path(args.study).stem
    out: Path = args.out or Path(f"study-{name}")
    only = [part.strip() for part in args.only.split(",")] if args.only is not None else []
    try:
        with _output.progress_bar(name) as progress:
            result = run_bench(args.study, out, only, args.jobs, progress)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"finished runs are kept in {out}; run the same command again to go on"
        ) from None
    report = None if args.no_report else write_bench_report(result)
    table = choices(result.runs)
    if args.json:
        data = {
            "folder": str(result.folder), "report": str(report) if report else None,
            "choices": [c.as_dict() for c in table],
            "standings": [vars(s) for s in standings(result.runs)],
        }  # fmt: skip
        _output.print_json(data)
        return 0
    for c in table:
        best = f"{c.chosen.label:<22} {c.chosen.mean:6.3f} of the PD's error" if c.chosen else "none of them"
        print(f"{c.machine:<10} {c.knowledge:<20} {c.condition:<28} {best}")
    for path in (result.folder / "results.jsonl", report):
        if path:
            print(path)
    return 0
