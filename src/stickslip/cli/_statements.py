"""Output of `stickslip study` for experiments: the thesis's statements that were tested."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from stickslip.report.rig_report import verdict_table
from stickslip.studies.experiments import ExperimentView
from stickslip.studies.result import StudyResult
from stickslip.thesis.rig_verdicts import Judged, judged_over, main_share, tally_imperfections, tally_starts


def judged_in(result: StudyResult) -> list[Judged]:
    """Return every statement on the variants that were run; empty if none can be tested."""
    if "experiments" not in result.config:
        return []
    view = ExperimentView(result)
    judged = judged_over(view, view.varied())
    return judged if any(j.holds is not None for j in judged) else []


def statements_as_data(result: StudyResult, judged: list[Judged], report: Path | None) -> dict[str, Any]:
    """Return plain data."""
    return {
        "folder": str(result.folder), "report": str(report) if report else None,
        "statements": verdict_table(judged), "main": main_share(judged),
        "starts": [asdict(t) for t in tally_starts(judged)], "imperfections": tally_imperfections(judged),
    }  # fmt: skip


def print_statements(result: StudyResult, judged: list[Judged], report: Path | None) -> None:
    """Print one line per statement, the main statements, and the paths of the files."""
    for row in verdict_table(judged):
        if row["word"] != "not run":
            share = f"  ({row['share']} starts)" if row["share"] else ""
            print(f"{row['word']:<14} {row['id']:<28} {row['text']}{share}")
    print()
    for text, (held, of) in main_share(judged).items():
        print(f"{held} of {of}  {text}")
    print_tallies(judged)
    hold, fail = (sum(j.holds is value for j in judged) for value in (True, False))
    wall = result.manifest["timings"]["wall_s"]
    print(f"{hold} statements hold, {fail} do not; {len(result.runs)} runs, {wall:.1f} s")
    for path in (result.folder / "metrics.csv", result.folder / "manifest.json", report):
        if path:
            print(path)


def print_tallies(judged: list[Judged]) -> None:
    """Print how many statements hold from further starts, and without single imperfections."""
    if starts := tally_starts(judged):
        print("\nfrom further starts    statements  hold  hold always  hold never  share of starts")
        for t in starts:
            print(
                f"{t.words:<22}{t.statements:>11}{t.hold:>6}{t.always:>13}{t.never:>12}{100.0 * t.share:>15.0f} %"
            )
    if without := tally_imperfections(judged):
        print("\nwithout               now hold  no longer hold")
        for name, (now, no_longer) in without.items():
            print(f"{name:<22}{now:>8}{no_longer:>16}")
        print()
