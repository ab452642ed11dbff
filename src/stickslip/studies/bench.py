"""`stickslip study compensators`: compensators on machines, along references, with what is not as believed.

A run is machine/change/reference/loop/compensator. Its numbers are kept as a line of results.jsonl under a fingerprint
of everything that determines them, so that an interrupted bench goes on where it was; the motion itself is not kept.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from stickslip.control.catalogue import CATALOGUE, LOOPS, Belief, compensated
from stickslip.control.controller import Controller
from stickslip.core.config import Table, read_toml
from stickslip.core.errors import ConfigError, SimulationError, UnknownName
from stickslip.core.resources import insist_on_jobs
from stickslip.machines.machine import Machine
from stickslip.machines.numbers import with_numbers
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.studies import build, files
from stickslip.studies.bench_metrics import judged
from stickslip.studies.planned_run import described
from stickslip.studies.provenance import engine_hash, source_hash

BENCH = "compensators"
COUNTS = 2.0**20
"""Of every machine's encoder, unless a change says otherwise."""
FAMILIES = ("machine", "change", "reference", "loop", "compensator")
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Change:
    """What is not as believed."""

    friction: float
    numbers: Mapping[str, float]
    references: Sequence[str]

    def of(self, machine: Machine) -> Machine:
        """The machine with it."""
        changed = with_numbers(machine, {"encoder.counts": COUNTS, **self.numbers})
        ways = machine.contact.direction
        direction = (self.friction * ways[0], self.friction * ways[1])
        return replace(changed, contact=replace(changed.contact, direction=direction))


@dataclass(frozen=True)
class Bench:
    """A bench as its file describes it."""

    title: str
    bandwidth: float
    loops: Sequence[str]
    compensators: Sequence[str]
    machines: Mapping[str, Machine]
    motions: Mapping[str, tuple[Reference, float]]
    changes: Mapping[str, Change]
    laws: Mapping[str, Model]

    def belief(self, name: str) -> Belief:
        """What is believed of a machine."""
        machine = self.machines[name]
        known = {**self.laws, **machine.models}
        return Belief(
            machine.inertia, known["lugre"], known.get("gms"), machine.sample_time,
            machine.limits.get("torque", 1.0), self.bandwidth, COUNTS,
        )  # fmt: skip


@dataclass(frozen=True)
class BenchRun:
    """One run of the bench, done or to be done; `metrics` are those of `stickslip.studies.bench_metrics`,
    `learned` what the record of its end says (`stickslip.control.learned`), `counts` those of the encoder."""

    machine: str
    change: str
    reference: str
    loop: str
    compensator: str
    metrics: Mapping[str, float | None]
    failure: str = ""
    learned: Mapping[str, Any] = field(default_factory=dict[str, Any])
    counts: float = COUNTS

    @property
    def key(self) -> str:
        """machine/change/reference/loop/compensator"""
        return "/".join(getattr(self, family) for family in FAMILIES)

    @property
    def bare(self) -> str:
        """The key of the run that it is compared with: the PD alone on the same machine, change and reference."""
        return "/".join((self.machine, self.change, self.reference, "PD", "none"))


@dataclass(frozen=True)
class BenchResult:
    """What is known of a bench: its runs, in the order of its file."""

    bench: Bench
    folder: Path
    runs: Sequence[BenchRun]
    seconds: float
    """CPU time of this call, s."""


@dataclass(frozen=True)
class Planned:
    """A run to be done."""

    run: BenchRun
    machine: Machine
    control: Controller
    reference: Reference
    duration: float
    event: float
    """s, at which the machine changes; 0: not within the run."""
    made_of: tuple[str, ...]
    """Hashes of machine and controller."""

    @property
    def fingerprint(self) -> str:
        """A hash of everything that determines the run's numbers."""
        content = [
            *self.made_of,
            self.reference.as_dict(),
            self.duration,
            engine_hash(),
            source_hash(judged.__module__),
        ]
        return hashed(content)


def hashed(content: Any) -> str:
    """The hash of plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def hash_of(machine: Machine) -> str:
    """Of everything of a machine."""
    return hashed([described(machine), source_hash(machine.friction.law.Params.__module__)])


def hash_of_control(control: Controller) -> str:
    """Of a controller, and of the text of its laws."""
    laws = [*(m.law for m in control.frictions.values()), *control.control_laws]
    return hashed([control.as_dict(), [source_hash(law.Params.__module__) for law in laws]])


# ---- its file ------------------------------------------------------------------------------------------------------


def is_bench(study: str | Path) -> bool:
    """Whether a study is a bench: the one of the package, or a file that says so."""
    if str(study) == BENCH:
        return True
    path = Path(study)
    return path.suffix == ".toml" and path.is_file() and "bench" in read_toml(path).values


def path_of(study: str | Path) -> Path:
    """Its TOML file."""
    return Path(__file__).with_name(f"{BENCH}.toml") if str(study) == BENCH else Path(study)


def read_bench(study: str | Path = BENCH) -> Bench:
    """Read a bench: "compensators", or the path of a TOML file.

    Raises
    ------
    ConfigError
        One line that names the key, its value and what is allowed.
    """
    with read_toml(path_of(study)) as table:
        table.choice("bench", [BENCH])
        title, bandwidth = table.text("title", BENCH), table.positive("bandwidth_hz", "Hz", 10.0)
        loops = table.texts("loops", LOOPS) if table.has("loops") else LOOPS
        names = table.texts("compensators", CATALOGUE) if table.has("compensators") else tuple(CATALOGUE)
        for key, found, bare in (("loops", loops, "PD"), ("compensators", names, "none")):
            if bare not in found:
                raise table.error(key, f"must hold {bare!r}: every compensator is compared with the PD alone")
        machines = _machines(table.tables("machines"))
        laws = build.models(table.tables("laws"), build.law_files(table))
        motions = {name: build.motion(t) for name, t in table.tables("references").items()}
        changes = {name: _change(t, motions) for name, t in table.tables("changes").items()}
        for family, found in (("machines", machines), ("references", motions), ("changes", changes)):
            if not found:
                raise ConfigError(f"{table.label(family)} is missing; give at least one [{family}.NAME]")
        for name, machine in machines.items():
            if "lugre" not in {**laws, **machine.models}:
                raise ConfigError(f"machine {name!r} has no model lugre; give one as [laws.lugre]")
    return Bench(title, bandwidth, loops, names, machines, motions, changes, laws)


def _machines(tables: Mapping[str, Table]) -> dict[str, Machine]:
    """The machines by name; ``models`` names another whose models are believed of it."""
    borrowed = {name: t.text("models", "") for name, t in tables.items()}
    out = build.machines(tables)
    for name, other in borrowed.items():
        if other and other not in out:
            raise tables[name].error("models", f"= {other!r} names no machine of this file")
        if other:
            out[name] = replace(out[name], models=out[other].models)
    return out


def _change(table: Table, motions: Mapping[str, Any]) -> Change:
    with table:
        numbers: dict[str, float] = {}
        if table.has("numbers"):
            with table.table("numbers") as given:
                numbers = {key: given.number(key, "") for key in list(given.values)}
        wanted = table.texts("references", motions) if table.has("references") else tuple(motions)
        return Change(table.positive("friction", "", 1.0), numbers, wanted)


def planned(bench: Bench, only: Sequence[str] = ()) -> list[Planned]:
    """Its runs, in order; of those whose names hold the parts of `only`, with the bare PD that each is compared with.

    Raises
    ------
    UnknownName
        If a part is no machine, change, reference, loop or compensator.
    """
    known = {
        "machine": bench.machines, "change": bench.changes, "reference": bench.motions, "loop": bench.loops,
        "compensator": bench.compensators,
    }  # fmt: skip
    wanted: dict[str, set[str]] = {}
    for part in only:
        family = next((f for f in FAMILIES if part in known[f]), None)
        if family is None:
            raise UnknownName("part of a run's name", part, [n for names in known.values() for n in names])
        wanted.setdefault(family, set()).add(part)
    runs = list(_planned(bench))
    kept = [p.run for p in runs if all(getattr(p.run, f) in names for f, names in wanted.items())]
    keys = {run.key for run in kept} | {run.bare for run in kept}
    return [p for p in runs if p.run.key in keys]


def _planned(bench: Bench) -> Iterator[Planned]:
    for m, machine in bench.machines.items():
        belief = bench.belief(m)
        controls = {
            (loop, name): compensated(name, loop, belief)
            for name in bench.compensators
            for loop in (CATALOGUE[name].loops or bench.loops[:1])
            if loop in bench.loops
        }
        prints = {key: hash_of_control(control) for key, control in controls.items()}
        for c, change in bench.changes.items():
            changed, event = change.of(machine), change.numbers.get("drift.begin", 0.0)
            own = hash_of(changed)
            for r in change.references:
                for (loop, name), control in controls.items():
                    where = loop if CATALOGUE[name].loops else "-"
                    run = BenchRun(m, c, r, where, name, {}, counts=changed.encoder.counts)
                    yield Planned(run, changed, control, *bench.motions[r], event, (own, prints[loop, name]))


# ---- running it ----------------------------------------------------------------------------------------------------


def run_bench(
    study: str | Path,
    out: str | Path,
    only: Sequence[str] = (),
    jobs: int = 1,
    progress: Progress | None = None,
) -> BenchResult:
    """Run a bench, or find its runs done, and write results.jsonl.

    Parameters
    ----------
    study : str or path
        As `read_bench`.
    out : path
        The folder to write to; made if missing.
    only : sequence of str
        Parts of the names of the runs wanted.
    jobs : int
        Threads.
    progress : callable, optional
        ``progress(finished, all)``.

    Raises
    ------
    InputError
        If the file or a part of a name is wrong, or the folder cannot be written.
    """
    insist_on_jobs(jobs)
    bench = read_bench(study)
    everything = planned(bench)
    wanted = {p.run.key for p in planned(bench, only)}
    folder = files.claim_folder(Path(out), BENCH)
    log = folder / "results.jsonl"
    prints = {p.run.key: p.fingerprint for p in everything}
    done = {k: v for k, v in kept_in(log).items() if v["fingerprint"] == prints.get(k)}
    missing = [p for p in everything if p.run.key in wanted and p.run.key not in done]
    cpu = time.process_time()
    finished = len(wanted) - len(missing)
    with log.open("a", encoding="utf-8") as lines, ThreadPoolExecutor(jobs) as pool:
        try:
            if is_cut(log):
                lines.write("\n")
            for p, line in zip(missing, pool.map(executed, missing)):
                done[p.run.key] = line = {"run": p.run.key, "fingerprint": prints[p.run.key], **line}
                lines.write(json.dumps(line) + "\n")
                lines.flush()
                finished += 1
                if progress:
                    progress(finished, len(wanted))
        finally:
            pool.shutdown(cancel_futures=True)
    runs = [
        replace(
            p.run,
            metrics=done[p.run.key]["metrics"],
            failure=done[p.run.key]["failure"],
            learned=done[p.run.key].get("learned", {}),
        )
        for p in everything
        if p.run.key in done
    ]
    return BenchResult(bench, folder, runs, time.process_time() - cpu)


def kept_in(log: Path) -> dict[str, dict[str, Any]]:
    """The lines of an earlier call by run; one that was cut short is left out."""
    found: dict[str, dict[str, Any]] = {}
    if log.exists():
        for text in log.read_text(encoding="utf-8").splitlines():
            try:
                line = json.loads(text)
                found[line["run"]] = line
            except (ValueError, KeyError, TypeError):
                continue
    return found


def is_cut(log: Path) -> bool:
    """Return whether the last line of a file was cut short, so that the next one needs a line of its own."""
    content = log.read_bytes()
    return content != b"" and not content.endswith(b"\n")


def executed(p: Planned) -> dict[str, Any]:
    """Metrics of a run, or why it ended early."""
    try:
        record = simulate(
            p.machine, p.control, p.reference, p.duration, output=p.machine.sample_time, metered=False
        )
    except SimulationError as error:
        return {"metrics": {}, "failure": str(error)}
    metrics = judged(record, p.event if p.event < p.duration else 0.0)
    return {"metrics": metrics, "failure": "", "learned": record.meta.get("learned", {})}
