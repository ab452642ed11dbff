"""Choice of the law: every candidate is fitted to one part of the records and scored on the rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.spec import Law
from stickslip.identification.estimate import silent
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import feasible
from stickslip.identification.fit.parallel import mapped
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.observer.innovations import BAND, DELAY, FIRST, Criterion, robust_std
from stickslip.identification.observer.observer import Motion, Prepared, prepare
from stickslip.identification.output_error.search import Asked, errors_of, fitted_axis
from stickslip.identification.output_error.starts import motion_of, watched
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.identification.slow_motion import Evidence, held_elsewhere, search_law, start_beside
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

BLOCKS = 20
"""Blocks of the held-out data, whose scores vary by chance."""
HELD_OUT = 0.3
"""Last part of every record, held out if no validation record is given."""
COMPARABLE = 1e-2
"""Relative decrease of the sum of squares at which a comparing output-error fit stops: laws differ by more."""
SEARCH = 30
"""Most simulations of a search in the comparison."""


@dataclass(frozen=True)
class Candidate:
    """One law in the comparison.

    Attributes
    ----------
    law : str
    parameters : int
        Number of free parameters.
    held_out : mapping of str to float
        Errors on data that were not fitted.
    score : array
        Mean squared misfit of each block of held-out data, under weights common to all laws.
    start : mapping
        The fitted values: starting values of the fit to all data.
    failure : str
        Reason why it could not be fitted; empty otherwise.
    """

    law: str
    parameters: int
    held_out: Mapping[str, float]
    score: Array
    start: Mapping[str, Any]
    failure: str = ""


def hold_out(
    experiments: Sequence[Experiment], validation: Sequence[Experiment]
) -> tuple[list[Experiment], list[Experiment]]:
    """Return the experiments to fit and those to compare laws on."""
    if validation:
        return list(experiments), list(validation)
    pairs = [t.split(HELD_OUT) for t in experiments]
    return [a for a, _ in pairs], [b for _, b in pairs]


def compare_laws(
    evidence: Evidence, held: Sequence[Experiment], laws: Sequence[Law], asked: Asked,
    progress: Callable[[str], None] = silent,
) -> list[Candidate]:  # fmt: skip
    """Fit every law to slow motion and score the torque that it lacks on the held-out data.

    Parameters
    ----------
    evidence : Evidence
        Its experiments are fitted.
    held : sequence of Experiment
        Only the rows that count are scored.
    laws : sequence of Law
    asked : Asked
    progress : callable
        Called with the name of each law as its fit starts.

    Raises
    ------
    InputError
        If a record has no drive signal, too little is held out, or no law could be fitted.
    """
    followed = watched(evidence.experiments, evidence.axis, asked)

    def search(law: Law) -> tuple[Criterion, Array] | str:
        progress(f"{law.name}: law {laws.index(law) + 1} of {len(laws)}")
        try:
            return search_law(evidence, law, asked_of(law, asked, laws), followed, SEARCH)
        except InputError as error:
            return str(error)

    searches = dict(zip((law.name for law in laws), mapped(search, laws), strict=True))
    found = {name: result for name, result in searches.items() if not isinstance(result, str)}
    failures = {name: result for name, result in searches.items() if isinstance(result, str)}
    if not found:
        raise InputError("; ".join(failures.values()))
    # The weights of the law with the smallest fitted residual apply to all.
    criterion, u = min(found.values(), key=lambda f: robust_std(replace(f[0], whitening=FIRST).white(f[1])))
    weights = criterion.adapted(u)
    seen, level = [motion_of(t) for t in held], abs(start_beside(evidence).coulomb)

    def judge(law: Law) -> Candidate:
        if law.name not in found:
            return failed(law, failures[law.name])
        return judged(law, *found[law.name], weights, held, seen, level)

    return mapped(judge, laws)


def judged(
    law: Law, criterion: Criterion, u: Array, weights: Criterion, held: Sequence[Experiment], motions: Sequence[Motion],
    friction: float,
) -> Candidate:  # fmt: skip
    """Score a fitted law by the torque that it lacks on the held-out data, under the common weights."""
    inertia = criterion.vector.named(u)["inertia"]
    # The held-out drive signals are already aligned with the time at which they acted.
    vector = held_elsewhere(criterion.vector, DELAY, -0.5 * held[0].period)
    own = replace(weights, law=law, vector=vector, mechanics=criterion.mechanics, prior=None)
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
    """Return a candidate that could not be fitted."""
    return Candidate(law.name, 0, {}, np.full(BLOCKS, math.inf), {}, why)


def lacking(criterion: Criterion, record: Prepared, u: Array, experiment: Experiment) -> Array:
    """Return the squared corrections of one experiment, scaled and outlier-weighted, in the rows that count."""
    time = record.course.drive.time[record.edge : -record.edge : record.stride]
    counts = np.interp(
        time[criterion.whitening.size - 1 :], experiment.time, experiment.rows.astype(np.float64)
    )
    return replace(criterion, records=[record]).residuals(u)[counts > 0.5] ** 2


def compare_by_output(
    fitted: Sequence[Experiment], held: Sequence[Experiment], axis: ServoAxis, laws: Sequence[Law],
    inverse: InverseDynamics | None, asked: Asked, progress: Callable[[str], None] = silent,
) -> list[Candidate]:  # fmt: skip
    """Compare laws by the simulation's output error, for records without the drive's signal."""
    out: list[Candidate] = []
    weights: Mapping[str, float] | None = None
    for number, law in enumerate(laws, 1):
        progress(f"{law.name}: law {number} of {len(laws)}")
        try:
            result = fitted_axis(fitted, axis, law, inverse, asked_of(law, asked, laws), tolerance=COMPARABLE)
        except InputError as error:
            out.append(failed(law, str(error)))
            continue
        weights = weights or result.problem.weights
        misfits = result.misfits(held)
        size = np.array([weights[s] for s in result.problem.signals])
        squares = np.concatenate([np.sum((m / size) ** 2, axis=1) for m in misfits])
        score = np.array([float(np.mean(part)) for part in np.array_split(squares, BLOCKS)])
        errors = errors_of(held, result.problem.signals, misfits)
        start = values_of(result.problem.vector, result.u, result.model)
        out.append(Candidate(law.name, result.problem.vector.size, errors, score, start))
    if all(c.failure for c in out):
        raise InputError("; ".join(c.failure for c in out))
    return out


def asked_of(law: Law, asked: Asked, laws: Sequence[Law]) -> Asked:
    """Return the request without names that only other candidate laws have; naming those is no mistake."""
    own = {f.name for f in law.fields}
    others = {f.name for x in laws for f in x.fields} - own

    def meant(name: str) -> bool:
        return name.partition("[")[0] not in others

    values = {k: v for k, v in asked.values.items() if meant(k)}
    return replace(
        asked, free=[*filter(meant, asked.free)], frozen=[*filter(meant, asked.frozen)], values=values
    )


def values_of(vector: Vector, u: Array, model: Model) -> dict[str, Any]:
    """Return a fit's values of the law's parameters, those of elements as lists."""
    law = model.as_dict()
    return {f.name: law[f.name] for f in model.law.fields}


def choose(candidates: Sequence[Candidate]) -> int:
    """Return the index of the law with the fewest parameters within one SE of the best (Hastie et al. 2009, 7.10)."""
    means = [float(np.mean(c.score)) for c in candidates]
    best = int(np.nanargmin(means))
    near = [best]
    for i, c in enumerate(candidates):
        if i == best or c.failure or not np.all(np.isfinite(c.score)):
            continue
        difference = c.score - candidates[best].score
        error = float(np.std(difference, ddof=1)) / math.sqrt(difference.size)
        if float(np.mean(difference)) <= error:
            near.append(i)
    return min(near, key=lambda i: (candidates[i].parameters, means[i]))


def note_on(candidates: Sequence[Candidate], chosen: str) -> str:
    """Return the comparison's result as a sentence."""
    parts = [
        f"{c.law} {'failed' if c.failure else f'{math.sqrt(float(np.mean(c.score))):.3g}'}"
        for c in candidates
    ]
    return (
        f"Law {chosen!r} is the simplest within one standard error of the best held-out misfit (in standard "
        f"deviations: {', '.join(parts)})."
    )
