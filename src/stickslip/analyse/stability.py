"""Why feedback compensation oscillates: the sampled loop about rest; the question of thesis 5.2.

While everything sticks the contact is a spring, and a feedback compensator with a dynamic law is the same spring with
the opposite sign, measured by the encoder, delayed by half a sample and held. The remaining stiffness is

    contact + k_p - gain x compensator,

so its gain has the static margin (contact + k_p) / compensator: only slightly above 1 on a stiff contact, so the loop
tolerates only a small loss of contact stiffness. At the loop's own frequencies the delayed spring is a damper of either
sign, which a filter removes. The viscous part of a law, or its jump at v = 0, becomes negative damping by compensation.

Laws are represented by their describing functions (first harmonic balance): for small motion of a given amplitude the
loop is linear. It has a limit cycle at the amplitude at which its growth is zero. Quantisation by the encoder is a
factor between 0 and 4/pi for motion of a few counts.
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
from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import FREE, Drivetrain, LinearContact
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

COUNTED = 4.0 / math.pi
"""Largest value of a quantiser's describing function."""
AMPLITUDES = np.geomspace(1.0, 4096.0, 17)
"""Amplitudes for the search of limit cycles, relative to the smallest one."""
TRIED_GAINS = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5)
TRIED_FILTERS = (0.0, 200.0, 150.0, 100.0, 70.0, 50.0, 35.0, 25.0, 20.0, 15.0, 10.0, 7.0, 5.0, 3.0, 2.0)
RESERVE = 1.25
"""Factor on the recommended gain up to which the loop must be stable."""
SOFTER = (1.0, 0.95, 0.9, 0.85, 0.8)
"""Shares of the contact stiffness with which the recommended setting must be stable: friction varies by 20 % over a
revolution
(thesis 3.2.2.3)."""
SLOW = 5.0
"""Hz: a slower instability creeps instead of ringing."""


# ---- one loop ------------------------------------------------------------------------------------------------------


def stable(drivetrain: Drivetrain, drive: Sampled, measured: float = 1.0) -> bool:
    """Whether the loop is stable."""
    return Loop(drivetrain, drive, measured).poles().stable


def edge(good: Callable[[float], bool], points: Array) -> float:
    """Return the end of the interval from the first point in which `good` is true; NaN if it is false at the first."""
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
    """Return the gain up to which the loop is stable from 0 on, at most `MOST_GAIN`; NaN if it is unstable at 0."""
    # Steep laws become unstable at tiny gains, so the first points are close together.
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
    """Return drivetrain and drive at an amplitude of the encoder; the compensator's input is filtered."""
    drivetrain = axis.at(amplitude, frequency)
    if model is None:
        return drivetrain, replace(drive, law=FREE, filter_hz=0.0)
    left = 1.0
    if drive.filter_hz > 0.0:
        left = 1.0 / math.sqrt(1.0 + (frequency / drive.filter_hz) ** 4)
    return drivetrain, replace(drive, law=describing(model, amplitude * left, frequency), gain=1.0)


def _poles(axis: Axis, drive: Drive, model: Model | None, amplitude: float) -> Poles:
    """Return the least stable pole at an amplitude, with the laws at its own frequency."""
    found = Loop(*with_law(axis, drive, model, amplitude, axis.ringing)).poles()
    for _ in range(2):
        if found.frequency < SLOW:
            break
        found = Loop(*with_law(axis, drive, model, amplitude, found.frequency)).poles()
    return found


def _cycle(axis: Axis, drive: Drive, model: Model | None, first: Poles) -> Cycle | None:
    """Return the limit cycle of an unstable loop."""
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
    """Return the highest gain, and for it the highest filter corner, that keep the margins.

    The loop must be stable at the small amplitude with `RESERVE` times the gain (as far as the stiffness allows), with
    80 % of the contact stiffness, and for all factors of the encoder's quantisation.
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
    # Without remaining stiffness the loop creeps away with any filter, so the reserve of the gain ends there.
    static = (drivetrain.visible + setting.gains.kp) / max(setting.law.stiffness, 1e-9)
    more = replace(setting, gain=min(RESERVE * setting.gain, 0.999 * static))
    return stable(drivetrain, more) and all(
        stable(drivetrain, setting, n) for n in (0.25, 0.5, 0.75, 1.1, COUNTED)
    )


# ---- all of them ---------------------------------------------------------------------------------------------------


def stability(
    axis: Axis, drive: Drive, models: Mapping[str, Model], filters: Sequence[float] = (0.0, 10.0)
) -> Stability:
    """Return margins of feedback compensators, maps of them, and a recommendation.

    Parameters
    ----------
    axis : Axis
    drive : Drive
        Linear controller, sample time and delay.
    models : mapping of str to Model
        Models of the compensators, by name.
    filters : sequence of float
        Filter corners to report, Hz; 0 for none.

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
