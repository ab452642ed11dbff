"""Running a sweep: blocks through threads, processes or a Dask cluster, each kept as soon as it is done."""

from __future__ import annotations

import functools
import importlib
import itertools
import os
import pickle
import platform
import re
import signal
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.resources import insist_on_jobs, insist_on_memory
from stickslip.identification.estimate import silent
from stickslip.studies.files import claim_folder, save_manifest
from stickslip.studies.study import interrupts_between_runs
from stickslip.sweeps import dataset
from stickslip.sweeps.block import Block, compute, integrator_of
from stickslip.sweeps.checked_numbers import unvaried_lines
from stickslip.sweeps.forecast import size_timed
from stickslip.sweeps.plan import BLOCK, Sweep

ADDRESS = re.compile(r"(?:[a-z]+://)?(?:[^\s:/\[\]]+|\[[0-9a-fA-F:.]+\]):\d{1,5}/?|inproc://\S+")
"""Of a Dask scheduler: its client looks for another kind of text in vain, and for long."""
PATIENCE = 10.0
"""s that a scheduler has to answer."""
OTHER_PARTS = (
    AttributeError,
    ImportError,
    NotImplementedError,
    TypeError,
    ValueError,
    pickle.UnpicklingError,
)
"""What a pickle raises where another version of the package has other parts, or another system other paths"""
MOST_TRIES = 5
"""So often workers may be killed before the command gives up; what is done is kept."""
Progress = Callable[[int, int], None]


def run(
    sweep: Sweep,
    out: str | Path,
    jobs: int = 0,
    backend: str = "threads",
    scheduler: str = "",
    progress: Progress | None = None,
    say: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run a sweep, or what is missing of it, and write its data set and manifest.json.

    Parameters
    ----------
    sweep : Sweep
    out : path
        The folder to write to; made if missing.
    jobs : int
        Blocks at a time; 0 for one a core.
    backend : {"threads", "processes"}
    scheduler : str
        Address of a Dask scheduler (tcp://host:8786), whose workers run the blocks instead.
    progress : callable, optional
        ``progress(finished, all)`` in closed loops, first of what was found.
    say : callable, optional
        ``say(line)`` is told before anything runs which runs the first integrator cannot run, and why, which do not
        have a number that varies, and how many blocks were found.

    Returns
    -------
    dict
        The manifest.

    Raises
    ------
    InputError
        If the folder or the scheduler cannot be used, or workers are killed again and again.
    """
    say = say or silent
    progress = progress or _unseen
    if jobs:
        insist_on_jobs(jobs)
    ready(sweep, scheduler)
    folder, sweep = _prepared(Path(out), sweep)
    integrators = [integrator_of(sweep, i) for i in range(len(sweep.runs))]
    for line in [*departures(sweep, integrators), *unvaried_lines(sweep)]:
        say(line)
    clock, cpu = time.perf_counter(), time.process_time()
    missing = [b for b in sweep.blocks if not dataset.has_block(folder, sweep, *b)]
    found = len(sweep.blocks) - len(missing)
    if found:
        say(f"{found} of {len(sweep.blocks)} blocks were already done{'; going on' if missing else ''}")
    done = sweep.cases - sum(_size(sweep, b) for b in missing)
    progress(done, sweep.cases)
    with interrupts_between_runs() as check:
        goes_on = functools.partial(_passes, check)
        for block in computed(sweep, missing, jobs or os.cpu_count() or 1, backend, scheduler, goes_on):
            dataset.keep_block(folder, sweep, block)
            done += len(block.numbers)
            progress(done, sweep.cases)
        check()
    dataset.write_cases(folder, sweep)
    timings = {
        "wall_s": time.perf_counter() - clock, "cpu_s": time.process_time() - cpu, "jobs": jobs,
        "blocks_computed": len(missing), "blocks_found": found,
    }  # fmt: skip
    return write_manifest(folder, sweep, timings, integrators)


def _unseen(finished: int, total: int) -> None:
    """The progress of a sweep that nobody watches."""


def _prepared(out: Path, sweep: Sweep) -> tuple[Path, Sweep]:
    """The folder, with room for the sweep and without another's blocks or halves of them, and the sweep in blocks."""
    dataset.room_for(out, sweep)
    folder = claim_folder(out, sweep.name, "sweep")
    sweep = in_blocks(folder, sweep)
    dataset.refuse_strays(folder, sweep)
    dataset.clear_drafts(folder)
    return folder, sweep


BOOKED = 1000
"""Bytes that a block takes in the books of a sweep"""


def ready(sweep: Sweep, scheduler: str = "") -> None:
    """Refuse what cannot run here.

    Raises
    ------
    InputError
        If a run is bad, or the scheduler's address is none.
    """
    if scheduler and not ADDRESS.fullmatch(scheduler):
        raise InputError(
            f"{name_option('scheduler', f'{scheduler!r}')} is no address of a Dask scheduler; give one such as tcp://host:8786"
        )
    loops = len(sweep.runs) * sweep.drawn.cases
    insist_on_memory(loops / BLOCK * BOOKED, f"{loops:.3g} closed loops in blocks of {BLOCK}", "run fewer")
    for planned in sweep.runs:
        planned.check()


def departures(sweep: Sweep, integrators: Sequence[tuple[str, str]]) -> list[str]:
    """A line for every reason why runs are not integrated by what comes first."""
    groups: dict[tuple[str, str], list[str]] = {}
    for planned, (name, why) in zip(sweep.runs, integrators):
        if why:
            groups.setdefault((name, why), []).append(planned.key)
    return [
        f"{', '.join(keys[:3])}{f' and {len(keys) - 3} more' if len(keys) > 3 else ''}:"
        f" integrator {name}, not exactly: {why}"
        for (name, why), keys in groups.items()
    ]


def _passes(check: Callable[[], None]) -> bool:
    """Whether no interruption was asked for."""
    try:
        check()
    except KeyboardInterrupt:
        return False
    return True


def _size(sweep: Sweep, block: tuple[int, int]) -> int:
    return min(sweep.size_of(block[0]), sweep.drawn.cases - block[1])


def in_blocks(folder: Path, sweep: Sweep) -> Sweep:
    """The sweep in blocks as those that are there have it, else as it says itself, else of some seconds each."""
    return replace(
        sweep,
        sizes=tuple(
            dataset.size_found(folder, sweep, i) or (sweep.sizes[i] if sweep.sizes else size_timed(sweep, i))
            for i in range(len(sweep.runs))
        ),
    )


# ---- where blocks are computed ---------------------------------------------------------------------------------


def computed(
    sweep: Sweep, blocks: Sequence[tuple[int, int]], jobs: int, backend: str = "threads", scheduler: str = "",
    goes_on: Callable[[], bool] = lambda: True,
) -> Iterator[Block]:  # fmt: skip
    """The blocks as they get done; those of a killed worker are computed again.

    None is begun any more once `goes_on` says no, but those in hand are done.
    """
    left, last = dict.fromkeys(blocks), ""
    for _ in range(MOST_TRIES):
        try:
            for block in _once(sweep, list(left), jobs, backend, scheduler, goes_on):
                del left[block.run, block.start]
                yield block
            return
        except _killed() as error:
            last = type(error).__name__
    raise InputError(f"workers were killed {MOST_TRIES} times ({last}); run the same command again to go on")


def _killed() -> tuple[type[BaseException], ...]:
    """What is raised where a worker was killed."""
    loky: Any = importlib.import_module("joblib.externals.loky.process_executor")
    kinds: list[type[BaseException]] = [loky.BrokenProcessPool]
    with suppress(ImportError):
        kinds.append(importlib.import_module("distributed").KilledWorker)
    return tuple(kinds)


def _once(
    sweep: Sweep, blocks: Sequence[tuple[int, int]], jobs: int, backend: str, scheduler: str,
    goes_on: Callable[[], bool],
) -> Iterator[Block]:  # fmt: skip
    if not blocks or not goes_on():
        return
    begun = itertools.takewhile(lambda _: goes_on(), blocks)
    joblib: Any = importlib.import_module("joblib")
    # What an interruption leaves undone is said by the verb; joblib's advice is for those who iterate themselves.
    warnings.filterwarnings("ignore", r"\d+ tasks (which were still|have been)", UserWarning)
    if not scheduler and (jobs == 1 or backend == "threads"):
        tasks = (joblib.delayed(compute)(sweep, *block) for block in begun)
        # As many at a time as run: what waits in a queue could not be held back any more.
        yield from joblib.Parallel(
            jobs, backend="threading", return_as="generator_unordered", pre_dispatch="n_jobs"
        )(tasks)
        return
    parcel = Parcel.of(sweep)
    work = compute_parcel if scheduler else compute_undisturbed
    tasks = (joblib.delayed(work)(parcel, *block) for block in begun)
    ahead = "2*n_jobs" if scheduler else "n_jobs"  # The way to another machine is worth a queue.
    with _cluster(scheduler) as options:
        yield from joblib.Parallel(
            -1 if scheduler else jobs,
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch=ahead,
            **options,
        )(tasks)


@contextmanager
def _cluster(scheduler: str) -> Generator[dict[str, Any]]:
    """Options of `joblib.Parallel` for local processes, or for the workers of a Dask scheduler."""
    if not scheduler:
        yield {"backend": "loky"}
        return
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise InputError(f"{name_option('scheduler')} needs Dask; pip install 'stickslip[dask]'") from None
    joblib: Any = importlib.import_module("joblib")
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler at {scheduler} ({error}); start one with `dask scheduler`"
        ) from None
    with client, joblib.parallel_config(backend="dask", client=client):
        yield {}


# ---- a sweep that travels --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Parcel:
    """A sweep for another process or machine: its pickle, whose laws are names, or the texts of their files.

    Attributes
    ----------
    sweep : bytes
    fingerprints : tuple of str
        Of the runs.
    """

    sweep: bytes
    fingerprints: tuple[str, ...]

    @staticmethod
    def of(sweep: Sweep) -> Parcel:
        """Pack a sweep."""
        return Parcel(pickle.dumps(sweep), fingerprints(sweep))

    def load(self) -> Sweep:
        """Unpack it.

        Raises
        ------
        InputError
            If another version of this package runs here, or a law of the sweep cannot be had here.
        """
        try:
            sweep: Sweep = pickle.loads(self.sweep)
            if fingerprints(sweep) == self.fingerprints:
                return sweep
        except InputError as error:
            raise InputError(f"a worker on {platform.node()} cannot read the sweep: {error}") from None
        except OTHER_PARTS:
            pass
        raise InputError(
            f"a worker on {platform.node()} would compute other numbers: install the same version of stickslip there, "
            "under the same operating system"
        )


def fingerprints(sweep: Sweep) -> tuple[str, ...]:
    """Of all runs."""
    return tuple(sweep.fingerprint(i) for i in range(len(sweep.runs)))


@functools.lru_cache(maxsize=4)
def _loaded(parcel: Parcel) -> Sweep:
    return parcel.load()


def compute_parcel(parcel: Parcel, run: int, start: int) -> Block:
    """Compute a block in another process."""
    return compute(_loaded(parcel), run, start)


def compute_undisturbed(parcel: Parcel, run: int, start: int) -> Block:
    """Compute a block in a process of this terminal: Ctrl-C reaches it too, but it is for the command to stop it.

    It stays deaf to it, since an interruption may come between two blocks.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return compute_parcel(parcel, run, start)


# ---- the manifest ------------------------------------------------------------------------------------------------


def write_manifest(
    folder: Path, sweep: Sweep, timings: Mapping[str, Any], integrators: Sequence[tuple[str, str]]
) -> dict[str, Any]:
    """Write the manifest of a sweep."""
    files = [(source.name, source) for source in dict.fromkeys((sweep.source, sweep.study.source))]
    content: dict[str, Any] = {
        "configuration": sweep.config,
        "cases": sweep.drawn.cases,
        "varied": list(sweep.drawn.names),
        "metrics": list(sweep.metrics),
        "timings": dict(timings),
        "runs": [
            {
                "run": p.key,
                "fingerprint": sweep.fingerprint(i),
                "integrator": name,
                "sample_time_s": p.control.sample_time,
                "varied": sweep.varied(p),
                **({"because": why} if why else {}),
            }
            for i, (p, (name, why)) in enumerate(zip(sweep.runs, integrators))
        ],
    }
    inputs = [*files, *sweep.study.files.items(), *sweep.files.items()]
    return save_manifest(folder, {"sweep": sweep.name, "title": sweep.title}, inputs, content)
