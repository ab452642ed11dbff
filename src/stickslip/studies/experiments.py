"""Experiments on virtual rigs as runs of a study: controllers compared on a machine, judged by what its sensors show.

Every run begins at rest on a machine just switched on. Besides the machine as it is, a study may run it without each
imperfection (``ablation``) and from further starts (``seeds``): a seed sets every noise and the angle at the start.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse import tracking
from stickslip.analyse.tracking import tracking_metrics
from stickslip.control.controller import Controller
from stickslip.control.files import is_composed
from stickslip.control.linear import LINEAR
from stickslip.control.sample_time import sampled_by
from stickslip.core.config import Table
from stickslip.core.errors import Interrupted, RigError
from stickslip.core.record import Record
from stickslip.machines.files import LIBRARY, library
from stickslip.machines.machine import IMPERFECTIONS, Machine
from stickslip.models.model import Model
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig
from stickslip.studies import build
from stickslip.studies.build import Placement
from stickslip.studies.planned_run import OWN, Executed, PlannedRun
from stickslip.studies.provenance import source_hash
from stickslip.studies.result import Run, StudyResult

NOMINAL = "as it is"


@dataclass(frozen=True)
class Experiment:
    """Controllers compared on one machine along one reference: a figure of the thesis.

    Attributes
    ----------
    name, machine, reference : str
    linear : str
        What the compensators are added to: "PD", "PID", ...
    bandwidth, damping : float
        Of its poles, Hz and -.
    beside : tuple of str
        Linear controllers of the same poles that run beside it.
    figures, enlarged : tuple of str
        Numbers of its figures, and of those that enlarge a reversal.
    """

    name: str
    machine: str
    reference: str
    linear: str
    bandwidth: float
    damping: float
    beside: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    enlarged: tuple[str, ...] = ()

    @property
    def poles(self) -> Placement:
        """Where its poles lie."""
        return Placement(self.bandwidth, self.damping)

    def key(self, variant: str, controller: str) -> str:
        """The name of a run of this experiment in its study."""
        named = _named(self.machine, variant)
        return f"{OWN}/{self.reference}/{named}/{self.linear}{self.bandwidth:g}-{controller}"


def experiments_of(config: Mapping[str, Any]) -> list[Experiment]:
    """The experiments of a study's configuration; none where it is a study of another kind."""
    return [
        Experiment(
            name, t["machine"], t["reference"], t["linear"], t["bandwidth_hz"], t["damping"],
            tuple(t.get("beside", ())), tuple(t.get("figures", ())), tuple(t.get("enlarged", ())),
        )
        for name, t in config.get("experiments", {}).items()
    ]  # fmt: skip


def variants_of(config: Mapping[str, Any]) -> list[str]:
    """The variants of its machines that a study runs, the nominal one first."""
    out = [NOMINAL]
    out += [f"without {name}" for name in IMPERFECTIONS] if config.get("ablation", False) else []
    return out + [f"seed {i}" for i in range(1, int(config.get("seeds", 0)) + 1)]


def variant(plant: Machine, name: str) -> Machine:
    """A machine as the variant has it: "as it is", "without NAME" or "seed N"."""
    if name.startswith("without "):
        return plant.without(name.removeprefix("without "))
    if name.startswith("seed "):
        seed = int(name.removeprefix("seed "))
        angle = float(np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi))
        return replace(plant, seed=plant.seed + seed, start_angle=plant.start_angle + angle)
    return plant


def _named(machine: str, variant: str) -> str:
    return machine if variant == NOMINAL else f"{machine}-{variant.replace(' ', '-')}"


# ---- runs -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExperimentRun(PlannedRun):
    """One run on a virtual rig.

    Attributes
    ----------
    experiment, machine, compared : str
        By what else `--only` finds it: its experiment, its machine in any variant, its controller in any experiment.
    variant : str
    """

    experiment: str = ""
    machine: str = ""
    compared: str = ""
    variant: str = NOMINAL

    @property
    def names(self) -> Mapping[str, str]:
        """Its name in every family of names."""
        own = {"experiment": self.experiment, "machine": self.machine, "compared": self.compared}
        return {**own, **super().names}

    def content(self) -> dict[str, Any]:
        """What the fingerprint is made of; what judges the run counts, and where its record is kept whole."""
        return {**super().content(), "judged": source_hash(tracking.__name__), "variant": self.variant}

    def check(self) -> None:
        """Nothing: machine and controller were made when the study was read."""

    def execute(self, check: bool = False) -> Executed:
        """Run it on a rig. The record is that of the sensors; of a variant its ends alone are kept (gigabytes else)."""
        assert isinstance(self.axis, Machine)
        start = time.thread_time()
        record, stopped = self.measured(self.axis)
        metrics = tracking_metrics(record, self.control.torque_limit)
        rows = slice(None) if self.variant == NOMINAL else [0, -1]
        kept = {name: values[rows] for name, values in record.channels.items()}
        meta = {**record.meta, "metrics": metrics}
        return Executed(
            Record(record.time[rows], kept, record.units, meta), stopped, time.thread_time() - start
        )

    def measured(self, plant: Machine) -> tuple[Record, str]:
        """What the rig measured while the loop was closed, and why the rig stopped it (or nothing)."""
        stopped, count = "", round(self.duration / plant.sample_time)
        path = self.motion.sample(np.arange(count) * plant.sample_time)
        sent = setpoints(count, position=path[:, 0], velocity=path[:, 1], acceleration=path[:, 2], closed=1.0)
        with Loop(VirtualRig(plant), meta={"run": self.key, "machine": plant.as_dict()}) as loop:
            try:
                loop.run(sent, self.control)
            except Interrupted:
                raise
            except RigError as error:
                stopped = str(error)
            record = loop.record()
        closed = record["closed"] > 0.0
        kept = {name: values[closed] for name, values in record.channels.items()}
        return Record(record.time[closed], kept, record.units, record.meta), stopped


def planned_experiments(table: Table) -> list[ExperimentRun]:
    """Every run of a study's file: variant by variant, in each experiment its linear controllers, then compensators.

    Raises
    ------
    ConfigError
    """
    config = _checked(table)
    plants = build.machines(table.tables("machines"))
    motions = {name: build.motion(t) for name, t in table.tables("references").items()}
    laws, files = build.models(table.tables("laws"), build.law_files(table)), build.law_files(table)
    inertia = build.design_inertia(table)
    controllers = table.tables("controllers")
    experiments = [_experiment(name, t, plants, motions) for name, t in table.tables("experiments").items()]
    compared = {
        e.name: list(_controllers(e, plants[e.machine], inertia, controllers, laws, files))
        for e in experiments
    }
    _note_inputs(table)
    numerics = build.Numerics()
    out: list[ExperimentRun] = []
    for name in variants_of(config):
        varied = {key: variant(plant, name) for key, plant in plants.items()}
        out += [
            ExperimentRun(
                OWN, e.reference, _named(e.machine, name), f"{e.linear}{e.bandwidth:g}-{controller}",
                varied[e.machine], control, *motions[e.reference], numerics,
                e.name, e.machine, controller, name,
            )
            for e in experiments for controller, control in compared[e.name]
        ]  # fmt: skip
    return out


def _checked(table: Table) -> Mapping[str, Any]:
    """``seeds`` and ``ablation``, checked."""
    seeds = table.number("seeds", "", 0.0, 0.0)
    if not seeds.is_integer():
        raise table.error("seeds", "must be a whole number")
    return {"seeds": int(seeds), "ablation": table.flag("ablation", False)}


def _experiment(name: str, table: Table, plants: Mapping[str, Any], motions: Mapping[str, Any]) -> Experiment:
    with table:
        return Experiment(
            name, table.choice("machine", plants), table.choice("reference", motions),
            table.choice("linear", LINEAR), table.positive("bandwidth_hz", "Hz"), table.positive("damping", ""),
            tuple(table.texts("beside", LINEAR)) if table.has("beside") else (),
            tuple(table.values["figures"]) if table.has("figures") else (),
            tuple(table.values["enlarged"]) if table.has("enlarged") else (),
        )  # fmt: skip


def _controllers(
    e: Experiment, plant: Machine, inertia: float, tables: Mapping[str, Table], laws: Mapping[str, Model],
    files: Mapping[str, Any],
) -> Iterator[tuple[str, Controller]]:  # fmt: skip
    """Its controllers by name, sampled with the machine and limited as its rig is."""
    limit, placed_with = VirtualRig(plant).limits.torque, inertia or plant.inertia
    known = {**plant.models, **laws}

    def made(table: Table) -> Controller:
        with table:
            found = build.controller(table, placed_with, e.poles, known, files, plant.sample_time)
            with table.blamed():
                found = sampled_by(found, plant.sample_time, f"machine {plant.name}")
        return replace(found, torque_limit=min(found.torque_limit, limit))

    any_table = next(iter(tables.values()))
    for kind in (e.linear, *(k for k in e.beside if k != e.linear)):
        yield kind, made(Table({"linear": kind}, any_table.document, ("experiments", e.name)))
    for name, table in tables.items():
        linear = {} if is_composed(table) else {"linear": e.linear}
        yield name, made(Table({**table.values, **linear}, table.document, table.path))


def _note_inputs(table: Table) -> None:
    """Machines of the library are inputs too: the manifest has their SHA-256 (decision 0014)."""
    for one in table.tables("machines").values():
        name = one.values.get("machine")
        if name in library():
            table.document.files[f"{name}.toml"] = LIBRARY / f"{name}.toml"


# ---- results --------------------------------------------------------------------------------------------------------


class ExperimentView:
    """What statements are judged on: metrics by variant and ``EXPERIMENT/CONTROLLER``."""

    def __init__(self, result: StudyResult) -> None:
        self.experiments = {e.name: e for e in experiments_of(result.config)}
        self.variants = variants_of(result.config)
        self._runs = {run.key: run for run in result.runs}

    def run(self, variant: str, case: str) -> Run:
        """One run; KeyError where it is missing."""
        experiment, _, controller = case.partition("/")
        return self._runs[self.experiments[experiment].key(variant, controller)]

    def metric(self, rule: str, case: str, name: str) -> float:
        """One metric of a run; KeyError where it is missing. `rule` is the variant."""
        return self.run(rule, case).metrics[name]

    def record(self, rule: str, case: str) -> Record:
        """The record of a nominal run."""
        if rule != NOMINAL:
            raise KeyError(case)
        return self.run(rule, case).record()

    def nominal(self, experiment: Experiment) -> dict[str, Run]:
        """The nominal runs of an experiment that are there, by controller."""
        start = experiment.key(NOMINAL, "")
        return {key.removeprefix(start): run for key, run in self._runs.items() if key.startswith(start)}

    def varied(self) -> Sequence[str]:
        """The variants of which a run is there, the nominal one first."""
        there = {run.friction for run in self._runs.values()}
        plants = {e.machine for e in self.experiments.values()}
        return [v for v in self.variants if any(_named(p, v) in there for p in plants)] or [NOMINAL]
