"""One law fitted to an axis, each number from the estimator that shows it on the records at hand.

Certain sliding alone (`stickslip.identify.regression.regression`) where it tells the whole law; else the prediction
error (`stickslip.identify.axis.prediction`), held against certain sliding (`stickslip.identify.axis.agreed`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.identify.axis.agreed import (
    agreed,
    as_good,
    held_against,
    known_to_act,
    sliding_values,
    told_apart,
)
from stickslip.identify.axis.choice import Candidate
from stickslip.identify.axis.exponent import predicted_with, with_other
from stickslip.identify.axis.falling import with_level
from stickslip.identify.axis.form import TOLD_BY_SLIDING, static_by_name, told_with
from stickslip.identify.axis.output import OutputError
from stickslip.identify.axis.prediction import axis_prediction
from stickslip.identify.axis.problem import Problem
from stickslip.identify.axis.result import (
    IN_SERIES,
    ONLY_REVERSALS,
    assembled,
    evident,
    noted,
    told_whole,
    untold_by_reversals,
)
from stickslip.identify.axis.search import Asked, Extras, FittedAxis, laid_out, starting_models
from stickslip.identify.axis.settled import ALIKE, settled
from stickslip.identify.axis.settled_each_way import settled_each_way
from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.observer.prediction_error import PredictionError
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.regression import Regression
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]

HELD = 0.1
"""Rows by which a torque may act beside its row for reversals to tell stiffness."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known of the records before a law is fitted to them.

    Attributes
    ----------
    experiments, validation : sequence of Experiment
        Fitted, and held out; the torque where it acted.
    axis : ServoAxis
    inverse : InverseDynamics or None
        Plain regression, where the records allow it.
    sliding : Regression or None
        The regression on certain sliding, where it is part of the answer.
    unchecked : bool
        Whether the drive's signal is known, but no regression on certain sliding: the inverse dynamics stand in.
    candidates : sequence of Candidate
        The laws that were compared.
    exponent_open : bool
        Whether nobody named the exponent with which friction falls.
    """

    experiments: Sequence[Experiment]
    validation: Sequence[Experiment]
    axis: ServoAxis
    inverse: InverseDynamics | None
    sliding: Regression | None
    unchecked: bool
    candidates: Sequence[Candidate] = ()
    exponent_open: bool = False


def estimated(law: Law, asked: Asked, evidence: Evidence, notes: Sequence[str]) -> Identification:
    """The law's values and intervals by certain sliding alone where that suffices, else by the prediction error.

    Raises
    ------
    InputError
        If the records do not allow the prediction error.
    """
    inverse, sliding = evidence.inverse, evidence.sliding
    if sliding is not None and inverse is not None and told_whole(law):
        model = starting_models(evidence.experiments, law, inverse, asked.values)[0]
        if told_with(model, sliding):
            found = by_sliding(model, asked, evidence, inverse, sliding, notes)
            if all(e.identified for e in found.estimates) or not sliding.held_for(HELD):
                return found
    return predicted(law, asked, evidence, notes)


def by_sliding(
    model: Model,
    asked: Asked,
    evidence: Evidence,
    inverse: InverseDynamics,
    sliding: Regression,
    notes: Sequence[str],
) -> Identification:
    """An axis whose law certain sliding tells whole: nothing is left for a search."""
    experiments, axis, law = evidence.experiments, evidence.axis, model.law
    vector, _ = laid_out(experiments, axis, law, inverse, model, asked)
    scale = vector.signed_scale(sliding.friction)
    start = vector.values(vector.start)
    first = [
        Estimate(
            p.name, p.par.unit, p.par.symbol, float(x), math.inf, -math.inf, math.inf, False, "not fitted"
        )
        for p, x in zip(vector.free, start, strict=True)
    ]
    estimates, said = agreed(first, sliding, vector, inverse, scale, fine=False)
    u = vector.coordinates(vector.named(vector.start) | {e.name: e.value for e in estimates})
    estimates = evident(estimates, vector, u, experiments, axis)
    estimates, more = beside_plain(estimates, model, vector, inverse, sliding)
    estimates = told_apart(estimates, sliding, model, inverse)
    u = vector.coordinates(vector.named(u) | {e.name: e.value for e in estimates})
    found = with_values(experiments, axis, law, vector, u, asked.extras)
    shown = [replace(e, unit=axis.unit(e.unit)) for e in estimates]
    names, told = [e.name for e in shown], sliding.correlated
    correlation = np.eye(len(names))
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            if a in told and b in told:
                correlation[i, j] = sliding.bands[0].correlation[told.index(a), told.index(b)]
    result = assembled(
        found,
        shown,
        correlation,
        inverse,
        evidence.validation,
        evidence.candidates,
        [*notes, *said, *more],
        sliding,
    )
    return noted(result)


def beside_plain(
    estimates: Sequence[Estimate], model: Model, vector: Vector, inverse: InverseDynamics, sliding: Regression
) -> tuple[tuple[Estimate, ...], list[str]]:
    """The estimates settled beside the plain inverse dynamics, as far as certain sliding does not refute it.

    They stay as they are where the user holds a part of the axis, or where the law's static torque is not its `fs`:
    the inverse dynamics has neither.
    """
    if holds_a_part(vector) or not static_by_name(model):
        return tuple(estimates), []
    if any(e.name == f"fc{NEGATIVE}" for e in estimates):
        return settled_each_way(estimates, model, inverse, falls=sliding.shows_a_fall), []
    if as_good(inverse, sliding, ALIKE):
        return settled(estimates, model, inverse)
    own = {n: (low, high) for n, (_, low, high) in sliding_values(sliding, model).items()}
    # Refuted by less than half, it is still in the intervals of the estimates.
    both = {e.name: (e.lower, e.upper) for e in estimates} if as_good(inverse, sliding) else None
    return settled(estimates, model, inverse, own, both, falls=sliding.shows_a_fall)


def holds_a_part(vector: Vector) -> bool:
    """Whether inertia, a constant torque or gravity is held at a value, and not fitted."""
    held = {p.name: p.value for p in vector.parameters if not p.free}
    return any(held.get(name, 0.0) != 0.0 for name in ("inertia", "offset", "gravity", "gravity_angle"))


def with_values(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, vector: Vector, u: Array, extras: Extras
) -> FittedAxis:
    """The axis with these values, ready to be simulated."""
    problem = Problem.of(
        experiments,
        axis,
        law,
        vector,
        inertia=vector.named(u)["inertia"],
        harmonic_period=extras.harmonic_period,
    )
    return FittedAxis(problem.weighted(u).resolved(u), u)


def predicted(law: Law, asked: Asked, evidence: Evidence, notes: Sequence[str]) -> Identification:
    """Each number from the estimator that shows it, misfits of the simulation with these values."""
    experiments, axis, inverse, sliding = (
        evidence.experiments,
        evidence.axis,
        evidence.inverse,
        evidence.sliding,
    )
    result = axis_prediction(
        experiments, axis, law, first=inverse, values=asked.values, free=asked.free, frozen=asked.frozen,
        extras=asked.extras,
    )  # fmt: skip
    estimates, said = checked(result, evidence)
    if evidence.exponent_open:
        better, other, by = predicted_with(experiments, axis, law, inverse, asked, result, sliding, estimates)
        if better is not result:
            result = better
            estimates, said = checked(result, evidence)
        estimates, said = with_other(estimates, result, other), [*by, *said]
    u = result.vector.coordinates(result.vector.named(result.u) | {e.name: e.value for e in estimates})
    fitted = with_values(experiments, axis, law, result.vector, u, asked.extras)
    estimates = tuple(replace(e, unit=axis.unit(e.unit)) for e in estimates)
    found = assembled(
        fitted,
        estimates,
        result.correlation(),
        inverse,
        evidence.validation,
        evidence.candidates,
        [*notes, *said],
        sliding,
    )
    return noted(replace(found, details={**found.details, "prediction": result}))


def against_sliding(
    found: OutputError, evidence: Evidence
) -> tuple[FittedAxis, tuple[Estimate, ...], list[str]]:
    """An output error that stands in for the prediction error, held against what else the records tell."""
    problem = found.problem
    estimates, said = checked(Fitted(problem.vector, found.u, found.model, found.fit.estimates), evidence)
    u = problem.vector.coordinates(problem.vector.named(found.u) | {e.name: e.value for e in estimates})
    shown = tuple(replace(e, unit=problem.axis.unit(e.unit)) for e in estimates)
    return FittedAxis(problem, u), shown, said


class Fitted(NamedTuple):
    """What a fit by simulation says: parameters, where it ended, and how sure it is."""

    vector: Vector
    u: Array
    model: Model
    estimates: tuple[Estimate, ...]


def checked(result: PredictionError | Fitted, evidence: Evidence) -> tuple[tuple[Estimate, ...], list[str]]:
    """Estimates of a fit by simulation, held against what else the records tell; and what is to be said."""
    experiments, axis, inverse, sliding = (
        evidence.experiments,
        evidence.axis,
        evidence.inverse,
        evidence.sliding,
    )
    estimates, u, said = result.estimates, result.u, list[str]()
    if sliding is not None:
        scale = result.vector.signed_scale(sliding.friction)
        estimates, said = agreed(estimates, sliding, result.vector, inverse, scale)
        if not sliding.held_for(HELD) or sliding.bands[0].may_give:
            why = IN_SERIES if sliding.held_for(HELD) else ONLY_REVERSALS
            estimates = untold_by_reversals(estimates, result.model, sliding, why)
        u = result.vector.coordinates(
            result.vector.named(u) | {e.name: e.value for e in estimates if e.name in TOLD_BY_SLIDING}
        )
    estimates = evident(estimates, result.vector, u, experiments, axis)
    if evidence.unchecked and inverse is not None:
        estimates = held_against(estimates, inverse)
    if sliding is None:
        return estimates, said
    if inverse is not None:
        estimates, more = beside_plain(estimates, result.model, result.vector, inverse, sliding)
        said = [*said, *more]
    estimates = told_apart(estimates, sliding, result.model, inverse)
    return (estimates if known_to_act(sliding) else with_level(estimates)), said
