"""Which law an axis has: every law is fitted to one part of the records, and judged on the other.

Where the records hold the drive's signal, by the torque that an observer must add there, as the values are found
afterwards (`stickslip.identify.axis.prediction`); else by the output error of the simulation. An open loop that
simulates a wrong inertia drifts so far that the output error tells no law from another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.axis.form import never_falls
from stickslip.identify.axis.prediction import motion_of, searched, watched
from stickslip.identify.axis.search import Asked, errors_of, fitted_axis
from stickslip.identify.estimate import silent
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.axis_start import feasible
from stickslip.identify.fit.parallel import mapped
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.observer.innovations import BAND, FIRST, Criterion, robust_std
from stickslip.identify.observer.observer import Motion, Prepared, prepare
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.regression import Regression
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]

BLOCKS = 20
CLEARLY = 0.75
"""Times the held-out misfit of a simpler law, that a law of more parameters must stay below: parts of one record, and
records of one machine, then have the same law."""
PREDICTED = 2.0
"""Standard deviations of the lowest held-out misfit above which no law is said to predict what was held out."""
COMPARABLE = 1e-2
"""Relative decrease of the sum of squares at which the fits that are compared end: laws differ by more."""
NOT_COMPARED = (
    "Not compared, since friction falls with velocity where the axis slides, and theirs does not: {names}."
)


@dataclass(frozen=True)
class Candidate:
    """One law in the comparison.

    Attributes
    ----------
    law : str
    parameters : int
        Free ones.
    held_out : mapping of str to float
        Errors on data that were not fitted.
    score : array
        Mean squared misfit of each block of held-out data, over weights common to all laws.
    start : mapping
        The values fitted: where the fit to all data starts.
    failure : str
        Why it could not be fitted; empty otherwise.
    """

    law: str
    parameters: int
    held_out: Mapping[str, float]
    score: Array
    start: Mapping[str, Any]
    failure: str = ""


def shortlist(laws: Sequence[Law], sliding: Regression | None) -> tuple[list[Law], list[str]]:
    """The laws worth a comparison, of several, and what is to be said of the others: those without a fall of friction
    are left out where one shows clearly.

    Where none shows it may lie below the speeds of certain sliding.
    """
    if sliding is None or not sliding.shows_a_fall:
        return list(laws), []
    level = [law for law in laws if never_falls(law)]
    if not level or len(level) == len(laws):
        return list(laws), []
    names = ", ".join(law.name for law in level)
    return [law for law in laws if law not in level], [NOT_COMPARED.format(names=names)]


def foreseen(
    fitted: Sequence[Experiment], held: Sequence[Experiment], axis: ServoAxis, laws: Sequence[Law],
    inverse: InverseDynamics, asked: Asked, progress: Callable[[str], None] = silent,
) -> list[Candidate]:  # fmt: skip
    """Fit every law by the prediction error and look at the torque that it lacks on the held-out data.

    Parameters
    ----------
    fitted, held : sequence of Experiment
        With the drive's signal; of those held out only the rows that count are judged.
    axis : ServoAxis
    laws : sequence of Law
    inverse : InverseDynamics
        Where the searches start.
    asked : Asked
    progress : callable
        Is told which law begins.

    Raises
    ------
    InputError
        If a record has no drive signal, too little is held out, or no law could be fitted.
    """
    followed = watched(fitted, axis, asked)

    def search(law: Law) -> tuple[Criterion, Array] | str:
        progress(f"{law.name}: law {laws.index(law) + 1} of {len(laws)}")
        try:
            own = asked_of(law, asked, laws)
            return searched(fitted, axis, law, followed, inverse, own, hops=0, tolerance=COMPARABLE)
        except InputError as error:
            return str(error)

    searches = dict(zip((law.name for law in laws), mapped(search, laws), strict=True))
    found = {name: result for name, result in searches.items() if not isinstance(result, str)}
    failures = {name: result for name, result in searches.items() if isinstance(result, str)}
    if not found:
        raise InputError("; ".join(failures.values()))
    # Weighed for all as by the law that lacks least where it was fitted.
    criterion, u = min(found.values(), key=lambda f: robust_std(replace(f[0], whitening=FIRST).white(f[1])))
    weights = criterion.adapted(u)
    seen = [motion_of(t) for t in held]

    def judge(law: Law) -> Candidate:
        if law.name not in found:
            return failed(law, failures[law.name])
        return foreseen_by(law, *found[law.name], weights, held, seen, abs(inverse.coulomb))

    return mapped(judge, laws)


def foreseen_by(
    law: Law,
    criterion: Criterion,
    u: Array,
    weights: Criterion,
    held: Sequence[Experiment],
    motions: Sequence[Motion],
    friction: float,
) -> Candidate:
    """What one law, fitted, lacks on the held-out data, with the weights common to all."""
    inertia = criterion.vector.named(u)["inertia"]
    own = replace(weights, law=law, vector=criterion.vector, mechanics=criterion.mechanics)
    squares = np.concatenate([
        lacking(own, prepare(m, law, inertia, friction, min(BAND, 0.1 / t.period)), u, t)
        for t, m in zip(held, motions, strict=True)
    ])  # fmt: skip
    if squares.size < BLOCKS:
        raise InputError("the part held out is too short to judge laws on")
    score = np.array([float(np.mean(part)) for part in np.array_split(squares, BLOCKS)])
    parameters = feasible(law, criterion.vector.law_parameters(u))
    assert parameters is not None
    start = values_of(criterion.vector, u, Model(law, **parameters._asdict()))
    return Candidate(law.name, criterion.vector.size, {}, score, start)


def failed(law: Law, why: str) -> Candidate:
    """A law that could not be fitted."""
    return Candidate(law.name, 0, {}, np.full(BLOCKS, math.inf), {}, why)


def lacking(criterion: Criterion, record: Prepared, u: Array, experiment: Experiment) -> Array:
    """Squares of the corrections of one experiment in scales, outliers weighed, in the rows that count."""
    time = record.course.drive.time[record.edge : -record.edge : record.stride]
    used = (
        np.interp(time[criterion.whitening.size - 1 :], experiment.time, experiment.rows.astype(np.float64))
        > 0.5
    )
    return replace(criterion, records=[record]).residuals(u)[used] ** 2


def compared(
    fitted: Sequence[Experiment], held: Sequence[Experiment], axis: ServoAxis, laws: Sequence[Law],
    inverse: InverseDynamics | None, asked: Asked, progress: Callable[[str], None] = silent,
) -> list[Candidate]:  # fmt: skip
    """Fit every law and look at what it says about the held-out data."""
    out: list[Candidate] = []
    weights: Mapping[str, float] | None = None
    for number, law in enumerate(laws, 1):
        progress(f"{law.name}: law {number} of {len(laws)}")
        own = asked_of(law, asked, laws)
        try:
            result = fitted_axis(fitted, axis, law, inverse, own, tolerance=COMPARABLE)
        except InputError as error:
            out.append(failed(law, str(error)))
            continue
        weights = weights or result.problem.weights
        misfits = result.misfits(held)
        size = np.array([weights[s] for s in result.problem.signals])
        squares = np.concatenate([np.sum((m / size) ** 2, axis=1) for m in misfits])
        score = np.array([float(np.mean(part)) for part in np.array_split(squares, BLOCKS)])
        out.append(
            Candidate(
                law.name,
                result.problem.vector.size,
                errors_of(held, result.problem.signals, misfits),
                score,
                values_of(result.problem.vector, result.u, result.model),
            )
        )
    if all(c.failure for c in out):
        raise InputError("; ".join(c.failure for c in out))
    return out


def asked_of(law: Law, asked: Asked, laws: Sequence[Law]) -> Asked:
    """What is asked without what belongs to another of the laws only: to name that is no mistake."""
    own = {f.name for f in law.fields}
    others = {f.name for x in laws for f in x.fields} - own

    def meant(name: str) -> bool:
        return name.partition("[")[0] not in others

    values = {k: v for k, v in asked.values.items() if meant(k)}
    return replace(
        asked, free=[*filter(meant, asked.free)], frozen=[*filter(meant, asked.frozen)], values=values
    )


def values_of(vector: Vector, u: Array, model: Model) -> dict[str, Any]:
    """Every value of a fit, those of elements as lists."""
    plain = {
        k: v for k, v in vector.named(u).items() if "[" not in k or k.startswith(("cos", "sin", "friction_"))
    }
    law = model.as_dict()
    return plain | {f.name: law[f.name] for f in model.law.fields}


def chosen_of(candidates: Sequence[Candidate]) -> int:
    """The simplest law of which no other is clearly better: by more than a standard error, and by a quarter."""
    means = [float(np.mean(c.score)) for c in candidates]
    best = int(np.nanargmin(means))
    near = [best]
    for i, c in enumerate(candidates):
        if i == best or c.failure or not np.all(np.isfinite(c.score)):
            continue
        difference = c.score - candidates[best].score
        error = float(np.std(difference, ddof=1)) / math.sqrt(difference.size)
        if float(np.mean(difference)) <= error or CLEARLY**2 * means[i] <= means[best]:
            near.append(i)
    return min(near, key=lambda i: (candidates[i].parameters, means[i]))


def nothing_foreseen(candidates: Sequence[Candidate]) -> bool:
    """Whether none of the laws predicts what was held out."""
    return min(math.sqrt(float(np.mean(c.score))) for c in candidates) > PREDICTED


def sentence_on(candidates: Sequence[Candidate], chosen: str) -> str:
    """What the comparison showed."""
    parts = [
        f"{c.law} {'failed' if c.failure else f'{math.sqrt(float(np.mean(c.score))):.3g}'}"
        for c in candidates
    ]
    said = (
        f"Law {chosen!r} is the simplest of those that predict what was held out about as well as any: no other's "
        f"held-out misfit is lower by more than 1.25 standard errors (in standard deviations: {', '.join(parts)})."
    )
    if nothing_foreseen(candidates):
        said += (
            " None of them predicts what was held out, which may be unlike the rest (speeds, load): the choice is "
            "unsure; name a law (--law), or give a record to judge them by (--validation)."
        )
    return said
