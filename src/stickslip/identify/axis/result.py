"""What an identification of an axis hands back: numbers that the record can hold, errors, and what is to be said."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.identify.axis.choice import (
    Candidate,
)  # fmt: skip
from stickslip.identify.axis.falling import NOT_TOGETHER, number_of, with_rest
from stickslip.identify.axis.form import TOLD_BY_SLIDING, static_by_name, told_with
from stickslip.identify.axis.gravity import within_a_turn
from stickslip.identify.axis.load_check import ADVICE, judged_load
from stickslip.identify.axis.loop_check import doubted_loops
from stickslip.identify.axis.output import OutputError
from stickslip.identify.axis.search import FittedAxis, errors_of
from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.evidence import within_speeds
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.axis_start import told_by
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.fit.smooth import root_mean_square
from stickslip.identify.monte_carlo import resisting_torque
from stickslip.identify.regression.bands import GAUSSIAN
from stickslip.identify.regression.force_error import force_error, force_error_on, plain_error_on
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.reasons import COGGING, NOT_AS_ONE
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.strokes import stacked
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.simulation.recorded_input.simulation import Mechanics
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]

WINDOW, CREEP = 0.02, 1e-3
"""s over which a speed is averaged; part of the highest below which an axis counts as at rest."""
ONLY_REVERSALS = (
    "only reversals determine it, and the torque is not known to act from row to row as recorded; say so if its column "
    "is the command (--torque-is commanded and --delay 0), or log the command at the drive's own rate"
)
IN_SERIES = (
    "only reversals determine it, and the torque bends as with a load behind a spring, which yields there, too; record "
    "slow reversals with a sensor at the load"
)
HELD_BY_FRICTION = (
    "the friction level is not determined, and friction at rest holds any torque up to its own: a constant torque "
    "shows where the axis slides both ways"
)
WORSE = 2.0
"""Times the force error of plain least squares from which on a model that leaves more torque than there is tells
nothing: of little but standstills both leave as much. Of another program's logs one was ten times worse."""
MOSTLY_MISSED, FAR = 0.4, 0.05
"""Part of the torque where the axis slides that a model may leave at most; and from which on `WORSE` times what plain
least squares leave there counts; of 451 logs of another program nine passed twice, all with wrong models."""
MISSES = "the model leaves {own:.0%} of the torque even where the axis slides"
BESIDE_PLAIN = ", plain least squares {plain:.0%}"
HALF = 0.5
"""Part of the torque that a model may leave where the record has no gross sliding that could confirm it: of tuning
steps over play and cogging such a one had 37 % too much inertia, identified."""
UNCONFIRMED = (
    "the model leaves {own:.0%} of the torque, and the record has too little gross sliding to confirm it"
)
EXPLAINS_NOTHING = (
    "the model leaves {own:.0%} of the torque over the whole record, plain least squares {plain:.0%}: it does not "
    "describe this axis"
)
STRIBECK = ("fs", "vs", "delta_s")
EACH_LEVEL = ("fc", "fc_negative")
EACH_REST_AND_LEVEL = ("fs", "fs_negative", *EACH_LEVEL)
UNEVEN = 0.3
"""Part of friction's level by which either direction may differ from it before a constant torque is likelier: on
another program's axes 24 levels without one were within it and held, 6 that counted one as friction were beyond."""
PERHAPS_A_WEIGHT = (
    "friction of {forward:.4g} and {backward:.4g} {unit} may as well be {middle:.4g} {unit} both ways and a constant "
    "torque of {constant:.4g} {unit} (a weight, a spring, an offset), which one record does not distinguish; leave out "
    "--per-direction"
)
LOOP_OFF = 0.3
"""Relative error of the simulated loop's drive signal from which on its gains are doubted."""


def assembled(
    result: FittedAxis, estimates: Sequence[Estimate], correlation: Array, inverse: InverseDynamics | None,
    validation: Sequence[Experiment], candidates: Sequence[Candidate], notes: Sequence[str],
    sliding: Regression | None = None,
) -> Identification:  # fmt: skip
    """Everything in one `Identification`, but for what is to be said of its intervals."""
    experiments = result.problem.experiments
    estimates = within_a_turn(estimates, np.concatenate([t.position for t in experiments]))
    judged = judged_load(estimates, inverse, result.mechanics)
    if sliding is None:
        judged = constant_torque_told(judged)
        if any(e.name == "fs_negative" for e in judged):
            judged = with_rest(judged)  # no certain sliding says more of either direction
    judged = apart_from_a_weight(judged)
    misfit = errors_of(experiments, result.problem.signals, result.misfits(experiments))
    axis, named = result.problem.axis, result.problem.vector.named(result.u)
    if inverse is not None and inverse.has("fc"):
        misfit["force_relative"] = force_error(inverse, result.model, named)
        misfit["inverse_dynamics_relative"] = inverse.relative_error
    judged = explaining(judged, misfit, confirmed=sliding is not None)
    if sliding is not None:
        misfit |= left_where_it_slides(sliding, result.model, result.mechanics)
        if result.model.law.steady is not None:
            own = left_of(sliding, result.model, result.mechanics)
            judged = explaining_sliding(judged, own, sliding, inverse)
        misfit["slowest_sliding"] = sliding.slowest
        if math.isfinite(sliding.rebuilt):
            misfit["friction_rebuilt_within"] = sliding.rebuilt
    if validation:
        misfit |= {f"held_out_{k}": v for k, v in result.held_out(validation).items()}
        if inverse is not None and inverse.has("fc"):
            misfit["held_out_force_relative"] = force_error_on(
                validation, axis, result.model, named, inverse.cutoff
            )
            misfit["held_out_inverse_dynamics_relative"] = plain_error_on(validation, axis, inverse)
    return Identification(
        "axis",
        result.model,
        judged,
        correlation,
        misfit,
        tuple(notes),
        measure_next=advice(judged, result.problem.law, sliding.doubt if sliding else ""),
        details={
            "mechanics": result.mechanics, "inverse": inverse, "regression": sliding,
            "output": result, "candidates": tuple(candidates),
            "axis": result.problem.axis, "units": result.problem.units,
        },
    )  # fmt: skip


def explaining(
    estimates: Sequence[Estimate], misfit: Mapping[str, float], *, confirmed: bool
) -> tuple[Estimate, ...]:
    """The estimates, none of them identified where the model leaves more of the torque than there is, and plain least
    squares less than half as much; or half of it, where no gross sliding is there to have `confirmed` the numbers."""
    own, plain = misfit.get("force_relative", 0.0), misfit.get("inverse_dynamics_relative", math.inf)
    if math.isfinite(plain) and own > max(1.0, WORSE * plain):
        why = EXPLAINS_NOTHING.format(own=own, plain=plain)
    elif own > HALF and not confirmed:
        why = UNCONFIRMED.format(own=own)
    else:
        return tuple(estimates)
    return tuple(replace(e, identified=False, verdict=why) if e.identified else e for e in estimates)


def explaining_sliding(
    estimates: Sequence[Estimate], left: Array, sliding: Regression, inverse: InverseDynamics | None
) -> tuple[Estimate, ...]:
    """The estimates, none of them identified where the model leaves most of the torque even where the axis slides, or
    far more than plain least squares do, the torque over the position aside that was found; `left`: N·m (N)."""
    nothing = {"inertia": 0.0, "sigma2": 0.0, "fc": 0.0, "offset": 0.0}
    torque = max(sliding.left_by(nothing), 1e-300)
    own, plain = root_mean_square(sliding.beside_orders(left)) / torque, math.inf
    if inverse is not None and inverse.has("fc"):
        plain = sliding.unexplained_by(inverse.numbers()) / torque
    if not (own > MOSTLY_MISSED or (own > FAR and own > WORSE * plain)):
        return tuple(estimates)
    why = MISSES.format(own=own) + (BESIDE_PLAIN.format(plain=plain) if math.isfinite(plain) else "")
    return tuple(replace(e, identified=False, verdict=why) if e.identified else e for e in estimates)


def left_of(sliding: Regression, model: Model, mechanics: Mechanics) -> Array:
    """Torque that the model leaves in the rows of certain sliding, N·m (N), shape (n,)."""
    weight, angle = mechanics.gravity, mechanics.gravity_angle
    frictionless = {
        "inertia": mechanics.inertia, "sigma2": 0.0, "fc": 0.0, "offset": mechanics.offset,
        "gravity_sin": weight * math.cos(angle), "gravity_cos": -weight * math.sin(angle),
    }  # fmt: skip
    return sliding.remainder(frictionless) - resisting_torque(model, stacked(sliding.rows, "speed"))


def left_where_it_slides(sliding: Regression, model: Model, mechanics: Mechanics) -> dict[str, float]:
    """RMS of the torque that the model leaves in gross sliding; and a fall of friction with velocity
    that shows there, but that its law does not have."""
    if model.law.steady is None:
        return {"sliding_rms_Nm": sliding.left}
    left = left_of(sliding, model, mechanics)
    out = {"sliding_rms_Nm": root_mean_square(left)}
    if sliding.shows_a_fall and told_whole(model.law) and told_with(model, sliding):
        fall = sliding.numbers["fs"].value - sliding.numbers["fc"].value
        velocity = number_of("vs", sliding, GAUSSIAN[0]) or sliding.vs
        out |= {"fall_missing_Nm": fall, "fall_missing_velocity": velocity.value}
    return out


def told_whole(law: Law) -> bool:
    """Whether certain sliding tells every parameter of a law."""
    return {f.name for f in law.fields} <= set(TOLD_BY_SLIDING)


def evident(
    estimates: Sequence[Estimate],
    vector: Vector,
    u: Array,
    experiments: Sequence[Experiment],
    axis: ServoAxis,
) -> tuple[Estimate, ...]:
    """The estimates, those refused that the record cannot hold: too high levels, effects at other speeds."""
    largest = max(float(np.max(np.abs(t.torque(axis, speed_of(t))))) for t in experiments)
    speeds = np.concatenate([np.abs(speed_of(t)) for t in experiments])
    moving = speeds[speeds > CREEP * float(np.max(speeds))]
    seen = np.quantile(moving, np.linspace(0.02, 1.0, 50)) if moving.size else np.zeros(0)
    out: list[Estimate] = []
    for e in within_speeds(estimates, vector, u, seen, axis.unit("rad/s")):
        above = e.unit == "N·m" and e.name not in ("offset", "gravity") and e.value > largest
        why = f"a level of friction above the largest torque recorded, {largest:.4g}, cannot be"
        out.append(replace(e, identified=False, verdict=why) if above else e)
    by_name_at_rest = vector.base is None or static_by_name(vector.base)
    for way in ("", NEGATIVE) if by_name_at_rest else ():
        by_name = {e.name: e for e in out}
        rest, level = (by_name[n + way].value if n + way in by_name else math.nan for n in ("fs", "fc"))
        if rest <= level:
            why = f"no fall of friction with velocity shows: fs{way} is not above fc{way}"
            fall = {n + way for n in STRIBECK}
            out = [replace(e, identified=False, verdict=why) if e.name in fall else e for e in out]
        if rest <= level or (rest > largest and level <= largest):
            # No model is to hold a friction at rest that nothing moved against.
            out = [at_level(e, level) if e.name == f"fs{way}" else e for e in out]
    return tuple(out)


def constant_torque_told(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """The estimates, the offset refused where friction's level is not identified."""
    levels = [e for e in estimates if e.name in ("fc", "fc_negative")]
    if not levels or all(e.identified for e in levels):
        return tuple(estimates)
    return tuple(
        replace(e, identified=False, verdict=e.verdict or HELD_BY_FRICTION) if e.name == "offset" else e
        for e in estimates
    )


def apart_from_a_weight(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """The estimates, friction's levels refused where they differ by so much that a constant torque is likelier."""
    why, share = perhaps_a_weight(estimates)
    if share <= UNEVEN:
        return tuple(estimates)
    return tuple(
        replace(e, identified=False, verdict=why) if e.name in EACH_REST_AND_LEVEL and e.identified else e
        for e in estimates
    )


def perhaps_a_weight(estimates: Sequence[Estimate]) -> tuple[str, float]:
    """That levels of either direction may hold a constant torque, in words, and its part of their mean; "" and 0 where
    they differ by no more than their intervals, or a constant torque is among the estimates."""
    level = {e.name: e for e in estimates if e.name in EACH_LEVEL}
    if len(level) < len(EACH_LEVEL) or any(e.name == "offset" for e in estimates):
        return "", 0.0
    forward, backward = (level[n].value for n in EACH_LEVEL)
    middle, constant = 0.5 * (forward + backward), 0.5 * (forward - backward)
    unsure = math.hypot(*(0.5 * (level[n].upper - level[n].lower) for n in EACH_LEVEL))
    share = abs(constant) / max(middle, 1e-300)
    if share <= UNEVEN and abs(forward - backward) <= unsure:
        return "", 0.0
    return PERHAPS_A_WEIGHT.format(
        forward=forward, backward=backward, middle=middle, constant=constant, unit=level["fc"].unit
    ), share


def at_level(e: Estimate, level: float) -> Estimate:
    """Fs with the value of Fc: no fall of friction."""
    return replace(e, value=level, lower=min(e.lower, level), upper=max(e.upper, level))


def speed_of(experiment: Experiment) -> Array:
    """Velocity over `WINDOW` seconds at every row, rad/s (m/s)."""
    reach = max(1, round(0.5 * WINDOW / experiment.period))
    low = np.maximum(np.arange(experiment.time.size) - reach, 0)
    high = np.minimum(np.arange(experiment.time.size) + reach, experiment.time.size - 1)
    return (experiment.position[high] - experiment.position[low]) / (
        experiment.time[high] - experiment.time[low]
    )


def untold_by_reversals(
    estimates: Sequence[Estimate], model: Model, sliding: Regression, why: str
) -> tuple[Estimate, ...]:
    """The estimates, those refused that only reversals tell, for that reason: there a part of a row, or of a drive
    train's twist, counts for as much as they do."""
    v = np.geomspace(1e-4 * sliding.fastest, sliding.fastest, 40)
    steady = {*told_by(model, np.append(-v, v), ()), *TOLD_BY_SLIDING}
    return tuple(
        replace(e, identified=False, verdict=why)
        if e.identified and e.name.partition("[")[0] not in steady else e for e in estimates
    )  # fmt: skip


def noted(found: Identification, *more: str) -> Identification:
    """The same with these notes, and which parameters are not identified."""
    last = on_untold([e.name for e in found.estimates if not e.identified])
    return replace(found, notes=(*found.notes, *more, *strange_loop(found), *rising(found.estimates), *last))


def on_untold(names: Sequence[str]) -> list[str]:
    """What the model's values of numbers that are not identified are worth, in a sentence; nothing where there are
    none."""
    if not names:
        return []
    whose = "value of it is" if len(names) == 1 else "values of these are"
    return [f"Not identified: {', '.join(names)}; the model's {whose} one choice of many that fit as well."]


def strange_loop(found: Identification) -> list[str]:
    """That the loop does not make the drive's signal that was recorded; nothing where it does, or there is none."""
    fitted: FittedAxis = found.details["output"]
    named = fitted.problem.vector.named(fitted.u)
    if others := doubted_loops(fitted.problem.experiments, named["controller_gain"]):
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
        said += ", most of all for what slow motion and break-away determine"
    if ask and all(t.drive is not None for t in result.problem.experiments):
        said += ". --intervals prediction gives honest ones"
    return said + "."


def advice(estimates: Sequence[Estimate], law: Law, doubt: str = "") -> tuple[str, ...]:
    """What to measure to settle what is not identified; `doubt` is why certain sliding is not to be believed."""
    missing = {e.name.partition("[")[0] for e in estimates if not e.identified}
    out: list[str] = []
    units = {f.name: f.par.unit for f in law.fields}
    if any(units.get(n) == "rad/s" for n in missing):
        out.append(
            "Record constant velocities below and around the Stribeck velocity, at least three of them."
        )
    stiff = {n for n in missing if units.get(n) == "N·m/rad" or n in ("sigma1", "k")}
    if any(e.verdict == ONLY_REVERSALS for e in estimates):
        out.append(
            "If the torque's column is the command itself, held from row to row, say so: --torque-is commanded and "
            "--delay 0. Otherwise log it so at the drive's own rate, or say what the column holds (--torque-is) and "
            "how late it acts (--delay)."
        )
    elif stiff:
        out.append(
            "Record slow reversals with a finer position sensor: the pre-sliding range was hardly seen."
        )
    if "load_motor" in missing:
        out.append(ADVICE)
    elif any(NOT_TOGETHER in e.verdict for e in estimates):
        out.append("Log torque and motion by one clock, without filters of their own.")
    elif doubt.startswith(COGGING):
        out.append("Map the torque over the angle on slow turns: `stickslip identify LOG --method cogging`.")
    elif NOT_AS_ONE in doubt:
        out.append("Record longer moves with gentler accelerations: motor and load then move as one.")
    elif "inertia" in missing:
        out.append("Record stronger accelerations.")
    if "fc" in missing:
        out.append(
            "Record stretches at constant speeds, in both directions and at three speeds or more, with gentle ramps "
            "between them: play stays closed there, and friction's level shows by itself."
        )
    return tuple(out)
