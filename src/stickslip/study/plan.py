"""From a study's TOML file to the runs it asks for."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from stickslip.config import Table, read_toml
from stickslip.control.controller import Controller
from stickslip.control.sampled_controller import SampledController
from stickslip.control_spec import ControlLaw
from stickslip.errors import ConfigError, InputError, UnknownName
from stickslip.machines.machine import Machine
from stickslip.machines.numbers import machine_numbers
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model, Reference
from stickslip.simulation.closed_loop import check_machine_run, integrator_for, prepare
from stickslip.study import build
from stickslip.study.build import Numerics, Placement
from stickslip.study.provenance import engine_hash, source_hash
from stickslip.study.result import Run

__all__ = [
    "SLIP_RULES",
    "Drive",
    "PlannedRun",
    "Response",
    "Study",
    "frictions_of",
    "load",
    "load_run",
    "select",
]

SLIP_RULES = ("signed", "literal")
OWN = "own"
"""What stands for the slip rule in the name of a run whose laws keep rules of their own."""
BUILT_IN = ("thesis", "imperfections")
FAMILIES = ("slip_rule", "reference", "friction", "controller")


@dataclass(frozen=True)
class PlannedRun:
    """One closed loop to be run, with the names by which the study calls its parts."""

    slip_rule: str
    reference: str
    friction: str
    controller: str
    axis: RigidAxis | Machine
    control: Controller | SampledController
    motion: Reference
    duration: float
    numerics: Numerics

    @property
    def key(self) -> str:
        """`slip_rule/reference/friction/controller`."""
        return f"{self.slip_rule}/{self.reference}/{self.friction}/{self.controller}"

    @property
    def rule(self) -> str | None:
        """The slip rule that the file gives for the whole run; None where each law keeps its own."""
        return None if self.slip_rule == OWN else self.slip_rule

    @functools.cached_property
    def fingerprint(self) -> str:
        """A hash of everything that determines the run's numbers."""
        return hashlib.sha256(json.dumps(self._content(), sort_keys=True).encode()).hexdigest()

    def _content(self) -> dict[str, Any]:
        """What the fingerprint is made of."""
        laws = [self.axis.friction.law, *(m.law for m in frictions_of(self.control))]
        return {
            "slip_rule": self.slip_rule,
            "inertia": self.axis.inertia,
            "friction": self.axis.friction.as_dict(),
            **({"machine": described(self.axis)} if isinstance(self.axis, Machine) else {}),
            **(
                {"controller": self.control.as_dict()}
                if isinstance(self.control, SampledController)
                else _control_content(self.control)
            ),
            "reference": self.motion.as_dict(),
            "duration": self.duration,
            "numerics": asdict(self.numerics),
            "laws": [source_hash(law.Params.__module__) for law in (*laws, *control_laws_of(self.control))],
            "engine": engine_hash(),
        }

    def check(self) -> None:
        """Find what is wrong with the run without running it; compiles its laws.

        Raises
        ------
        InputError
        """
        n = self.numerics
        try:
            if isinstance(self.axis, Machine):
                check_machine_run(
                    self.axis, self.control, self.duration, n.output, n.integrator, slip_rule=self.rule
                )
                return
            case = prepare(
                self.axis, self.control, self.motion, self.duration,
                tolerance=n.tolerance, slip_rule=self.rule, output=n.output,
            )  # fmt: skip
            integrator_for(case, n.integrator)
        except InputError as error:
            raise ConfigError(f"run {self.key}: {error}") from None


def described(machine: Machine) -> dict[str, Any]:
    """Everything of a machine that a run's numbers depend on."""
    laws = {name: model.as_dict() for name, model in machine.models.items()}
    return {**machine_numbers(machine), **machine.as_dict(), "sample_time": machine.sample_time,
            "converters": repr((machine.amplifier, machine.sensor, machine.cogging, machine.contact.ripple)),
            "models": laws}  # fmt: skip


def frictions_of(control: Controller | SampledController) -> list[Model]:
    """The friction laws that a controller holds."""
    if isinstance(control, SampledController):
        return [block.friction for block in control.blocks.values() if block.friction]
    return [control.compensator.model] if control.compensator else []


def control_laws_of(control: Controller | SampledController) -> list[ControlLaw]:
    """The control laws that a controller is made of."""
    blocks = control.blocks.values() if isinstance(control, SampledController) else ()
    return [block.law for block in blocks]


def _control_content(control: Controller) -> dict[str, Any]:
    """What determines the numbers of a controller with gains and a compensator."""
    helper = control.compensator
    sampled = [helper.lead, helper.deadband] if helper and helper.sampled else []
    if helper and (helper.offset or helper.inertia_feedforward):
        sampled += [helper.offset, helper.inertia_feedforward]
    if helper and helper.substeps != 1:
        sampled += ["substeps", helper.substeps]
    filtered = [control.velocity_filter] if control.velocity_filter else []
    return {
        "gains": control.gains._asdict(),
        "compensator": helper
        and [helper.name, helper.gain, helper.filter_hz, helper.model.as_dict(), *sampled],
        "control": [control.torque_limit, control.sample_time, control.encoder_counts, *filtered],
    }


@dataclass(frozen=True)
class Response:
    """Friction over velocity in open loop: laws that answer to the velocity of a reference."""

    name: str
    title: str
    figure: str
    motion: Reference
    duration: float
    models: Mapping[str, Model]


@dataclass(frozen=True)
class Drive:
    """Positions in open loop: axes with different frictions under the same sinusoidal motor torque."""

    name: str
    title: str
    figure: str
    amplitude: float
    """N·m"""
    frequency: float
    """Hz"""
    duration: float
    axes: Mapping[str, RigidAxis]


@dataclass(frozen=True)
class Study:
    """A study as its file describes it.

    Attributes
    ----------
    runs : sequence of PlannedRun
        In order: slip rule, reference, friction, controller.
    extras : sequence of PlannedRun
        What the comparisons add to them.
    responses : sequence of Response
    drives : sequence of Drive
    config : mapping
        The TOML as read.
    source : Path
        The TOML file.
    files : mapping of str to Path
        Files it refers to (laws, tables), by the path as written.
    """

    name: str
    title: str
    runs: Sequence[PlannedRun]
    extras: Sequence[PlannedRun]
    responses: Sequence[Response]
    drives: Sequence[Drive]
    config: Mapping[str, Any]
    source: Path
    files: Mapping[str, Path]


def load(study: str | Path, moved: Mapping[str, Path] | None = None) -> Study:
    """Read a study: the path of a TOML file, or the name of one that ships with the package.

    Parameters
    ----------
    study : str or Path
    moved : mapping of str to Path, optional
        Where files that the study refers to lie now, by the path as written.

    Raises
    ------
    ConfigError
        One line that names the key, its value and what is allowed.
    """
    name = str(study)
    if name in BUILT_IN:
        table = read_toml(Path(__file__).with_name(f"{name}.toml"), f"{name}.toml", moved)
        return _study(name, Path(__file__).with_name(f"{name}.toml"), table)
    path = Path(study)
    if path.suffix != ".toml" and not path.exists():
        raise ConfigError(
            f"unknown study {name!r}; give the path of a TOML file, or one of {', '.join(BUILT_IN)}"
        )
    return _study(path.stem, path, read_toml(path, moved=moved))


def _study(name: str, path: Path, table: Table) -> Study:
    with table:
        title = table.text("title", name)
        rules = table.texts("slip_rules", SLIP_RULES) if table.has("slip_rules") else [None]
        parts = _Parts.read(table)
        runs = parts.runs(rules, parts.motions, parts.frictions, parts.controllers)
        compared = [r for t in table.tables("comparisons").values() for r in _comparison(t, parts, rules[0])]
        extras = _without_doubles(runs, compared, table.label("comparisons"))
        responses = [_response(n, t, parts) for n, t in table.tables("responses").items()]
        drives = [_drive(n, t, parts) for n, t in table.tables("drives").items()]
    return Study(name, title, runs, extras, responses, drives, table.values, path, dict(table.document.files))


def _without_doubles(
    runs: Sequence[PlannedRun], extras: Sequence[PlannedRun], label: str
) -> list[PlannedRun]:
    """The extras that are not planned already; one name must not mean two different runs."""
    planned = {run.key: run for run in runs}
    found: dict[str, PlannedRun] = {}
    for run in extras:
        same = planned.get(run.key) or found.setdefault(run.key, run)
        if same.fingerprint != run.fingerprint:
            raise ConfigError(
                f"{label}: {run.key} means two different runs; give one of its parts another name"
            )
    return list(found.values())


def load_run(path: Path) -> PlannedRun:
    """Read one run from the TOML file at `path`: [axis], [friction], [reference], [controller], perhaps [laws.*].

    Raises
    ------
    ConfigError
    """
    with read_toml(path) as table:
        if table.has("law") and not table.has("friction"):
            raise ConfigError(
                f"{path} holds a model, not a closed loop; write a file with `law = {{model = {path.name!r}}}` in its "
                "table [friction] (`stickslip simulate --help` shows one)"
            )
        numerics = build.numerics(table, Numerics())
        rule = table.choice("slip_rule", SLIP_RULES) if table.has("slip_rule") else None
        files = build.law_files(table)
        axis = _axis(table, files)
        known = _models_of({"": axis}) if isinstance(axis, Machine) else {}
        laws = {**known, **build.models(table.tables("laws"), files)}
        with table.table("reference") as t:
            motion = _Motion.read(t)
        with table.table("controller") as t:
            numerics = build.numerics(t, numerics)
            control = build.controller(t, axis.inertia, motion.placement, laws, files)
    return PlannedRun(
        named_rule(rule, axis, control), motion.reference.kind.name, axis.friction.law.name, "controller",
        axis, control, motion.reference, motion.duration, numerics,
    )  # fmt: skip


def _axis(table: Table, files: Mapping[str, Any]) -> RigidAxis | Machine:
    """The axis of a single run: [axis] and [friction], or [machine]."""
    if not table.has("machine"):
        with table.table("friction") as t:
            return build.axis(table.table("axis"), build.model(t, build.friction_laws(files)))
    for other in ("axis", "friction"):
        if table.has(other):
            raise table.error(other, "and [machine] exclude each other; give one of them")
    found = build.machine_of(table.table("machine"))
    if list(found) != [""]:
        raise table.error("machine", "names several machines (each_alone); a single run has one")
    return found[""]


def named_rule(rule: str | None, axis: RigidAxis | Machine, control: Controller | SampledController) -> str:
    """The rule by which a run's name calls it: what its file gives; where it gives none, "own" if one of its laws
    brings another one than the default."""
    kept = {m.law.option_of("slip_rule") for m in (axis.friction, *frictions_of(control))} - {""}
    return rule or (OWN if kept - {SLIP_RULES[0]} else SLIP_RULES[0])


@dataclass(frozen=True)
class _Motion:
    reference: Reference
    duration: float
    placement: Placement | None

    @staticmethod
    def read(table: Table) -> _Motion:
        with table:
            duration, poles = table.positive("duration", "s"), build.placement(table)
            return _Motion(build.reference(table), duration, poles)


@dataclass(frozen=True)
class _Parts:
    """What a study names: machine, frictions, references, laws and controllers."""

    axis: Table | None
    laws_from_files: Mapping[str, Any]
    numerics: Numerics
    motions: Mapping[str, _Motion]
    frictions: Mapping[str, RigidAxis | Machine]
    laws: Mapping[str, Model]
    controllers: Mapping[str, Table]

    @staticmethod
    def read(table: Table) -> _Parts:
        numerics = build.numerics(table, Numerics())
        files = build.law_files(table)
        machines = build.machines(table.tables("machines"))
        for family in ("friction", "references", "controllers"):
            if not table.tables(family) and not (family == "friction" and machines):
                raise ConfigError(f"{table.label(family)} is missing; give at least one [{family}.NAME]")
        frictions = build.models(table.tables("friction"), files)
        axis = table.table("axis") if frictions or table.has("axis") else None
        if both := set(frictions) & set(machines):
            raise table.error("machines", f"and friction share the name {min(both)!r}; give one another name")
        return _Parts(
            axis,
            files,
            numerics,
            {name: _Motion.read(t) for name, t in table.tables("references").items()},
            {
                **{name: build.axis(axis, friction) for name, friction in frictions.items() if axis},
                **machines,
            },
            {**_models_of(machines), **build.models(table.tables("laws"), files)},
            table.tables("controllers"),
        )

    @property
    def inertia(self) -> float:
        """What gains are placed with, kg·m²: that of the axis, else of the first machine."""
        return next(iter(self.frictions.values())).inertia

    def runs(
        self,
        rules: Iterable[str | None],
        motions: Iterable[str],
        frictions: Iterable[str],
        controllers: Iterable[str],
    ) -> list[PlannedRun]:
        """Every one of each with every one of the others."""
        made: dict[tuple[str, str], tuple[Controller | SampledController, Numerics]] = {}
        inertia = self.inertia
        for c in controllers:
            for m in motions:
                with self.controllers[c] as table:
                    numerics = build.numerics(table, self.numerics)
                    made[c, m] = (
                        build.controller(
                            table, inertia, self.motions[m].placement, self.laws, self.laws_from_files
                        ),
                        numerics,
                    )
        return [
            PlannedRun(named_rule(rule, self.frictions[f], made[c, m][0]), m, f, c, self.frictions[f], made[c, m][0],
                       self.motions[m].reference, self.motions[m].duration, made[c, m][1])
            for rule in rules for m in motions for f in frictions for c in controllers
        ]  # fmt: skip


def _models_of(machines: Mapping[str, Machine]) -> dict[str, Model]:
    """The laws that somebody identified on the machines, by name: what controllers may hold beside [laws.*]."""
    found: dict[str, Model] = {}
    for one in machines.values():
        for name, model in one.models.items():
            if found.setdefault(name, model).as_dict() != model.as_dict():
                raise ConfigError(
                    f"two machines have different models {name!r}; give what is meant as [laws.{name}]"
                )
    return found


def _comparison(table: Table, parts: _Parts, rule: str | None) -> list[PlannedRun]:
    with table:
        table.text("title", "")
        table.has("figures")
        own = build.models(table.tables("friction"), parts.laws_from_files)
        if own and parts.axis is None:
            raise table.error("friction", "needs a table [axis]")
        axes = {name: build.axis(parts.axis, friction) for name, friction in own.items() if parts.axis}
        wider = replace(
            parts,
            frictions={**parts.frictions, **axes},
            controllers={**parts.controllers, **table.tables("controller")},
        )
        return wider.runs(
            [rule],
            table.texts("references", wider.motions),
            table.texts("frictions", wider.frictions),
            table.texts("controllers", wider.controllers),
        )


def _response(name: str, table: Table, parts: _Parts) -> Response:
    with table:
        frictions = table.texts("frictions", parts.frictions) if table.has("frictions") else []
        laws = table.texts("laws", parts.laws, "laws") if table.has("laws") else []
        motion = parts.motions[table.choice("reference", parts.motions)]
        models = {f: parts.frictions[f].friction for f in frictions} | {n: parts.laws[n] for n in laws}
        return Response(name, table.text("title", name), table.text("figure", ""),
                        motion.reference, motion.duration, models)  # fmt: skip


def _drive(name: str, table: Table, parts: _Parts) -> Drive:
    with table:
        frictions = table.texts("frictions", parts.frictions) if table.has("frictions") else []
        laws = table.texts("laws", parts.laws, "laws") if table.has("laws") else []
        axes = {f: axis for f in frictions if isinstance(axis := parts.frictions[f], RigidAxis)}
        if left := [f for f in frictions if f not in axes]:
            raise table.error(
                "frictions", f"has {left[0]!r}, a machine: in open loop only ideal axes are driven"
            )
        axes |= {n: RigidAxis(parts.inertia, parts.laws[n]) for n in laws}
        return Drive(
            name, table.text("title", name), table.text("figure", ""), table.positive("amplitude", "N·m"),
            table.positive("frequency", "Hz"), table.positive("duration", "s"), axes,
        )  # fmt: skip


PlannedOrDone = TypeVar("PlannedOrDone", PlannedRun, Run)


def select(
    runs: Sequence[PlannedOrDone], parts: Sequence[str], all_runs: Sequence[PlannedRun] = ()
) -> list[PlannedOrDone]:
    """The runs whose names contain the parts: one of those given for a family, of every family given.

    ``["low", "step", "PD"]`` selects the controller PD along the references low and step.

    Parameters
    ----------
    runs : sequence of PlannedRun or of Run
    parts : sequence of str
        Names of slip rules, references, frictions and controllers.
    all_runs : sequence of PlannedRun
        Where the names are looked up, if not in `runs`.

    Raises
    ------
    UnknownName
    """
    names = {family: dict.fromkeys(getattr(run, family) for run in all_runs or runs) for family in FAMILIES}
    wanted: dict[str, set[str]] = {}
    for part in parts:
        family = next((f for f in FAMILIES if part in names[f]), None)
        if family is None:
            raise UnknownName("part of a run's name", part, [n for known in names.values() for n in known])
        wanted.setdefault(family, set()).add(part)
    return [run for run in runs if all(getattr(run, f) in chosen for f, chosen in wanted.items())]
