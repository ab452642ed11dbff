"""A whole axis from any record: inertia, gravity or offset, and friction jointly.

First the inverse dynamics (`stickslip.identify.axis_inverse`), then the output error of the simulated axis for one law
or for several, among which the error on held-out data chooses (`stickslip.identify.axis_output`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip import plugins
from stickslip.errors import InputError, UnknownName
from stickslip.identify.axis_inverse import InverseDynamics, inverse_dynamics
from stickslip.identify.axis_output import OutputError, output_error
from stickslip.identify.axis_prediction import axis_prediction
from stickslip.identify.axis_problem import Problem
from stickslip.identify.axis_search import Extras, FittedAxis, errors_of, fitted_axis, require_start
from stickslip.identify.axis_trial import Trial
from stickslip.identify.estimate import Estimate, Identification, silent
from stickslip.identify.load_check import ADVICE, judged_load
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

__all__ = ["AUTOMATIC", "Candidate", "identify_axis", "inverse_identification"]

Array = np.ndarray[Any, np.dtype[np.float64]]

AUTOMATIC = ("coulomb", "stribeck", "lugre")
"""Laws among which the held-out error chooses where none is named."""
NO_PREDICTION = "The prediction error cannot be had from these records:"
INTERVALS = ("prediction", "covariance")
HELD_OUT = 0.3
"""Last part of every record that is held out where several laws are compared and no validation record is given."""
BLOCKS = 20
COMPARABLE = 1e-2
"""Relative decrease of the sum of squares at which the fits that are compared end: laws differ by more."""


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
        The values fitted: where the output error of all data starts.
    failure : str
        Why it could not be fitted; empty otherwise.
    """

    law: str
    parameters: int
    held_out: Mapping[str, float]
    score: Array
    start: Mapping[str, Any]
    failure: str = ""


def identify_axis(
    trials: Sequence[Trial],
    axis: ServoAxis,
    laws: Sequence[str | Law] = AUTOMATIC,
    *,
    validation: Sequence[Trial] = (),
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    values: Mapping[str, Any] | None = None,
    extras: Extras = Extras(),  # noqa: B008 (frozen)
    per_direction: bool = False,
    robust: bool = False,
    profiles: bool = False,
    intervals: str = "prediction",
    progress: Callable[[str], None] = silent,
) -> Identification:
    """Identify an axis: by output error, which law; by prediction error, its values and how sure they are.

    Parameters
    ----------
    trials : sequence of Trial
        Fitted together.
    axis : ServoAxis
    laws : sequence of str or Law
        Names, paths of law files, or laws. Of several, the one with the fewest parameters is taken whose held-out
        error lies within one standard error of the best (Hastie, Tibshirani and Friedman 2009, 7.10).
    validation : sequence of Trial
        Held out. Without any, and with several laws, the last 30 % of every record are held out for the choice,
        and the chosen law is then fitted to all.
    free, frozen, values, extras
        As in `stickslip.identify.axis_output.output_error`.
    robust, profiles
        As there, for the output error alone: the comparison of laws and the covariance's intervals. The prediction
        error weighs outliers anyway.
    per_direction : bool
        Whether the inverse dynamics reported beside it has friction of its own for each direction.
    intervals : {"prediction", "covariance"}
        Values and intervals from the prediction error (`stickslip.identify.axis_prediction`), where the records allow
        it; or from the covariance of the output error: in half the time, and too narrow where noise is coloured.
    progress : callable
        Is told what begins, in a few words.

    Returns
    -------
    Identification
        ``details`` holds ``mechanics``, ``inverse`` (`InverseDynamics` or None), ``output`` (`FittedAxis`) and
        ``candidates``.

    Raises
    ------
    InputError
        If the records do not allow it, or no law could be fitted.
    """
    if not laws:
        raise InputError("no law to identify; name at least one")
    if intervals not in INTERVALS:
        raise UnknownName("source of intervals", intervals, INTERVALS)
    tried = [plugins.law(x) if isinstance(x, str) else x for x in laws]
    options: dict[str, Any] = {
        "free": free, "frozen": frozen, "values": values, "extras": extras, "robust": robust
    }  # fmt: skip
    inverse, notes = first_look(trials, axis, extras, per_direction)
    if inverse is None:
        require_start(trials, axis, tried, dict(values or {}), extras)
    candidates: list[Candidate] = []
    chosen, start = tried[0], values
    if len(tried) > 1:
        candidates = compared(*held_out(trials, validation), axis, tried, inverse, options, progress)
        place = chosen_of(candidates)
        chosen, start = tried[place], candidates[place].start
        notes = [*notes, sentence_on(candidates, chosen.name)]
    own = options_of(chosen, options, tried)
    progress(f"{chosen.name}: all of the data")
    lacking = ""
    if intervals == "prediction":
        try:
            return predicted(trials, axis, chosen, inverse, own, validation, candidates, notes)
        except InputError as error:
            lacking = f"{NO_PREDICTION} {error}."
    result = output_error(
        trials, axis, chosen, inverse, profiles=profiles, **dict[str, Any](own, values=start)
    )
    found = assembled(
        result, result.estimates, result.fit.correlation, inverse, validation, candidates, notes
    )
    return noted(found, narrow_note(result, ask=not lacking), *filter(None, [lacking]))


def predicted(
    trials: Sequence[Trial], axis: ServoAxis, law: Law, inverse: InverseDynamics | None, options: Mapping[str, Any],
    validation: Sequence[Trial], candidates: Sequence[Candidate], notes: Sequence[str],
) -> Identification:  # fmt: skip
    """Values and intervals of the prediction error, misfits of the simulation with these values."""
    given = {k: v for k, v in options.items() if k != "robust"}
    result = axis_prediction(trials, axis, law, first=inverse, **given)
    problem = Problem.of(
        trials, axis, law, result.vector, inertia=result.mechanics.inertia,
        harmonic_period=options["extras"].harmonic_period,
    )  # fmt: skip
    fitted = FittedAxis(problem.weighted(result.u).resolved(result.u), result.u)
    estimates = tuple(replace(e, unit=axis.unit(e.unit)) for e in result.estimates)
    found = assembled(fitted, estimates, result.correlation(), inverse, validation, candidates, notes)
    return noted(replace(found, details={**found.details, "prediction": result}))


def held_out(trials: Sequence[Trial], validation: Sequence[Trial]) -> tuple[list[Trial], list[Trial]]:
    """What laws are fitted to, and what they are compared on."""
    if validation:
        return list(trials), list(validation)
    pairs = [t.split(HELD_OUT) for t in trials]
    return [a for a, _ in pairs], [b for _, b in pairs]


def first_look(
    trials: Sequence[Trial], axis: ServoAxis, extras: Extras, per_direction: bool
) -> tuple[InverseDynamics | None, list[str]]:
    """The inverse dynamics, where the records allow one."""
    try:
        found = inverse_dynamics(
            trials, axis, harmonics=extras.harmonics, harmonic_period=extras.harmonic_period
        )
    except InputError as error:
        return None, [f"No inverse dynamics: {error}"]
    notes: list[str] = []
    if per_direction:
        each = inverse_dynamics(trials, axis, per_direction=True, harmonics=extras.harmonics)
        notes.append(
            f"Per direction: Fc {each['fc_plus']:.4g} and {each['fc_minus']:.4g}, Fv {each['fv_plus']:.4g} and "
            f"{each['fv_minus']:.4g}; relative error {100 * each.relative_error:.2f} % instead of "
            f"{100 * found.relative_error:.2f} %."
        )
    return found, notes


# ---- the choice among laws ------------------------------------------------------------------------------------


def compared(
    fitted: Sequence[Trial], held: Sequence[Trial], axis: ServoAxis, laws: Sequence[Law],
    inverse: InverseDynamics | None, options: Mapping[str, Any], progress: Callable[[str], None] = silent,
) -> list[Candidate]:  # fmt: skip
    """Fit every law and look at what it says about the held-out data."""
    out: list[Candidate] = []
    weights: Mapping[str, float] | None = None
    for number, law in enumerate(laws, 1):
        progress(f"{law.name}: law {number} of {len(laws)}")
        own = options_of(law, options, laws)
        try:
            result = fitted_axis(fitted, axis, law, inverse, tolerance=COMPARABLE, **own)
        except InputError as error:
            out.append(Candidate(law.name, 0, {}, np.full(BLOCKS, math.inf), {}, str(error)))
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
                fitted_values(result),
            )
        )
    if all(c.failure for c in out):
        raise InputError("; ".join(c.failure for c in out))
    return out


def options_of(law: Law, options: Mapping[str, Any], laws: Sequence[Law]) -> dict[str, Any]:
    """The options without what belongs to another of the laws only: to name that is no mistake."""
    own = {f.name for f in law.fields}
    others = {f.name for x in laws for f in x.fields} - own

    def meant(name: str) -> bool:
        return name.partition("[")[0] not in others

    values = {k: v for k, v in dict[str, Any](options["values"] or {}).items() if meant(k)}
    return {
        **options, "free": [*filter(meant, options["free"])], "frozen": [*filter(meant, options["frozen"])],
        "values": values,
    }  # fmt: skip


def fitted_values(result: FittedAxis) -> dict[str, Any]:
    """Every value of a fit, those of elements as lists."""
    plain = {
        k: v
        for k, v in result.problem.vector.named(result.u).items()
        if "[" not in k or k.startswith(("cos", "sin", "friction_"))
    }
    law = result.model.as_dict()
    return plain | {f.name: law[f.name] for f in result.problem.law.fields}


def chosen_of(candidates: Sequence[Candidate]) -> int:
    """The simplest law within one standard error of the best."""
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


def sentence_on(candidates: Sequence[Candidate], chosen: str) -> str:
    """What the comparison showed."""
    parts = [
        f"{c.law} {'failed' if c.failure else f'{math.sqrt(float(np.mean(c.score))):.3g}'}"
        for c in candidates
    ]
    return (
        f"Law {chosen!r} is the simplest within one standard error of the lowest held-out misfit (in standard "
        f"deviations: {', '.join(parts)})."
    )


# ---- the result ------------------------------------------------------------------------------------------------


def assembled(
    result: FittedAxis, estimates: Sequence[Estimate], correlation: Array, inverse: InverseDynamics | None,
    validation: Sequence[Trial], candidates: Sequence[Candidate], notes: Sequence[str],
) -> Identification:  # fmt: skip
    """Everything in one `Identification`, but for what is to be said of its intervals."""
    trials, judged = result.problem.trials, judged_load(estimates, inverse, result.mechanics)
    misfit = errors_of(trials, result.problem.signals, result.misfits(trials))
    if inverse is not None:
        misfit["inverse_dynamics_relative"] = inverse.relative_error
    if validation:
        misfit |= {f"held_out_{k}": v for k, v in result.held_out(validation).items()}
    return Identification(
        "axis",
        result.model,
        judged,
        correlation,
        misfit,
        tuple(notes),
        measure_next=advice(judged, result.problem.law),
        details={
            "mechanics": result.mechanics, "inverse": inverse, "output": result, "candidates": tuple(candidates),
            "axis": result.problem.axis, "units": result.problem.units,
        },
    )  # fmt: skip


def noted(found: Identification, *more: str) -> Identification:
    """The same with these notes, and which parameters are not identified."""
    missing = [e.name for e in found.estimates if not e.identified]
    last = (
        [f"Not identified: {', '.join(missing)}; their values are one choice among many."] if missing else []
    )
    return replace(found, notes=(*found.notes, *more, *rising(found.estimates), *last))


def rising(estimates: Sequence[Estimate]) -> list[str]:
    """That friction rises with the speed where a Stribeck effect would let it fall; empty where the data do not say."""
    by_name = {e.name: e for e in estimates}
    if not {"fs", "fc"} <= by_name.keys() or not by_name["fs"].upper < by_name["fc"].lower:
        return []
    return ["fs lies below fc: friction rises from rest to vs; these records show no Stribeck effect."]


def narrow_note(result: OutputError, ask: bool = True) -> str:
    """That the intervals are too narrow where noise is coloured; where friction has a velocity of its own, by far."""
    said = "Intervals come from the covariance of the output error: too narrow where noise is coloured"
    if result.problem.law.velocity_scale:
        said += ", most of all for what slow motion and break-away tell"
    if ask and all(t.drive is not None for t in result.problem.trials):
        said += ". --intervals prediction gives honest ones"
    return said + "."


def advice(estimates: Sequence[Estimate], law: Law) -> tuple[str, ...]:
    """What to measure to settle what is not identified."""
    missing = {e.name.partition("[")[0] for e in estimates if not e.identified}
    out: list[str] = []
    units = {f.name: f.par.unit for f in law.fields}
    if any(units.get(n) == "rad/s" for n in missing):
        out.append(
            "Record constant velocities below and around the Stribeck velocity, at least three of them."
        )
    stiff = {n for n in missing if units.get(n) == "N·m/rad" or n in ("sigma1", "k")}
    if stiff:
        out.append(
            "Record slow reversals with a finer position sensor: the pre-sliding range was hardly seen."
        )
    if "load_motor" in missing:
        out.append(ADVICE)
    elif "inertia" in missing:
        out.append("Record stronger accelerations.")
    return tuple(out)


def inverse_identification(found: InverseDynamics, axis: ServoAxis) -> Identification:
    """The inverse dynamics as an `Identification`, its friction as the law ``coulomb``.

    Per direction the law has the mean of both, and the estimates say what each is.
    """
    estimates: list[Estimate] = []
    for name, unit, value, std in zip(found.names, found.units, found.values, found.robust_std, strict=True):
        low, high = float(value - 1.96 * std), float(value + 1.96 * std)
        signed = not name.startswith(("inertia", "fc", "fv"))
        if signed:
            good = bool(1.96 * std <= 0.05 * abs(found.coulomb))
        else:
            good = low > 0.0 and high <= 2.0 * low
        why = "" if good else "its interval is too wide"
        estimates.append(Estimate(name, unit, name, float(value), float(std), low, high, good, why))
    std = np.sqrt(np.diag(found.covariance))
    model = Model("coulomb", fc=max(found.coulomb, 0.0), sigma2=max(found.viscous, 0.0))
    return Identification(
        "inverse dynamics", model, tuple(estimates), found.covariance / np.outer(std, std),
        {"inverse_dynamics_relative": found.relative_error},
        (f"Position filtered at {found.cutoff:.4g} Hz, decimated to {found.band:.4g} Hz; intervals allow for the "
         "correlation of the residuals.",),
        details={"inverse": found, "axis": axis, "classic_std": dict(zip(found.names, found.std.tolist()))},
    )  # fmt: skip
