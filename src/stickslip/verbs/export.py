"""A law, a compensator or a controller as text for another machine or simulator: the verb `export`."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.config import Document, Table, read_toml
from stickslip.core.errors import InputError, unwritable
from stickslip.core.messages import name_option, rendered, units_of_axis
from stickslip.core.spec import Surroundings
from stickslip.core.type_rules import with_article
from stickslip.core.whole_files import prepared_folder, write_together
from stickslip.exports import CONTROLLER_TARGETS, TARGETS, controller_target, target_named
from stickslip.exports.controllers import what_it_is
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.maps import MAP_TARGETS, MapTarget, map_target, written
from stickslip.exports.target import Target, settings_of
from stickslip.machines.position_map import PositionMap
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.studies.study import load_run
from stickslip.verbs import own_files
from stickslip.verbs.export_compensator import CompensatorOptions, compensator_of, recommendation_in
from stickslip.verbs.export_maps import map_in, only_map
from stickslip.verbs.export_notes import around_of, axis_of, notes_on, notes_on_controller
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.kinds import require
from stickslip.verbs.recommendation import RecommendationResult

Source = (
    IdentificationResult | RecommendationResult | Model | Controller | PositionMap | str
    | os.PathLike[str]
)  # fmt: skip
"""What can be exported; a path is that of a model.toml, a recommended.toml or a `stickslip simulate` file."""

TURN = "the axis is linear: a turn in these files stands for 2π m"
STANDS_FOR = "the axis is linear: N·m, rad and kg·m² in these files stand for N, m and kg"
ROTARY_ONLY = ("bam",)
"""Targets whose actuators turn: their numbers keep the meaning that the target gives them."""
Attempt = Callable[[Export], Check]
"""How a target tries files of its own."""


@constructor_checked
@dataclass(frozen=True, eq=False, repr=False)
class ExportResult:
    """Files for another machine or simulator.

    Attributes
    ----------
    target : Target
    name : str
        Prefix of every name in the target's language.
    files : mapping of str to str or bytes
        Contents by file name.
    notes : tuple of str
        What the user must know, one sentence each.
    check : Check or None
        What trying the export in its own tool showed, where that was asked for and the tool is installed.
    paths : tuple of Path
        Where the files were written; empty where they were not.
    """

    target: Target | MapTarget
    name: str
    files: Mapping[str, str | bytes]
    notes: tuple[str, ...] = ()
    check: Check | None = None
    paths: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", rendered(self.notes))

    @arguments_checked
    def save(self, folder: str | os.PathLike[str]) -> ExportResult:
        """Write the files.

        Parameters
        ----------
        folder : path
            It is made.

        Raises
        ------
        InputError
            If a file cannot be written.
        """
        prepared_folder(Path(folder))
        paths = tuple(Path(folder) / name for name in self.files)
        for path in paths:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise unwritable(path, error) from None
        write_together(dict(zip(paths, self.files.values(), strict=True)))
        own_files.written(paths)
        return replace(self, paths=paths)

    def __str__(self) -> str:
        lines = [f"{self.target.title}:", *(f"  {path}" for path in self.paths or self.files)]
        lines += [f"note: {note}" for note in self.notes]
        if self.check:
            lines.append(f"check{' failed' * (self.check.passed is False)}: {self.check.text}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<ExportResult: {self.target.name}, {', '.join(self.files)}>"


@arguments_checked
def export(
    source: Source,
    to: str,
    folder: str | os.PathLike[str] | None = None,
    *,
    name: str | None = None,
    single: bool = False,
    controller: bool = False,
    compensator: Literal["ff", "fb", "recommended"] | None = None,
    sample_time: float | None = None,
    substeps: int | None = None,
    gain: float | None = None,
    lead: float | None = None,
    deadband: float | None = None,
    offset: float | None = None,
    inertia_feedforward: float | None = None,
    filter_hz: float | None = None,
    nearest: bool = False,
    top_speed: float | None = None,
    settings: Mapping[str, str | float] | None = None,
    check: bool = False,
    position_map: bool = False,
) -> ExportResult:
    """Write a model, a compensator or a controller as C, structured text, MATLAB, Python, ...

    Parameters
    ----------
    source : IdentificationResult, RecommendationResult, Model, Controller, PositionMap or path
        A path is that of model.toml, recommended.toml or, with `controller`, a `stickslip simulate` file.
    to : str
        The target, one of `stickslip.exports.TARGETS`: "c99", "arduino", "st", "fmu", ...; of a map over the angle one
        of `stickslip.exports.maps.MAP_TARGETS`: "c99", "moteus", "odrive", "vesc", "st", ...
    folder : path, optional
        Where the files are written; without it they are in ``files`` of the result alone.
    name : str, optional
        Prefix of every name in the target's language; that of the file unless given, with ``_friction`` behind it
        and a note where that one is taken.
    single : bool
        Single precision, where the target has it.
    controller : bool
        The whole sampled controller of a simulation's file; a `Controller` is exported so anyway.
    compensator : {"ff", "fb", "recommended"}, optional
        The law as a compensator that is called every sample: feedforward of the reference velocity, feedback of the
        measured one, or what was recommended (of a `RecommendationResult` the default, where the target carries it; a
        whole controller where that is what was recommended).
    sample_time : float, optional
        Of the compensator, s; 0.001, or the recommended one.
    substeps : int, optional
        Steps of the compensator's law in a sample; 1.
    gain, lead, deadband, offset, inertia_feedforward, filter_hz : float, optional
        Of the compensator "ff" or "fb": factor on its torque, s ahead of the reference, rad/s below which its law sees
        rest, N·m in addition to friction, kg·m² times the reference's acceleration, Hz of a low-pass on its velocity.
    nearest : bool
        Where the target cannot hold the law, the nearest that it can.
    top_speed : float, optional
        Greatest velocity of the application, rad/s, up to which tables are made and sliding curves compared; the
        fastest recorded of an identified model unless given, else 100 times the velocity over which the law changes.
    settings : mapping, optional
        What only the target asks for, by name.
    check : bool
        Try the export in its own tool, where that is installed.
    position_map : bool
        The torque over the angle that method cogging found, not its law; a source or a target that knows nothing else
        is exported so anyway.

    Returns
    -------
    ExportResult

    Raises
    ------
    InputError
        One line that names what the target cannot carry, or what is missing, and the remedy.
    """
    if position_map or only_map(source) or (to in MAP_TARGETS and to not in TARGETS):
        asked = {"single": single, "controller": controller, "compensator": compensator, "nearest": nearest}
        return saved(exported_map(source, to, name or "cogging", settings, asked), folder)
    chosen = target_named(to)
    if single and not chosen.precision:
        raise InputError(f"{name_option('single')}: {chosen.name} supports only one precision; leave it out")
    options = CompensatorOptions(
        sample_time, substeps, gain, lead, deadband, offset, inertia_feedforward, filter_hz
    )
    advised = isinstance(source, RecommendationResult) and chosen.name in CONTROLLER_TARGETS
    whole = advised and is_whole(source)
    if whole and compensator == "recommended":
        compensator = None  # what is recommended is the controller
    elif compensator is None and advised and not (whole or controller or options.given):
        compensator = "recommended"
    controller = controller or isinstance(source, Controller) or (whole and compensator is None)
    refuse_controllers(chosen, controller, compensator)
    if compensator == "recommended":
        refuse_missing(source)
    content = content_of(source)
    own, renamed = named(chosen, name, content)
    linear = content.values.get("motion") == "linear"
    if compensator is None and options.given:
        raise InputError(
            f"{name_option(options.given[0])} belongs to {name_option('compensator')}; give both or neither"
        )
    if nearest and not chosen.forms:
        raise InputError(f"{name_option('nearest')}: {chosen.name} carries {chosen.carries}; leave it out")
    if controller or compensator:
        settings_of(chosen, settings or {})
        with units_of_axis(linear):
            result = exported_controller(
                source, content, chosen, own, options, compensator, single, check, linear
            )
        return saved(with_notes(result, renamed), folder)
    job = job_of(source, content, own, chosen)
    given = {**job.settings, **(settings or {})}
    top = job.top_speed if top_speed is None else top_speed
    job = replace(job, single=single, nearest=nearest, top_speed=top, settings=given)
    with units_of_axis(linear):
        result = exported_law(content, job, chosen, check)
    return saved(with_notes(result, renamed), folder)


def named(chosen: Target, name: str | None, content: Table) -> tuple[str, tuple[str, ...]]:
    """The name given, else that of the source's file, which is changed with a note where the target has it.

    Raises
    ------
    InputError
        If the name given is taken.
    """
    if name:
        chosen.insist_on_name(name)
        return name, ()
    return chosen.name_like(re.sub(r"[^A-Za-z0-9_]+", "_", Path(content.document.name).stem))


def with_notes(result: ExportResult, more: tuple[str, ...]) -> ExportResult:
    """The result with more to say, first."""
    return replace(result, notes=(*more, *result.notes))


def exported_map(
    source: Source, to: str, name: str, settings: Mapping[str, str | float] | None, asked: Mapping[str, Any]
) -> ExportResult:
    """A torque over the angle; `asked` are options that it has none of."""
    for option, given in asked.items():
        if given:
            raise InputError(f"{name_option(option)}: a torque over the angle has none; leave it out")
    target = map_target(to)
    made = written(map_in(source, to), target, name, settings)
    return ExportResult(target, name, made.files, (*made.notes, f"tried: {target.tried}"))


def exported_controller(
    source: Source, content: Table, chosen: Target, name: str, options: CompensatorOptions,
    compensator: str | None, single: bool, check: bool, linear: bool,
) -> ExportResult:  # fmt: skip
    """The controller of the source, or the compensator asked for on its law."""
    if compensator:
        made = compensator_of(content, model_of(source, content), options, compensator)
        offset = made.compensator.offset if made.compensator else 0.0
    else:
        made, offset = controller_in(source), 0.0
    target = controller_target(chosen.name)
    units = {"linear": linear} if target.declares_units else {}
    files: Export = target.write(made, name, single, surroundings_of(source), **units)
    turns = (TURN,) if linear and not target.declares_units else ()
    notes = (*files.notes, *notes_on_controller(content, made, compensator, offset), *turns)
    run = target.check if check else None
    attempt: Attempt | None = (lambda made: run(made, name)) if run else None
    titled = replace(chosen, title=target.title.format(what_it_is(made)) or chosen.title)
    return finished(titled, name, replace(files, notes=notes), attempt)


def exported_law(content: Table, job: Job, chosen: Target, check: bool) -> ExportResult:
    """The law alone."""
    settings_of(chosen, job.settings)
    rotary = job.linear and chosen.name in ROTARY_ONLY
    with units_of_axis(job.linear and not rotary):
        files = chosen.write(job)
    notes = (
        *files.notes,
        *around_of(chosen, job),
        *notes_on(content, job),
        *([STANDS_FOR] if rotary else []),
    )
    attempt = partial(chosen.check, job) if check and chosen.check else None
    return finished(chosen, job.name, replace(files, notes=notes), attempt)


def finished(chosen: Target, name: str, files: Export, attempt: Attempt | None) -> ExportResult:
    """Return the export, tried if that is requested."""
    return ExportResult(chosen, name, files.files, files.notes, attempt(files) if attempt else None)


def is_whole(source: Source) -> bool:
    """Whether a recommendation is a whole controller: a loop of control laws, or a compensator of the catalogue."""
    if not isinstance(source, RecommendationResult):
        return False
    return source.recommendation.instead is not None or not source.loop.is_short


def saved(result: ExportResult, folder: str | os.PathLike[str] | None) -> ExportResult:
    """The result, written where a folder is given."""
    return result if folder is None else result.save(folder)


def refuse_controllers(chosen: Target, controller: bool, compensator: str | None) -> None:
    """Refuse a controller or compensator where the target carries the law alone.

    Raises
    ------
    InputError
    """
    for option, asked in (("controller", controller), ("compensator", compensator)):
        if asked and chosen.name not in CONTROLLER_TARGETS:
            raise InputError(
                f"{name_option(option)}: {chosen.name} supports the law alone; leave it out, or use "
                f"{name_option('to', 'c99')}"
            )
    if controller and compensator:
        raise InputError(
            f"{name_option('controller')} takes the compensator of its file; leave "
            f"{name_option('compensator')} out"
        )


def refuse_missing(source: Source) -> None:
    """Refuse a recommendation that is not there, and say why it may not be.

    Raises
    ------
    InputError
    """
    if isinstance(source, (str, os.PathLike)) and not Path(source).exists():
        raise InputError(
            f"no file {source}; check the path, or whether `stickslip recommend --out` wrote it: it writes none, and "
            "removes an earlier one, where nothing is recommended"
        )


def content_of(source: Source) -> Table:
    """What is known besides the law: the content of the source's file, empty for a model or a controller."""
    if isinstance(source, (IdentificationResult, RecommendationResult)):
        return source.table()
    if isinstance(source, Model):
        return Table({}, Document("friction", Path()))
    if isinstance(source, Controller):
        return Table({}, Document("controller", Path()))
    assert not isinstance(source, PositionMap)
    require(source, "model", "simulation")
    return read_toml(Path(source))


def model_of(source: Source, content: Table) -> Model:
    """The law and its parameters."""
    if isinstance(source, (Model, IdentificationResult, RecommendationResult)):
        return source if isinstance(source, Model) else source.model
    return Model.from_table(content)


def controller_in(source: Source) -> Controller:
    """The controller given, or that of a file for `stickslip simulate`."""
    if isinstance(source, Controller):
        return source
    if isinstance(source, RecommendationResult):
        return source.controller
    if isinstance(source, (Model, IdentificationResult, PositionMap)):
        raise InputError(
            f"{with_article(type(source).__name__)} has no controller; give a Controller, or leave controller out"
        )
    whole = read_toml(Path(source))
    if whole.has("controller") and not whole.has("reference"):
        return read_controller(source)  # of `stickslip recommend --controller`, or written by hand
    if whole.has("recommended"):
        return recommendation_in(whole).controller(Model.from_table(whole))
    return load_run(Path(source)).control


def surroundings_of(source: Source) -> Surroundings:
    """The load and temperature that a simulation's file has."""
    if isinstance(source, (str, os.PathLike)) and read_toml(Path(source)).has("reference"):
        axis = load_run(Path(source)).axis
        if isinstance(axis, RigidAxis):
            return Surroundings(load=axis.load, temperature=axis.temperature)
    return Surroundings()


def job_of(source: Source, content: Table, name: str, chosen: Target) -> Job:
    """The model, with what the file knows of its axis."""
    known = axis_of(content)
    settings: dict[str, str | float] = {s.name: known[s.name] for s in chosen.settings if s.name in known}
    linear = content.values.get("motion") == "linear"
    if linear and any(s.name == "motion" for s in chosen.settings):
        settings["motion"] = "linear"
    return Job(
        model_of(source, content), name, top_speed=fastest_recorded(content), linear=linear, settings=settings
    )


def fastest_recorded(content: Table) -> float | None:
    """The highest speed of the records that a model was identified from, rad/s; None where it does not tell one."""
    recorded: Any = content.values.get("speeds", {})
    sides = [np.abs(np.array(side, dtype=np.float64)) for side in recorded.values() if side]
    return max((float(np.max(side)) for side in sides), default=0.0) or None
