"""Fit of a curve to the torques at constant velocities, with a choice among several laws.

The curve is that of `stickslip.identification.steady_friction.curve`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.core.spec import Law
from stickslip.identification.doctor.steady_table import NOTES, is_steady_table
from stickslip.identification.estimate import Identification
from stickslip.identification.fit.axis_start import each_way, frozen_by_default, starts
from stickslip.identification.methods._coasting import coasting_points
from stickslip.identification.methods._records import has_torque, with_torque
from stickslip.identification.methods.method import TORQUE, Method, Options, law_of, refuse_unsaid
from stickslip.identification.steady_friction.choice import (
    candidates,
    choose_sliding,
    comparable,
    each_direction,
)
from stickslip.identification.steady_friction.curve import Array, identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.segments import sliding_points
from stickslip.models.model import Model

FEW = "Coulomb with viscous friction was fitted: these points are too few to choose among several curves."
PER_DIRECTION = (
    f"Friction of each direction includes any constant torque: {name_option('per_direction', True)} "
    "holds offset at 0."
)


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Fit the named laws, or the curves of the thesis, together with a constant torque; choose one of several."""
    measured, notes = measured_points(records, options)
    points = replace(measured, offset=known_offset(measured, options))
    if options.laws:
        laws = [law_of(given) for given in options.laws]
        laws = [each_way(law) for law in laws] if options.per_direction else laws
        templates = {law.name: template(law, points.velocity, points.torque, options) for law in laws}
    else:
        every = candidates(points.velocity, points.torque, dict(options.values))
        every = {name: each_direction(m) for name, m in every.items()} if options.per_direction else every
        templates = comparable(points, every)
        notes = (*notes, FEW) if len(templates) < len(every) else notes
    refuse_unknown(options, templates.values())
    frozen = [name for name in options.frozen if name != "offset"]
    if len(templates) > 1:
        found = choose_sliding(
            points, templates, noise=options.noise, frozen=frozen, progress=options.progress
        )[1]
    else:
        found = identify_sliding(points, next(iter(templates.values())), noise=options.noise, frozen=frozen)
    said = [PER_DIRECTION] if options.per_direction and "offset" not in options.frozen else []
    return replace(found, notes=(*notes, *said, *found.notes))


def measured_points(records: Sequence[Record], options: Options) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Return velocities and friction torques: of a coasting axis if its inertia is given, else those of `points_in`."""
    inertia = options.values.get("inertia")
    if inertia is not None:
        return coasting_points(records, inertia)
    records, channel = with_torque(records, options, "sliding")
    return points_in(records, channel)


def check(records: Sequence[Record], options: Options) -> None:
    """Refuse records without a torque, unless the inertia of a coasting axis is given."""
    if "inertia" not in options.values:
        has_torque("sliding")(records, options)


def points_in(records: Sequence[Record], torque: str) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Return the points of the records: rows of tables, averages over constant velocities of logs; and notes.

    Raises
    ------
    InputError
        If tables and logs are mixed.
    """
    tables = [r for r in records if is_steady_table(r)]
    if not tables:
        return sliding_points(records, torque=torque)
    if len(tables) < len(records):
        raise InputError(
            f"{name_option('method', 'sliding')} takes either logs with times or tables of steady points; give "
            "them apart"
        )
    velocity, effort = (np.concatenate([r[name] for r in tables]) for name in ("velocity", torque))
    linear = tables[0].units["velocity"] == "m/s"
    unit = "m/s" if linear else "rad/s"
    reach = f"{float(np.min(velocity)):.3g} to {float(np.max(velocity)):.3g} {unit}"
    said = [f"{text[0].upper()}{text[1:]}." for r in tables for text in r.meta[NOTES]]
    return SlidingPoints(velocity, effort), (f"{velocity.size} steady points of a table, {reach}.", *said)


def known_offset(points: SlidingPoints, options: Options) -> float | None:
    """Return the constant torque given by the user, N·m; None if it is fitted.

    With friction parameters for each direction it is 0 unless it was given: it cannot be distinguished from them.

    Raises
    ------
    InputError
        If parameters for each direction are requested but the points are of one direction.
    """
    if options.per_direction and points.one_way:
        raise InputError(
            f"{name_option('per_direction', True)} needs constant velocities in both directions, and the record "
            "has one; leave it out, or "
            "move in both directions"
        )
    if "offset" in options.frozen and "offset" in options.values:
        return options.values["offset"]
    return 0.0 if options.per_direction else None


def refuse_unknown(options: Options, templates: Iterable[Model]) -> None:
    """Refuse unknown parameter names, freeing a parameter that is free anyway, and holding one without a value.

    Raises
    ------
    UnknownName, InputError
    """
    names = {"offset", *(f.name for model in templates for f in model.law.fields)}
    for name in (*(set(options.values) - {"inertia"}), *options.frozen):
        if name.partition("[")[0] not in names:
            raise UnknownName(f"parameter of {name_option('method', 'sliding')}", name, names)
    for name in options.free:
        raise InputError(
            f"{name_option('method', 'sliding')} fits every parameter; leave {name_option('free', name)} out, "
            f"or {name_option('frozen')} the others"
        )
    refuse_unsaid(options, {n for model in templates for n in frozen_by_default(model.law)})


def template(law: Law, velocity: Array, torque: Array, options: Options) -> Model:
    """Return a law scaled to a sliding curve, as the start of the search."""
    speed = float(np.max(np.abs(velocity)))
    known = {k: v for k, v in options.values.items() if k in {f.name for f in law.fields}}
    return starts(law, float(np.median(np.abs(torque))), 0.0, speed, 1.0, known)[0]


METHOD = Method(
    "sliding", "sliding curve from constant velocities", identify, check,
    uses=TORQUE | {"laws", "values", "frozen", "free", "noise", "per_direction", "inertia"},
    narrowed={"inertia": frozenset({"inertia", "laws", "values", "frozen", "free", "noise", "per_direction"})},
    takes_steady_points=True,
)  # fmt: skip
