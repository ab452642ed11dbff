"""A whole axis from any record: inertia, gravity or offset, and friction jointly.

First what certain sliding tells in several bands (`stickslip.identify.regression.regression`), and when the torque
acted; its hold and delay are taken out of the record before anything is simulated. What only slow motion and reversals
tell comes from the prediction error (`stickslip.identify.axis.prediction`); `stickslip.identify.axis.agreed` says which
number is whose. Of several laws the error on held-out data chooses (`stickslip.identify.axis.choice`). Records
without the drive's signal are fitted by the output error (`stickslip.identify.axis.output`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

from stickslip import plugins
from stickslip.errors import InputError, UnknownName
from stickslip.identify.axis.agreed import aligned, regressed
from stickslip.identify.axis.choice import (
    Candidate,
    asked_of,
    chosen_of,
    compared,
    foreseen,
    nothing_foreseen,
    sentence_on,
    shortlist,
)
from stickslip.identify.axis.drifting import at_the_middle, on_drift
from stickslip.identify.axis.exponent import is_open, named_for_both, shown
from stickslip.identify.axis.form import TOLD_BY_SLIDING
from stickslip.identify.axis.in_sentences import on_bend, on_creep, on_swing, on_timing, on_width
from stickslip.identify.axis.known import known_to_sliding, on_known, refuse_a_known_torque, refuse_a_weight
from stickslip.identify.axis.law_fit import Evidence, against_sliding, estimated
from stickslip.identify.axis.output import judged
from stickslip.identify.axis.result import assembled, narrow_note, noted
from stickslip.identify.axis.search import Asked, Extras, fitted_axis, require_start
from stickslip.identify.axis.settled import ALIKE
from stickslip.identify.estimate import Estimate, Identification, silent
from stickslip.identify.experiment import Experiment, insist_on_motion
from stickslip.identify.fit.axis_start import each_way
from stickslip.identify.regression.inverse import InverseDynamics, inverse_dynamics, refuse_harmonics
from stickslip.identify.regression.regression import regress_axis
from stickslip.identify.regression.regressions import Regress
from stickslip.machines.servo import ServoAxis
from stickslip.spec import Law

AUTOMATIC = ("coulomb", "stribeck", "lugre")
"""Laws among which the held-out error chooses where none is named."""
NO_PREDICTION = "The prediction error cannot be had from these records:"
INTERVALS = ("prediction", "covariance")
SIMPLEST = (
    "Law '{simplest}' is given instead of '{law}', which may predict reversals and standstills better: of its "
    "additional parameters ({more}) the record determines none, and no fall of friction with velocity shows where the "
    "axis slides."
)
CLOSER = (
    "Law '{simplest}' is given instead of '{law}', which leaves more of the torque than plain least squares "
    "do: of its additional parameters ({more}) the record does not determine all."
)
SLOWEST = 0.25
"""s between two samples, from which on a record says nothing of an axis's dynamics."""
HELD_OUT = 0.3
"""Last part of every record that is held out where several laws are compared and no validation record is given."""


def identify_axis(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    laws: Sequence[str | Law] = AUTOMATIC,
    *,
    validation: Sequence[Experiment] = (),
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    values: Mapping[str, Any] | None = None,
    extras: Extras = Extras(),  # noqa: B008 (frozen)
    per_direction: bool = False,
    robust: bool = False,
    profiles: bool = False,
    intervals: str = "prediction",
    skew: float | None = None,
    regress: Regress = regress_axis,
    progress: Callable[[str], None] = silent,
) -> Identification:
    """Identify an axis: which law it has, its values, and how sure they are.

    Parameters
    ----------
    experiments : sequence of Experiment
        Fitted together.
    axis : ServoAxis
    laws : sequence of str or Law
        Names, paths of law files, or laws. Of several, the one with the fewest parameters is taken whose held-out
        error lies within one standard error of the best (Hastie, Tibshirani and Friedman 2009, 7.10).
    validation : sequence of Experiment
        Held out. Without any, and with several laws, the last 30 % of every record are held out for the choice
        (the first, where the end is half as fast again as all before), and the chosen law is then fitted to all.
    free, frozen, values, extras
        As in `stickslip.identify.axis.output.output_error`.
    robust, profiles
        As there, for the output error alone; the prediction error weighs outliers anyway.
    per_direction : bool
        Whether friction has parameters of its own for each direction, in every law that allows it and in the inverse
        dynamics reported with it. A constant torque cannot be distinguished from it: `offset` is kept at 0 unless it is
        free or given.
    intervals : {"prediction", "covariance"}
        Values and intervals from the prediction error (`stickslip.identify.axis.prediction`), where the records allow
        it; or from the covariance of the output error, which is too narrow where noise is coloured.
    skew : float, optional
        s by which the column of the torque lies behind the torque that acted, where it is known; found otherwise.
    regress : callable
        The regression on certain sliding; a `stickslip.identify.regression.regressions.Regressions` does not repeat
        the doctor's.
    progress : callable
        Is told what begins, in a few words.

    Returns
    -------
    Identification
        ``details`` holds ``mechanics``, ``inverse`` (`InverseDynamics` or None), ``regression`` (`Regression` or None),
        ``output`` (`FittedAxis`) and ``candidates``.

    Raises
    ------
    InputError
        If the records do not allow it, or no law could be fitted.
    """
    if not laws:
        raise InputError("no law to identify; name at least one")
    insist_on_motion(experiments)
    refuse_slow(experiments)
    if intervals not in INTERVALS:
        raise UnknownName("source of intervals", intervals, INTERVALS)
    tried = [plugins.law(x) if isinstance(x, str) else x for x in laws]
    if per_direction:
        tried = [each_way(law) for law in tried]
        refuse_a_known_torque(frozen, values or {}, axis)
        if "offset" not in (*free, *(values or {})):
            frozen, values = (*frozen, "offset"), {"offset": 0.0, **(values or {})}
    asked = Asked(free, frozen, values or {}, extras, robust)
    refuse_harmonics(experiments, extras.harmonics + extras.friction_harmonics, simulated=True)
    known = known_to_sliding(asked, tried, per_direction)
    evidence, notes = looked_at(experiments, validation, axis, extras, skew, per_direction, regress, known)
    notes = [*on_known(known, axis), *notes]
    if per_direction:
        refuse_a_weight(evidence.sliding, axis)
    if evidence.inverse is None:
        require_start(evidence.experiments, axis, tried, asked)
    if not plain_axis(asked) or (per_direction and "offset" not in frozen):
        evidence = replace(evidence, sliding=None)
    automatic, given = tuple(laws) == AUTOMATIC, asked
    asked = named_for_both(asked, tried)
    if is_open(asked, tried):
        evidence = replace(evidence, exponent_open=True)
        asked, more = shown(asked, evidence.sliding, tried)
        notes = [*notes, *more]
    tried, candidates, more, by = worth_comparing(evidence, tried, asked, intervals, progress)
    notes = notes if automatic else [*notes, *more]
    chosen, own = tried[0], asked_of(tried[0], asked, tried)
    if candidates:
        place = chosen_of(candidates)
        chosen, evidence = tried[place], replace(evidence, candidates=candidates)
        own = replace(asked_of(chosen, asked, tried), values=candidates[place].start)
        notes = [*notes, sentence_on(candidates, chosen.name), *by]
    progress(f"{chosen.name}: all of the data")
    lacking = ""
    if intervals == "prediction":
        try:
            found = estimated(chosen, own, evidence, notes)
            named = {*free, *frozen, *given.values}
            changes = automatic and not per_direction
            return rather_simplest(found, given, named, evidence, notes) if changes else found
        except InputError as error:
            lacking = f"{NO_PREDICTION} {error}."
    return by_output_error(chosen, own, evidence, notes, profiles=profiles, lacking=lacking)


def refuse_slow(experiments: Sequence[Experiment]) -> None:
    """Refuse records that show no acceleration and no reversal, and whose observer would take hours.

    Raises
    ------
    InputError
    """
    for t in experiments:
        if t.period >= SLOWEST:
            raise InputError(
                f"{t.name}: samples are {t.period:.3g} s apart, too far for accelerations and reversals to be seen; "
                "say the unit of the time if it is wrong (--map time=COLUMN:ms), log faster, or identify the curve of "
                "constant speeds with --method sliding"
            )


def rather_simplest(
    found: Identification, asked: Asked, named: Set[str], evidence: Evidence, notes: Sequence[str]
) -> Identification:
    """What was found; the simplest law where the record tells nothing more, or that explains the torque better."""
    if nothing_more(found, named):
        return simplest_of(found, asked, evidence, notes, SIMPLEST)
    falls = evidence.sliding is not None and evidence.sliding.shows_a_fall
    if falls or not leaves_more(found, named):
        return found
    simpler = simplest_of(found, asked, evidence, notes, CLOSER)
    return simpler if ALIKE * of_torque(simpler) < of_torque(found) else found


def simplest_of(
    found: Identification, asked: Asked, evidence: Evidence, notes: Sequence[str], why: str
) -> Identification:
    """The simplest law in place of one whose additional parameters the record does not determine; `why` it is."""
    simplest, more = plugins.law(AUTOMATIC[0]), ", ".join(e.name for e in beside_sliding(found))
    assert found.model is not None
    said = [*notes, why.format(law=found.model.law.name, simplest=simplest.name, more=more)]
    return estimated(simplest, asked_of(simplest, asked, [simplest]), evidence, said)


def by_output_error(
    law: Law, own: Asked, evidence: Evidence, notes: Sequence[str], *, profiles: bool, lacking: str
) -> Identification:
    """A law fitted by the output error; ``lacking`` says why the prediction error cannot be had, where it was asked
    for."""
    result = judged(fitted_axis(evidence.experiments, evidence.axis, law, evidence.inverse, own), profiles)
    fitted, estimates, said = result, result.estimates, list[str]()
    if lacking:
        fitted, estimates, said = against_sliding(result, evidence)
    found = assembled(
        fitted, estimates, result.fit.correlation, evidence.inverse, evidence.validation,
        evidence.candidates, [*notes, *said], evidence.sliding if lacking else None,
    )  # fmt: skip
    return noted(found, narrow_note(result, ask=not lacking), *filter(None, [lacking]))


def looked_at(
    experiments: Sequence[Experiment], validation: Sequence[Experiment], axis: ServoAxis, extras: Extras,
    skew: float | None, per_direction: bool, regress: Regress, known: Mapping[str, float],
) -> tuple[Evidence, list[str]]:  # fmt: skip
    """What the regressions tell, the torque of every record moved to where it acted; and what is to be said."""
    # A turn is what the regression takes where no period is given: so the doctor has asked before.
    period = None if extras.harmonic_period == Extras().harmonic_period else extras.harmonic_period
    sliding, notes = regressed(experiments, axis, skew, period, regress, per_direction, known)
    experiments = at_the_middle(aligned(experiments, sliding), axis, sliding)
    validation = aligned(validation, sliding)
    inverse, more = first_look(experiments, axis, extras, per_direction, known)
    unchecked = sliding is None and all(t.drive is not None for t in experiments)
    said = [
        *(on_timing(sliding) if skew is None else []),
        *on_width(sliding),
        *on_swing(sliding),
        *on_creep(sliding, axis),
        *on_bend(sliding),
        *on_drift(sliding),
        *notes,
        *more,
    ]
    return Evidence(experiments, validation, axis, inverse, sliding, unchecked), said


def worth_comparing(
    evidence: Evidence, laws: Sequence[Law], asked: Asked, intervals: str, progress: Callable[[str], None]
) -> tuple[list[Law], list[Candidate], list[str], list[str]]:  # fmt: skip
    """The laws of a shortlist, judged where there are several; what is to be said of the others, and of the judging.

    Where none of them predicts what was held out, the fall of friction that left the others out may be another thing:
    all are judged.
    """
    listed, more = shortlist(laws, evidence.sliding)
    if len(listed) == 1:
        return listed, [], more, []
    candidates, by = judged_laws(evidence, listed, asked, intervals, progress)
    if len(listed) < len(laws) and nothing_foreseen(candidates):
        listed, more = list(laws), []
        candidates, by = judged_laws(evidence, listed, asked, intervals, progress)
    return listed, candidates, more, by


def nothing_more(found: Identification, given: Set[str]) -> bool:
    """Whether the record tells nothing of what a law has beside Coulomb's, and shows no fall of friction either.

    What the user named (`given`) is never dropped.
    """
    estimates, more = {e.name: e for e in found.estimates}, beside_sliding(found)
    falls = "fs" in estimates and estimates["fs"].value > estimates["fc"].value
    return bool(more) and not (own_of(found) & given or any(e.identified for e in more) or falls)


def leaves_more(found: Identification, given: Set[str]) -> bool:
    """Whether a law, not all of whose own parameters the record determines, leaves more of its torque than plain least
    squares do, which have none of them; what the user named (`given`) is never dropped."""
    own, plain = of_torque(found), found.misfit.get("inverse_dynamics_relative", math.inf)
    untold = not all(e.identified for e in beside_sliding(found))
    return untold and own > ALIKE * plain and not own_of(found) & given


def of_torque(found: Identification) -> float:
    """Part of the record's torque that a model leaves unexplained."""
    return found.misfit.get("force_relative", 0.0)


def beside_sliding(found: Identification) -> list[Estimate]:
    """The estimates of what a law has beside Coulomb's."""
    own = own_of(found)
    return [e for e in found.estimates if e.name.partition("[")[0] in own]


def own_of(found: Identification) -> set[str]:
    """The parameters that a law has beside Coulomb's."""
    return {f.name for f in found.model.law.fields} - {*TOLD_BY_SLIDING} if found.model else set[str]()


def judged_laws(
    evidence: Evidence,
    laws: Sequence[Law],
    asked: Asked,
    intervals: str,
    progress: Callable[[str], None],
) -> tuple[list[Candidate], list[str]]:
    """The laws judged as the chosen one will be fitted; and what is to be said where that could not be."""
    axis, inverse = evidence.axis, evidence.inverse
    fitted, held = held_out(evidence.experiments, evidence.validation)
    said: list[str] = []
    if intervals == "prediction" and inverse is not None:
        try:
            return foreseen(fitted, held, axis, laws, inverse, asked, progress), said
        except InputError as error:
            said.append(
                f"Laws were compared by the output error of the simulation, not the prediction error: {error}."
            )
    return compared(fitted, held, axis, laws, inverse, asked, progress), said


def plain_axis(asked: Asked) -> bool:
    """Whether the axis is no more than inertia, friction, offset or gravity, and a torque over the position."""
    more = {"drive_gain", "back_emf", "backlash", "controller_gain", "load_motor", "load_external"}
    return not (asked.extras.load or asked.extras.friction_harmonics or more & {*asked.free, *asked.values})


def held_out(
    experiments: Sequence[Experiment], validation: Sequence[Experiment]
) -> tuple[list[Experiment], list[Experiment]]:
    """What laws are fitted to, and what they are compared on."""
    if validation:
        return list(experiments), list(validation)
    pairs = [t.split(HELD_OUT) for t in experiments]
    return [a for a, _ in pairs], [b for _, b in pairs]


def first_look(
    experiments: Sequence[Experiment], axis: ServoAxis, extras: Extras, per_direction: bool,
    known: Mapping[str, float],
) -> tuple[InverseDynamics | None, list[str]]:  # fmt: skip
    """Return the inverse dynamics, if the records allow one, with a known constant torque held."""
    held = {name: value for name, value in known.items() if name == "offset"}
    try:
        found = inverse_dynamics(
            experiments, axis, harmonics=extras.harmonics, harmonic_period=extras.harmonic_period, held=held
        )
    except InputError as error:
        return None, [f"No inverse dynamics: {error}"]
    notes: list[str] = []
    if per_direction:
        each = inverse_dynamics(experiments, axis, per_direction=True, harmonics=extras.harmonics)
        # Its levels, of all rows that move, are others than those of certain sliding: one number for one thing.
        notes.append(
            f"Plain least squares over the whole record leave {100 * each.relative_error:.2f} % of the torque with "
            f"friction per direction, {100 * found.relative_error:.2f} % with one friction for both."
        )
        notes.append("A torque offset cannot be distinguished from friction that differs by direction.")
    return found, notes
