"""Why feedback compensation oscillates: the sampled loop about rest; the question of thesis 5.2.

While everything sticks the contact is a spring, and a feedback compensator with a dynamic law is the same spring with
the opposite sign, read through the encoder, half a sample late and held. What is left of the stiffness is

    contact + k_p - gain x compensator,

so its gain has the static margin (contact + k_p) / compensator: little more than 1 on a stiff contact, and as little of
the contact may be missing. At the loop's own frequencies the delayed spring is a damper of either sign, which a filter
takes away. What a law takes by viscosity or by a jump at v = 0, its compensation gives back as negative damping.

Laws enter by their describing functions (first harmonic balance): for small motion of a given amplitude the loop is
linear, and where its growth passes through zero as the amplitude rises, it cycles. An encoder's counts are a factor
between 0 and 4/pi on motions of their size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from stickslip.analyse.presliding_loop import Axis, Drive, Loop, Poles, Sampled, describing
from stickslip.analyse.stability_result import (
    FILTERS,
    GAINS,
    MOST_GAIN,
    TIMES,
    Cycle,
    Map,
    Margins,
    SafeGain,
    Stability,
)
from stickslip.control.linear import Gains
from stickslip.control.short_form import highest_corner
from stickslip.errors import ParameterError
from stickslip.machines.drivetrain import FREE, Drivetrain, LinearContact
from stickslip.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

COUNTED = 4.0 / math.pi
"""Largest value of a quantiser's describing function."""
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


# ---- one loop ------------------------------------------------------------------------------------------------------


def stable(drivetrain: Drivetrain, drive: Sampled, measured: float = 1.0) -> bool:
    """Whether the loop is stable."""
    return Loop(drivetrain, drive, measured).poles().stable


def edge(good: Callable[[float], bool], points: Array) -> float:
    """The end of the stretch from the first point on in which `good` holds; NaN if not even there."""
    if not good(float(points[0])):
        return math.nan
    for low, high in pairwise(points):
        if not good(float(high)):
            inside, outside = float(low), float(high)
            for _ in range(20):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if good(middle) else (inside, middle)
            return inside
    return float(points[-1])


def gain_margin(drivetrain: Drivetrain, drive: Drive, law: LinearContact) -> float:
    """The loop is stable for all gains from 0 to this, at most `MOST_GAIN`; NaN where it is unstable without any."""
    # Steep laws go unstable at tiny gains: the first points are close together.
    points = np.concatenate([[0.0], np.geomspace(1e-4, 0.1, 10), np.linspace(0.2, MOST_GAIN, 29)])
    return edge(lambda g: stable(drivetrain, replace(drive, law=law, gain=g)), points)


def _linear_limit(drivetrain: Drivetrain, drive: Drive) -> float:
    def good(s: float) -> bool:
        g = drive.gains
        scaled = Gains(g.kp * s * s, g.ki * s**3, g.kd * s, g.kr * s)
        return stable(drivetrain, replace(drive, gains=scaled, law=FREE))

    return edge(good, np.geomspace(0.02, 20.0, 61))


def with_law(
    axis: Axis, drive: Drive, model: Model | None, amplitude: float, frequency: float
) -> tuple[Drivetrain, Drive]:
    """Drivetrain and drive at an amplitude of the encoder; the compensator sees what its filter leaves of it."""
    drivetrain = axis.at(amplitude, frequency)
    if model is None:
        return drivetrain, replace(drive, law=FREE, filter_hz=0.0)
    left = 1.0
    if drive.filter_hz > 0.0:
        left = 1.0 / math.sqrt(1.0 + (frequency / drive.filter_hz) ** 4)
    return drivetrain, replace(drive, law=describing(model, amplitude * left, frequency), gain=1.0)


def _poles(axis: Axis, drive: Drive, model: Model | None, amplitude: float) -> Poles:
    """Least stable pole at an amplitude, with the laws as they are at its own frequency."""
    found = Loop(*with_law(axis, drive, model, amplitude, axis.ringing)).poles()
    for _ in range(2):
        if found.frequency < SLOW:
            break
        found = Loop(*with_law(axis, drive, model, amplitude, found.frequency)).poles()
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
    drivetrain, there = with_law(axis, drive, model, axis.amplitude, frequency)
    softer = counts = math.nan
    if at_one.stable:
        lost = edge(lambda s: stable(drivetrain.softer(1.0 - s), there), np.linspace(0.0, 1.0, 51))
        softer = lost
        counts = edge(lambda n: stable(drivetrain, there, n), np.linspace(1.0, MOST_GAIN, 41))
        if not all(stable(drivetrain, there, n) for n in np.linspace(0.05, 1.0, 20)):
            counts = 0.0
    law = there.law
    static = (drivetrain.visible + drive.gains.kp) / law.stiffness if law.stiffness > 1e-9 else math.inf
    return Margins(
        name, law, there.filter_hz, at_one, gain_margin(drivetrain, there, law) if model else math.nan,
        static if model else math.nan, softer, counts, _cycle(axis, drive, model, at_one),
    )  # fmt: skip


def _recommended(name: str, axis: Axis, drive: Drive, model: Model) -> SafeGain | None:
    """The highest gain, and for it the highest filter, that keep the margins.

    The loop must be stable at the small amplitude with `RESERVE` times the gain (as far as the stiffness allows it),
    with the contact down to 80 %, and at all factors that an encoder's counts may make.
    """
    for gain in TRIED_GAINS:
        for corner in (f for f in TRIED_FILTERS if f <= highest_corner(drive.sample_time)):
            drivetrain, setting = with_law(
                axis, replace(drive, filter_hz=corner), model, axis.amplitude, axis.ringing
            )
            setting = replace(setting, gain=gain)
            if _safe(drivetrain, setting):
                return SafeGain(name, gain, corner, Loop(drivetrain, setting).poles())
    return None


def _safe(drivetrain: Drivetrain, setting: Drive) -> bool:
    if not all(stable(drivetrain.softer(share), setting) for share in SOFTER):
        return False
    # Without stiffness left the loop creeps away whatever the filter: the reserve of the gain goes no further.
    static = (drivetrain.visible + setting.gains.kp) / max(setting.law.stiffness, 1e-9)
    more = replace(setting, gain=min(RESERVE * setting.gain, 0.999 * static))
    return stable(drivetrain, more) and all(
        stable(drivetrain, setting, n) for n in (0.25, 0.5, 0.75, 1.1, COUNTED)
    )


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
    for corner in filters:
        if not 0.0 <= corner < math.inf:
            raise ParameterError(f"stability: filter = {corner:g} Hz must be a finite number of 0 or more")
    alone = replace(drive, law=FREE, filter_hz=0.0)
    rows = [_margins("", axis, alone, None)]
    rows += [
        _margins(name, axis, replace(alone, filter_hz=f), model) for name, model in models.items() for f in filters
    ]  # fmt: skip
    drivetrain = axis.at(axis.amplitude, axis.ringing)
    over_time: dict[str, Array] = {}
    over_filter: dict[str, Array] = {}
    for name, model in models.items():
        law = describing(model, axis.amplitude, axis.ringing)
        over_time[name] = np.array(
            [gain_margin(drivetrain, replace(alone, sample_time=float(t)), law) for t in TIMES]
        )
        over_filter[name] = np.array([_filtered(axis, alone, model, float(f)) for f in FILTERS])
    stiffest = max(models, key=lambda name: describing(models[name], axis.amplitude, axis.ringing).stiffness)
    advice = {name: _recommended(name, axis, alone, model) for name, model in models.items()}
    return Stability(
        axis, alone, drivetrain, _linear_limit(drivetrain, alone), tuple(rows), over_time, over_filter, advice,
        _map(axis, stiffest, models[stiffest], [replace(alone, sample_time=float(t)) for t in TIMES]),
        _map(axis, stiffest, models[stiffest], [replace(alone, filter_hz=float(f)) for f in FILTERS]),
    )  # fmt: skip


def _map(axis: Axis, name: str, model: Model, drives: Sequence[Drive]) -> Map:
    growth, frequency = np.empty((GAINS.size, len(drives))), np.empty((GAINS.size, len(drives)))
    for j, drive in enumerate(drives):
        drivetrain, there = with_law(axis, drive, model, axis.amplitude, axis.ringing)
        for i, gain in enumerate(GAINS):
            found = Loop(drivetrain, replace(there, gain=float(gain))).poles()
            growth[i, j], frequency[i, j] = found.growth, found.frequency
    return Map(name, growth, frequency)


def _filtered(axis: Axis, drive: Drive, model: Model, corner: float) -> float:
    drivetrain, there = with_law(axis, replace(drive, filter_hz=corner), model, axis.amplitude, axis.ringing)
    return gain_margin(drivetrain, there, there.law)
