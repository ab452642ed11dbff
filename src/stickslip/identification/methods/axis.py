"""Joint identification of inertia, offset or gravity and friction from any motion (`stickslip.identification.axis`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option, name_parameter
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.record import Record
from stickslip.identification.axis import AUTOMATIC, identify_axis
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import frozen_by_default
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.methods._experiments import driven, experiments_of
from stickslip.identification.methods._play import with_dead_travel
from stickslip.identification.methods.method import AXIS, Method, Options, law_of, refuse_unsaid
from stickslip.identification.notes import against_given
from stickslip.identification.output_error.over_angle import over_angle
from stickslip.identification.output_error.plain import at_other_corners, inverse_identification
from stickslip.identification.output_error.problem import mechanics_parameters
from stickslip.identification.output_error.search import LEVELS, Extras, require_known
from stickslip.identification.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the whole axis; the last records validate it if some are held out."""
    axis, experiments = experiments_of(records, options)
    count = len(experiments) - options.held_out
    skew, said = stated_delay(experiments[:count], options.torque_is, options.delay)
    if skew is not None:
        said += contradictions(experiments[:count], axis, skew, options.estimate)
    mapped = with_map if options.position_map else by_law
    found = mapped(axis, experiments, count, skew, options)
    return with_dead_travel(replace(found, notes=(*said, *found.notes)), experiments[:count], axis)


def with_map(
    axis: ServoAxis, experiments: Sequence[Experiment], count: int, skew: float | None, options: Options
) -> Identification:
    """Identify the axis and its torque over the angle from the first `count` experiments."""
    try:
        over = over_angle(experiments[:count], axis, skew, options.estimate)
    except InputError as error:
        found = by_law(axis, experiments, count, skew, options)
        return replace(found, notes=(*found.notes, f"No torque over the angle is identified: {error}."))
    without = [over.taken_out_of(t, axis) for t in experiments]
    return over.joined_to(by_law(axis, without, count, skew, options))


def by_law(
    axis: ServoAxis, experiments: Sequence[Experiment], count: int, skew: float | None, options: Options
) -> Identification:
    """Identify the axis with its laws, or by plain least squares."""
    fitted, held = experiments[:count], experiments[count:]
    refuse_for_every_law(axis, fitted, options)
    if options.inverse:
        refuse_held(options)
        plain = inverse_dynamics(
            fitted, axis, per_direction=options.per_direction, harmonics=options.harmonics
        )
        others = at_other_corners(plain, fitted, axis, options.harmonics)
        return inverse_identification(plain, axis, held, others)
    return identify_axis(
        fitted, axis, options.laws or AUTOMATIC, validation=held, free=options.free, frozen=options.frozen,
        values=dict(options.values), extras=Extras(harmonics=options.harmonics, load=options.load),
        per_direction=options.per_direction, robust=options.robust, intervals=options.intervals, skew=skew,
        estimate=options.estimate, progress=options.progress,
    )  # fmt: skip


BEHIND = {"commanded": -0.5, "actual": 0.0, "mean": 0.5}
"""Delay of a column relative to the torque, rows: a command acts half a row after its row on average, and a mean over
the row before is centred half a row before it."""
TAKEN = (
    f"With {name_option('delay')} alone the torque column counts as commanded from its row to the next "
    f"({name_option('torque_is', 'commanded')}); say "
    "what it is if it is another."
)
ALONE = (
    f"{name_option('torque_is')} alone does not say how late the torque acted (the delay of a current loop): "
    "that is found from the "
    f"record. Give {name_option('delay')} as well to hold both, 0 where it acted at once."
)


def stated_delay(
    experiments: Sequence[Experiment], torque_is: str | None, delay: float | None
) -> tuple[float | None, list[str]]:  # fmt: skip
    """Return the stated delay of the torque's column relative to the torque that acted, s, or None, and notes.

    The meaning of the column does not determine the delay of a current loop: without the delay nothing is held.

    Raises
    ------
    UnknownName
        If the meaning of the column is unknown.
    """
    if torque_is is not None and torque_is not in BEHIND:
        raise UnknownName("torque_is", torque_is, BEHIND)
    if delay is None:
        return None, [] if torque_is is None else [ALONE]
    skew = BEHIND[torque_is or "commanded"] * max(t.period for t in experiments) - delay
    return skew, [TAKEN] if torque_is is None else []


def contradictions(
    experiments: Sequence[Experiment], axis: ServoAxis, skew: float, estimate: EstimateSliding
) -> list[str]:
    """Report that sliding contradicts the stated delay, in a sentence; none if it does not."""
    if any(t.drive is None for t in experiments):
        return []
    try:
        return against_given(estimate(experiments, axis), skew)
    except InputError:
        return []


def refuse_for_every_law(axis: ServoAxis, experiments: Sequence[Experiment], options: Options) -> None:
    """Refuse options that are wrong for every law, before each law's search repeats the error.

    Raises
    ------
    InputError
        If a given inertia is not positive, a named parameter belongs neither to a law nor to the axis, or a held
        parameter has no value.
    """
    inertia = options.values.get("inertia", 1.0)
    if not inertia > 0.0:
        raise InputError(f"inertia = {inertia:g} {axis.unit('kg·m²')} must be greater than 0")
    of_axis = {p.name for p in mechanics_parameters(axis, experiments[0].quantity, {}, 0, 0)}
    known = of_axis | {f.name for x in options.laws or AUTOMATIC for f in law_of(x).fields} | LEVELS
    names = [*options.values, *options.free, *options.frozen]
    # Parameters of one direction, and torques over the position, are known only in their search.
    plain = [n for n in names if not n.endswith(NEGATIVE) and not n.startswith(("cos", "sin", "friction_"))]
    require_known(plain, known)
    neutral = {"drive_gain", "back_emf", "backlash", "controller_gain", "load_motor", "load_external"}
    own = {name for x in options.laws or AUTOMATIC for name in frozen_by_default(law_of(x))}
    refuse_unsaid(options, neutral | own)


MOTION = AXIS | {"held_out", "inverse", "per_direction", "harmonics", "position_map", "torque_is", "delay"}
"""Options of both ways to identify an axis."""
LEAST_SQUARES = MOTION | {"laws", "values", "frozen", "inertia"}
"""Options of the plain inverse dynamics; it refuses some of them with its own message."""
METHOD = Method(
    "axis", "inertia, offset or gravity and friction jointly", identify, driven,
    uses=LEAST_SQUARES | {"free", "load", "intervals", "robust"}, narrowed={"inverse": LEAST_SQUARES},
)  # fmt: skip


def refuse_held(options: Options) -> None:
    """Refuse options that the plain inverse dynamics would ignore: it fits every number of one law.

    Raises
    ------
    InputError
    """
    others = [law for law in (x if isinstance(x, str) else x.name for x in options.laws) if law != "coulomb"]
    if others:
        raise InputError(
            f"the plain inverse dynamics ({name_option('inverse', True)}) fits law coulomb only, not "
            f"{', '.join(others)}; leave out "
            f"{name_option('inverse', True)}, or {name_option('law')}"
        )
    if started := [name for name in options.values if name not in options.frozen]:
        raise InputError(
            f"the plain inverse dynamics ({name_option('inverse', True)}) has no start: "
            f"{name_parameter(started[0])} would be ignored; leave it out"
        )
    if options.frozen:
        raise InputError(
            f"the plain inverse dynamics ({name_option('inverse', True)}) fits every number: "
            f"{', '.join(options.frozen)} cannot be held "
            f"there; leave out {name_option('inverse', True)}, or the value that is known"
        )
