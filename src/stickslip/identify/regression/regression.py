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

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.fit.smooth import Window, seen
from stickslip.identify.fit.uncertainty import RATIO
from stickslip.identify.regression.band_fit import BandFit, Number, fit_band
from stickslip.identify.regression.orders import candidate_orders, goes_round, shown_orders
from stickslip.identify.regression.sliding_rows import (
    FEWEST,
    Signals,
    SlidingRows,
    narrowest_width,
    signals_of,
    sliding_rows,
)
from stickslip.identify.regression.strokes import stacked
from stickslip.identify.trial import Trial
from stickslip.machines.servo import ServoAxis

__all__ = ["Regression", "regress_axis"]

Array = np.ndarray[Any, np.dtype[np.float64]]

BANDS = (1.0, 1.6, 2.6)
"""Widths of the windows, in that of the narrowest which noise allows."""
LEVELS = 18
"""Stribeck velocities that are averaged over, from `SLOWEST` to `FASTEST` of the highest speed."""
SLOWEST, FASTEST = 1e-3, 3.0
SKEW_ROWS, SKEW_TIME = 1.0, 1e-3
"""Rows, or s if longer, by which a torque column usually lies off at most (one standard deviation)."""
TELLING, NARROW = 4.0, 0.1
"""A band tells of a number where its standard deviation is at most so many times the smallest, or that part of the
value."""
LOOKED, CLEAR = 0.04, 0.5
"""s over which a skew is looked for at a glance; part of the misfit without one that it must leave at most."""
UNSURE = 0.3
"""Part of Fc to which the torque that accelerates must be known for friction to be believed."""
USUALLY = 2.0
"""Standard deviations of the usual skew that need no inertia above 0 to be believed."""
GIVEN = 0.05
"""Rows to which a skew that is given is known."""
REBUILT, SHORT, MARGIN = -0.15, 0.6, 2.5
"""Friction this far below the level, in parts of it, is still being rebuilt after a reversal; the part of the rows that
may be left out for that; and how much farther they are left out."""
LEVEL, EXCLUDED = 0.05, 0.05
"""Half-width, in parts of Fc, up to which it is told in any case; probability of a fall up to which none is there."""
LEVEL_UNTOLD = (
    "extrapolated: friction may still fall at the highest recorded speeds, and viscous friction is not told apart "
    "from it"
)
BACKGROUND = 12
"""Lowest orders of a torque over the position that is small, but may be there."""
QUANTILE = 1.96
ROTATED = {"gravity_sin", "gravity_cos"}


@dataclass(frozen=True, eq=False)
class Regression:
    """What the bands say together.

    Attributes
    ----------
    numbers : dict of str to Number
        ``inertia``, ``sigma2``, ``fc``, ``offset``, ``fs`` (the curve's end at rest), ``skew`` (s by which the
        column of the torque lies behind the torque that acted; negative: ahead), and of a pendulum ``gravity_sin``,
        ``gravity_cos``.
    bands : tuple of BandFit
        From the widest band of frequencies to the narrowest.
    orders : tuple of float
        Cycles a radian (m) of the torque over the position that were found.
    falls : float
        Probability that friction falls with velocity within the recorded speeds (Stribeck effect).
    vs : Number
        Of its velocity, if it does; rad/s (m/s).
    slowest, fastest : float
        Speeds of certain sliding: their first percentile and the highest.
    period : float
        s from row to row.
    rows : tuple of SlidingRows
        Of the widest band.
    """

    numbers: dict[str, Number]
    bands: tuple[BandFit, ...]
    orders: tuple[float, ...]
    falls: float
    vs: Number
    slowest: float
    fastest: float
    period: float
    rows: tuple[SlidingRows, ...]

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a number."""
        n = self.numbers[name]
        return n.value - QUANTILE * n.std, n.value + QUANTILE * n.std

    def left_by(self, values: Mapping[str, float]) -> float:
        """RMS of the torque that inertia, sigma2, fc, offset and gravity leave in the rows of certain sliding, N·m
        (N)."""
        fixed, position = stacked(self.rows, "fixed"), stacked(self.rows, "position")
        torque = np.concatenate([r.torque(self.numbers["skew"].value) for r in self.rows])
        known = fixed @ np.array([values[n] for n in ("inertia", "sigma2", "fc", "offset")])
        known = known + values.get("gravity_sin", 0.0) * np.sin(position)
        known = known + values.get("gravity_cos", 0.0) * np.cos(position)
        return float(np.sqrt(np.mean((torque - known) ** 2)))

    @property
    def doubt(self) -> str:
        """Why its numbers are not to be believed; empty where they are."""
        inertia, level = self.numbers["inertia"], abs(self.numbers["fc"].value)
        usual = float(np.sqrt(np.mean(stacked(self.rows, "fixed")[:, 0] ** 2)))
        unsure = QUANTILE * inertia.std * usual
        if unsure <= UNSURE * level:
            return ""
        return (
            f"the axis does not follow its torque as one inertia does: what its acceleration needs is unsure to "
            f"{unsure / max(level, 1e-300):.2g} of Fc"
        )

    @property
    def level_doubt(self) -> str:
        """Why the level that friction falls to with velocity is not told; empty where it is.

        Where a fall is not excluded and viscous friction not told apart from its end, level and slope are one number at
        the highest speeds: the level is extrapolated, however narrow half of its value would seem.
        """
        level, (low, high) = self.numbers["fc"], self.interval("sigma2")
        sure = QUANTILE * level.std <= LEVEL * abs(level.value)
        if sure or self.falls <= EXCLUDED or 0.0 < high <= RATIO * low:
            return ""
        return LEVEL_UNTOLD

    @property
    def fall_shown(self) -> float:
        """Friction at rest above its level, in standard deviations."""
        rest, level = self.numbers["fs"], self.numbers["fc"]
        return (rest.value - level.value) / max(math.hypot(rest.std, level.std), 1e-300)

    @property
    def harmonics(self) -> Array:
        """Amplitude of every order found, N·m (N), shape (k,)."""
        return np.hypot(*self.bands[0].harmonics.T) if self.orders else np.zeros(0)

    def held_for(self, tolerance: float) -> bool:
        """Whether the torque acted as recorded from row to row: half a row ahead, to a part of a row."""
        low, high = (x / self.period + 0.5 for x in self.interval("skew"))
        return -tolerance <= low and high <= tolerance


def regress_axis(
    trials: Sequence[Trial], axis: ServoAxis, *, skew: float | None = None, harmonics: bool = True,
    harmonic_period: float | None = None,
) -> Regression:  # fmt: skip
    """Inertia, friction, offset and skew of an axis by least squares on certain sliding, in several bands.

    Parameters
    ----------
    trials : sequence of Trial
        With the drive's signal. Fitted together.
    axis : ServoAxis
    skew : float, optional
        s by which the column of the torque lies behind the torque that acted, where it is known.
    harmonics : bool
        Whether a torque over the position is looked for.
    harmonic_period : float, optional
        rad (m) after which it repeats; a turn unless given.

    Returns
    -------
    Regression

    Raises
    ------
    InputError
        If the records slide too little in one direction at a time, or a motor's constant is missing.
    """
    if not trials:
        raise InputError("no record; give at least one")
    signals = [signals_of(t, axis) for t in trials]
    width = max(narrowest_width(s) for s in signals)
    period = max(s.period for s in signals)
    size = max(SKEW_ROWS * period, SKEW_TIME) if skew is None else GIVEN * period
    options: dict[str, Any] = {"pendulum": axis.gravity == "pendulum", "skew_size": size, "skew": skew}
    bands, widest, orders = in_bands(signals, width, axis, options, harmonics, harmonic_period)
    if skew is None and not follows(bands[0], widest, size):
        # Seen half a cycle late, ringing explains itself by an inertia below 0: the torque acts about its row.
        bands, widest, orders = in_bands(
            signals, width, axis, {**options, "skew": 0.0}, harmonics, harmonic_period
        )
    speed = np.abs(stacked(widest, "speed"))
    falls, vs = fall_of(bands)
    numbers = {name: together(name, bands) for name in bands[0].numbers}
    if skew is not None:
        numbers["skew"] = Number(skew, size)
    return Regression(
        numbers, tuple(bands), tuple(orders), falls, vs, float(np.quantile(speed, 0.01)),
        float(np.max(speed)), period, tuple(widest),
    )  # fmt: skip


def in_bands(
    signals: Sequence[Signals], width: float, axis: ServoAxis, options: Mapping[str, Any], harmonics: bool,
    period: float | None,
) -> tuple[list[BandFit], list[SlidingRows], list[float]]:  # fmt: skip
    """Fits from the widest band of frequencies to the narrowest, the rows of the widest, and its orders."""
    bands: list[BandFit] = []
    widest: list[SlidingRows] = []
    chosen: dict[str, Any] = {}
    lacking = InputError("no band of the record slides long enough in one direction")
    for factor in BANDS:
        try:
            if not bands:
                known = options["skew"]
                start = clear_skew(signals, factor * width) if known is None else known
                widest, levels = rows_of(signals, factor * width, start)
                own = {**options, "start": start}
                chosen = {
                    "start": start,
                    **(orders_in(widest, levels, axis, period, own) if harmonics else {}),
                }
                rows = widest
            else:
                rows, levels = rows_of(signals, factor * width, bands[0].numbers["skew"].value)
            bands.append(fit_band(rows, levels, **{**options, **chosen}))
        except InputError as error:
            lacking = error
    if not bands:
        raise lacking
    return bands, widest, chosen.get("orders", [])


def follows(band: BandFit, rows: Sequence[SlidingRows], size: float) -> bool:
    """Whether a fit's skew may be one: a small one, or one with an inertia above 0."""
    inertia, skew = band.numbers["inertia"], band.numbers["skew"]
    return abs(skew.value) <= USUALLY * size or inertia.value > QUANTILE * inertia.std


def orders_in(
    rows: Sequence[SlidingRows], levels: Sequence[float], axis: ServoAxis, period: float | None,
    options: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """Orders of a torque over the position that show, and the lowest others, which may be there but are small."""
    skew = fit_band(rows, levels, **options).numbers["skew"].value
    candidates = candidate_orders(rows, axis.motion == "rotary", period)
    candidates = candidates[axis.gravity == "pendulum" :]  # the first is a pendulum's own
    shown = shown_orders(rows, skew, candidates)
    return {
        "orders": shown, "background": [o for o in candidates[:BACKGROUND] if o not in shown],
        "blurred": not goes_round(rows, axis.motion == "rotary", period),
    }  # fmt: skip


def clear_skew(signals: Sequence[Signals], width: float) -> float:
    """A skew of some rows that shows at a glance, s; 0 where none does: where the search begins."""
    rows = [sliding_rows(s, Window(width, s.period)) for s in signals]
    reach = math.ceil(LOOKED / max(s.period for s in signals))
    left = np.zeros(2 * reach + 1)
    for r in rows:
        size = np.linalg.norm(r.fixed, axis=0)
        basis, _ = np.linalg.qr(r.fixed / np.where(size > 0.0, size, 1.0))
        (drive,) = seen(r.signals.drive, r.window.weights(0))
        for k in range(-reach, reach + 1):
            torque = drive[np.clip(r.places + k, 0, drive.size - 1)] - r.signals.loss * r.speed
            told = basis.T @ torque
            left[k + reach] += float(torque @ torque - told @ told)
    best = int(np.argmin(left))
    if best in (0, 2 * reach) or left[best] > CLEAR * left[reach]:
        return 0.0
    return (best - reach) * rows[0].signals.period


def rows_of(signals: Sequence[Signals], width: float, skew: float) -> tuple[list[SlidingRows], list[float]]:
    """Rows seen through one window, without those where friction is still being rebuilt; and the vs tried."""
    windows = [Window(width, s.period) for s in signals]
    first = [sliding_rows(s, w) for s, w in zip(signals, windows, strict=True)]
    speed = np.abs(stacked(first, "speed"))
    top = float(np.max(speed))
    levels = np.geomspace(max(float(np.min(speed)), SLOWEST * top), FASTEST * top, LEVELS).tolist()
    way = rebuilding_way(first, skew)
    rows = [r.falling_at(levels).farther(way) for r in first]
    rows = [r for r in rows if r.time.size >= FEWEST]
    if not rows:
        raise InputError("friction is rebuilt over the whole of every stroke; record longer strokes")
    return rows, levels


def rebuilding_way(records: Sequence[SlidingRows], skew: float) -> float:
    """Way after a reversal or stop over which friction is still being built up again, rad (m).

    Pre-sliding, play and wind-up all leave friction below its level there, whatever their law.
    """
    fixed, gone = stacked(records, "fixed"), stacked(records, "gone")
    torque = np.concatenate([r.torque(skew) for r in records])
    middle = float(np.median(gone))
    far = gone >= middle
    values = np.linalg.lstsq(fixed[far], torque[far], rcond=1e-9)[0]
    level = float(values[2])
    if level <= 0.0 or middle <= 0.0:
        return 0.0
    lacking = (torque - fixed @ values) * fixed[:, 2] / level
    edges = np.geomspace(max(float(gone.min()), 1e-9 * middle), middle, 25)
    last = 0.0
    for low, high in itertools.pairwise(edges.tolist()):
        inside = (gone >= low) & (gone < high)
        if np.count_nonzero(inside) >= 3 and np.median(lacking[inside]) < REBUILT:
            last = high
    # Both directions must be left.
    most = [
        float(np.quantile(gone[fixed[:, 2] * side > 0.0], SHORT))
        for side in (-1.0, 1.0)
        if np.any(fixed[:, 2] * side > 0.0)
    ]
    return min(MARGIN * last, *most)


def together(name: str, bands: Sequence[BandFit]) -> Number:
    """One number of all bands that tell of it: their mean, and their spread beside each one's own."""
    numbers = [b.numbers[name] for b in bands]
    least = min(n.std for n in numbers)
    signed = name in ROTATED or name in ("skew", "offset")
    told = [n for n in numbers if n.std <= max(TELLING * least, 0.0 if signed else NARROW * abs(n.value))]
    found = mixed(told)
    against = [
        n for n in numbers
        if n not in told and abs(n.value - found.value) > QUANTILE * math.hypot(n.std, found.std)
    ]  # fmt: skip
    return mixed([*told, *against]) if against else found


def mixed(numbers: Sequence[Number]) -> Number:
    """Their mean, with the spread of what each says."""
    value = math.fsum(n.value for n in numbers) / len(numbers)
    variance = math.fsum(n.std**2 + (n.value - value) ** 2 for n in numbers) / len(numbers)
    return Number(value, math.sqrt(variance))


def fall_of(bands: Sequence[BandFit]) -> tuple[float, Number]:
    """Probability that friction falls within the recorded speeds in every band, and vs if it does."""
    falls = min(b.falls for b in bands)
    logs: list[Mapping[str, float]] = []
    for b in bands:
        weight = b.probability[1:]
        if weight.sum() <= 0.0:
            continue
        weight = weight / weight.sum()
        place = np.log(b.stribeck[1:])
        middle = float(weight @ place)
        logs.append({"middle": middle, "variance": float(weight @ (place - middle) ** 2)})
    if not logs:
        return falls, Number(math.nan, math.inf)
    middle = math.fsum(x["middle"] for x in logs) / len(logs)
    variance = math.fsum(x["variance"] + (x["middle"] - middle) ** 2 for x in logs) / len(logs)
    return falls, Number(math.exp(middle), math.exp(middle) * math.sqrt(variance))
