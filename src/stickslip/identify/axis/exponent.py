"""The exponent with which friction falls: Tustin's form exp(-|v/vs|), or the Gaussian exp(-(v/vs)²).

Both look alike, and the wrong one moves the levels at rest and at speed by several percent. Certain sliding is averaged
over both (`stickslip.identify.regression.band_fit`); a law is fitted with the one that it shows, and the other must
explain the whole record worse (`stickslip.identify.axis.prediction.rival`). A law's exponent is otherwise left at its
default: neither form tells it as a number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from stickslip.binding import NEGATIVE
from stickslip.errors import InputError
from stickslip.identify.axis.falling import told
from stickslip.identify.axis.prediction import axis_prediction, rival
from stickslip.identify.axis.search import Asked
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.observer.prediction_error import PredictionError
from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.identify.regression.regression import Regression
from stickslip.identify.regression.sliding_rows import Fall
from stickslip.machines.servo import ServoAxis
from stickslip.spec import Law

EXPONENT = "delta_s"
FORMS = {1.0: 2.0, 2.0: 1.0}
"""Every exponent that is tried, and the other."""
CLEARLY = 0.1
"""Part of the sum of squares by which one of both must explain the record better for the other to be out. Of friction
that no curve describes (GMS fitted as a curve, exponent 2) the wrong one explained 2 to 8 % more; of curves the right
one explained more than a tenth more (`benchmarks/ordinary_coverage.py --exponent`)."""
MORE = 3.0
"""Times as probable as before the record, for certain sliding to contradict the whole record: nothing then decides.
Another friction each way, or a train that winds up, lets the wrong form explain a tenth more (998035, 998121)."""
SURE = 0.99
"""Probability by certain sliding from which on the record is not asked."""
TOLD = ("fs", "vs", f"fs{NEGATIVE}", f"vs{NEGATIVE}")
"""What depends on it most."""
SHOWN = (
    "Friction falls as exp(-|v/vs|^delta_s) with delta_s = {found:g}, not the usual {usual:g}: {by} (--set "
    "delta_s={usual:g} fits that all the same)."
)
SLIDING, RECORD = "gross sliding shows it", "the record is explained better"
UNDECIDED = (
    "Whether friction falls with delta_s = 1 or 2 the record does not decide; the intervals of Fs and vs hold what "
    "both say."
)


def is_open(asked: Asked, laws: Iterable[Law]) -> bool:
    """Whether a law has an exponent that nobody named, of either direction."""
    named = {EXPONENT, EXPONENT + NEGATIVE} & {*asked.values, *asked.free}
    return not named and any(usual_of(law) is not None for law in laws)


def of_both_ways(exponent: float, laws: Iterable[Law]) -> dict[str, float]:
    """An exponent of friction's fall by the names of some laws: one contact has one form, in either direction."""
    names = {f.name for law in laws for f in law.fields}
    return dict.fromkeys([n for n in (EXPONENT, EXPONENT + NEGATIVE) if n in names], exponent)


def named_for_both(asked: Asked, laws: Iterable[Law]) -> Asked:
    """What is asked, with an exponent that is named without its direction as that of both."""
    other = EXPONENT + NEGATIVE
    if EXPONENT not in asked.values or other in {*asked.values, *asked.free}:
        return asked
    return replace(asked, values={**of_both_ways(asked.values[EXPONENT], laws), **asked.values})


def usual_of(law: Law) -> float | None:
    """The exponent that a law takes where nothing is said; none where it has none of those that are tried."""
    usual = next((f.par.default for f in law.fields if f.name == EXPONENT), None)
    return usual if isinstance(usual, float) and usual in FORMS else None


def shown(asked: Asked, sliding: Regression | None, laws: Sequence[Law]) -> tuple[Asked, list[str]]:
    """What is asked, with the exponent that certain sliding shows; and what is to be said."""
    usual = next((u for u in map(usual_of, laws) if u is not None), None)
    if sliding is None or usual is None or not sliding.shows_a_fall or sliding.exponent == usual:
        return asked, []
    said = SHOWN.format(found=sliding.exponent, usual=usual, by=SLIDING)
    return replace(asked, values={**of_both_ways(sliding.exponent, laws), **asked.values}), [said]


def predicted_with(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, first: InverseDynamics | None, asked: Asked,
    found: PredictionError, sliding: Regression | None, judged: Iterable[Estimate],
) -> tuple[PredictionError, dict[str, float], list[str]]:  # fmt: skip
    """The prediction error with the exponent that explains the record better, what the other says of `TOLD` where the
    record does not decide, and what is to be said. Nothing is asked where none of them is identified as `judged`."""
    usual = usual_of(law)
    if usual is None or first is None or not any(e.identified for e in judged if e.name in TOLD):
        return found, {}, []
    own = float(getattr(found.model.parameters, EXPONENT))
    seen = sliding is not None and sliding.both_forms and sliding.shows_a_fall
    if sliding is not None and seen and sliding.falling[own][0] >= SURE:
        return found, {}, []
    # Of either form a tenth is left at the same speed.
    slower = Fall.like(1.0, FORMS[own]).vs / Fall.like(1.0, own).vs
    start = {
        p.name: found.vector.named(found.u)[p.name] * slower
        for p in found.vector.free
        if p.name in ("vs", f"vs{NEGATIVE}")
    }
    try:
        fixed = of_both_ways(FORMS[own], [law])
        other = rival(experiments, axis, law, first, asked, found, fixed, start)
    except InputError:
        return found, {}, []
    least = CLEARLY * found.cost
    if not math.isfinite(other.better):
        return found, {}, []
    if other.better < -least and not prefers(sliding, FORMS[own]):
        return found, {}, []
    if other.better <= least or prefers(sliding, own):
        return found, {n: other.values[n] for n in TOLD if n in other.values}, [UNDECIDED]
    values = {**asked.values, **other.values, **fixed}
    better = axis_prediction(
        experiments, axis, law, first=first, values=values, free=asked.free, frozen=asked.frozen, extras=asked.extras
    )  # fmt: skip
    said = [] if FORMS[own] == usual else [SHOWN.format(found=FORMS[own], usual=usual, by=RECORD)]
    return better, {}, said


def prefers(sliding: Regression | None, exponent: float) -> bool:
    """Whether certain sliding, where both were looked at, clearly says more for an exponent than was thought before."""
    if sliding is None or not sliding.both_forms:
        return False
    (own, _), (other, _) = sliding.falling[exponent], sliding.falling[FORMS[exponent]]
    return own * USUAL_EXPONENTS[FORMS[exponent]] > MORE * other * USUAL_EXPONENTS[exponent]


def with_other(
    estimates: Iterable[Estimate], found: PredictionError, other: dict[str, float]
) -> tuple[Estimate, ...]:
    """The estimates, their intervals holding those that the other exponent would give, as wide in logarithms."""
    parameters = {p.name: p for p in found.vector.free}

    def wider(e: Estimate) -> Estimate:
        moved = other[e.name] / e.value
        low, high = min(e.lower, moved * e.lower), max(e.upper, moved * e.upper)
        return told(e, parameters[e.name], e.value, low, high, math.nan)

    return tuple(wider(e) if e.name in other and e.identified else e for e in estimates)
