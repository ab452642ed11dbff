"""From tables of a TOML file to a controller.

    [controller]
    sample_time = 0.001
    torque_limit = 1.0
    placement = {bandwidth_hz = 20.0, damping = 1.0}
    loop = {law = "pd"}
    feedforward = {law = "friction_feedforward", friction = "lugre", gain = 0.9}
    observer = {law = "disturbance_observer", corner = 400.0}

In a file of its own, `read_controller` reads it with the tables that it names: ``[laws.NAME]``, ``[axis]`` with the
inertia, ``plugins``; what else the file holds (it may be one of `stickslip simulate`) is left alone.

A place may hold a list of tables. Gains that are left out are placed; an inertia that is left out is the axis's.
Instead of the loop, or of any law at all, a table may have the short form (`stickslip.control.short_tables`):

    [controller]
    linear = "PD"
    placement = {bandwidth_hz = 20.0, damping = 1.0}
    compensator = "feedforward"
    law = "lugre"
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.own_loop import REFERENCE_VELOCITIES, REFERENCE_VELOCITY, ReferenceVelocity
from stickslip.control.registry import control_law, control_law_names, law_files
from stickslip.control.short_tables import OF_GAINS, Placement, compensator_in, gains_in, placement
from stickslip.core.config import Table, read_toml
from stickslip.core.control_spec import PLACES, ControlLaw
from stickslip.core.errors import ConfigError, ModelRemark
from stickslip.models.model import Model
from stickslip.models.tables import models, refuse_unknown

NUMERICS = ("integrator", "tolerance", "time_step", "output")
"""Keys of a controller's table that are not the controller's: how a simulation integrates it."""


def is_composed(table: Table) -> bool:
    """Whether a controller's table names control laws."""
    return any(isinstance(table.values.get(place), (dict, list)) for place in PLACES)


def read_controller(
    path: str | os.PathLike[str],
    inertia: float | None = None,
    known: Mapping[str, Model] | None = None,
    sample_time: float = 0.0,
) -> Controller:
    """Read the controller of a file.

    Parameters
    ----------
    path : path
        A TOML file with a table ``[controller]``.
    inertia : float, optional
        Of the axis, kg·m², where the file has no ``[axis]``; without it the file must have one.
    known : mapping of str to Model, optional
        What ``friction`` may name besides the file's own ``[laws.NAME]``.
    sample_time : float
        Of the machine or rig that it is for, s, where the file gives none; 0: none.

    Raises
    ------
    ConfigError
        If the file cannot be read, or its controller names no control laws.
    """
    whole = read_toml(Path(path))
    files = law_files(whole)
    own = models(whole.tables("laws"), files)
    if inertia is None or whole.has("axis"):
        inertia = whole.table("axis").positive("inertia", "kg·m²")
    default = placement(whole.table("reference")) if whole.has("reference") else None
    with whole.table("controller") as table:
        for key in NUMERICS:
            table.has(key)
        if not is_composed(table):
            raise ConfigError(
                f'{table.label()} names no control laws; give it a loop, `loop = {{law = "pd"}}`'
            )
        laws = {name: law for name, law in files.items() if isinstance(law, ControlLaw)}
        poles = placement(table) or default
        return composed(table, inertia, poles, {**(known or {}), **own}, laws, sample_time)


def sample_time_in(path: str | os.PathLike[str]) -> float:
    """The sample time that a controller's file gives, s; 0: none.

    Raises
    ------
    ConfigError
        If the file cannot be read, or has no table ``[controller]``.
    """
    return read_toml(Path(path)).table("controller").number("sample_time", "s", 0.0, lower=0.0)


def composed(
    table: Table,
    inertia: float,
    poles: Placement | None,
    known: Mapping[str, Model],
    laws: Mapping[str, ControlLaw],
    sample_time: float = 0.0,
) -> Controller:
    """Read a controller.

    Parameters
    ----------
    table : Table
    inertia : float
        Of the axis, kg·m².
    poles : Placement or None
        Where gains that are left out place the poles.
    known : mapping of str to Model
        What ``friction`` may name.
    laws : mapping of str to ControlLaw
        Control laws from files, by name; the registered ones are known anyway.
    sample_time : float
        Of the machine or rig that it is for, s, where the table gives none; 0: none, continuous time.

    Raises
    ------
    ConfigError
        One line that names the key, its value and what is allowed.
    """
    places: dict[str, Any] = {
        place: [block(t, inertia, poles, known, laws) for t in listed(table, place)] for place in PLACES
    }
    estimator = places.pop("estimator")
    if len(estimator) > 1:
        raise table.error("estimator", "must be one table; a controller has one velocity")
    short = not is_composed(table)
    with table.blamed():
        made = Controller(
            gains_in(table, inertia, poles) if short or any(map(table.has, OF_GAINS)) else None,
            compensator_in(table, known),
            table.positive("torque_limit", "N·m") if table.has("torque_limit") else math.inf,
            table.number("sample_time", "s", sample_time, lower=0.0),
            table.number("encoder_counts", "counts per revolution", 0.0, lower=0.0),
            table.number("velocity_filter", "Hz", 0.0, lower=0.0),
            estimator=estimator[0] if estimator else None,
            reference_velocity=reference_velocity_in(table),
            **places,
        )
    if made.remark:
        warnings.warn(f"{table.label()}: {made.remark}", ModelRemark, stacklevel=2)
    return made


def reference_velocity_in(table: Table) -> ReferenceVelocity | None:
    """Return how a controller's table forms the reference velocity; None if it does not state it."""
    if not table.has(REFERENCE_VELOCITY):
        return None
    return cast("ReferenceVelocity", table.choice(REFERENCE_VELOCITY, REFERENCE_VELOCITIES))


def listed(table: Table, place: str) -> Iterator[Table]:
    """The tables of a place: none, one, or those of a list."""
    if not table.has(place):
        return
    if not isinstance(table.values[place], list):
        yield table.table(place)
        return
    for i, values in enumerate(cast("list[Any]", table.values[place])):
        if not isinstance(values, dict):
            raise table.error(place, f"must be a table or a list of tables; entry {i} is none")
        yield Table(cast("dict[str, Any]", values), table.document, (*table.path, f"{place}[{i}]"))


def block(
    table: Table,
    inertia: float,
    poles: Placement | None,
    known: Mapping[str, Model],
    laws: Mapping[str, ControlLaw],
) -> ControlBlock:
    """Read a control law, its choices, its friction law and its parameters."""
    with table, table.blamed():
        law = law_of(table, laws)
        friction = known[table.choice("friction", known, family="laws")] if law.holds_friction else None
        options = {c.name for c in law.choices}
        given = table.rest()
        choices = {k: v for k, v in given.items() if k in options and isinstance(v, str)}
        values = {k: v for k, v in given.items() if k not in choices}
        variant = law.having(**choices)
        refuse_unknown(table, values, variant, options)
        if poles and law.placed:
            placed = law.placed(inertia, poles.bandwidth, poles.damping)
            values = {**placed, **values}
        if "inertia" in {f.name for f in variant.fields}:
            values = {"inertia": inertia, **values}
        return ControlBlock(law, friction, choices, **values)


def law_of(table: Table, laws: Mapping[str, ControlLaw]) -> ControlLaw:
    """The control law that a table names."""
    name = table.text("law")
    if name.endswith(".py"):
        return control_law(str(table.document.locate(name)), table.label("law"))
    if name in laws:
        return laws[name]
    return control_law(table.choice("law", (*control_law_names(), *laws)))
