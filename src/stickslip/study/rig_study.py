"""`stickslip study thesis-rig`: the tracking experiments of thesis chapter 4 on the virtual machines.

Every run begins at rest on a machine just switched on. A seed sets every noise of the machine, and with it the angle at
which the run begins (ripple and cogging turned by it); seed 0 is the machine as its file has it.
"""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import stickslip
from stickslip.analyse.tracking import METRICS, tracking_metrics
from stickslip.errors import RigError, UnknownName
from stickslip.machines import machine as machines
from stickslip.machines.machine import IMPERFECTIONS, Machine, machine
from stickslip.machines.motor import Harmonics
from stickslip.record import Record
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig
from stickslip.study.rig_cases import GROUPS, Case, cases_of

__all__ = ["MACHINES", "RigResult", "RigRun", "RigView", "all_cases", "run_case", "run_rig_study", "variant"]

MACHINES = {"dry": "thesis-dry", "grease": "thesis-grease"}
NOMINAL = "as it is"
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class RigRun:
    """One run.

    Attributes
    ----------
    variant : str
        "as it is", "without NAME", or "seed N".
    key : str
        ``GROUP/CONTROLLER``
    metrics : mapping of str to float
        `stickslip.analyse.tracking.METRICS`.
    stopped : str
        Why the rig stopped it, or nothing.
    """

    variant: str
    key: str
    metrics: Mapping[str, float]
    stopped: str


@dataclass(frozen=True)
class RigResult:
    """A finished study: its folder, its runs (the nominal ones with records beside), the manifest."""

    folder: Path
    runs: tuple[RigRun, ...]
    manifest: Mapping[str, Any]

    @property
    def variants(self) -> list[str]:
        """In the order in which they were run."""
        return list(dict.fromkeys(run.variant for run in self.runs))

    def record(self, key: str) -> Record:
        """The record of a nominal run."""
        return Record.load(record_path(self.folder, key))


class RigView:
    """What statements are judged on: metrics by variant and case."""

    def __init__(self, result: RigResult) -> None:
        self.result = result
        self._runs = {(run.variant, run.key): run for run in result.runs}

    def metric(self, rule: str, case: str, name: str) -> float:
        """One metric of a run; KeyError where it is missing. `rule` is the variant."""
        run = self._runs.get((rule, case))
        if run is None:
            raise KeyError(case)
        return run.metrics[name]

    def record(self, rule: str, case: str) -> Record:
        """The record of a nominal run."""
        if rule != NOMINAL:
            raise KeyError(case)
        return self.result.record(case)


def record_path(folder: Path, key: str) -> Path:
    """Where the record of a nominal run lies."""
    return folder / "records" / f"{key.replace('/', '--')}.npz"


def variant(plant: Machine, name: str) -> Machine:
    """A machine as the variant has it."""
    if name.startswith("without "):
        return plant.without(name.removeprefix("without "))
    if name.startswith("seed "):
        return _seeded(plant, int(name.removeprefix("seed ")))
    return plant


def _seeded(plant: Machine, seed: int) -> Machine:
    """Other noise, and another angle at the start."""
    angle = float(np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi)) if seed else 0.0

    def turned(h: Harmonics) -> Harmonics:
        return replace(h, phase=tuple(p + n * angle for n, p in zip(h.order, h.phase, strict=True)))

    contact = replace(plant.contact, ripple=turned(plant.contact.ripple))
    return replace(plant, seed=plant.seed + seed, contact=contact, cogging=turned(plant.cogging))


def all_cases(only: Sequence[str] = ()) -> list[Case]:
    """Every run of chapter 4, or those whose friction, reference, group or controller is named in `only`.

    Raises
    ------
    UnknownName
    """
    found = [case for group in GROUPS for case in _cases(group.friction, group)]
    parts = [(c.group.friction, c.group.reference, c.group.name, c.controller) for c in found]
    families = [set(family) for family in zip(*parts)]
    known = set[str]().union(*families)
    for name in only:
        if name not in known:
            raise UnknownName("part of a run's name", name, sorted(known))
    wanted = [family & set(only) for family in families]
    return [
        case
        for case, names in zip(found, parts, strict=True)
        if all(not some or name in some for some, name in zip(wanted, names, strict=True))
    ]


def _cases(friction: str, group: Any) -> Iterator[Case]:
    plant = machine(MACHINES[friction])
    limits = VirtualRig(plant).limits
    return cases_of(group, plant.models, plant.sample_time, limits.torque)


def run_case(plant: Machine, case: Case) -> tuple[Record, str]:
    """One run on a machine just switched on: its record, and why the rig stopped it (or nothing)."""
    rig, stopped = VirtualRig(plant), ""
    count = round(case.duration / plant.sample_time)
    path = case.reference.sample(np.arange(count) * plant.sample_time)
    wanted = setpoints(count, position=path[:, 0], velocity=path[:, 1], acceleration=path[:, 2], closed=1.0)
    with Loop(rig, meta={"run": case.key, "machine": plant.as_dict()}) as loop:
        try:
            loop.run(wanted, case.control)
        except RigError as error:
            stopped = str(error)
        record = loop.record()
    closed = record["closed"] > 0.0
    kept = {name: values[closed] for name, values in record.channels.items()}
    return Record(record.time[closed], kept, record.units, record.meta), stopped


def run_rig_study(
    out: str | Path,
    *,
    only: Sequence[str] = (),
    seeds: int = 20,
    ablation: bool = True,
    jobs: int = 1,
    progress: Progress | None = None,
) -> RigResult:
    """Run the study and write metrics.csv, records/ and manifest.json; finished variants are kept for the next call.

    Parameters
    ----------
    out : path
    only : sequence of str
        As for `all_cases`.
    seeds : int
        Further starts of every run: other noise and another angle.
    ablation : bool
        Every run once more for each imperfection, without it.
    jobs : int
        Processes.
    progress : callable, optional
        ``progress(finished, all)``

    Raises
    ------
    InputError
        If a name is unknown or the folder cannot be written.
    """
    from stickslip.study.files import claim_folder, prepared_folder

    cases = all_cases(only)
    names = [NOMINAL]
    names += [f"without {name}" for name in IMPERFECTIONS] if ablation else []
    names += [f"seed {i}" for i in range(1, seeds + 1)]
    folder = claim_folder(Path(out), "thesis-rig")
    prepared_folder(folder / "records")
    prepared_folder(folder / "variants")
    clock, runs = time.perf_counter(), list[RigRun]()
    work = [(name, tuple(only), str(folder)) for name in names]
    if jobs == 1:
        found = map(_variant_runs, work)
    else:
        pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
        found = pool.map(_variant_runs, work)
    for some in found:
        runs += some
        if progress:
            progress(len(runs), len(names) * len(cases))
    manifest = _manifest(only, seeds, ablation, len(runs), time.perf_counter() - clock)
    result = RigResult(folder, tuple(runs), manifest)
    _write(result)
    return result


def _variant_runs(work: tuple[str, tuple[str, ...], str]) -> list[RigRun]:
    """Every run of one variant, or those that an earlier call left; records of the nominal ones are kept."""
    name, only, folder = work
    kept = Path(folder) / "variants" / f"{name.replace(' ', '-')}.json"
    mark = fingerprint(only)
    if kept.exists() and (found := json.loads(kept.read_text(encoding="utf-8")))["fingerprint"] == mark:
        return [RigRun(**run) for run in found["runs"]]
    plants = {friction: variant(machine(file), name) for friction, file in MACHINES.items()}
    runs: list[RigRun] = []
    for case in all_cases(only):
        record, stopped = run_case(plants[case.group.friction], case)
        if name == NOMINAL:
            record.save(record_path(Path(folder), case.key))
        runs.append(RigRun(name, case.key, tracking_metrics(record, case.control.torque_limit), stopped))
    draft = kept.with_suffix(f".{os.getpid()}")
    draft.write_text(json.dumps({"fingerprint": mark, "runs": [vars(r) for r in runs]}), encoding="utf-8")
    os.replace(draft, kept)
    return runs


def fingerprint(only: Sequence[str]) -> str:
    """Of what the numbers depend on: the package's version, the machines, the cases, the metrics."""
    cases = [(c.key, repr(c.control), repr(c.reference), c.duration) for c in all_cases(only)]
    said = json.dumps([stickslip.__version__, machine_files(), cases, METRICS])
    return hashlib.sha256(said.encode()).hexdigest()


def machine_files() -> dict[str, str]:
    """SHA-256 of the machines' files."""
    place = Path(machines.__file__).parent / "library"
    return {
        file: hashlib.sha256((place / f"{file}.toml").read_bytes()).hexdigest() for file in MACHINES.values()
    }


def _manifest(only: Sequence[str], seeds: int, ablation: bool, count: int, wall: float) -> dict[str, Any]:
    return {
        "study": "thesis-rig",
        "version": stickslip.__version__,
        "machines": machine_files(),
        "only": list(only), "seeds": seeds, "ablation": ablation, "runs": count, "wall_s": wall,
    }  # fmt: skip


def _write(result: RigResult) -> None:
    lines = [",".join(("variant", "run", *METRICS, "stopped"))]
    for run in result.runs:
        cells = [run.variant, run.key, *(f"{run.metrics[m]:.9g}" for m in METRICS)]
        lines.append(",".join([*cells, '"' + run.stopped.replace('"', "'") + '"']))
    (result.folder / "metrics.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (result.folder / "manifest.json").write_text(
        json.dumps(result.manifest, indent=1) + "\n", encoding="utf-8"
    )  # fmt: skip
