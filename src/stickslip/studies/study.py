"""Running a study: every run once, found again by its fingerprint, kept when the next one fails."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from stickslip.core.resources import insist_on_jobs
from stickslip.studies import files
from stickslip.studies.plan import Study, load, load_run, select
from stickslip.studies.planned_run import Executed, PlannedRun
from stickslip.studies.result import Run, StudyResult

__all__ = ["PlannedRun", "Study", "execute", "load", "load_run", "run", "select"]

Progress = Callable[[int, int], None]
"""Called with the number of runs finished and the number of all."""


def execute(planned: PlannedRun, check: bool = False) -> Executed:
    """Simulate one run (`PlannedRun.execute`).

    Parameters
    ----------
    planned : PlannedRun
    check : bool
        Whether the record's meta has the estimate of its error.
    """
    return planned.execute(check)


def run(
    study: Study,
    out: str | Path,
    only: Sequence[str] | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
    say: Callable[[str], None] | None = None,
) -> StudyResult:
    """Run a study, or find its runs finished, and write metrics.csv, records/ and manifest.json.

    A run is finished once its record lies in the folder with the fingerprint of the run; a second call does
    the rest. Tables, manifest and result hold every finished run of the study, those that earlier calls left in
    the folder besides those that `only` asks for.

    Parameters
    ----------
    study : Study
    out : path
        The folder to write to; made if missing.
    only : sequence of str, optional
        Parts of the names of the runs wanted (`stickslip.studies.plan.select`).
    jobs : int
        Threads; the kernels release the interpreter's lock.
    progress : callable, optional
        ``progress(finished, all)``, called after every run.
    say : callable, optional
        ``say(line)``: how many runs were found finished, before the others run.

    Raises
    ------
    InputError
        If a part of a name is unknown, a run cannot be run, or the folder cannot be written.
    """
    insist_on_jobs(jobs)
    everything = [*study.runs, *study.extras]
    wanted = select(everything, only or ())
    folder = files.claim_folder(Path(out), study.name)
    clock, cpu = time.perf_counter(), time.process_time()
    results: dict[str, Run] = {}
    with interrupts_between_runs() as check:
        for done, finished in enumerate(_finished(wanted, folder, jobs, say), 1):
            results[finished.key] = finished
            if progress:
                progress(done, len(wanted))
            check()
    for p in everything:
        if p.key not in results and (found := files.find_run(folder, p)):
            results[p.key] = found
    runs = [results[p.key] for p in study.runs if p.key in results]
    more = [results[p.key] for p in study.extras if p.key in results]
    files.write_metrics(folder, runs)
    timings = {"wall_s": time.perf_counter() - clock, "cpu_s": time.process_time() - cpu, "jobs": jobs}
    kept = [p for p in everything if p.key in results]
    manifest = files.write_manifest(folder, study, only, kept, results, timings)
    return StudyResult(folder, runs, manifest, study.config, more)


STOPPING = "finishing the running cases; press Ctrl-C again to abort"


@contextmanager
def interrupts_between_runs(said: str = STOPPING) -> Generator[Callable[[], None]]:
    """Hold Ctrl-C and a request to end (SIGTERM) back until the run in hand is kept; a second one stops at once.

    Yields what raises KeyboardInterrupt if one was asked for. Raised inside a compilation it would tear the
    compiler down with it. `said` is a line for stderr, at once.
    """
    asked: list[int] = []

    def note(number: int, frame: object) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)
        # Not by sys.stderr: the signal may come while it is being written to. A terminal has a bar in this line.
        with suppress(OSError):
            os.write(2, f"{os.linesep if os.isatty(2) else ''}stickslip: {said}{os.linesep}".encode())

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _finished(
    planned: Sequence[PlannedRun], folder: Path, jobs: int, say: Callable[[str], None] | None
) -> Iterator[Run]:
    """The runs as they are found or get finished."""
    missing: list[PlannedRun] = []
    for p in planned:
        found = files.find_run(folder, p)
        if found:
            yield found
        else:
            missing.append(p)
    if say and 0 < len(missing) < len(planned):
        say(f"{len(planned) - len(missing)} of {len(planned)} runs were already done; going on")
    for p in missing:
        p.check()  # Before the first of them runs; laws are compiled here, one after another.
    if jobs == 1:
        for p in missing:
            yield _run_and_keep(p, folder)
    else:
        yield from _in_threads(missing, folder, jobs)


def _in_threads(planned: Sequence[PlannedRun], folder: Path, jobs: int) -> Iterator[Run]:
    pool = ThreadPoolExecutor(jobs)
    try:
        futures: list[Future[Run]] = [pool.submit(_run_and_keep, p, folder) for p in planned]
        for future in as_completed(futures):
            yield future.result()
    finally:
        # Runs under way are finished and kept; the others are left for the next call.
        pool.shutdown(wait=True, cancel_futures=True)


def _run_and_keep(planned: PlannedRun, folder: Path) -> Run:
    executed = execute(planned)
    about: dict[str, Any] = {
        "run": planned.key,
        "fingerprint": planned.fingerprint,
        "seconds": executed.seconds,
        "failure": executed.failure,
    }
    record = replace(executed.record, meta={**executed.record.meta, "study": about})
    path = files.keep_record(folder, planned, record)
    return Run(
        planned.slip_rule, planned.reference, planned.friction, planned.controller,
        executed.metrics, path, executed.failure, executed.seconds, files.depends_on_start(record.meta),
        planned.compensation,
    )  # fmt: skip
