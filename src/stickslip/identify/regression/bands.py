"""A record seen in several bands of frequencies, from rows of certain sliding: which rows, which widths, which orders.

The narrowest window is the one that noise allows; where motor and load do not move as one in it (play that opens while
the motor slides, a train that rings), the narrowest in which they do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.fit.shifts import Whole, least_between, shifts_looked_at
from stickslip.identify.fit.smooth import Window, seen
from stickslip.identify.regression.band_fit import BandFit, fit_band
from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.creeping import FAR, NOWHERE, Creep, creep_of, steady_lack
from stickslip.identify.regression.flexible import GIVES, HARDLY, SWINGS, Train, swings_alike
from stickslip.identify.regression.number import QUANTILE, Number
from stickslip.identify.regression.orders import Shown, candidate_orders, goes_round, shown_orders
from stickslip.identify.regression.rebuilding import rebuilding_way
from stickslip.identify.regression.sliding_rows import (
    FEWEST,
    Fall,
    Signals,
    SlidingRows,
    TooLittleSliding,
    sliding_rows,
)
from stickslip.identify.regression.strokes import stacked
from stickslip.identify.regression.together import telling, together
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

BANDS = (1.0, 1.6, 2.6)
"""Widths of the windows, in that of the narrowest which noise allows."""
ROUGH, WIDER = 0.05, (1.6, 2.6, 4.1, 6.6, 10.0)
"""Misfit in the first band, in parts of Fc, from which on wider windows are tried; how much wider. What play does to a
sum of motor and load falls with the square of the width."""
FALLS = 0.5
"""Part of the first band's misfit that the last may leave, for still wider windows to be worth a look; and that wider
windows may leave which are rough as well."""
LEVELS = 18
"""Stribeck velocities that are averaged over, from `SLOWEST` to `FASTEST` of the highest speed."""
SLOWEST, FASTEST = 1e-3, 3.0
LOOKED, FARTHEST, STROKE, CLEAR = 0.04, 0.12, 0.25, 0.5
"""s over which a skew is looked for at a glance, and how far at most within a part of the usual stroke; part of the
misfit without one that it must leave at most."""
USUALLY = 2.0
"""Standard deviations of the usual skew from which on one is unusual."""
CLEARLY, THROUGHOUT = 3.0, 1.7
"""Misfit that none must then leave in the first band, or in every band of several, in those with it. Of 23 that torque
over the position and ringing had made, 21 were below both (of the others one shows no inertia, one leaves 3.4 times);
of 48 delays of 5 rows on production moves all skews hold, and of 24 on staircases (`benchmarks/ordinary_logs.py`)."""
GAUSSIAN = (2.0,)
"""The exponent of friction's fall in windows that are wider than noise asks, and where what is left is rough: the
slower form of exponent 1 explains by level and slope what motor and load do apart (680382: Fc 25 % too low)."""
CURVE = 3
"""Every so many of the falls tried make up friction's curve where orders are looked for."""
BACKGROUND = 12
"""Lowest orders of a torque over the position that is small, but may be there."""
WEIGHT = (0.5 / math.pi,)
"""Cycles a radian of a pendulum's weight."""


@dataclass(frozen=True, eq=False)
class Bands:
    """One record in several bands.

    Attributes
    ----------
    fits : tuple of BandFit
        From the widest band of frequencies to the narrowest.
    rows : tuple of SlidingRows
        Of the widest.
    orders : tuple of float
        Cycles a radian (m) of the torque over the position that were found there.
    widened : float
        Times that the windows are wider than noise asks.
    creep : Creep
        Up to which speed friction is missing in the widest, so that slower rows are left out.
    perhaps : tuple of BandFit
        The fits beside a drift of friction that may be there, but is not told.
    train : Train
        What is taken to move.
    alike : tuple of tuple of float
        Of each of the orders, those it may be as well.
    """

    fits: tuple[BandFit, ...]
    rows: tuple[SlidingRows, ...]
    orders: tuple[float, ...]
    widened: float = 1.0
    creep: Creep = NOWHERE
    perhaps: tuple[BandFit, ...] = ()
    train: Train = Train.RIGID
    alike: tuple[tuple[float, ...], ...] = ()

    @property
    def drifts(self) -> bool:
        """Whether friction is taken to drift over the record."""
        return "drift" in self.fits[0].numbers

    @property
    def exponents(self) -> Sequence[float]:
        """Of friction's fall, that such windows may tell apart."""
        return GAUSSIAN if self.widened > 1.0 or rough(self.fits[0]) else tuple(USUAL_EXPONENTS)


def rough(band: BandFit) -> bool:
    """Whether a band leaves so much that motor and load may not move as one there."""
    return band.misfit > ROUGH * abs(band.numbers["fc"].value)


def calmed(found: Bands, signals: Sequence[Signals], width: float, *ask: Any) -> Bands:
    """What was found; where its first band is rough, what wider windows show, if they tell as much.

    The narrowest windows that are not rough; else, of those that leave half as much, the ones in which the level of
    friction is surest; else the narrowest, beside which friction falls as `GAUSSIAN`.

    Play that opens while the motor slides (the drive brakes, the load runs ahead, meets the other flank and rebounds)
    moves the load against the motor by no more than the play: seen through a window, the torque of that falls with
    the square of its width, that of inertia and friction does not.
    """
    if not rough(found.fits[0]):
        return found
    tried: dict[float, Bands] = {}
    for wider in worth_a_look(found):
        other = seen_wider(signals, wider, width, *ask)
        if other is None:
            break
        tried[wider] = other
        if not rough(other.fits[0]):
            if tells_as_much(other.fits[0], found.fits[0]) or as_sure(other, found):
                return other
            break
    best = surest(found, tried, signals, width, *ask)
    return best if best.widened > 1.0 else in_bands(signals, width, *ask, exponents=GAUSSIAN)


def surest(
    found: Bands, tried: Mapping[float, Bands], signals: Sequence[Signals], width: float, *ask: Any
) -> Bands:
    """Of all wider windows that leave half as much and tell as much, those in which the level of friction is surest;
    what was found where there are none."""
    most = FALLS * found.fits[0].misfit
    best = found
    for wider in WIDER if found.fits[-1].misfit <= most else ():
        other = tried.get(wider) or seen_wider(signals, wider, width, *ask)
        if other is None:
            break
        surer = as_sure(other, found) and level_of(other).std <= level_of(best).std
        # In rough windows a number that one width alone tells is contradicted by none.
        confirmed = not rough(other.fits[0]) or all(
            len(telling(n, other.fits)) > 1 for n in ("inertia", "fc")
        )
        if surer and confirmed and other.fits[0].misfit <= most:
            best = other
    return best


def seen_wider(signals: Sequence[Signals], wider: float, width: float, *ask: Any) -> Bands | None:
    """What windows so many times wider show; nothing where they are too wide for two bands."""
    try:
        other = in_bands(signals, wider * width, *ask, exponents=GAUSSIAN)
    except TooLittleSliding:
        return None
    return replace(other, widened=wider) if len(other.fits) > 1 else None


def level_of(found: Bands) -> Number:
    """The level of friction that all bands tell together, N·m (N)."""
    return together("fc", found.fits)


def as_sure(other: Bands, than: Bands) -> bool:
    """Whether all bands together tell inertia and the level of friction as surely."""
    return all(together(n, other.fits).std <= together(n, than.fits).std for n in ("inertia", "fc"))


def worth_a_look(found: Bands) -> tuple[float, ...]:
    """Of the wider windows, those in which the bands at hand do not say already that as much is left."""
    fits = found.fits
    known = {wider for wider, fit in zip(BANDS[1:], fits[1:], strict=False) if rough(fit)}
    falls = not known or fits[-1].misfit <= FALLS * fits[0].misfit
    return tuple(w for w in WIDER if w not in known and (falls or w in BANDS))


def tells_as_much(band: BandFit, other: BandFit) -> bool:
    """Whether inertia and the level of friction are as sure in a band as in the other."""
    return all(band.numbers[n].std <= other.numbers[n].std for n in ("inertia", "fc"))


def in_bands(
    signals: Sequence[Signals], width: float, axis: ServoAxis, options: Mapping[str, Any], harmonics: bool,
    period: float | None, exponents: Sequence[float] = tuple(USUAL_EXPONENTS),
) -> Bands:  # fmt: skip
    """Fits from the widest band of frequencies to the narrowest, friction falling with one of these exponents."""
    bands: list[BandFit] = []
    first: Widest | None = None
    lacking = TooLittleSliding("no band of the record slides long enough in one direction")
    for factor in BANDS:
        try:
            if first is None:
                first = in_widest(signals, factor * width, axis, options, harmonics, period, exponents)
                bands.append(first.seen.fits[0])
                continue
            skew = bands[0].numbers["skew"].value
            rows, falls, *_ = rows_of(signals, factor * width, skew, exponents, math.inf)
            bands.append(fit_band(rows, falls, **first.others))
        except TooLittleSliding as error:
            lacking = error
    if first is None:
        raise lacking
    if first.stiffer is not None and not swings_alike([b.swing for b in bands]):
        stiffer = {**options, "train": first.stiffer}
        return in_bands(signals, width, axis, stiffer, harmonics, period, exponents)
    return replace(first.seen, fits=tuple(bands))


class Widest(NamedTuple):
    """The widest band, how the others are fitted, and the train to be taken where its swing is none."""

    seen: Bands
    others: dict[str, Any]
    stiffer: Train | None


def in_widest(
    signals: Sequence[Signals], width: float, axis: ServoAxis, options: Mapping[str, Any], harmonics: bool,
    period: float | None, exponents: Sequence[float],
) -> Widest:  # fmt: skip
    """The first band: there the search for the skew begins, a torque over the position shows, and what moves."""
    known = options["skew"]
    start = clear_skew(signals, width) if known is None else known
    rows, falls, creep, steady = rows_of(signals, width, start, exponents, FAR[axis.motion])
    chosen: dict[str, Any] = {**options, "start": start}
    shown = shown_in(rows, falls, axis, period, chosen) if harmonics else []
    if harmonics:
        chosen |= orders_in(rows, axis, period, shown)
    orders: tuple[float, ...] = tuple(chosen.get("orders", ()))
    # A weight, and other torques over the position, are not in what slow rows are held against.
    if steady is not NOWHERE and axis.gravity != "pendulum" and not orders:
        creep = steady
    found, train, stiffer = fit_band(rows, falls, **chosen), options.get("train", Train.RIGID), None
    if "train" not in options:
        found, train, stiffer = freed(found, lambda train: fit_band(rows, falls, **chosen, train=train))
    alike = tuple(s.alike for s in shown)
    seen = Bands((found,), tuple(rows), orders, creep=creep, train=train, alike=alike)
    return Widest(seen, {**chosen, "train": train}, stiffer)


def freed(rigid: BandFit, fit: Callable[[Train], BandFit]) -> tuple[BandFit, Train, Train | None]:
    """What is fitted with as much give of the train as the rows need, and where that is a swing what else they may."""
    if rigid.flexible > HARDLY:
        return rigid, Train.RIGID, None
    gives, swings = fit(Train.GIVES), fit(Train.SWINGS)
    found, train = (gives, Train.GIVES) if gives.misfit < GIVES * rigid.misfit else (rigid, Train.RIGID)
    if swings.misfit < SWINGS * min(gives.misfit, rigid.misfit):
        return swings, Train.SWINGS, train
    return found, train, None


def decided(found: Bands, none: Bands) -> Bands:
    """What was found with an unusual skew, `none` where the torque acts about its row, or both where neither is clear.

    Torque over the position, or a train that rings, looks like a skew of many rows in a slow sine or tuning steps, and
    seen half a cycle late ringing explains itself by an inertia below 0. A delay that is one leaves several times less
    where the axis accelerates, or less in every band.
    """
    inertia = found.fits[0].numbers["inertia"]
    less = [n.misfit / max(f.misfit, 1e-300) for f, n in zip(found.fits, none.fits, strict=False)]
    if inertia.value <= QUANTILE * inertia.std or less[0] < 1.0:
        return none
    if less[0] >= CLEARLY or (len(less) > 1 and min(less) >= THROUGHOUT):
        return found
    return replace(found, fits=(*found.fits, *none.fits))


def shown_in(
    rows: Sequence[SlidingRows], falls: Sequence[Fall], axis: ServoAxis, period: float | None,
    options: Mapping[str, Any],
) -> list[Shown]:  # fmt: skip
    """Orders of a torque over the position that show."""
    skew = fit_band(rows, falls, **options).numbers["skew"].value
    curve = [k for k, fall in enumerate(falls) if fall.exponent in GAUSSIAN][::CURVE]
    candidates = orders_tried(rows, axis, period)
    return shown_orders(rows, skew, candidates, curve, own_of(axis), options.get("drifting", False))


def orders_in(
    rows: Sequence[SlidingRows], axis: ServoAxis, period: float | None, shown: Sequence[Shown]
) -> dict[str, Any]:
    """Those that show, and the lowest others, which may be there but are small."""
    orders = [s.order for s in shown]
    return {
        "orders": orders,
        "background": [o for o in orders_tried(rows, axis, period)[:BACKGROUND] if o not in orders],
        "blurred": not goes_round(rows, axis.motion == "rotary", period),
    }


def own_of(axis: ServoAxis) -> Sequence[float]:
    """Orders that are there in any case, cycles a radian: a pendulum's weight."""
    return WEIGHT if axis.gravity == "pendulum" else ()


def orders_tried(rows: Sequence[SlidingRows], axis: ServoAxis, period: float | None) -> list[float]:
    """The others, cycles a radian (m): the first is a pendulum's own."""
    return candidate_orders(rows, axis.motion == "rotary", period)[len(own_of(axis)) :]


def clear_skew(signals: Sequence[Signals], width: float) -> float:
    """A skew of some rows that shows at a glance, s; 0 where none does: where the search begins."""
    first, asked = signals[0], (width, tuple(signals[1:]))
    if asked not in first.glances:
        first.glances[asked] = at_a_glance(signals, width)
    return first.glances[asked]


def at_a_glance(signals: Sequence[Signals], width: float) -> float:
    """The same, looked at anew."""
    rows = [sliding_rows(s, Window(width, s.period)) for s in signals]
    period = max(r.signals.period for r in rows)
    reach = math.ceil(LOOKED / period)
    shifts, left = shifts_looked_at(lambda these: misfits(rows, these), reach, 20)
    found = clear_in(shifts, left, CLEAR * float(left[shifts == 0][0]))
    farther = math.floor(min(FARTHEST / period, STROKE * stroke_of(rows)))
    if farther > reach:
        # A shake fits itself some periods later: no near shift, nor a part of a row beside it, may leave as little.
        near = CLEAR * least_between(shifts, left)
        found = clear_in(*shifts_looked_at(lambda these: misfits(rows, these), farther, 60), near) or found
    return found * rows[0].signals.period


def clear_in(shifts: Whole, left: Array, most: float) -> int:
    """The shift that leaves the least, where that is no more than `most` and lies inside; else 0."""
    best = int(np.argmin(left))
    return int(shifts[best]) if 0 < best < shifts.size - 1 and left[best] <= most else 0


def stroke_of(rows: Sequence[SlidingRows]) -> float:
    """Rows of certain sliding in one direction, on average."""
    return sum(r.time.size for r in rows) / sum(1 + np.count_nonzero(np.diff(r.fixed[:, 2])) for r in rows)


def misfits(rows: Sequence[SlidingRows], shifts: Whole) -> Array:
    """What certain sliding leaves with the torque taken so many rows later, shape (shifts,)."""
    left = np.zeros(len(shifts))
    for r in rows:
        size = np.linalg.norm(r.fixed, axis=0)
        basis, _ = np.linalg.qr(r.fixed / np.where(size > 0.0, size, 1.0))
        (drive,) = seen(r.signals.drive, r.window.weights(0))
        for i, k in enumerate(shifts.tolist()):
            torque = drive[np.clip(r.places + k, 0, drive.size - 1)] - r.signals.loss * r.speed
            told = basis.T @ torque
            left[i] += float(torque @ torque - told @ told)
    return left


def rows_of(
    signals: Sequence[Signals], width: float, skew: float, exponents: Sequence[float], far: float
) -> tuple[list[SlidingRows], list[Fall], Creep, Creep]:
    """Rows seen through one window, without those where friction is still being rebuilt or the axis creeps with too
    little of it; the falls tried; that creeping; and what friction lacks `far` behind a reversal, rad (m)."""
    windows = [Window(width, s.period) for s in signals]
    first = [sliding_rows(s, w) for s, w in zip(signals, windows, strict=True)]
    speed = np.abs(stacked(first, "speed"))
    top = float(np.max(speed))
    levels = np.geomspace(max(float(np.min(speed)), SLOWEST * top), FASTEST * top, LEVELS).tolist()
    falls = [Fall.like(vs, exponent) for exponent in exponents for vs in levels]
    way = rebuilding_way(first, skew)
    rows = [r.falling_at(falls).farther(way) for r in first]
    rows = [r for r in rows if r.time.size >= FEWEST]
    if not rows:
        raise TooLittleSliding("friction is rebuilt over the whole of every stroke; record longer strokes")
    creep = creep_of(rows, skew)
    faster = [r for r in (r.faster(creep.speed) for r in rows) if r.time.size >= FEWEST]
    if not faster or creep is NOWHERE:
        faster, creep = rows, NOWHERE
    return faster, falls, creep, steady_lack(first, faster, skew, far)
