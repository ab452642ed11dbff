"""Run a study: controllers compared over references and friction models.

    stickslip study thesis           the thesis's simulation study, which ships with the package
    stickslip study thesis-rig       the thesis's experiments (chapter 4) on virtual machines, statements checked
    stickslip study compensators     every compensator on one bench of machines, references and changes of friction
    stickslip study my.toml          your own; start from a copy of thesis.toml (`stickslip study thesis --print`)

Writes DIR/metrics.csv, records/, manifest.json and report.html (metrics.parquet too with the extra `parquet`).
Finished runs are kept: after an
interruption the same command resumes, and runs that --only leaves out stay in the tables and the report.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.core.errors import InputError, Interrupted

if TYPE_CHECKING:
    from stickslip.studies.plan import Study
    from stickslip.studies.result import StudyResult

SUMMARY = "compare controllers over references and friction models"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Study, output, selection."""
    parser.add_argument(
        "study",
        metavar="STUDY",
        help="thesis, thesis-rig, imperfections, compensators, or the path of a TOML file",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: study-STUDY)")
    parser.add_argument(
        "--only", metavar="PARTS", help="run only what matches these names: low,step or FF-lugre,signed"
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="number of parallel runs (default 1)"
    )
    parser.add_argument("--json", action="store_true", help="print the results as JSON instead of a table")
    parser.add_argument("--no-report", action="store_true", help="write no figures and no report.html")
    parser.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        help="experiments: further start angles per run (thesis-rig: 20)",
    )
    parser.add_argument(
        "--no-ablation",
        action="store_true",
        help="experiments: skip the runs with one imperfection removed",
    )
    parser.add_argument("--print", action="store_true", help="print the study's TOML and run nothing")


def run(args: argparse.Namespace) -> int:
    """Run, print the table, write the report."""
    from stickslip.studies.bench import is_bench

    if is_bench(args.study):
        from stickslip.cli import _bench

        return _bench.run(args)
    from stickslip.cli import _output
    from stickslip.verbs.study import chosen, study_of

    study = study_of(args.study, args.seeds, not args.no_ablation)
    if args.print:
        print(study.source.read_text(encoding="utf-8"), end="")
        return 0
    only = None if args.only is None else [part.strip() for part in args.only.split(",")]
    if only is not None and not all(only):
        raise InputError(f"--only {args.only!r} has an empty part; give names like low,step")
    result, report = _ran(study, only, args)
    shown = chosen(result, study, only or ())
    _show(shown, report, len(result.runs), args.json)
    failed = [r for r in (*shown.runs, *shown.extras) if r.failure]
    return _output.report_failures([(r.key, r.failure, r.path) for r in failed])


def _ran(study: Study, only: list[str] | None, args: argparse.Namespace) -> tuple[StudyResult, Path | None]:
    """Run it and write its report."""
    from stickslip.cli import _output
    from stickslip.report import write
    from stickslip.studies import study as studies

    out: Path = args.out or Path(f"study-{study.name}")
    try:
        with _output.progress_bar(study.name) as progress:
            result = studies.run(study, out, only, args.jobs, progress, _output.warn)
        if args.no_report:
            return result, None
        _output.say("drawing figures ...")
        return result, write(result)
    except (KeyboardInterrupt, Interrupted):
        raise KeyboardInterrupt(
            f"finished runs are kept in {out}; run the same command again to resume"
        ) from None


def _show(shown: StudyResult, report: Path | None, kept: int, as_json: bool) -> None:
    """Print the statements of experiments, else the table of runs."""
    from stickslip.cli import _output

    judged: list[Any] = []
    if "experiments" in shown.config:
        from stickslip.cli import _statements

        judged = _statements.judged_in(shown)
        if judged and as_json:
            _output.print_json(_statements.statements_as_data(shown, judged, report))
        elif judged:
            _statements.print_statements(shown, judged, report)
    if not judged and as_json:
        _output.print_json(_output.result_as_data(shown, report))
    elif not judged:
        _output.print_study(shown, report, kept)
