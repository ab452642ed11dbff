"""Why feedback compensation oscillates: the sampled loop about rest; the question of thesis 5.2.

While everything sticks the contact is a spring, and a feedback compensator with a dynamic law is the same spring with the
opposite sign, read through the encoder, half a sample late and held. What is left of the stiffness is

    contact + k_p - gain x compensator,

so its gain has the static margin (contact + k_p) / compensator: little more than 1 on a stiff contact, and as little of the
contact may be missing. At the loop's own frequencies the delayed spring is a damper of either sign, which a filter takes
away. What a law loses in viscosity or by its jump, it gives as negative damping.

Laws enter by their describing functions (first harmonic balance; Gelb and Vander Velde 1968): for small motion of a given
amplitude the loop is linear, and where its growth passes through zero as the amplitude rises, it cycles. An encoder's
counts are a factor between 0 and 4/pi on motions of their size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse.presliding_loop import Contact, Drive, Loop, Poles, Train, describing
from stickslip.control.linear import Gains
from stickslip.model import Model

__all__ = ["COUNTED", "Axis", "Cycle", "Margins", "Recommended", "Stability", "gain_margin", "stability"]

Array = np.ndarray[Any, np.dtype[np.float64]]

COUNTED = 4.0 / math.pi
"""Largest value of a quantiser's describing function."""
MOST_GAIN = 3.0
TIMES = np.geomspace(1e-4, 4e-3, 33)
"""s, of the map over sample times."""
FILTERS = np.geomspace(2.0, 300.0, 33)
"""Hz, of the map over filters."""
AMPLITUDES = np.geomspace(1.0, 4096.0, 17)
"""Amplitudes at which cycles are looked for, over the smallest one."""
TRIED_GAINS = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5)
TRIED_FILTERS = (0.0, 200.0, 150.0, 100.0, 70.0, 50.0, 35.0, 25.0, 20.0, 15.0, 10.0, 7.0, 5.0, 3.0, 2.0)
RESERVE = 1.25
"""Factor on the recommended gain up to which the dynamics must stay stable."""
SOFTER = (1.0, 0.95, 0.9, 0.85, 0.8)
"""Shares of the contact at which the recommended setting must stay stable: friction varies by 20 % over a revolution
(thesis 3.2.2.3)."""
SLOW = 5.0
"""Hz: an instability below it creeps, it does not ring."""


@dataclass(frozen=True)
class Axis:
    """A train, the law of its contact, and the amplitude of motion at the encoder (rad) that counts as small."""

    train: Train
    friction: Model
    amplitude: float = math.pi * 2e-6

    @property
    def ringing(self) -> float:
        """Frequency of the whole inertia on the contact that the encoder sees, Hz."""
        stiff = self.at(self.amplitude, 100.0).visible
        return math.sqrt(max(stiff, 1e-9) / math.fsum(self.train.inertias)) / (2.0 * math.pi)

    def at(self, amplitude: float, frequency: float) -> Train:
        """The train with its contact as it is at that amplitude of the encoder (rad) and frequency (Hz)."""
        out = self.train
        # How far the contact moves depends on its stiffness, and that on how far it moves.
        for _ in range(3):
            moved = amplitude * (out.reach if out.contact.stiffness > 0.0 else 1.0)
            out = replace(self.train, contact=describing(self.friction, moved, frequency))
        return out


@dataclass(frozen=True)
class Cycle:
    """A limit cycle: frequency (Hz) and amplitude at the encoder (rad); infinite where none bounds the growth."""

    frequency: float
    amplitude: float


@dataclass(frozen=True)
class Margins:
    """How far one compensator is from instability.

    Attributes
    ----------
    name : str
        Empty: no compensation.
    law : Contact
        The compensator's law at the small amplitude.
    filter_hz : float
        Of its input; 0 for none.
    at_one : Poles
        Least stable pole with gain 1.
    gain : float
        The loop is stable for all gains from 0 to this; NaN where it is unstable without compensation.
    static : float
        The gain at which no stiffness is left.
    softer : float
        The part of the contact that may be missing with gain 1; NaN where that is unstable anyway.
    counts : float
        The loop with gain 1 is stable for all factors on the measured angle from 0 to this; above 4/pi the encoder's
        counts make no cycle; NaN where it is unstable anyway.
    cycle : Cycle or None
        Where an unstable loop ends, with gain 1; None where it is stable.
    """

    name: str
    law: Contact
    filter_hz: float
    at_one: Poles
    gain: float
    static: float
    softer: float
    counts: float
    cycle: Cycle | None

    def line(self) -> str:
        """A row of the table."""
        sieve = f"{self.filter_hz:g} Hz" if self.filter_hz else "none"
        pole = f"{self.at_one.growth:+9.1f}/s at {self.at_one.frequency:5.1f} Hz"
        end = ""
        if self.cycle:
            end = "grows on" if math.isinf(self.cycle.amplitude) else f"{_angle(self.cycle.amplitude)}"
            if math.isfinite(self.cycle.amplitude):
                end += f" at {self.cycle.frequency:.0f} Hz"
        verdict = "stable" if self.at_one.stable else "unstable"
        return (
            f"{self.name or 'none':<10}{sieve:>8}{self.law.stiffness:>9.1f}{self.law.damping:>11.4g}  {verdict:<9}"
            f"{pole}  {end:<20}{_number(self.gain):>6}{_number(self.static):>8}{_share(self.softer):>8}"
            f"{_number(self.counts):>8}"
        ).rstrip()


HEADER = (
    f"{'law':<10}{'filter':>8}{'N·m/rad':>9}{'N·m·s/rad':>11}  {'with gain 1':<32}{'ends in':<20}"
    f"{'gain':>6}{'static':>8}{'softer':>8}{'counts':>8}"
)


def _angle(amplitude: float) -> str:
    return f"{1e6 * amplitude:.0f} µrad" if amplitude < 1e-3 else f"{1e3 * amplitude:.3g} mrad"


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f">{MOST_GAIN:g}" if value >= MOST_GAIN else f"{value:.2f}"


def _share(value: float) -> str:
    return "-" if math.isnan(value) else f"{100.0 * value:.0f} %"


@dataclass(frozen=True)
class Recommended:
    """A gain and a filter (Hz, 0 for none) for a compensator, and the least stable pole with them."""

    name: str
    gain: float
    filter_hz: float
    poles: Poles


@dataclass(frozen=True, eq=False)
class Stability:
    """The margins of every compensator on one axis and drive.

    Attributes
    ----------
    axis : Axis
    drive : Drive
        Its law and gain are not used.
    train : Train
        With the contact as it is at the small amplitude.
    linear_limit : float
        The linear controller alone is stable up to this factor on its bandwidth; NaN where at none.
    margins : tuple of Margins
        The first without compensation.
    over_time, over_filter : mapping of str to array
        Gain margin at `TIMES` and, with a filter, at `FILTERS`.
    recommended : mapping of str to Recommended or None
        None where nothing tried is safe.
    """

    axis: Axis
    drive: Drive
    train: Train
    linear_limit: float
    margins: tuple[Margins, ...]
    over_time: Mapping[str, Array]
    over_filter: Mapping[str, Array]
    recommended: Mapping[str, Recommended | None]

    @property
    def linear(self) -> Margins:
        """Without compensation."""
        return self.margins[0]

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "train": asdict(self.train), "drive": asdict(self.drive), "visible_stiffness": self.train.visible,
            "amplitude": self.axis.amplitude, "linear_limit": self.linear_limit,
            "margins": [asdict(m) for m in self.margins],
            "sample_times": TIMES.tolist(), "filters": FILTERS.tolist(),
            "gain_over_sample_time": {k: v.tolist() for k, v in self.over_time.items()},
            "gain_over_filter": {k: v.tolist() for k, v in self.over_filter.items()},
            "recommended": {k: asdict(r) if r else None for k, r in self.recommended.items()},
        }  # fmt: skip

    def lines(self) -> list[str]:
        """What people read."""
        d = self.drive
        limit = "at no bandwidth" if math.isnan(self.linear_limit) else f"up to {self.linear_limit:.2f} times its bandwidth"
        return [
            f"motion of {_angle(self.axis.amplitude)}; contact as the encoder sees it {self.train.visible:.1f} N·m/rad, "
            f"k_p {d.gains.kp:.4g}; {1e3 * d.sample_time:g} ms, {d.delay} samples late",
            f"the linear controller alone is stable {limit}",
            "",
            HEADER,
            *(m.line() for m in self.margins),
            "",
            *(self._advice(name, found) for name, found in self.recommended.items()),
        ]

    def _advice(self, name: str, found: Recommended | None) -> str:
        if found:
            sieve = f"a filter of {found.filter_hz:g} Hz" if found.filter_hz else "no filter"
            pole = f"{found.poles.growth:+.1f}/s at {found.poles.frequency:.1f} Hz"
            return f"{name}: gain {found.gain:g} with {sieve} keeps its margins ({pole})"
        if not self.linear.at_one.stable:
            return f"{name}: the linear controller alone is unstable; lower its bandwidth first"
        return f"{name}: no gain from 0.5 to 1 keeps its margins with any filter from 2 Hz; use feedforward"


# ---- one loop ------------------------------------------------------------------------------------------------------


def stable(train: Train, drive: Drive, measured: float = 1.0) -> bool:
    """Whether the loop is stable."""
    return Loop(train, drive, measured).poles().stable


def _edge(good: Callable[[float], bool], points: Array) -> float:
    """The end of the stretch from the first point on in which `good` holds; NaN if not even there."""
    if not good(float(points[0])):
        return math.nan
    for low, high in zip(points[:-1], points[1:]):
        if not good(float(high)):
            inside, outside = float(low), float(high)
            for _ in range(20):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if good(middle) else (inside, middle)
            return inside
    return float(points[-1])


def gain_margin(train: Train, drive: Drive, law: Contact) -> float:
    """Gains from 0 to this leave the loop stable, at most `MOST_GAIN`; NaN where it is unstable without compensation."""
    # Steep laws go unstable at tiny gains: the first points are close together.
    points = np.concatenate([[0.0], np.geomspace(1e-4, 0.1, 10), np.linspace(0.2, MOST_GAIN, 29)])
    return _edge(lambda g: stable(train, replace(drive, law=law, gain=g)), points)


def _linear_limit(train: Train, drive: Drive) -> float:
    def good(s: float) -> bool:
        g = drive.gains
        scaled = Gains(g.kp * s * s, g.ki * s**3, g.kd * s, g.kr * s)
        return stable(train, replace(drive, gains=scaled, law=Contact(0.0)))

    return _edge(good, np.geomspace(0.02, 20.0, 61))


def _with_law(axis: Axis, drive: Drive, model: Model | None, amplitude: float, frequency: float) -> tuple[Train, Drive]:
    """Train and drive at an amplitude of the encoder; the compensator sees what its filter leaves of it."""
    train = axis.at(amplitude, frequency)
    if model is None:
        return train, replace(drive, law=Contact(0.0), filter_hz=0.0)
    left = 1.0
    if drive.filter_hz > 0.0:
        left = 1.0 / math.sqrt(1.0 + (frequency / drive.filter_hz) ** 4)
    return train, replace(drive, law=describing(model, amplitude * left, frequency), gain=1.0)


def _poles(axis: Axis, drive: Drive, model: Model | None, amplitude: float) -> Poles:
    """Least stable pole at an amplitude, with the laws as they are at its own frequency."""
    frequency = axis.ringing
    for _ in range(3):
        found = Loop(*_with_law(axis, drive, model, amplitude, frequency)).poles()
        if found.frequency < SLOW:
            break
        frequency = found.frequency
    return found


def _cycle(axis: Axis, drive: Drive, model: Model | None, first: Poles) -> Cycle | None:
    """Where the growth of an unstable loop ends as its amplitude rises."""
    if first.stable:
        return None
    low = axis.amplitude
    for factor in AMPLITUDES[1:]:
        high = factor * axis.amplitude
        if _poles(axis, drive, model, high).stable:
            for _ in range(8):
                middle = math.sqrt(low * high)
                low, high = (low, middle) if _poles(axis, drive, model, middle).stable else (middle, high)
            return Cycle(_poles(axis, drive, model, low).frequency, low)
        low = high
    return Cycle(first.frequency, math.inf)


def _margins(name: str, axis: Axis, drive: Drive, model: Model | None) -> Margins:
    at_one = _poles(axis, drive, model, axis.amplitude)
    frequency = at_one.frequency if at_one.frequency >= SLOW else axis.ringing
    train, there = _with_law(axis, drive, model, axis.amplitude, frequency)
    softer = counts = math.nan
    if at_one.stable:
        lost = _edge(lambda s: stable(train.softer(1.0 - s), there), np.linspace(0.0, 1.0, 51))
        softer = lost
        counts = _edge(lambda n: stable(train, there, n), np.linspace(1.0, MOST_GAIN, 41))
        if not all(stable(train, there, n) for n in np.linspace(0.05, 1.0, 20)):
            counts = 0.0
    law = there.law
    static = (train.visible + drive.gains.kp) / law.stiffness if law.stiffness > 1e-9 else math.inf
    return Margins(
        name, law, there.filter_hz, at_one, gain_margin(train, there, law) if model else math.nan,
        static if model else math.nan, softer, counts, _cycle(axis, drive, model, at_one),
    )  # fmt: skip


def _recommended(name: str, axis: Axis, drive: Drive, model: Model) -> Recommended | None:
    """The highest gain, and for it the highest filter, that keep the margins.

    The loop must be stable at the small amplitude with `RESERVE` times the gain (as far as the stiffness allows it), with
    the contact down to 80 %, and at all factors that an encoder's counts may make.
    """
    for gain in TRIED_GAINS:
        for corner in TRIED_FILTERS:
            train, setting = _with_law(
                axis, replace(drive, filter_hz=corner), model, axis.amplitude, axis.ringing
            )
            setting = replace(setting, gain=gain)
            if _safe(train, setting):
                return Recommended(name, gain, corner, Loop(train, setting).poles())
    return None


def _safe(train: Train, setting: Drive) -> bool:
    if not all(stable(train.softer(share), setting) for share in SOFTER):
        return False
    # Without stiffness left the loop creeps away whatever the filter: the reserve of the gain goes no further.
    static = (train.visible + setting.gains.kp) / max(setting.law.stiffness, 1e-9)
    more = replace(setting, gain=min(RESERVE * setting.gain, 0.999 * static))
    return stable(train, more) and all(stable(train, setting, n) for n in (0.25, 0.5, 0.75, 1.1, COUNTED))


# ---- all of them ---------------------------------------------------------------------------------------------------


def stability(
    axis: Axis, drive: Drive, models: Mapping[str, Model], filters: Sequence[float] = (0.0, 10.0)
) -> Stability:
    """Margins of feedback compensators, maps of them, and a recommendation.

    Parameters
    ----------
    axis : Axis
    drive : Drive
        Linear controller, sample time and delay.
    models : mapping of str to Model
        What the compensators believe, by name.
    filters : sequence of float
        Corners to report, Hz; 0 for none.

    Raises
    ------
    ParameterError
    """
    alone = replace(drive, law=Contact(0.0), filter_hz=0.0)
    rows = [_margins("", axis, alone, None)]
    rows += [
        _margins(name, axis, replace(alone, filter_hz=f), model) for name, model in models.items() for f in filters
    ]  # fmt: skip
    train = axis.at(axis.amplitude, axis.ringing)
    over_time: dict[str, Array] = {}
    over_filter: dict[str, Array] = {}
    for name, model in models.items():
        law = describing(model, axis.amplitude, axis.ringing)
        over_time[name] = np.array([gain_margin(train, replace(alone, sample_time=float(t)), law) for t in TIMES])
        over_filter[name] = np.array([_filtered(axis, alone, model, float(f)) for f in FILTERS])
    advice = {name: _recommended(name, axis, alone, model) for name, model in models.items()}
    return Stability(
        axis, alone, train, _linear_limit(train, alone), tuple(rows), over_time, over_filter, advice
    )  # fmt: skip


def _filtered(axis: Axis, drive: Drive, model: Model, corner: float) -> float:
    train, there = _with_law(axis, replace(drive, filter_hz=corner), model, axis.amplitude, axis.ringing)
    return gain_margin(train, there, there.law)
