"""A whole axis from any record: inertia, gravity or constant torque, friction and delay jointly.

Gross sliding determines inertia, constant torque, gravity, delay and the steady friction curve
(`stickslip.identification.sliding`). Reversals, break-away and slow motion determine a law's other parameters through
its simulation, given those (`stickslip.identification.slow_motion`). Among several laws the error on held-out data
decides (`stickslip.identification.laws`). Records without the drive's signal are fitted by the output error
(`stickslip.identification.output_error.output`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import Note, name_columns, name_option
from stickslip.core.spec import Law
from stickslip.identification.estimate import Estimate, Identification, silent
from stickslip.identification.experiment import Experiment, insist_on_motion
from stickslip.identification.fit.axis_start import each_way
from stickslip.identification.fit.noise import Noise
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.fit.uncertainty import verdict_on
from stickslip.identification.laws import (
    Candidate,
    asked_of,
    choose,
    compare_by_output,
    compare_laws,
    hold_out,
    note_on,
)
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.notes import (
    cause_of,
    on_alternatives,
    on_drift,
    on_exponents,
    on_timing,
    reason_for,
)
from stickslip.identification.output_error.gravity import hanging, within_a_turn
from stickslip.identification.output_error.load_check import ADVICE, judged_load
from stickslip.identification.output_error.loop_check import doubted_loops
from stickslip.identification.output_error.output import OutputError, judged
from stickslip.identification.output_error.problem import Problem, mechanics_parameters
from stickslip.identification.output_error.search import (
    Asked,
    Extras,
    FittedAxis,
    errors_of,
    fitted_axis,
    require_start,
)
from stickslip.identification.regression.force_error import force_error, force_error_on, plain_error_on
from stickslip.identification.regression.inverse import InverseDynamics, inverse_dynamics, refuse_harmonics
from stickslip.identification.search import Asked as SlidingAsked
from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.identification.slow_motion import (
    EXPONENT_NAMES,
    Evidence,
    LawFit,
    correlation_of,
    fit_law,
    means_the_same,
    moments,
)
from stickslip.machines.servo import ServoAxis
from stickslip.models import plugins
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

AUTOMATIC = ("coulomb", "stribeck", "lugre")
"""Candidate laws if none is named; the held-out error decides among them."""
INTERVALS = ("prediction", "covariance")
SLOWEST = 0.25
"""Sample period, s, from which on a record contains no information about an axis's dynamics."""
FALLS = 0.95
"""Probability from which on friction is taken to fall with velocity."""
LOOP_OFF = 0.3
"""Relative error of the simulated loop's drive signal from which on a warning about its gains is given."""
NOT_SIMULATED = "The law was not simulated beside the record:"
USUAL_SPEEDS = np.geomspace(1e-3, 1e2, 40)
"""Speeds at which the meanings of a law's parameters are compared, rad/s (m/s)."""
UNEVEN = 0.3
"""Relative difference of the levels by direction from which on a constant torque is more likely."""
BY_DIRECTION = "A torque offset cannot be distinguished from friction that differs by direction."
BESIDE_AXIS = {"drive_gain", "back_emf", "backlash", "controller_gain", "load_motor", "load_external"}
"""Parts of an axis that sliding does not model: if one is fitted or given, the simulation fits everything."""


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
    estimate: EstimateSliding = estimate_sliding,
    progress: Callable[[str], None] = silent,
) -> Identification:
    """Identify an axis: its law, its parameters and their uncertainty.

    Parameters
    ----------
    experiments : sequence of Experiment
        Fitted together.
    axis : ServoAxis
    laws : sequence of str or Law
        Names, paths of law files, or laws. Of several, the one with the fewest parameters within one standard error of
        the best held-out error is chosen (Hastie, Tibshirani and Friedman 2009, 7.10).
    validation : sequence of Experiment
        Held out. Without any, and with several laws, the last 30 % of every record are held out for the choice (the
        first 30 %, if the end is more than 1.5 times as fast as everything before), and the chosen law is then fitted
        to all.
    free, frozen, values, extras
        As in `stickslip.identification.output_error.output.output_error`.
    robust, profiles
        As there, for the output error only; the prediction error weights outliers down anyway.
    per_direction : bool
        Whether friction has separate parameters for each direction, in every law that allows it. A constant torque
        cannot be distinguished from that: `offset` is held at 0 unless it is free or given.
    intervals : {"prediction", "covariance"}
        From sliding and the prediction error, if the records allow it; or from the covariance of the output error,
        which is too narrow if the noise is coloured.
    skew : float, optional
        Delay of the torque's column relative to the torque that acted, s, if known; estimated otherwise.
    estimate : callable
        `estimate_sliding`, or a memo of it.
    progress : callable
        Called with a short description of each step as it starts.

    Returns
    -------
    Identification
        ``details`` contains ``mechanics``, ``inverse`` (`InverseDynamics` or None), ``sliding`` (`SlidingPosterior` or
        None), ``slow_motion`` (`LawFit`, if a law was simulated), ``output`` (`FittedAxis`) and ``candidates``.

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
    given = dict(values or {})
    if per_direction:
        tried = [each_way(law) for law in tried]
        refuse_known_torque(frozen, given, axis)
        if "offset" not in (*free, *given):
            frozen, given = (*frozen, "offset"), {"offset": 0.0, **given}
    asked = Asked(free, frozen, given, extras, robust)
    refuse_harmonics(experiments, extras.harmonics + extras.friction_harmonics, simulated=True)
    seen = look_at(experiments, axis, asked, tried, per_direction, skew, estimate)
    held_exponent = hold_likeliest_exponent(asked, tried, seen.sliding)
    if seen.start is None:
        require_start(seen.experiments, axis, tried, held_exponent)
    notes, candidates = list(seen.notes), list[Candidate]()
    if per_direction and "offset" in frozen:
        notes.insert(0, BY_DIRECTION)
        refuse_weight(seen.sliding, axis)
    simulated = intervals == "prediction" and seen.start is not None
    if len(tried) > 1:
        fitted, held = hold_out(seen.experiments, validation)
        held = [aligned(t, seen.sliding) for t in held]
        candidates = compared(seen, fitted, held, tried, held_exponent, simulated, progress)
        notes.append(note_on(candidates, tried[choose(candidates)].name))
    place = choose(candidates) if candidates else 0
    chosen = tried[place]
    start: Mapping[str, Any] = candidates[place].start if candidates else {}
    own = asked_of(chosen, asked, tried)
    progress(f"{chosen.name}: all of the data")
    why = ""
    if simulated:
        try:
            exponents = exponents_open(asked, chosen, seen.sliding)
            fit = fit_law(seen.evidence, chosen, own, start, exponents)
            notes += on_exponents(fit.exponents)
            return assembled(seen, chosen, own, fit, validation, candidates, notes)
        except InputError as error:
            why = f"{NOT_SIMULATED} {error}."
    own = asked_of(chosen, held_exponent, tried)
    result = judged(fitted_axis(seen.aligned, axis, chosen, seen.start, own), profiles)
    return by_output(
        seen, result, validation, candidates, [*notes, *filter(None, [why]), narrow_note(result)]
    )


@dataclass(frozen=True, eq=False)
class Seen:
    """Results that do not depend on the law.

    Attributes
    ----------
    recorded, experiments : sequence of Experiment
        As recorded, and without the torque over position and time that sliding found.
    aligned : sequence of Experiment
        The same, with the torque shifted to when it acted.
    axis : ServoAxis
    start : InverseDynamics or None
        Plain least squares, if the records allow it.
    sliding : SlidingPosterior or None
    notes : tuple of str
    """

    recorded: Sequence[Experiment]
    experiments: Sequence[Experiment]
    aligned: Sequence[Experiment]
    axis: ServoAxis
    start: InverseDynamics | None
    sliding: SlidingPosterior | None
    notes: tuple[str, ...]

    @property
    def evidence(self) -> Evidence:
        """Input for a law's simulation; requires `start`."""
        assert self.start is not None
        return Evidence(self.experiments, self.axis, self.start, self.sliding)


def look_at(
    experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked, laws: Sequence[Law], per_direction: bool,
    skew: float | None, estimate: EstimateSliding,
) -> Seen:  # fmt: skip
    """Estimate sliding and plain least squares."""
    recorded, sliding, notes = experiments, None, list[str]()
    driven = all(t.drive is not None for t in experiments)
    if driven and not (
        asked.extras.load or asked.extras.friction_harmonics or BESIDE_AXIS & {*asked.free, *asked.values}
    ):
        try:
            sliding = estimate(experiments, axis, sliding_asked(axis, asked, laws, per_direction, skew))
            notes += [
                *(on_timing(sliding) if skew is None else []),
                *on_drift(sliding),
                *on_alternatives(sliding),
            ]
            if not asked.extras.harmonics:
                experiments = without_alternatives(experiments, axis, sliding)
        except InputError as error:
            notes.append(f"Gross sliding is not used: {error}.")
    moved = [aligned(t, sliding) for t in experiments]
    held = (
        {"offset": float(asked.values["offset"])}
        if "offset" in asked.frozen and "offset" in asked.values
        else {}
    )
    start = None
    try:
        start = inverse_dynamics(
            moved, axis, harmonics=asked.extras.harmonics, harmonic_period=asked.extras.harmonic_period,
            held={} if per_direction else held,
        )  # fmt: skip
    except InputError as error:
        notes.append(f"No inverse dynamics: {error}")
    parts = [
        f"{n} = {float(asked.values[n]):g} {axis.unit(u)}" for n, u in (("inertia", "kg·m²"), ("offset", "N·m"))
        if n in asked.frozen and n in asked.values and not (per_direction and n == "offset")
    ]  # fmt: skip
    known = [f"Known, not fitted: {', '.join(parts)}."] if parts else []
    return Seen(recorded, experiments, moved, axis, start, sliding, (*known, *notes))


def hold_likeliest_exponent(asked: Asked, laws: Sequence[Law], sliding: SlidingPosterior | None) -> Asked:
    """Hold the exponent of friction's fall if no law and no user fixes it, to compare all laws with the same one."""
    for law in laws:
        if exponents := exponents_open(asked, law, sliding):
            likeliest = next(iter(exponents))
            own = {n: likeliest for n in EXPONENT_NAMES if any(f.name == n for f in law.fields)}
            return replace(asked, values={**asked.values, **own})
    return asked


def exponents_open(asked: Asked, law: Law, sliding: SlidingPosterior | None) -> dict[float, float]:
    """Return the exponents of a law's fall with their probabilities from sliding; none if law or user fixes it."""
    has = any(f.name == "delta_s" for f in law.fields)
    if sliding is None or not has or {*EXPONENT_NAMES} & {*asked.free, *asked.values}:
        return {}
    return sliding.exponents


def sliding_asked(
    axis: ServoAxis, asked: Asked, laws: Sequence[Law], per_direction: bool, skew: float | None
) -> SlidingAsked:
    """Return the request for the sliding estimate: held values and the delay.

    Level and slope of friction are held only if every law means these by their names and both directions share them.
    """
    names = {"inertia"} if per_direction else {"inertia", "offset"}
    if not per_direction and all(means_the_same(Model(law, **law.example), USUAL_SPEEDS) for law in laws):
        names |= {"fc", "sigma2"}
    known = {n: float(asked.values[n]) for n in asked.frozen if n in names and n in asked.values}
    period = asked.extras.harmonic_period
    return SlidingAsked(
        axis.gravity == "pendulum", per_direction, skew, known,
        period=None if period == Extras().harmonic_period else period,
    )  # fmt: skip


def without_alternatives(
    experiments: Sequence[Experiment], axis: ServoAxis, sliding: SlidingPosterior
) -> list[Experiment]:
    """Return the experiments without the torque over position and time that sliding found in their drive signals."""
    out = list[Experiment]()
    for number, t in enumerate(experiments):
        record = sliding.rows.sources[number]
        torque = sliding.removable_torque(number)
        gain, _ = axis.drive_gains(t.quantity)
        supply = 1.0 if t.supply is None else t.supply
        if t.drive is None or not np.any(torque) or np.any(supply == 0.0):
            out.append(t)
            continue
        # The column is delayed relative to the torque that acted.
        acted = np.interp(t.time - sliding.numbers["skew"].value, record.time, torque)
        out.append(replace(t, drive=t.drive - acted / (gain * supply)))
    return out


def aligned(experiment: Experiment, sliding: SlidingPosterior | None) -> Experiment:
    """Return the experiment with its drive signal shifted to act from its row to the next, as in simulations."""
    if sliding is None or experiment.drive is None:
        return experiment
    late = sliding.numbers["skew"].value + 0.5 * experiment.period
    return replace(experiment, drive=np.interp(experiment.time + late, experiment.time, experiment.drive))


def compared(
    seen: Seen, fitted: Sequence[Experiment], held: Sequence[Experiment], laws: Sequence[Law], asked: Asked,
    simulated: bool, progress: Callable[[str], None],
) -> list[Candidate]:  # fmt: skip
    """Score the laws by the prediction error as in the final fit, or by the output error if that fails."""
    if simulated:
        try:
            return compare_laws(replace(seen, experiments=fitted).evidence, held, laws, asked, progress)
        except InputError:
            pass
    return compare_by_output(
        [aligned(t, seen.sliding) for t in fitted], held, seen.axis, laws, seen.start, asked, progress
    )


# ---- the answer -----------------------------------------------------------------------------------------------------


def assembled(
    seen: Seen, law: Law, asked: Asked, fit: LawFit, validation: Sequence[Experiment], candidates: Sequence[Candidate],
    notes: Sequence[str],
) -> Identification:  # fmt: skip
    """Combine the axis's parameters from sliding with the law's from slow motion."""
    vector, named = fit.vector, fit.vector.named(fit.u)
    mechanics, correlation = of_axis(seen, asked, fit.vector)
    estimates = (*mechanics, *fit.estimates)
    size = len(mechanics)
    whole = np.eye(len(estimates))
    whole[:size, :size], whole[size:, size:] = correlation, fit.correlation
    problem = Problem.of(
        seen.aligned,
        seen.axis,
        law,
        vector,
        inertia=named["inertia"],
        harmonic_period=asked.extras.harmonic_period,
    )
    fitted = FittedAxis(problem.weighted(fit.u).resolved(fit.u), fit.u)
    estimates = tuple(replace(e, unit=seen.axis.unit(e.unit)) for e in estimates)
    return finished(seen, fitted, estimates, whole, validation, candidates, notes, {"slow_motion": fit})


def of_axis(seen: Seen, asked: Asked, vector: Vector) -> tuple[list[Estimate], Array]:
    """Return inertia, constant torque and gravity from sliding, with their correlation; none without sliding."""
    sliding = seen.sliding
    if sliding is None:
        return [], np.zeros((0, 0))
    scale = max(sliding.numbers["fc"].value, 0.0)
    described = {p.name: p for p in mechanics_parameters(seen.axis, seen.experiments[0].quantity, {}, 0, 0)}
    wanted = (
        ["inertia"] if "gravity_sin" in sliding.names and "offset" in asked.frozen else ["inertia", "offset"]
    )
    wanted = [n for n in wanted if n not in asked.frozen]
    out = [estimate_from(described[n], sliding, n, scale) for n in wanted]
    _, covariance = (
        moments(sliding, [sliding.names.index(n) for n in wanted]) if wanted else (None, np.zeros((0, 0)))
    )
    if "gravity_sin" in sliding.names:
        out += gravity_estimates(described, sliding, scale)
    correlation = np.eye(len(out))
    correlation[: len(wanted), : len(wanted)] = correlation_of(covariance) if wanted else covariance
    return out, correlation


def estimate_from(p: Parameter, sliding: SlidingPosterior, name: str, scale: float) -> Estimate:
    """Return a number of sliding as an estimate with its verdict."""
    number = sliding.numbers[name]
    low, high = max(number.lower, p.par.lower), min(number.upper, p.par.upper)
    value = min(max(number.value, low), high)
    why = verdict_on(
        p, value, low, high, Noise(1.0, "residual", math.inf), 1.0 if p.par.unit == "rad" else scale
    )
    cause, share = cause_of(sliding, name) if why else ("", 0.0)
    why += reason_for(sliding, cause, share)
    return Estimate(
        p.name, p.par.unit, p.par.symbol, value, number.std, low, high, not why, why, cause, share
    )


def gravity_estimates(
    described: Mapping[str, Parameter], sliding: SlidingPosterior, scale: float
) -> list[Estimate]:
    """Return size and angle of a pendulum's gravity from its two amplitudes."""
    sine, cosine = sliding.numbers["gravity_sin"], sliding.numbers["gravity_cos"]
    size, angle = hanging(sine.value, cosine.value, sliding.rows.position)
    along = math.hypot(sine.value * sine.half, cosine.value * cosine.half) / max(size, 1e-300)
    across = math.hypot(cosine.value * sine.half, sine.value * cosine.half) / max(size, 1e-300) ** 2
    out = list[Estimate]()
    for name, value, half, unit in (("gravity", size, along, scale), ("gravity_angle", angle, across, 1.0)):
        p = described[name]
        low, high = max(value - half, p.par.lower), value + half
        why = verdict_on(p, value, low, high, Noise(1.0, "residual", math.inf), unit)
        out.append(Estimate(name, p.par.unit, p.par.symbol, value, half / 1.96, low, high, not why, why))
    return out


def by_output(
    seen: Seen,
    result: OutputError,
    validation: Sequence[Experiment],
    candidates: Sequence[Candidate],
    notes: Sequence[str],
) -> Identification:
    """Return the result of an axis fitted by the output error."""
    return finished(seen, result, result.estimates, result.fit.correlation, validation, candidates, notes, {})


def finished(
    seen: Seen, fitted: FittedAxis, estimates: Sequence[Estimate], correlation: Array, validation: Sequence[Experiment],
    candidates: Sequence[Candidate], notes: Sequence[str], details: Mapping[str, Any],
) -> Identification:  # fmt: skip
    """Combine all results in one `Identification`, with errors and notes."""
    experiments, problem = fitted.problem.experiments, fitted.problem
    estimates = within_a_turn(estimates, np.concatenate([t.position for t in experiments]))
    estimates = apart_from_weight(judged_load(estimates, seen.start, fitted.mechanics))
    misfit = errors_of(experiments, problem.signals, fitted.misfits(experiments))
    named, start = problem.vector.named(fitted.u), seen.start
    if start is not None and start.has("fc"):
        misfit["force_relative"] = force_error(start, fitted.model, named)
        misfit["inverse_dynamics_relative"] = start.relative_error
    if seen.sliding is not None:
        misfit["slowest_sliding"] = seen.sliding.slowest
        if seen.sliding.falls >= FALLS and "fs" not in {f.name for f in problem.law.fields}:
            numbers = seen.sliding.numbers
            fall = numbers["fs"].value - numbers["fc"].value
            misfit |= (
                {"fall_missing_Nm": fall, "fall_missing_velocity": numbers["vs"].value} if fall > 0.0 else {}
            )
    if validation:
        misfit |= {f"held_out_{k}": v for k, v in fitted.held_out(validation).items()}
        if start is not None and start.has("fc"):
            misfit["held_out_force_relative"] = force_error_on(
                validation, seen.axis, fitted.model, named, start.cutoff
            )
            misfit["held_out_inverse_dynamics_relative"] = plain_error_on(validation, seen.axis, start)
    untold = [e.name for e in estimates if not e.identified]
    fit = details.get("slow_motion")
    combined = fit.combinations() if isinstance(fit, LawFit) else list[str]()
    last = (
        [Note(f"Not identified: {', '.join(untold)}; other values fit equally well.", "not-identified")]
        if untold
        else []
    )
    found = Identification(
        "axis", fitted.model, tuple(estimates), correlation, misfit,
        (*notes, *loop_notes(seen, fitted, misfit), *last, *combined),
        measure_next=advice(estimates, problem.law, seen.sliding),
        details={
            "mechanics": fitted.mechanics, "inverse": start, "sliding": seen.sliding, "output": fitted,
            "candidates": tuple(candidates), "axis": seen.axis, "units": problem.units, **details,
        },
    )  # fmt: skip
    return found


def loop_notes(seen: Seen, fitted: FittedAxis, misfit: Mapping[str, float]) -> list[str]:
    """Return a note if the simulated loop does not reproduce the recorded drive signal; none without a loop."""
    named = fitted.problem.vector.named(fitted.u)
    if others := doubted_loops(seen.recorded, named["controller_gain"]):
        return others
    off = misfit.get("drive_relative", 0.0)
    if off <= LOOP_OFF:
        return []
    return [
        f"The loop simulated makes a drive signal that is {off:.0%} off the recorded one: check its gains and limit."
    ]


def narrow_note(result: OutputError) -> str:
    """Return a note that intervals of the output error are too narrow if the noise is coloured."""
    said = "Intervals come from the covariance of the output error: too narrow where noise is coloured"
    if result.problem.law.velocity_scale:
        said += ", most of all for what slow motion and break-away determine"
    return said + "."


def advice(estimates: Sequence[Estimate], law: Law, sliding: SlidingPosterior | None) -> tuple[str, ...]:
    """Return the recordings that would determine what is not identified."""
    missing = {e.name.partition("[")[0] for e in estimates if not e.identified}
    units = {f.name: f.par.unit for f in law.fields}
    out = list[str]()
    if any(units.get(n) == "rad/s" for n in missing):
        out.append(
            "Record constant velocities below and around the Stribeck velocity, at least three of them."
        )
    if any(units.get(n) == "N·m/rad" or n in ("sigma1", "k") for n in missing):
        out.append(
            "Record slow reversals with a finer position sensor: the pre-sliding range was hardly seen."
        )
    causes = dict.fromkeys(e.cause for e in estimates if e.cause and not e.identified)
    remedies = [] if sliding is None else [sliding.alternatives[c].remedy for c in causes]
    out += [f"{r[0].upper()}{r[1:]}." for r in remedies]
    if "load_motor" in missing:
        out.append(ADVICE)
    if "inertia" in missing:
        out.append("Record stronger accelerations.")
    if "fc" in missing:
        out.append(
            "Record constant speeds in both directions, at three speeds or more, with gentle ramps between them: play "
            "stays closed there, and friction's level shows by itself."
        )
    return tuple(out)


# ---- what is refused ------------------------------------------------------------------------------------------------


def refuse_slow(experiments: Sequence[Experiment]) -> None:
    """Refuse records whose samples are too far apart.

    Raises
    ------
    InputError
    """
    for t in experiments:
        if t.period >= SLOWEST:
            raise InputError(
                f"{t.name}: samples are {t.period:.3g} s apart, too far for accelerations and reversals to be seen; "
                f"say the unit of the time if it is wrong ({name_columns(time='COLUMN:ms')}), log faster, or "
                "identify the curve of "
                f"constant speeds with {name_option('method', 'sliding')}"
            )


def refuse_weight(sliding: SlidingPosterior | None, axis: ServoAxis) -> None:
    """Refuse friction per direction that would drive the axis in one of them: a constant torque acts.

    Raises
    ------
    InputError
    """
    if sliding is None or "fc_positive" not in sliding.names:
        return
    level, constant = abs(sliding.numbers["fc"].value), sliding.numbers["offset"].value
    if min(sliding.numbers[n].upper for n in ("fc_positive", "fc_negative")) < 0.0:
        raise InputError(
            f"a constant torque of {constant:.3g} {axis.unit('N·m')} acts, a weight, a spring or an offset, "
            f"larger than friction, {level:.3g}: it cannot be told from a difference between directions; leave "
            f"out {name_option('per_direction', True)}"
        )


def apart_from_weight(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """Return the estimates; levels by direction that differ by more than is usual become not identified."""
    level = {e.name: e for e in estimates if e.name in ("fc", "fc_negative")}
    if len(level) < 2 or any(e.name == "offset" for e in estimates):
        return tuple(estimates)
    forward, backward = level["fc"].value, level["fc_negative"].value
    middle, constant = 0.5 * (forward + backward), 0.5 * (forward - backward)
    if abs(constant) <= UNEVEN * middle:
        return tuple(estimates)
    why = (
        f"friction of {forward:.4g} and {backward:.4g} may as well be {middle:.4g} both ways and a constant torque of "
        f"{constant:.4g} {level['fc'].unit} (a weight, a spring, an offset); leave out "
        f"{name_option('per_direction', True)}"
    )
    both = ("fc", "fs", "fc_negative", "fs_negative")
    return tuple(
        replace(e, identified=False, verdict=why) if e.name in both and e.identified else e for e in estimates
    )


def refuse_known_torque(frozen: Sequence[str], values: Mapping[str, float], axis: ServoAxis) -> None:
    """Refuse a constant torque held together with friction per direction: sliding counts it as friction.

    Raises
    ------
    InputError
    """
    known = values.get("offset", 0.0)
    if "offset" in frozen and known != 0.0:
        raise InputError(
            f"offset = {known:g} {axis.unit('N·m')}: a constant torque that is known is not taken off friction per "
            f"direction; subtract it from the torque's column, or leave out {name_option('per_direction', True)}"
        )
