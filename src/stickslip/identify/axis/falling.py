"""What is said of friction's fall with velocity, Fs and vs, by the prediction error and by certain sliding together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from stickslip.binding import NEGATIVE
from stickslip.identify.estimate import Estimate
from stickslip.identify.fit.noise import Noise
from stickslip.identify.fit.parameter_vector import Parameter
from stickslip.identify.fit.uncertainty import verdict_on
from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.regression import FALLS, Regression

FALL = ("fs", "vs")
"""What friction's fall with velocity is told by."""
BEGINS = ("vs", f"vs{NEGATIVE}")
"""The velocity of the fall, in each direction."""
SAME = 0.05
"""Relative difference of two numbers that is none."""
MOVED, UNLIKE = 1.3, 0.01
"""Factor on the interval of these (in logarithms) where the torque had to be moved to where it acted, since reversals
are then blurred by a part of a row; and the half-width, in parts of the value, that no law's form is true to."""
NARROW, FORM = 1.6, 0.02
"""Factor on certain sliding's standard deviation of these, and the part of the value that its form is true to."""
LEAST = 1e-12
"""Of an interval's end: what stands for 0 where a parameter must be greater."""
NOT_TOGETHER = (
    "the columns do not belong together (a torque or velocity that comes late), or something else moves it"
)
BELOW = f"the torque asks for {{value:.3g}} {{unit}} ({{high:.3g}} at most), which cannot be below 0: {NOT_TOGETHER}"
BELOW_SLIDING = (
    "extrapolated: gross sliding begins at {slowest:.3g} {unit}, and below it friction after a reversal looks like a "
    "fall with velocity; record slow constant speeds"
)
NO_LEVEL = "the Coulomb level, to which friction falls with velocity, is not determined by the record"
AT_REST = (
    "extrapolated to rest: the record does not show at which velocity friction falls to the Coulomb level"
)


def fall_together(
    e: Estimate, found: Regression, p: Parameter, exponent: float | None, *, held: bool
) -> tuple[Estimate, list[str]]:
    """Fs or vs of the prediction error, with what certain sliding says of the fall of friction where both contradict
    each other, and with what a moved torque and the law's own form leave unsure.

    Where certain sliding shows the fall and the prediction error does not tell it, or says another, its value; never
    identified by that alone, since its own interval is too narrow: of 251 logs 78 to 85 % held
    (`benchmarks/ordinary_logs.py`).
    """
    own, notes = number_of(e.name, found, exponent), list[str]()
    if own is None:
        return e, notes
    if not e.identified:
        return (shown_by_sliding(e, own) if found.shows_a_fall else e), notes
    apart = abs(own.value - e.value) > math.hypot(half_width(e), QUANTILE * own.std)
    if found.falls >= FALLS and apart and abs(own.value - e.value) > SAME * abs(e.value):
        notes.append(
            f"{e.name}: gross sliding says {own.value:.4g}, the prediction error {e.value:.4g} {e.unit}; the "
            "interval holds both."
        )
        value = own.value if found.shows_a_fall else e.value
        e = told(e, p, value, min(e.lower, own.value), max(e.upper, own.value), math.nan)
    return with_timing(e, p, held=held), notes


def number_of(name: str, found: Regression, exponent: float | None) -> Number | None:
    """Fs, or vs with that exponent, of certain sliding; none where it did not look for a fall of that form."""
    if name != "vs":
        return found.numbers["fs"]
    return found.vs if exponent is None else found.falling.get(exponent, (0.0, None))[1]


def shown_by_sliding(e: Estimate, own: Number) -> Estimate:
    """The estimate, not identified, with the value of certain sliding and an interval that holds what both say."""
    half = QUANTILE * math.hypot(NARROW * own.std, FORM * own.value)
    return replace(
        e, value=own.value, lower=min(e.lower, own.value - half), upper=max(e.upper, own.value + half)
    )


def widened(e: Estimate, p: Parameter, factor: float) -> Estimate:
    """An estimate whose interval is so many times as wide, in logarithms, and not narrower than `UNLIKE`."""
    below, above = (math.hypot(factor * math.log(end / e.value), UNLIKE) for end in (e.lower, e.upper))
    return told(e, p, e.value, e.value * math.exp(-below), e.value * math.exp(above), math.nan)


def within_sliding(e: Estimate, slowest: float) -> Estimate:
    """A velocity of friction's fall, not identified where it lies below all certain sliding: only reversals show it
    there, each law in its way (of four logs of another program one held)."""
    if e.name not in BEGINS or not e.identified or e.value >= slowest:
        return e
    return replace(e, identified=False, verdict=BELOW_SLIDING.format(slowest=slowest, unit=e.unit))


def with_rest(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """The estimates, friction at rest not identified where the velocity of its fall is not."""
    untold = {e.name.removeprefix("vs") for e in estimates if e.name in BEGINS and not e.identified}
    at_rest = {f"fs{way}" for way in untold}
    return tuple(
        replace(e, identified=False, verdict=AT_REST) if e.name in at_rest and e.identified else e
        for e in estimates
    )


def with_level(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """The estimates, friction's fall not identified where the level that it falls to is not: of another program's logs
    4 of 9 such numbers held, and 44 of 46 beside a level that is told."""
    untold = {e.name.removeprefix("fc") for e in estimates if e.name.startswith("fc") and not e.identified}
    falls = {f"{name}{way}" for name in FALL for way in untold}
    return tuple(
        replace(e, identified=False, verdict=NO_LEVEL) if e.name in falls and e.identified else e
        for e in estimates
    )


def told(e: Estimate, p: Parameter, value: float, low: float, high: float, scale: float) -> Estimate:
    """An estimate with another value and interval, judged by the same rules, within the parameter's bounds.

    Where the whole interval lies below 0 and the parameter may not, it says nothing: the model is wrong there.
    """
    std = (high - low) / (2.0 * QUANTILE)
    least = p.par.lower if not p.par.positive else max(p.par.lower, LEAST * abs(high))
    if p.nonnegative and high <= 0.0:
        why = BELOW.format(value=value, high=high, unit=p.par.unit)
        least = max(least, LEAST * abs(low)) if p.par.positive else least
        return replace(e, value=least, std=std, lower=least, upper=-low, identified=False, verdict=why)
    value, low, high = (min(max(x, least), p.par.upper) for x in (value, low, high))
    why = verdict_on(p, value, low, high, Noise(1.0, "residual", math.inf), scale)
    return replace(e, value=value, std=std, lower=low, upper=high, identified=not why, verdict=why)


def with_timing(e: Estimate, p: Parameter, *, held: bool) -> Estimate:
    """Fs or vs by the prediction error alone, as unsure as a moved torque and the law's form make it."""
    return widened(e, p, 1.0 if held else MOVED) if e.identified else e


def fall_each_way(
    e: Estimate, found: Regression, p: Parameter, exponent: float | None, *, held: bool
) -> Estimate:
    """Fs or vs in one direction of the prediction error; where that does not tell it and certain sliding shows a fall,
    which it has in common for both directions, that fall from the direction's own level."""
    own = (
        None
        if e.identified or not found.shows_a_fall
        else number_of(e.name.removesuffix(NEGATIVE), found, exponent)
    )
    if own is None:
        return with_timing(e, p, held=held)
    if e.name not in BEGINS:
        way = found.numbers["fc_negative" if e.name.endswith(NEGATIVE) else "fc_positive"]
        own = replace(own, value=own.value - found.numbers["fc"].value + way.value)
    return shown_by_sliding(e, own)


def missing_fall(misfit: Mapping[str, float]) -> float:
    """By how much friction falls with velocity where the law has no fall, N·m (N); 0 where it misses none."""
    return next((misfit[k] for k in ("fall_missing_Nm", "fall_missing_N") if k in misfit), 0.0)


def half_width(e: Estimate) -> float:
    """Of its interval."""
    return 0.5 * (e.upper - e.lower)
