"""The rows of a record in which the axis slides for certain, and what each says about inertia and friction.

Every row is seen through a window (`stickslip.identify.fit.smooth`), torque and motion through the same. Rows whose
window holds a reversal, a stop, or the distance over which a contact builds up its torque again are left out: nothing
about the moment at which friction turned round is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.smooth import CORNER, NARROWEST, Window, seen, seen_at
from stickslip.identify.regression.inverse import uniform, white_noise
from stickslip.machines.servo import ServoAxis
from stickslip.record import encoder_step

Array = np.ndarray[Any, np.dtype[np.float64]]

HIGHEST_CORNER = 60.0  # Hz, of the narrowest window
NOISE_SHARE = 2e-3  # largest share of noise in the acceleration's power
WIDENED, WIDEST = 1.15, 0.02  # from one window to the next; of the record's length, at most
FINER = 3.0  # times narrower: the window that tells whether the axis moves
CERTAIN = 6.0  # standard deviations of the fine velocity's noise from which on its sign is certain
CREEPING = 3e-3  # of the usual speed
FEWEST = 30  # rows
DIRECTION = 2  # its column
KEPT = 2_000_000  # numbers of falls laid out that are kept for another look, at 8 bytes each
VANISHED = 700.0  # exponent beyond which a fall of friction is 0


class TooLittleSliding(InputError):
    """A record has too little gross sliding for a window: another window, or none, is then used."""


class Fall(NamedTuple):
    """How friction falls with velocity: as exp(-|v/vs|^exponent); vs in rad/s (m/s)."""

    vs: float
    exponent: float

    @classmethod
    def like(cls, vs: float, exponent: float) -> Fall:
        """The one of which a tenth is left where it is of that with exponent 2, rad/s (m/s)."""
        return cls(vs * math.log(10.0) ** (0.5 - 1.0 / exponent), exponent)

    def at(self, speed: Array) -> Array:
        """What is left of it at a speed, shape as that."""
        ratio = np.abs(speed) / self.vs
        # A square is exact, and much faster than a power.
        power = ratio * ratio if self.exponent == 2.0 else ratio**self.exponent
        return np.asarray(np.exp(-np.minimum(power, VANISHED)), dtype=np.float64)


class Logged(NamedTuple):
    """The rows of a record as they were logged: times, positions and drive torques, s, rad (m), N·m (N)."""

    time: Array
    position: Array
    drive: Array


@dataclass(frozen=True, eq=False)
class Signals:
    """An experiment on a regular grid, without gaps: what the windows look at.

    Attributes
    ----------
    time, position, drive : array, shape (n,)
        s, rad (m), and the torque that the drive's signal means before what its speed takes of it, N·m (N).
    loss : float
        Torque lost per velocity, N·m·s/rad.
    rows : array of bool, shape (n,)
        Which count.
    noise : float
        Standard deviation of the position's white part, rad (m).
    origin : float
        What was taken off the position, rad (m).
    logged : Logged
        The same before it was laid on the grid, positions from the record's own zero.
    count : float
        What the column of the torque is rounded to, N·m (N); 0 where it is to nothing that shows.
    """

    time: Array
    position: Array
    drive: Array
    loss: float
    rows: np.ndarray[Any, np.dtype[np.bool_]]
    noise: float
    origin: float
    logged: Logged
    count: float = 0.0

    @property
    def period(self) -> float:
        """From row to row, s."""
        return float((self.time[-1] - self.time[0]) / (self.time.size - 1))

    @property
    def middle(self) -> float:
        """Half way from the first row to the last, s."""
        return 0.5 * float(self.time[0] + self.time[-1])

    @cached_property
    def kept(self) -> dict[Window, SlidingRows]:
        """What windows have shown: most are asked for again, beside another skew or a drift."""
        return {}

    @cached_property
    def glances(self) -> dict[tuple[float, tuple[Signals, ...]], float]:
        """Skews that showed at a glance, s, by the narrowest window's width and the signals that were looked at beside
        these."""
        return {}


def signals_of(experiment: Experiment, axis: ServoAxis) -> Signals:
    """The experiment on a regular grid."""
    t, q, u, rate = uniform(experiment)
    gain, loss = axis.drive_gains(experiment.quantity)
    supply = 1.0 if experiment.supply is None else np.interp(t, experiment.time, experiment.supply)
    rows = np.interp(t, experiment.time, experiment.rows.astype(np.float64)) > 0.5
    noise = math.sqrt(white_noise(q, rate) * rate / 2.0)
    count = gain * float(np.median(supply)) * encoder_step(experiment.signal())
    sliding = np.asarray(rows, dtype=np.bool_)
    held = 1.0 if experiment.supply is None else experiment.supply
    logged = Logged(experiment.time, experiment.position, gain * held * experiment.signal())
    return Signals(t, q - q[0], gain * supply * u, loss, sliding, noise, float(q[0]), logged, count)


def narrowest_width(signals: Signals) -> float:
    """Width of the narrowest window through which noise leaves the acceleration alone, s.

    Raises
    ------
    TooLittleSliding
        If that window is long beside the record.
    """
    width = max(NARROWEST * signals.period, CORNER / HIGHEST_CORNER)
    seconds = signals.time.size * signals.period
    while True:
        if width > WIDEST * seconds:
            raise TooLittleSliding(
                f"the position is so coarse that gross sliding shows over {width:.2g} s alone, and the record lasts "
                f"{seconds:.3g} s; record faster motion, or a finer position"
            )
        window = Window(width, signals.period)
        (acceleration,) = seen(signals.position, window.weights(2))
        if (signals.noise * window.noise(2)) ** 2 <= NOISE_SHARE * float(np.var(acceleration)):
            break
        width *= WIDENED
    return width


@dataclass(frozen=True, eq=False)
class SlidingRows:
    """What certain sliding says, seen through one window.

    Attributes
    ----------
    time, position, speed : array, shape (n,)
        s, rad (m), rad/s (m/s; signed).
    fixed : array, shape (n, p)
        Acceleration, velocity, direction, 1.
    jerk, snap : array, shape (n,)
        Derivatives of the acceleration, the first and the second, rad/s³ and rad/s⁴ (m/s³, m/s⁴).
    falling : array, shape (n, m)
        What is left of friction's fall, in the direction of motion, for every one that `falling_at` was asked for.
    stroke : array of int, shape (n,)
        Stretch of sliding in one direction that a row belongs to, 0 ...
    signals : Signals
    window : Window
    places : array of int, shape (n,)
        Rows of the signals.
    gone : array, shape (n,)
        Way since the last reversal or stop, rad (m).
    quick : array
        Velocity of every row of the signals, seen through a narrower window, rad/s (m/s).
    """

    time: Array
    position: Array
    speed: Array
    fixed: Array
    jerk: Array
    snap: Array
    falling: Array
    stroke: np.ndarray[Any, np.dtype[np.int64]]
    signals: Signals
    window: Window
    places: np.ndarray[Any, np.dtype[np.int64]]
    gone: Array
    quick: Array

    @cached_property
    def laid_out(self) -> dict[tuple[Fall, ...], SlidingRows]:
        """What `falling_at` was asked for: as much is asked for again beside a drift."""
        return {}

    def falling_at(self, falls: Sequence[Fall]) -> SlidingRows:
        """The same rows, with every one of these falls of friction laid out."""
        asked = tuple(falls)
        if asked in self.laid_out:
            return self.laid_out[asked]
        sign, middle = self.fixed[:, DIRECTION], self.window.weights(0)
        falling = [seen_at(fall.at(self.quick), middle, self.places) * sign for fall in falls]
        found = replace(self, falling=np.column_stack(falling))
        if found.falling.size <= KEPT:
            self.laid_out[asked] = found
        return found

    @property
    def spacing(self) -> float:
        """From one row to the next of the same stroke, s."""
        return stride_of(self.window) * self.window.period

    def farther(self, distance: float) -> SlidingRows:
        """Only the rows that lie farther behind a reversal or stop, rad (m)."""
        return self.only(self.gone > distance)

    def faster(self, speed: float) -> SlidingRows:
        """Only the rows at which the axis is faster, rad/s (m/s)."""
        return self.only(np.abs(self.speed) > speed)

    def only(self, kept: np.ndarray[Any, np.dtype[np.bool_]]) -> SlidingRows:
        """Only some of the rows."""
        return SlidingRows(
            self.time[kept], self.position[kept], self.speed[kept], self.fixed[kept], self.jerk[kept], self.snap[kept],
            self.falling[kept], np.unique(self.stroke[kept], return_inverse=True)[1].astype(np.int64),
            self.signals, self.window, self.places[kept], self.gone[kept], self.quick,
        )  # fmt: skip

    def torque(self, skew: float) -> Array:
        """The torque that acted, if the recorded one lies `skew` seconds behind it, N·m (N), shape (n,).

        A torque that is held after its row acts spread over the row, one that is a mean was so before: seen through a
        window whose variance is greater, or less, by that of the spread, it goes with the motion.
        """
        window = replace(self.window, width=math.sqrt(self.window.width**2 + self.spread(skew)))
        drive = seen_at(self.signals.drive, window.weights(0, late=skew), self.places)
        return drive - self.signals.loss * self.speed

    def spread(self, skew: float) -> float:
        """Variance of the time over which a row's torque acts, s²; below 0 where the column is a mean.

        Of an even spread that begins (a hold) or ends (a mean) at the row, and whose middle lies `skew` off it: over a
        row at most. A skew of two rows or more is a delay, which says nothing of a spread.
        """
        row, off = self.signals.period, abs(skew)
        middle = max(0.0, min(off, 0.5 * row, row - 0.5 * off))
        return math.copysign(middle**2 / 3.0, -skew)

    def around(self, order: float) -> Array:
        """Cosine and sine of `order` cycles a radian (m) of position, as seen through the window, shape (n, 2)."""
        angle = 2.0 * math.pi * order * self.position
        # Over a window the speed hardly changes: the mean of a harmonic over it.
        damped = np.exp(-0.5 * (2.0 * math.pi * order * self.speed * self.window.width) ** 2)
        return np.column_stack([np.cos(angle) * damped, np.sin(angle) * damped])


def stride_of(window: Window) -> int:
    """Rows of the signals from one that is looked at to the next: neighbours within a window say the same."""
    return max(1, int(window.width / window.period))


def sliding_rows(signals: Signals, window: Window) -> SlidingRows:
    """The rows of certain sliding.

    Parameters
    ----------
    signals : Signals
    window : Window

    Raises
    ------
    TooLittleSliding
        If there are hardly any.
    """
    if window not in signals.kept:
        signals.kept[window] = seen_through(signals, window)
    return signals.kept[window]


def seen_through(signals: Signals, window: Window) -> SlidingRows:
    """The same, looked at anew."""
    q, period = signals.position, signals.period
    v, a, jerk, snap = seen(q, *(window.weights(k) for k in (1, 2, 3, 4)))
    fine = fine_window(window)
    (quick,) = seen(q, fine.weights(1))
    direction = np.sign(quick)
    turned = np.concatenate([[False], direction[1:] != direction[:-1]])
    doubtful = turned | (direction_in(signals, fine, quick) == 0.0) | ~signals.rows
    clear = ~within(doubtful, window.reach)
    clear[: window.reach] = clear[q.size - window.reach :] = False
    stride = stride_of(window)
    places = np.flatnonzero(clear[::stride]) * stride
    if places.size < FEWEST:
        raise TooLittleSliding(
            f"too little gross sliding: it lasts {longest_run(~doubtful) * period:.3g} s at a time at most, of which "
            f"{places.size * stride * period:.3g} s in all are far enough from reversals and stops for a window of "
            f"{2 * window.reach * period:.3g} s; record longer motion in one direction, a finer position, or rows "
            "more often"
        )
    stopped = np.maximum.accumulate(np.where(doubtful, np.arange(q.size), 0))
    sign = direction[places]
    rises = np.concatenate([[True], (np.diff(places) > stride) | (sign[1:] != sign[:-1])])
    stroke = np.cumsum(rises) - 1
    return SlidingRows(
        signals.time[places], q[places] + signals.origin, v[places],
        np.column_stack([a[places], v[places], sign, np.ones(places.size)]), jerk[places], snap[places],
        np.zeros((places.size, 0)), stroke, signals, window, places, np.abs(q[places] - q[stopped[places]]), quick,
    )  # fmt: skip


def longest_run(marked: np.ndarray[Any, np.dtype[np.bool_]]) -> int:
    """Return the length of the longest run of marked rows."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return int(np.max(np.diff(ends)[::2], initial=0))


def fine_window(window: Window) -> Window:
    """The narrower window that tells whether the axis moves."""
    return Window(max(NARROWEST * window.period, window.width / FINER), window.period)


def direction_in(signals: Signals, fine: Window, quick: Array) -> Array:
    """Direction of motion at every row of the signals, 0 where it is not certain; `quick` is the velocity that such a
    narrower window shows, rad/s (m/s)."""
    certain = max(CERTAIN * signals.noise * fine.noise(1), CREEPING * float(np.sqrt(np.mean(quick**2))))
    return np.asarray(np.where(np.abs(quick) < certain, 0.0, np.sign(quick)), dtype=np.float64)


def within(marked: np.ndarray[Any, np.dtype[np.bool_]], reach: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Rows that have a marked one within so many rows."""
    counted = np.concatenate([[0], np.cumsum(marked)])
    n = marked.size
    low = np.maximum(np.arange(n) - reach, 0)
    high = np.minimum(np.arange(n) + reach + 1, n)
    return counted[high] > counted[low]
