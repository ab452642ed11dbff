"""Inertia, friction and the skew between torque and motion, from whatever a drive writes down: several bands compared.

The inverse dynamics of an axis, over rows of certain sliding alone (`stickslip.identify.regression.sliding_rows`), in
bands that differ by a factor of 2.6 (`stickslip.identify.regression.band_fit`). What the bands say, and by how much
they differ, makes values and intervals: an axis that is not stiff, a torque sampled too seldom or a play shows there.
No controller, no simulation and no hold of the torque is assumed, so that a log with a delay, a current loop or a mean
torque over its rows is as good as any.

Sources: inverse dynamics of drives (Gautier 1997; Janot, Gautier and Brunot 2019), models of continuous time from
sampled data (``garnier2008``), robust covariances over groups (``liang1986``), averaging over models (``hoeting1999``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.identify.experiment import Experiment, insist_on_motion
from stickslip.identify.fit.smooth import Window, root_mean_square
from stickslip.identify.regression.band_fit import EACH_WAY, BandFit
from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.bands import USUALLY, WEIGHT, decided, in_bands, rough
from stickslip.identify.regression.creeping import NOWHERE, Creep
from stickslip.identify.regression.drifted import calm_beside_drift
from stickslip.identify.regression.drifting import DRIFTS, drift_torque, usual_speed
from stickslip.identify.regression.falls import Falling, fall_of
from stickslip.identify.regression.flexible import train_torque, two_inertias
from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.orders import without_waves
from stickslip.identify.regression.reasons import (
    APART,
    AT_ONE_SPEED,
    BEYOND_LEVEL,
    COGGED,
    DRIVES,
    LEVEL_UNTOLD,
    STILL_ROUGH,
    UNMOVED,
    UNSURE_THERE,
)  # fmt: skip
from stickslip.identify.regression.rebuilding import rebuilt_within
from stickslip.identify.regression.sliding_rows import (
    Fall,
    SlidingRows,
    narrowest_width,
    signals_of,
    sliding_rows,
)
from stickslip.identify.regression.strokes import stacked
from stickslip.identify.regression.together import ROTATED, as_told, holding, that_tell, together, with_form
from stickslip.machines.servo import ServoAxis
from stickslip.machines.two_inertias import TwoInertias

Array = np.ndarray[Any, np.dtype[np.float64]]

SKEW_ROWS, SKEW_TIME = 1.0, 1e-3
"""Rows, or s if longer, by which a torque column usually lies off at most (one standard deviation)."""
UNSURE = 0.3
"""Part of Fc to which the torque that accelerates must be known for friction to be believed."""
GIVEN = 0.05
"""Rows to which a skew that is given is known."""
LEVEL, EXCLUDED = 0.05, 0.05
"""Half-width, in parts of Fc, up to which it is told in any case; probability of a fall up to which none is there."""
SLOPED, WIDELY, FEW = 0.1, 0.2, 0.2
"""Part of Fc to which viscous friction must be known at the highest speed, where no fall shows; of that speed below
which the slowest rows lie where one may hide; and of the rows that must be faster for the level to be theirs."""
STRAIGHT = 0.15
"""The same two parts of Fc where no fall is there: level and slope are then one straight line's. Of 16 such levels of
another program's 200 logs, 5 to 15 % unsure, all held, wrong by 4 % at most."""
FALLS, SHOWN = 0.95, 4.0
"""Probability, and standard deviations of Fs - Fc, from which on friction is taken to fall with velocity."""
ONE_SPEED = 0.65
"""Of the highest speed, from which on the slowest rows lie at the same: level and slope are then one number. Levels of
parts of a motor's record from 0.6 of it on agree; one of another program's log, from 0.69 on, was 35 % too low."""
ROUGHLY = 0.1
"""Part of Fc to which it must then be told in windows in which motor and load do not move as one."""
BEYOND = 2.0
"""Times Fc that may be left of the torque in certain sliding for anything to be believed."""
SWUNG = 0.5
"""rad that a pendulum must swing for its weight to be looked for in the torque."""


@dataclass(frozen=True, eq=False)
class Regression:
    """What the bands say together.

    Attributes
    ----------
    numbers : dict of str to Number
        ``inertia``, ``sigma2``, ``fc``, ``offset``, ``fs`` (the curve's end at rest), ``skew`` (s by which the
        column of the torque lies behind the torque that acted; negative: ahead), and of a pendulum ``gravity_sin``,
        ``gravity_cos``. Where friction drifts also `stickslip.identify.regression.drifting.DRIFTS`, and the others are
        those of the middle of the record.
    bands : tuple of BandFit
        From the widest band of frequencies to the narrowest.
    orders : tuple of float
        Cycles a radian (m) of the torque over the position that were found.
    falls : float
        Probability that friction falls with velocity within the recorded speeds (Stribeck effect).
    falling : Falling
        How, if it does.
    slowest, fastest : float
        Speeds of certain sliding: their first percentile and the highest.
    period : float
        s from row to row.
    rows : tuple of SlidingRows
        Of the widest band.
    widened : float
        Times that the windows are wider than noise asks, so that motor and load move as one in them.
    creep : Creep
        Up to which speed friction is missing, so that slower rows are left out.
    rebuilt : float
        Way behind a reversal or stop within which friction is there again, rad (m).
    each_way : bool
        Whether friction has a level and a slope of its own in each direction: ``fc_positive`` and so on are numbers
        too, ``fc``, ``sigma2`` and ``fs`` the means of both.
    perhaps : tuple of BandFit
        The fits beside a drift of friction that may be there, but is not told.
    alike : tuple of tuple of float
        Of each of the orders, those that it may be as well: the record does not tell them apart.
    """

    numbers: dict[str, Number]
    bands: tuple[BandFit, ...]
    orders: tuple[float, ...]
    falls: float
    falling: Falling
    slowest: float
    fastest: float
    period: float
    rows: tuple[SlidingRows, ...]
    widened: float = 1.0
    creep: Creep = NOWHERE
    each_way: bool = False
    rebuilt: float = math.inf
    perhaps: tuple[BandFit, ...] = ()
    alike: tuple[tuple[float, ...], ...] = ()

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a number."""
        return self.numbers[name].interval

    def remainder(self, values: Mapping[str, float]) -> Array:
        """Torque that inertia, sigma2, fc, offset and gravity leave in the rows of certain sliding, N·m (N), shape
        (n,); of a fall of friction also that of `fs` and `vs`, where they are among the values, and `uneven`."""
        fixed, position = stacked(self.rows, "fixed"), stacked(self.rows, "position")
        torque = np.concatenate([r.torque(self.numbers["skew"].value) for r in self.rows])
        known = fixed @ np.array([values[n] for n in ("inertia", "sigma2", "fc", "offset")])
        known = known + values.get("gravity_sin", 0.0) * np.sin(position)
        known = known + values.get("gravity_cos", 0.0) * np.cos(position)
        speed = stacked(self.rows, "speed")
        known = known + values.get("uneven", 0.0) * np.abs(speed)
        known = known + self.beside_law
        if {"fs", "vs"} <= values.keys():
            left = Fall(values["vs"], self.exponent).at(speed)
            known = known + (values["fs"] - values["fc"]) * left * np.sign(speed)
        return np.asarray(torque - known, dtype=np.float64)

    @property
    def beside_law(self) -> Array:
        """What no law and no rigid axis holds of the torque in the rows, N·m (N), shape (n,): friction's drift, and a
        train that gives or swings."""
        return drift_torque(self.numbers, self.rows) + train_torque(self.rows, self.bands[0].swing)

    def left_by(self, values: Mapping[str, float]) -> float:
        """RMS of `remainder`, N·m (N)."""
        return root_mean_square(self.remainder(values))

    def beside_orders(self, torque: Array) -> Array:
        """A torque in the rows less what waves over the position, of the orders that were found, explain of it."""
        return without_waves(torque, self.rows, self.orders)

    def unexplained_by(self, values: Mapping[str, float]) -> float:
        """RMS of `remainder` beside that torque over the position, N·m (N)."""
        return root_mean_square(self.beside_orders(self.remainder(values)))

    @property
    def drifts(self) -> bool:
        """Whether friction is taken to drift over the record."""
        return "drift" in self.numbers

    @property
    def two_inertias(self) -> TwoInertias | None:
        """Motor and load behind a spring, where the two widest bands tell them and its numbers are to be believed."""
        return None if self.doubt else two_inertias([b.swing for b in self.bands])

    @property
    def both_forms(self) -> bool:
        """Whether friction's fall was looked for in every usual form."""
        return {fall.exponent for fall in self.bands[0].tried} == USUAL_EXPONENTS.keys()

    @property
    def exponent(self) -> float:
        """Of friction's fall, the more probable one."""
        return max(self.falling, key=lambda d: self.falling[d][0])

    @property
    def vs(self) -> Number:
        """Velocity of friction's fall with that exponent, rad/s (m/s)."""
        return self.falling[self.exponent][1]

    @property
    def own(self) -> dict[str, float]:
        """Its own numbers by name; of a fall of friction that shows also vs, where little else is left."""
        own = {name: n.value for name, n in self.numbers.items()}
        return own | ({"vs": self.vs.value} if self.shows_a_fall and not self.rough else {})

    @property
    def correlated(self) -> list[str]:
        """The numbers whose correlation the bands hold, in its order, by the names of estimates."""
        names = [n for n in self.bands[0].numbers if n not in ("skew", "fs", *DRIFTS)]
        if not self.each_way:
            return names
        return [f"mean of {n}" if n in ("fc", "sigma2") else n.removesuffix("_positive") for n in names]

    @property
    def left(self) -> float:
        """RMS of the torque that its own numbers leave in those rows, N·m (N), a torque over the position among it."""
        return self.left_by(self.own)

    @property
    def friction(self) -> float:
        """Level of friction that other torques are compared with, N·m (N): Fc, or friction at the usual speed where Fc
        is not known to a factor of two; 0 where that comes out below 0."""
        level, slope = self.numbers["fc"], max(self.numbers["sigma2"].value, 0.0)
        if level.told_to_two:
            return level.value
        return max(level.value + slope * usual_speed(self.rows), 0.0)

    @property
    def waves(self) -> float:
        """RMS of the torque over the position that was found, N·m (N)."""
        return float(np.sqrt(0.5 * np.sum(self.harmonics**2)))

    @property
    def unsure_share(self) -> float:
        """Part of Fc to which the torque that the usual acceleration needs is unsure."""
        usual = float(np.sqrt(np.mean(stacked(self.rows, "fixed")[:, 0] ** 2)))
        return QUANTILE * self.numbers["inertia"].std * usual / max(abs(self.numbers["fc"].value), 1e-300)

    @property
    def doubt(self) -> str:
        """Why its numbers are not to be believed; empty where they are."""
        level = abs(self.numbers["fc"].value)
        if self.unsure_share > UNSURE:
            if self.waves > self.unexplained_by(self.own):
                return COGGED.format(ratio=self.waves / max(level, 1e-300), share=self.unsure_share)
            return APART.format(share=self.unsure_share)
        if self.unexplained_by(self.own) > BEYOND * level:
            return BEYOND_LEVEL
        if self.interval("fc")[1] < 0.0:
            return DRIVES
        swings = self.numbers.keys() >= ROTATED and np.ptp(stacked(self.rows, "position")) >= SWUNG
        return UNMOVED if swings and not any(map(self.above_chance, ("inertia", *ROTATED))) else ""

    def confirmed(self, name: str) -> bool:
        """Whether more than one band of frequencies tells a number, whatever the skews they were fitted with.

        Of a pendulum's weight and of the angle at which it hangs, both amplitudes.
        """
        names = sorted(ROTATED) if name.startswith("gravity") else [name]
        return all(len({b.corner for b in that_tell(n, self.bands)}) > 1 for n in names)

    @property
    def rough(self) -> bool:
        """Whether the widest band leaves so much that motor and load may not move as one there."""
        return rough(self.bands[0])

    def above_chance(self, name: str) -> bool:
        """Whether a number differs from 0 by more than its interval."""
        low, high = self.interval(name)
        return low > 0.0 or high < 0.0

    @property
    def shows_inertia(self) -> bool:
        """Whether the torque shows that something accelerates: nothing else tells when it acted."""
        return self.interval("inertia")[0] > 0.0

    @property
    def level_doubt(self) -> str:
        """Why the level that friction falls to with velocity is not told; empty where it is.

        Windows that had to be widened and are rough still show play, of which its interval knows a part. Where a fall
        is not excluded and viscous friction not told apart from its end, level and slope are one number at the highest
        speeds: the level is extrapolated, however narrow half of its value would seem.
        """
        level = self.numbers["fc"]
        share = QUANTILE * level.std / max(abs(level.value), 1e-300)
        if share > ROUGHLY and self.widened > 1.0 and self.rough:
            return STILL_ROUGH + UNSURE_THERE.format(share=share, most=ROUGHLY)
        if self.slope_told:
            return ""
        if self.slowest > ONE_SPEED * self.fastest:
            return AT_ONE_SPEED.format(share=self.slowest / self.fastest)
        excluded = self.falls <= EXCLUDED
        most, most_sloped = (STRAIGHT, STRAIGHT) if excluded else (LEVEL, SLOPED)
        sloped = QUANTILE * self.numbers["sigma2"].std * self.fastest > most_sloped * abs(level.value)
        hidden = self.falls < FALLS and self.fall_may_hide
        slow = float(np.mean(np.abs(stacked(self.rows, "speed")) > WIDELY * self.fastest)) < FEW
        untold = (hidden and (sloped or slow or share > most)) or (share > LEVEL and not excluded)
        return LEVEL_UNTOLD if untold else ""

    @property
    def slope_told(self) -> bool:
        """Whether viscous friction is told to a factor of two."""
        return self.numbers["sigma2"].told_to_two

    @property
    def fall_may_hide(self) -> bool:
        """Whether a fall of friction may hide between slow rows and fast ones, which do not tell the slope."""
        return not self.slope_told and self.slowest < WIDELY * self.fastest

    @property
    def fall_shown(self) -> float:
        """Friction at rest above its level, in standard deviations."""
        rest, level = self.numbers["fs"], self.numbers["fc"]
        return (rest.value - level.value) / max(math.hypot(rest.std, level.std), 1e-300)

    @property
    def shows_a_fall(self) -> bool:
        """Whether friction is taken to fall with velocity."""
        return self.falls >= FALLS and self.fall_shown >= SHOWN

    @property
    def harmonics(self) -> Array:
        """Amplitude of every order found, N·m (N), shape (k,)."""
        return np.hypot(*self.bands[0].harmonics.T) if self.orders else np.zeros(0)

    def held_for(self, tolerance: float) -> bool:
        """Whether the torque acted as recorded from row to row: half a row ahead, to a part of a row."""
        low, high = (x / self.period + 0.5 for x in self.interval("skew"))
        return -tolerance <= low and high <= tolerance


def regress_axis(
    experiments: Sequence[Experiment], axis: ServoAxis, *, skew: float | None = None, harmonics: bool = True,
    harmonic_period: float | None = None, each_way: bool = False, known: Mapping[str, float] | None = None,
) -> Regression:  # fmt: skip
    """Inertia, friction, offset and skew of an axis by least squares on certain sliding, in several bands.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal. Fitted together.
    axis : ServoAxis
    skew : float, optional
        s by which the column of the torque lies behind the torque that acted, where it is known.
    harmonics : bool
        Whether a torque over the position is looked for.
    harmonic_period : float, optional
        rad (m) after which it repeats; a turn unless given.
    each_way : bool
        Whether friction has a level and a slope of its own in each direction.
    known : mapping of str to float, optional
        ``inertia``, ``sigma2``, ``fc``, ``offset`` as far as they are known: the others are fitted beside them.

    Returns
    -------
    Regression

    Raises
    ------
    InputError
        If the records slide too little in one direction at a time, or a motor's constant is missing.
    """
    insist_on_motion(experiments)
    signals = [signals_of(t, axis) for t in experiments]
    width = max(narrowest_width(s) for s in signals)
    period = max(s.period for s in signals)
    size = max(SKEW_ROWS * period, SKEW_TIME) if skew is None else GIVEN * period
    options: dict[str, Any] = {
        "pendulum": axis.gravity == "pendulum", "skew_size": size, "skew": skew, "each_way": each_way,
        "known": known,
    }  # fmt: skip
    ask = (axis, options, harmonics, harmonic_period)
    seen = calm_beside_drift(signals, width, *ask)
    if skew is None and abs(seen.fits[0].numbers["skew"].value) > USUALLY * size:
        ask = (axis, {**options, "skew": 0.0, "drifting": seen.drifts}, harmonics, harmonic_period)
        none = in_bands(signals, seen.widened * width, *ask, exponents=seen.exponents)
        seen = decided(seen, replace(none, widened=seen.widened))
    bands = seen.fits
    speed = np.abs(stacked(seen.rows, "speed"))
    falls, falling = fall_of(bands)
    numbers = {name: together(name, bands) for name in bands[0].numbers}
    for name in numbers.keys() & {"offset", "fc", "sigma2", *EACH_WAY} if seen.perhaps else ():
        numbers[name] = holding(numbers[name], together(name, seen.perhaps))
    for way in ("", "_positive", "_negative") if each_way else ("",):
        numbers[f"fc{way}"] = with_form(numbers[f"fc{way}"], numbers[f"sigma2{way}"])
    numbers |= {name: Number(value, 0.0) for name, value in (known or {}).items()}
    numbers["skew"] = Number(skew, size) if skew is not None else as_told(numbers, size, period, seen.train)
    weight = WEIGHT if axis.gravity == "pendulum" else ()
    whole = [sliding_rows(s, Window(width, s.period)) for s in signals]
    return Regression(
        numbers, bands, seen.orders, falls, falling, float(np.quantile(speed, 0.01)), float(np.max(speed)), period,
        seen.rows, seen.widened, seen.creep, each_way, rebuilt_within(whole, numbers["skew"].value, weight),
        seen.perhaps, seen.alike,
    )  # fmt: skip
