"""From a study's TOML file to the runs it asks for."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from stickslip.control.controller import Controller
from stickslip.core.config import Table, read_toml
from stickslip.core.errors import ConfigError, UnknownName, suggestion
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.studies import build
from stickslip.studies.build import Numerics, Placement
from stickslip.studies.known_laws import Design, KnownLaws, laws_in
from stickslip.studies.open_loop import Drive, Response
from stickslip.studies.planned_run import FAMILIES, OWN, PlannedRun
from stickslip.studies.result import Run

SLIP_RULES = ("signed", "literal")
BUILT_IN = ("thesis", "imperfections", "thesis-rig")
BENCH = "compensators"
"""The bench that ships beside them (`stickslip.studies.bench`)"""


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


def load(
    study: str | Path,
    moved: Mapping[str, Path] | None = None,
    given: Mapping[str, Any] | None = None,
    shown: str = "",
) -> Study:
    """Read a study: the path of a TOML file, or the name of one that ships with the package.

    Parameters
    ----------
    study : str or Path
    moved : mapping of str to Path, optional
        Where files that the study refers to lie now, by the path as written.
    given : mapping of str to number or bool, optional
        ``seeds`` and ``ablation`` of a study of experiments, instead of its file's.
    shown : str
        How messages call the file; its path unless given.

    Raises
    ------
    ConfigError
        One line that names the key, its value and what is allowed.
    """
    name = str(study)
    if name in BUILT_IN:
        table = read_toml(Path(__file__).with_name(f"{name}.toml"), f"{name}.toml", moved)
        return study_in(name, Path(__file__).with_name(f"{name}.toml"), _with(given, table))
    path = Path(study)
    if path.suffix != ".toml" and not path.exists():
        known = (*BUILT_IN, BENCH)
        raise ConfigError(
            f"unknown study {name!r}; "
            + suggestion(name, known, f"give the path of a TOML file, or one of {', '.join(known)}")
        )
    return study_in(path.stem, path, _with(given, read_toml(path, shown, moved)))


def _with(given: Mapping[str, Any] | None, table: Table) -> Table:
    """The table with what is given instead of its own."""
    if given and not table.has("experiments"):
        raise ConfigError(
            f"{table.label()} has no [experiments.NAME]; leave out {' and '.join(sorted(given))}"
        )
    return Table({**table.values, **(given or {})}, table.document)


def study_in(name: str, path: Path, table: Table) -> Study:
    """The study of a table that stands in the file at `path`.

    Raises
    ------
    ConfigError
    """
    with table:
        title = table.text("title", name)
        if table.has("experiments"):
            from stickslip.studies.experiments import planned_experiments

            runs = planned_experiments(table)
            return Study(name, title, runs, [], [], [], table.values, path, dict(table.document.files))
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
        known = axis.models if isinstance(axis, Machine) else dict[str, Model]()
        laws = {**known, **build.models(table.tables("laws"), files)}
        with table.table("reference") as t:
            motion = _Motion.read(t)
        with table.table("controller") as t:
            numerics = build.numerics(t, numerics)
            control = build.controller(
                t, axis.inertia, motion.placement, laws, files, build.sample_time_of(axis)
            )
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


def named_rule(rule: str | None, axis: RigidAxis | Machine, control: Controller) -> str:
    """The rule by which a run's name calls it: what its file gives; where it gives none, "own" if one of its laws
    brings another one than the default."""
    kept = {m.law.option_of("slip_rule") for m in (axis.friction, *control.frictions.values())} - {""}
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
    """What a study names: machine, frictions, references, laws and controllers; the inertia for gains, 0 for each
    axis's own."""

    axis: Table | None
    laws_from_files: Mapping[str, Any]
    numerics: Numerics
    motions: Mapping[str, _Motion]
    frictions: Mapping[str, RigidAxis | Machine]
    known: KnownLaws
    controllers: Mapping[str, Table]
    design_inertia: float

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
            KnownLaws(build.models(table.tables("laws"), files), machines),
            table.tables("controllers"),
            build.design_inertia(table),
        )

    @property
    def inertia(self) -> float:
        """Of the axes that are driven in open loop, kg·m²: that of the axis, else of the first machine."""
        return next(iter(self.frictions.values())).inertia

    def runs(
        self,
        rules: Iterable[str | None],
        motions: Iterable[str],
        frictions: Iterable[str],
        controllers: Iterable[str],
    ) -> list[PlannedRun]:
        """Every one of each with every one of the others."""
        axes = {f: self.frictions[f] for f in frictions}
        made = {(c, m): self._on_axes(c, m, axes) for c in controllers for m in motions}
        out: list[PlannedRun] = []
        for rule, m, f, c in itertools.product(rules, motions, axes, controllers):
            control, numerics = made[c, m][f]
            motion = self.motions[m]
            name = named_rule(rule, axes[f], control)
            out.append(
                PlannedRun(name, m, f, c, axes[f], control, motion.reference, motion.duration, numerics)
            )
        return out

    def _on_axes(
        self, name: str, motion: str, axes: Mapping[str, RigidAxis | Machine]
    ) -> dict[str, tuple[Controller, Numerics]]:
        """A controller along a motion, on each axis, and how its runs are integrated; axes that give it the same share
        it, and it is read once."""
        made: dict[Design, tuple[Controller, Numerics]] = {}
        out: dict[str, tuple[Controller, Numerics]] = {}
        for axis, one in axes.items():
            laws = tuple(self.known.on(axis).items())
            design = Design(self.design_inertia or one.inertia, build.sample_time_of(one), laws)
            if design not in made:
                made[design] = self._made(name, motion, axis, design)
            out[axis] = made[design]
        return out

    def _made(self, name: str, motion: str, axis: str, design: Design) -> tuple[Controller, Numerics]:
        """A controller along a motion on an axis, and how its runs are integrated."""
        poles, laws = self.motions[motion].placement, dict(design.laws)
        with self.controllers[name] as table:
            self.known.insist_on(laws_in(table), laws, f"{table.label()} on {axis}")
            numerics = build.numerics(table, self.numerics)
            made = build.controller(
                table, design.inertia, poles, laws, self.laws_from_files, design.sample_time
            )
        return made, numerics


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
        laws = parts.known.named_in(table)
        motion = parts.motions[table.choice("reference", parts.motions)]
        models = {f: parts.frictions[f].friction for f in frictions} | laws
        return Response(name, table.text("title", name), table.text("figure", ""),
                        motion.reference, motion.duration, models)  # fmt: skip


def _drive(name: str, table: Table, parts: _Parts) -> Drive:
    with table:
        frictions = table.texts("frictions", parts.frictions) if table.has("frictions") else []
        laws = parts.known.named_in(table)
        axes = {f: axis for f in frictions if isinstance(axis := parts.frictions[f], RigidAxis)}
        if left := [f for f in frictions if f not in axes]:
            raise table.error(
                "frictions", f"has {left[0]!r}, a machine: in open loop only ideal axes are driven"
            )
        axes |= {n: RigidAxis(parts.inertia, law) for n, law in laws.items()}
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
    named = [_names(run) for run in all_runs or runs]
    names = {family: dict.fromkeys(one[family] for one in named) for family in (named[0] if named else ())}
    chosen: dict[str, set[str]] = {}
    for part in parts:
        family = next((f for f in names if part in names[f]), None)
        if family is None:
            raise UnknownName("part of a run's name", part, [n for known in names.values() for n in known])
        chosen.setdefault(family, set()).add(part)
    return [run for run in runs if all(_names(run)[f] in some for f, some in chosen.items())]


def _names(run: PlannedRun | Run) -> Mapping[str, str]:
    return run.names if isinstance(run, PlannedRun) else {f: getattr(run, f) for f in FAMILIES}
