"""What several estimators say of one axis, and which of them a number is taken from.

Inertia, offset, gravity and the level and slope of friction are those of the regression on certain sliding
(`stickslip.identify.regression.regression`), which assumes nothing about the hold of the torque or about reversals; the
prediction error (`stickslip.identify.axis.prediction`) tells what only slow motion and reversals show. Where both
contradict each other, what it alone says is not called identified, and the reason is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.errors import InputError
from stickslip.identify.axis.falling import (
    FALL,
    SAME,
    fall_each_way,
    fall_together,
    told,
    with_rest,
    within_sliding,
)
from stickslip.identify.axis.form import told_with
from stickslip.identify.axis.gravity import hanging
from stickslip.identify.axis.plain_numbers import plain_each_way, plain_value
from stickslip.identify.axis.settled import ALONE, APART, TWO_METHODS
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.parameter_vector import Parameter, Vector
from stickslip.identify.fit.uncertainty import RATIO
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.narrow import LATE_FALL, SMOOTHED, falls_late, inertia_alone, smoothed_by
from stickslip.identify.regression.reasons import DROWNED
from stickslip.identify.regression.regression import QUANTILE, Regression, regress_axis
from stickslip.identify.regression.regressions import Regress
from stickslip.identify.regression.strokes import stacked
from stickslip.identify.regression.together import bend_of, bends_by_itself
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model

ALIGNED = 0.1
"""Rows by which a torque that acts from row to row must be off its row to be moved."""
KNOWN = 0.5
"""Rows: the skew's half-width up to which it says anything about the hold of the torque."""
AS_GOOD = 1.5
"""Times as much as the regression leaves of the torque in certain sliding, that other values may leave and still
stand."""
CONTRADICTS = 0.2
"""Part of the larger of two methods' numbers, by which they may differ where one is identified: the other is what four
lines of least squares give."""
DOUBT = "the prediction error, the only evidence for it, contradicts gross sliding on {name}: {other} against {own}"
ONE_BAND = (
    "two methods are apart: the prediction error says {other.value:.4g}, gross sliding, of which one band of "
    "frequencies alone shows it, {own.value:.4g} {own.unit}"
)
BAND_ALONE = (
    "one band of frequencies alone shows it, where level and slope, or motor and load, are not distinguished"
)
OTHER_FORM = "slower steady motion has another friction than this level and slope"
BENT = (
    "friction rises ever {how} with velocity: over the recorded speeds its curve is {share:.0%} of Fc off any "
    "level, slope and fall"
)
OR_SWINGS = (
    "the torque bends with velocity by {share:.0%} of Fc, as friction of another form or a load that swings bends it: "
    "this record does not tell which"
)
SWINGS = "a load that swings may be what bends the torque with velocity: motor and load then do not accelerate as one"
LEVELS = ("fc", "sigma2", *FALL)
"""What sliding alone tells of friction; that of v < 0 too where it has parameters of its own."""
UNSEEN = (
    "the record slides too little in one direction to tell a level of friction, or when the torque acted; record "
    "longer motion in one direction"
)
UNDECIDED = (
    "the prediction error says {name} {own}, the plain inverse dynamics {other}, and the record slides too little in "
    "one direction to decide"
)


def regressed(
    experiments: Sequence[Experiment], axis: ServoAxis, skew: float | None, harmonic_period: float | None = None,
    regress: Regress = regress_axis, each_way: bool = False, known: Mapping[str, float] | None = None,
) -> tuple[Regression | None, list[str]]:  # fmt: skip
    """The regression on certain sliding, where the records allow it; else why they do not."""
    # What the doctor has asked is asked again.
    ways = ({"each_way": True} if each_way else {}) | ({"known": known} if known else {})
    if any(t.drive is None for t in experiments):
        return None, []
    try:
        return regress(experiments, axis, skew=skew, harmonic_period=harmonic_period, **ways), []
    except InputError as error:
        return None, [f"No regression on gross sliding: {error}."]


def aligned(experiments: Sequence[Experiment], found: Regression | None) -> list[Experiment]:
    """The experiments, their drive's signal moved so that it acts from its row to the next, as simulations take it."""
    if found is None:
        return list(experiments)
    skew = found.numbers["skew"]
    out: list[Experiment] = []
    for t in experiments:
        late = skew.value + 0.5 * t.period
        if t.drive is None or abs(late) <= ALIGNED * t.period or QUANTILE * skew.std > KNOWN * t.period:
            out.append(t)
            continue
        out.append(replace(t, drive=np.interp(t.time + late, t.time, t.drive)))
    return out


# ---- numbers --------------------------------------------------------------------------------------------------


def sliding_values(found: Regression, model: Model | None) -> dict[str, tuple[float, float, float]]:
    """Value and ends of the 95 % interval of every number that certain sliding tells, by the names of estimates; none
    of friction where the law means others by these names."""
    own = {n: n for n in ("inertia", "offset", "fc", "sigma2")}
    if not told_with(model, found):
        own = {"inertia": "inertia"} if found.each_way else {n: n for n in ("inertia", "offset")}
    elif found.each_way:
        own = {
            "inertia": "inertia", **{n: f"{n}_positive" for n in ("fc", "sigma2")},
            **{n + NEGATIVE: f"{n}_negative" for n in ("fc", "sigma2")},
        }  # fmt: skip
    out = {e: (found.numbers[n].value, *found.interval(n)) for e, n in own.items()}
    if "gravity_sin" in found.numbers:
        sine, cosine = found.numbers["gravity_sin"], found.numbers["gravity_cos"]
        size, angle = hanging(sine.value, cosine.value, stacked(found.rows, "position"))
        along = math.hypot(sine.value * sine.std, cosine.value * cosine.std) / size
        across = math.hypot(cosine.value * sine.std, sine.value * cosine.std) / size**2
        out["gravity"] = (size, size - QUANTILE * along, size + QUANTILE * along)
        out["gravity_angle"] = (angle, angle - QUANTILE * across, angle + QUANTILE * across)
    return out


def agreed(
    estimates: Iterable[Estimate], found: Regression, vector: Vector, inverse: InverseDynamics | None,
    scale: Mapping[str, float], fine: bool = True,
) -> tuple[tuple[Estimate, ...], list[str]]:  # fmt: skip
    """Every number from the estimator that shows it, and what is to be said.

    Parameters
    ----------
    estimates : iterable of Estimate
        Those of the prediction error (or the starting values, where `fine` is False).
    found : Regression
    vector : Vector
        Whose parameters they are.
    inverse : InverseDynamics or None
        The plain inverse dynamics: an interval is widened to hold what it says.
    scale : mapping
        What the half-width of a signed parameter is compared with, by name.
    fine : bool
        Whether the prediction error was asked.
    """
    sliding, parameters = sliding_values(found, vector.base), {p.name: p for p in vector.free}
    held, estimates = known_to_act(found), list(estimates)
    taken, notes, doubts = of_sliding(estimates, found, sliding, parameters, inverse, scale, fine)
    if doubts:
        # Where both disagree on what both can tell, neither value nor interval of the fine one is to be trusted.
        taken |= {
            e.name: told(e, parameters[e.name], *sliding[e.name], scale.get(e.name, math.nan))
            for e in estimates if taken.get(e.name) is e
        }  # fmt: skip
        notes.append(f"Inertia, offset and friction's level are those of gross sliding: {doubts}.")
    for e in estimates if fine and told_with(vector.base, found) else ():
        if e.name.removesuffix(NEGATIVE) not in FALL or e.name not in parameters:
            continue
        if found.each_way:
            taken[e.name] = fall_each_way(e, found, parameters[e.name], exponent_of(vector), held=held)
        else:
            taken[e.name], said = fall_together(e, found, parameters[e.name], exponent_of(vector), held=held)
            notes += said
    out = tuple(taken.get(e.name, e) for e in estimates)
    # Reversals show what a contact withstands, where the torque is known to act from row to row.
    out = out if held else with_rest([within_sliding(e, found.slowest) for e in out])
    if doubts:
        out = tuple(
            replace(e, identified=False, verdict=doubts) if e.identified and e.name not in sliding else e
            for e in out
        )
    if found.doubt:
        kept, why, what = "", found.doubt, "Nothing"
        if inertia_alone(found):
            kept, why, what = "inertia", DROWNED.format(share=found.unsure_share), "The inertia alone"
        out = tuple(
            replace(e, identified=False, verdict=why) if e.identified and e.name != kept else e for e in out
        )
        notes.append(f"{what} is identified: {why}.")
    return out, notes


def exponent_of(vector: Vector) -> float | None:
    """With which friction falls in the law; none where it has none."""
    exponent = None if vector.base is None else getattr(vector.base.parameters, "delta_s", None)
    return None if exponent is None else float(exponent)


def known_to_act(found: Regression) -> bool:
    """Whether the torque is known to act from row to row, and nothing else over the position."""
    return found.held_for(ALIGNED) and not found.orders


def of_sliding(
    estimates: Iterable[Estimate], found: Regression, sliding: Mapping[str, tuple[float, float, float]],
    parameters: Mapping[str, Parameter], inverse: InverseDynamics | None, scale: Mapping[str, float], fine: bool,
) -> tuple[dict[str, Estimate], list[str], str]:  # fmt: skip
    """What certain sliding tells, by name, what is to be said, and why the prediction error is to be doubted, where it
    contradicts that; arguments as in `agreed`, and `sliding_values`."""
    held = known_to_act(found)
    stands = inverse is not None and as_good(inverse, found)
    taken: dict[str, Estimate] = {}
    notes: list[str] = []
    doubts = ""
    for e in estimates:
        if e.name not in sliding or e.name not in parameters:
            continue
        size = scale.get(e.name, math.nan)
        own = told(e, parameters[e.name], *sliding[e.name], size)
        apart = abs(e.value - own.value) > math.hypot(e.upper - e.lower, own.upper - own.lower) / 2.0
        if fine and not apart:
            # Its intervals are narrow, and hold where the torque acted as simulations take it.
            better = held and e.identified and not own.identified and not found.drifts
            taken[e.name] = e if better else own
            continue
        if (
            fine
            and abs(e.value - own.value) > SAME * abs(own.value)
            and e.name in ("inertia", "fc", f"fc{NEGATIVE}")
        ):
            doubts = DOUBT.format(name=e.name, other=f"{e.value:.4g}", own=f"{own.value:.4g} {e.unit}")
        if fine and e.identified and not found.confirmed(e.name):
            own = both_told(own, e, parameters[e.name])
        if stands:
            plain = plain_each_way(e.name, inverse) if found.each_way else plain_value(e.name, inverse)
            own, said = held_together(own, plain, parameters[e.name], size)
            notes += said
        taken[e.name] = own
    return taken, notes, doubts


def told_apart(
    estimates: Sequence[Estimate], found: Regression, model: Model, inverse: InverseDynamics | None = None
) -> tuple[Estimate, ...]:
    """The estimates, inertia, level and slope of friction not identified where certain sliding does not tell them
    apart; values stay.

    One band of frequencies alone tells inertia or level (on tuning steps 8 of 19 such levels held, 17 of 26 inertias),
    and the plain inverse dynamics, which has a band of its own, does not second it; or the slope where motor and load
    move apart; the level is extrapolated, or its value had to be moved far towards another method's; or friction rises
    with velocity in another form, or a load that swings makes it seem so, which leaves the inertia unsure as well; or
    friction falls up to the highest speeds; or the column of the torque is smoothed for too
    long. A law that means others by these names has its friction from the prediction error.
    """
    of_law = told_with(model, found)
    (low, high), own = found.interval("fc"), found.numbers["fc"].value
    bend, of_friction = bend_of(found.bands), bends_by_itself(found.bands)
    # What sliding hardly tells is the prediction error's.
    clear = {
        "inertia": True, "fc": of_law and high <= RATIO * low, "sigma2": of_law and found.slope_told,
    }  # fmt: skip

    def alone(e: Estimate) -> bool:
        name = e.name.removesuffix(NEGATIVE)
        return clear.get(name, False) and not found.confirmed(name) and not seconded(e, found, inverse)

    # A level that is not told apart from its slope leaves the slope as unsure.
    level_alone = any(alone(e) for e in estimates if e.name.removesuffix(NEGATIVE) == "fc")

    def doubt_on(e: Estimate) -> str:
        name = e.name.removesuffix(NEGATIVE)
        if found.creep.steady and name in ("fc", "sigma2"):
            return OTHER_FORM
        if name in ("inertia", "sigma2") and (lag := smoothed_by(found.bands)):
            return SMOOTHED.format(lag=1e3 * lag)
        if of_law and found.shows_a_fall and falls_late(name, found.vs, found.fastest):
            return LATE_FALL
        if bend and name == "inertia" and not of_friction:
            return SWINGS
        if bend and of_law and name in LEVELS:
            said = BENT if of_friction else OR_SWINGS
            return said.format(how="faster" if bend > 0.0 else "more slowly", share=min(abs(bend), 1.0))
        if alone(e) and (name != "sigma2" or level_alone or found.rough or high > ALONE * low):
            return BAND_ALONE
        if name != "fc" or not clear["fc"]:
            return ""
        share = 0.0 if found.each_way else abs(e.value - own) / abs(own)
        if not found.level_doubt and share > APART and found.fall_may_hide:
            return TWO_METHODS.format(share=share, own=own, value=e.value, unit=e.unit)
        return found.level_doubt

    doubts = ((e, doubt_on(e) if e.identified else "") for e in estimates)
    return tuple(replace(e, identified=False, verdict=doubt) if doubt else e for e, doubt in doubts)


def seconded(e: Estimate, found: Regression, inverse: InverseDynamics | None) -> bool:
    """Whether the plain inverse dynamics, as sure of inertia or level, says a value within the estimate's interval:
    of 24 inertias of tuning steps that one band alone shows, 22 then hold; of those it does not second 31 of 46."""
    if inverse is None or e.name.removesuffix(NEGATIVE) not in ("inertia", "fc"):
        return False
    plain = plain_each_way(e.name, inverse) if found.each_way else plain_value(e.name, inverse)
    return plain is not None and e.lower <= plain[0] <= e.upper and plain[1] <= 0.5 * (e.upper - e.lower)


def held_against(estimates: Iterable[Estimate], inverse: InverseDynamics) -> tuple[Estimate, ...]:
    """The estimates of a record without certain sliding: no level of friction is identified, since neither the level
    nor when the torque acted was seen.

    Nothing at all is where inertia, level or slope contradicts the plain inverse dynamics: nothing decides between
    the two, and the intervals hold what either says.
    """
    out = tuple(estimates)
    for e in out:
        other = plain_value(e.name, inverse)
        if e.name not in ("inertia", "fc", "sigma2") or other is None:
            continue
        apart = abs(other[0] - e.value) > math.hypot(0.5 * (e.upper - e.lower), other[1])
        if apart and abs(other[0] - e.value) > SAME * abs(e.value):
            why = UNDECIDED.format(name=e.name, own=f"{e.value:.4g}", other=f"{other[0]:.4g} {e.unit}")
            refused = (replace(x, identified=False, verdict=why) if x.identified else x for x in out)
            return tuple(holding_either(x, plain_value(x.name, inverse)) for x in refused)
    return tuple(
        replace(e, identified=False, verdict=UNSEEN)
        if e.identified and e.name.removesuffix(NEGATIVE) in LEVELS
        else e
        for e in out
    )


def holding_either(e: Estimate, other: tuple[float, float] | None) -> Estimate:
    """The estimate with an interval that holds what the plain inverse dynamics says, a value and its half-width, too;
    none but a constant torque is below 0."""
    if other is None:
        return e
    value, half = other
    low, high = min(e.lower, value - half), max(e.upper, value + half)
    return replace(e, lower=low if e.name == "offset" else max(low, 0.0), upper=high)


def as_good(inverse: InverseDynamics, found: Regression, times: float = AS_GOOD) -> bool:
    """Whether the plain inverse dynamics explains certain sliding as well as the regression: else that refutes it.

    It may leave so many `times` as much of the torque there; a fall of friction that shows is the regression's, where
    little else is left. Where motor and load move as one in wider windows alone, it looks at what they do apart, and
    has no say.
    """
    if found.widened > 1.0:
        return False
    return found.unexplained_by(inverse.numbers()) <= times * found.unexplained_by(found.own)


def both_told(e: Estimate, other: Estimate, p: Parameter) -> Estimate:
    """What one band of certain sliding alone tells, where the prediction error contradicts it: its interval holds both,
    and nothing decides between them."""
    if not e.identified or abs(other.value - e.value) <= SAME * abs(e.value):
        return e
    wide = told(e, p, e.value, min(e.lower, other.value), max(e.upper, other.value), math.nan)
    return replace(wide, identified=False, verdict=ONE_BAND.format(other=other, own=e))


def held_together(
    e: Estimate, other: tuple[float, float] | None, p: Parameter, scale: float
) -> tuple[Estimate, list[str]]:
    """The estimate, its interval widened to hold what the plain inverse dynamics says where both contradict each
    other."""
    if other is None:
        return e, []
    value, half = other
    apart = abs(value - e.value) > math.hypot(0.5 * (e.upper - e.lower), half)
    if not apart or abs(value - e.value) <= SAME * max(abs(e.value), scale if math.isfinite(scale) else 0.0):
        return e, []
    wide = told(e, p, e.value, min(e.lower, value), max(e.upper, value), scale)
    if not wide.lower <= value <= wide.upper:
        return wide, []  # it cannot be
    if wide.identified and abs(value - e.value) > CONTRADICTS * max(abs(value), abs(e.value)):
        wide = replace(
            wide, identified=False, verdict=f"the plain inverse dynamics says {value:.4g} {e.unit} instead"
        )
    return wide, [
        f"{e.name}: the plain inverse dynamics, reversals included, says {value:.4g}, gross sliding {e.value:.4g} "
        f"{e.unit}; the interval holds both."
    ]
