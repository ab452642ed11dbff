"""Output of the verbs: tables, JSON, progress."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.studies.result import Run, StudyResult
    from stickslip.sweeps.tune import Tuned

COLUMNS = (("position_rms_rad", 1e3, "RMS"), ("position_peak_rad", 1e3, "peak"))
"""Metrics of the table on the terminal, with their factor to mrad."""
SELDOM = 20.0
"""Time between two lines of progress without a terminal, s."""


@contextmanager
def progress_bar(title: str) -> Generator[Callable[[int, int], None]]:
    """Show a progress bar with the remaining time on stderr, or a line at intervals without a terminal; yield
    ``progress(finished, all)``."""
    if not sys.stderr.isatty():
        yield _lines(title)
        return
    from tqdm import tqdm

    with tqdm(desc=title, unit="run", file=sys.stderr, disable=None, leave=False) as bar:

        def progress(finished: int, total: int) -> None:
            if bar.total is None:
                # The time left is told from what is finished from now on, not from what was found.
                bar.reset(total)
                bar.initial = bar.n = finished
                bar.refresh()
            elif total != bar.total:
                bar.total, bar.n = total, finished
                bar.refresh()
            else:
                bar.update(finished - bar.n)

        yield progress


def _lines(title: str) -> Callable[[int, int], None]:
    """Print progress to a file or pipe: a line every `SELDOM` seconds, nothing for short work."""
    begun = said = time.monotonic()
    first: int | None = None

    def progress(finished: int, total: int) -> None:
        nonlocal said, first
        # The time left is told from what is finished from now on, not from what was found.
        first = finished if first is None else first
        now = time.monotonic()
        if now - said < SELDOM or finished >= total:
            return
        said = now
        pace = (now - begun) / (finished - first) if finished > first else math.nan
        left = f", about {duration(pace * (total - finished))} left" if math.isfinite(pace) else ""
        tell(f"stickslip: {title}: {finished} of {total} done{left}")

    return progress


def say(what: str) -> None:
    """Print the progress on a terminal."""
    if sys.stderr.isatty():
        print(what, file=sys.stderr)


def tell(what: str) -> None:
    """Print the progress on stderr, also into a file: the log of a long run needs one line per step."""
    print(what, file=sys.stderr, flush=True)


def warn(what: str) -> None:
    """Print a caveat about the results on stderr, above a progress bar if there is one."""
    from tqdm import tqdm

    tqdm.write(f"stickslip: {what}", file=sys.stderr)


def duration(seconds: float) -> str:
    """Return a duration as text in s, min or h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def print_json(data: Any) -> None:
    """Print data as standard JSON: NaN becomes null."""
    print(json.dumps(_plain(data), indent=1, allow_nan=False, ensure_ascii=False))


def _plain(data: Any) -> Any:
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(k): _plain(v) for k, v in data.items()}  # type: ignore[reportUnknownVariableType]
    if isinstance(data, (list, tuple)):
        return [_plain(v) for v in data]  # type: ignore[reportUnknownVariableType]
    return data


def print_metrics(metrics: Mapping[str, float]) -> None:
    """Print one line per metric; "none" without a number."""
    for name, value in metrics.items():
        print(f"{name:<44}{'none' if math.isnan(value) else f'{value:.6g}':>14}")


def print_learned(meta: Mapping[str, Any]) -> None:
    """Print what the controller of a run has learned, one line per value."""
    if not meta.get("learned"):
        return
    from stickslip.control.learned import told

    print(*told(meta), sep="\n")


def print_accuracy(meta: Mapping[str, Any]) -> None:
    """Print the error estimate of a checked run; nothing without a check."""
    found = meta.get("accuracy")
    if not found:
        return
    if found.get("depends_on_start"):
        print(
            "start: this run depends on its initial position: shifted by 1e-9 rad it follows another branch, "
            f"{found['start_rad']:.2g} rad away; its metrics are those of one branch"
        )
    if "error_rad" not in found:
        return
    if "machine" in meta:
        print(
            f"accuracy: position within about {found['error_rad']:.1g} rad, by a run at a thousandth of the tolerance"
        )
        return
    tolerance, error = meta["tolerance"], found["error_rad"]
    if error <= 10.0 * tolerance:
        print(
            f"accuracy: position within about {max(error, tolerance):.1g} rad (tolerance {tolerance:g} rad)"
        )
    else:
        print(
            f"accuracy: this run is sensitive: errors within the tolerance, {tolerance:g} rad, change its position by"
            f" about {error:.1g} rad; compare its metrics with those at another tolerance before you rely on them"
        )


def print_integrator(meta: Mapping[str, Any]) -> None:
    """Print the integrator if the first choice could not run the case, or the machine; else nothing."""
    if machine := meta.get("machine"):
        left = f" without {', '.join(machine['without'])}" if machine["without"] else ""
        every = meta["counts"]["substeps"]
        print(
            f"machine: {machine['name']}{left}, sampled every {meta['sample_time']:g} s in {every} sub-steps"
        )
    if refused := meta.get("refused"):
        loose = " (without error control)" if meta["integrator"] == "fixed" else ""
        print(f"integrator: {meta['integrator']}{loose}; {'; '.join(refused.values())}")


def result_as_data(result: StudyResult, report: Path | None) -> dict[str, Any]:
    """Return a study's result as plain data."""
    return {
        "folder": str(result.folder),
        "report": str(report) if report else None,
        "timings": result.manifest["timings"],
        "runs": [_run_as_data(run) for run in result.runs],
        "extras": [_run_as_data(run) for run in result.extras],
    }


def _run_as_data(run: Run) -> dict[str, Any]:
    return {
        "slip_rule": run.slip_rule,
        "reference": run.reference,
        "friction": run.friction,
        "controller": run.controller,
        "metrics": dict(run.metrics),
        "record": str(run.path),
        "failure": run.failure,
        "depends_on_start": run.depends_on_start,
        "seconds": run.seconds,
    }


def print_study(result: StudyResult, report: Path | None, kept: int) -> None:
    """Print a block for each slip rule and reference: controllers over frictions, with the best of each marked.

    `kept` is the number of runs in metrics.csv.
    """
    from stickslip.studies.result import designed_for

    for rule in _each(result.runs, "slip_rule"):
        for reference in _each(result.runs, "reference"):
            runs = [r for r in result.runs if (r.slip_rule, r.reference) == (rule, reference)]
            if runs:
                _print_block(f"{rule} / {reference}", runs)
    shown = len(result.runs)
    count = f"{shown} runs" if shown == kept else f"{shown} of the {kept} runs in metrics.csv"
    print(
        f"position error in mrad, RMS and peak; * is the best of its column. {count}, "
        f"{result.manifest['timings']['wall_s']:.1f} s"
    )
    times = {entry["sample_time_s"] for entry in result.manifest["runs"]} - {0.0}
    if times:
        print(f"controllers sampled every {', '.join(f'{time:g}' for time in sorted(times))} s")
    if said := designed_for(result.manifest):
        print(said)
    print_starts(result.runs)
    for path in (result.folder / "metrics.csv", result.folder / "manifest.json", report):
        if path:
            print(path)


def print_starts(runs: Sequence[Run]) -> None:
    """Print the runs whose motion depends on their start."""
    named = [run.key for run in runs if run.depends_on_start]
    if named:
        print(
            "these depend on their initial position (shifted by 1e-9 rad they follow another branch): "
            f"{', '.join(named)}"
        )


def _each(runs: Sequence[Run], part: str) -> list[str]:
    return list(dict.fromkeys(getattr(run, part) for run in runs))


def _print_block(title: str, runs: Sequence[Run]) -> None:
    frictions = _each(runs, "friction")
    cells = {
        (r.controller, r.friction, metric): r.metrics.get(metric, math.nan)
        for r in runs
        for metric, *_ in COLUMNS
    }
    best = {
        (friction, metric): min(
            (v for (_, f, m), v in cells.items() if (f, m) == (friction, metric)), key=_or_inf
        )
        for friction in frictions
        for metric, *_ in COLUMNS
    }
    name_width = max(14, *(len(r.controller) for r in runs))
    width = 10 * len(COLUMNS)
    print(f"{title:<{name_width}}" + "".join(f"{friction:>{width}}" for friction in frictions))
    print(" " * name_width + "".join(f"{label:>10}" for _ in frictions for *_, label in COLUMNS))
    for controller in _each(runs, "controller"):
        line = f"{controller:<{name_width}}"
        for friction in frictions:
            for metric, factor, _ in COLUMNS:
                value = cells.get((controller, friction, metric), math.nan)
                mark = "*" if value == best[friction, metric] else " "
                line += f"{f'{value * factor:.4g}' if math.isfinite(value) else '-':>9}{mark}"
        print(line.rstrip())
    print()


def _or_inf(value: float) -> float:
    return math.inf if math.isnan(value) else value


def report_failures(failed: Sequence[tuple[str, str, Path]]) -> int:
    """Print the runs that ended early on stderr, one line each; return the exit code."""
    for key, why, path in failed:
        print(f"stickslip: {key}: {why}; its record until then is {path}", file=sys.stderr)
    return 1 if failed else 0


def print_sweep(rows: Sequence[Mapping[str, Any]], metric: str, wall: float, written: Sequence[Path]) -> None:
    """Print one line per run: percentiles of a metric, flagged and missing cases."""
    from stickslip.sweeps.summary import summary_lines

    print(*summary_lines(rows, metric), sep="\n")
    print(f"{sum(row['cases'] for row in rows)} closed loops, {wall:.1f} s")
    for path in written:
        print(path)


def print_tuned(tuned: Tuned, written: Sequence[Path]) -> None:
    """Print the setting chosen for a run, before and after."""
    print(tuned)
    for path in written:
        print(path)
