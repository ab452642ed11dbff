"""A curve through the torques at constant velocities (`stickslip.identify.sliding.curve`); of several laws one is
chosen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from stickslip.errors import InputError, UnknownName
from stickslip.identify.estimate import Identification
from stickslip.identify.fit.axis_start import each_way, frozen_by_default, starts
from stickslip.identify.methods._records import has_torque, torque_channel
from stickslip.identify.methods.method import Method, Options, law_of, refuse_unsaid
from stickslip.identify.sliding.choice import candidates, choose_sliding
from stickslip.identify.sliding.curve import Array, identify_sliding
from stickslip.identify.sliding.offset import beside, constant_torque, without
from stickslip.identify.sliding.segments import sliding_points
from stickslip.model import Model
from stickslip.record import Record
from stickslip.spec import Law


def identify(records: Sequence[Record], options: Options) -> Identification:
    """A curve of the laws asked for, where none is named, of those of the thesis; and the constant torque beside it."""
    if options.per_direction and not options.laws:
        raise InputError("--method sliding --per-direction needs a law; name one, such as --law coulomb")
    measured, notes = sliding_points(records, torque=torque_channel(records, options, "sliding"))
    # With levels of its own for each direction a law takes up what a constant torque would.
    constant = None if options.per_direction else constant_torque(measured)
    points = without(measured, constant)
    if options.laws:
        laws = [law_of(given) for given in options.laws]
        laws = [each_way(law) for law in laws] if options.per_direction else laws
        templates = {law.name: template(law, points.velocity, points.torque, options) for law in laws}
    else:
        templates = candidates(points.velocity, points.torque, dict(options.values))
    refuse_unknown(options, templates.values())
    frozen = list(options.frozen)
    if len(templates) > 1:
        found = choose_sliding(
            points, templates, noise=options.noise, frozen=frozen, progress=options.progress
        )[1]
    else:
        found = identify_sliding(points, next(iter(templates.values())), noise=options.noise, frozen=frozen)
    found = beside(found, constant)
    return replace(found, notes=(*notes, *found.notes))


def refuse_unknown(options: Options, templates: Iterable[Model]) -> None:
    """Refuse names of parameters that none of the curves has, and to free what is free anyway, or to hold what
    has no value.

    Raises
    ------
    UnknownName, InputError
    """
    names = {f.name for model in templates for f in model.law.fields}
    for name in (*options.values, *options.frozen):
        if name.partition("[")[0] not in names:
            raise UnknownName("parameter of --method sliding", name, names)
    for name in options.free:
        raise InputError(
            f"--method sliding fits every parameter; leave --free {name} out, or --freeze the others"
        )
    refuse_unsaid(options, {n for model in templates for n in frozen_by_default(model.law)})


def template(law: Law, velocity: Array, torque: Array, options: Options) -> Model:
    """A law on the scales of a sliding curve, where the search starts."""
    speed = float(np.max(np.abs(velocity)))
    known = {k: v for k, v in options.values.items() if k in {f.name for f in law.fields}}
    return starts(law, float(np.median(np.abs(torque))), 0.0, speed, 1.0, known)[0]


METHOD = Method("sliding", "sliding curve from constant velocities", identify, has_torque("sliding"))
