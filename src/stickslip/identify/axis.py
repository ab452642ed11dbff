"""A whole axis from any record: inertia, gravity or offset, and friction jointly.

First the inverse dynamics (`stickslip.identify.axis_inverse`). Of several laws the error on held-out data chooses
(`stickslip.identify.axis_choice`). Values and intervals are the prediction error's
(`stickslip.identify.axis_prediction`) or, where records lack the drive's signal, the output error's
(`stickslip.identify.axis_output`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip import plugins
from stickslip.errors import InputError, UnknownName
from stickslip.identify.axis_choice import (
    Candidate,
    chosen_of,
    compared,
    foreseen,
    options_of,
    sentence_on,
)  # fmt: skip
from stickslip.identify.axis_inverse import InverseDynamics, inverse_dynamics
from stickslip.identify.axis_output import OutputError, output_error
from stickslip.identify.axis_prediction import axis_prediction
from stickslip.identify.axis_problem import Problem
from stickslip.identify.axis_search import Extras, FittedAxis, errors_of, require_start
from stickslip.identify.axis_trial import Trial
from stickslip.identify.estimate import Estimate, Identification, silent
from stickslip.identify.load_check import ADVICE, judged_load
from stickslip.identify.loop_check import doubted_loops
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

__all__ = ["AUTOMATIC", "Candidate", "identify_axis", "inverse_identification"]

Array = np.ndarray[Any, np.dtype[np.float64]]

AUTOMATIC = ("coulomb", "stribeck", "lugre")
"""Laws among which the held-out error chooses where none is named."""
NO_PREDICTION = "The prediction error cannot be had from these records:"
INTERVALS = ("prediction", "covariance")
LOOP_OFF = 0.3
"""Relative error of the simulated loop's drive signal from which on its gains are doubted."""
HELD_OUT = 0.3
"""Last part of every record that is held out where several laws are compared and no validation record is given."""


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
    """Identify an axis: which law it has, its values, and how sure they are.

    Parameters
    ----------
    trials : sequence of Trial
        Fitted together.
    axis : ServoAxis
    laws : sequence of str or Law
        Names, paths of law files, or laws. Of several, the one with the fewest parameters is taken whose held-out
        error lies within one standard error of the best (Hastie, Tibshirani and Friedman 2009, 7.10).
    validation : sequence of Trial
        Held out. Without any, and with several laws, the last 30 % of every record are held out for the choice
        (the first, where the end is half as fast again as all before), and the chosen law is then fitted to all.
    free, frozen, values, extras
        As in `stickslip.identify.axis_output.output_error`.
    robust, profiles
        As there, for the output error alone; the prediction error weighs outliers anyway.
    per_direction : bool
        Whether the inverse dynamics reported beside it has friction of its own for each direction.
    intervals : {"prediction", "covariance"}
        Values and intervals from the prediction error (`stickslip.identify.axis_prediction`), where the records allow
        it; or from the covariance of the output error, which is too narrow where noise is coloured.
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
    chosen = tried[0]
    own = options_of(chosen, options, tried)
    if len(tried) > 1:
        candidates, by = judged_laws(
            *held_out(trials, validation), axis, tried, inverse, options, intervals, progress
        )
        place = chosen_of(candidates)
        chosen = tried[place]
        own = dict(options_of(chosen, options, tried), values=candidates[place].start)
        notes = [*notes, sentence_on(candidates, chosen.name), *by]
    progress(f"{chosen.name}: all of the data")
    lacking = ""
    if intervals == "prediction":
        try:
            return predicted(trials, axis, chosen, inverse, own, validation, candidates, notes)
        except InputError as error:
            lacking = f"{NO_PREDICTION} {error}."
    result = output_error(trials, axis, chosen, inverse, profiles=profiles, **own)
    found = assembled(
        result, result.estimates, result.fit.correlation, inverse, validation, candidates, notes
    )
    return noted(found, narrow_note(result, ask=not lacking), *filter(None, [lacking]))


def judged_laws(
    fitted: Sequence[Trial], held: Sequence[Trial], axis: ServoAxis, laws: Sequence[Law],
    inverse: InverseDynamics | None, options: Mapping[str, Any], intervals: str, progress: Callable[[str], None],
) -> tuple[list[Candidate], list[str]]:  # fmt: skip
    """The laws judged as the chosen one will be fitted; and what is to be said where that could not be."""
    said: list[str] = []
    if intervals == "prediction" and inverse is not None:
        try:
            return foreseen(fitted, held, axis, laws, inverse, options, progress), said
        except InputError as error:
            said.append(
                f"Laws were compared by the output error of the simulation, not the prediction error: {error}."
            )
    return compared(fitted, held, axis, laws, inverse, options, progress), said


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
        [f"Not identified: {', '.join(missing)}; the model's values of them are one choice among many."]
        if missing
        else []
    )
    return replace(found, notes=(*found.notes, *more, *strange_loop(found), *rising(found.estimates), *last))


def strange_loop(found: Identification) -> list[str]:
    """That the loop does not make the drive's signal that was recorded; nothing where it does, or there is none."""
    fitted: FittedAxis = found.details["output"]
    named = fitted.problem.vector.named(fitted.u)
    if others := doubted_loops(fitted.problem.trials, named["controller_gain"]):
        return others
    off = found.misfit.get("drive_relative", 0.0)
    if off <= LOOP_OFF:
        return []
    return [
        f"The loop simulated makes a drive signal that is {off:.0%} off the recorded one: check its gains and limit."
    ]


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
