"""Power spectral density of an oscillating run, its peaks and the excited modes; thesis 4.5, figures 4.58, 4.59.

Welch's estimate: Hann windows that overlap by half, means removed, one-sided, so that its integral over frequency is
the variance of the signal.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

SEGMENTS = 8
"""Default number of windows over a record."""
PROMINENCE = 10.0
"""Smallest prominence of a peak, dB: noise averaged over 8 windows stays below."""
NEAR = 0.12
"""Largest relative distance between a peak and the mode named for it."""
FEWEST = 64
MOST = 100_000_000


@dataclass(frozen=True)
class Peak:
    """One peak.

    Attributes
    ----------
    frequency : float
        Hz
    amplitude : float
        Of a sinusoid with the power of the peak, in the signal's unit.
    share : float
        Of the signal's variance.
    mode : str
        Name of the excited mode; empty if none is near.
    """

    frequency: float
    amplitude: float
    share: float
    mode: str


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Power spectral density of one channel.

    Attributes
    ----------
    name, channel, unit : str
        Of the record, of the channel, of the signal.
    frequency, density : array, shape (n,)
        Hz, unit²/Hz (one-sided).
    rms : float
        Of the signal without its mean.
    sample_rate : float
        Hz
    peaks : tuple of Peak
        The strongest first.
    modes : mapping of str to float
        Modes for comparison, Hz, as they appear at this sample rate.
    """

    name: str
    channel: str
    unit: str
    frequency: Array
    density: Array
    rms: float
    sample_rate: float
    peaks: tuple[Peak, ...]
    modes: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, without the curve."""
        return {
            "record": self.name, "channel": self.channel, "unit": self.unit, "rms": self.rms,
            "sample_rate": self.sample_rate, "resolution": float(self.frequency[1]), "modes": dict(self.modes),
            "peaks": [asdict(p) for p in self.peaks],
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        head = (
            f"{self.name}: {self.channel}, RMS {self.rms:.4g} {self.unit} about its mean, "
            f"{self.sample_rate:g} samples/s, resolution {self.frequency[1]:.3g} Hz"
        )
        if not self.peaks:
            return [head, f"  no peak rises {PROMINENCE:g} dB above its surroundings"]
        rows = [
            f"  {p.frequency:8.1f} Hz  amplitude {p.amplitude:8.3g} {self.unit}  {100 * p.share:5.1f} % of the variance"
            f"{f'  {p.mode}' if p.mode else ''}"
            for p in self.peaks
        ]
        return [head, *rows]


def channel_of(record: Record, channel: str) -> tuple[Array, str]:
    """Return a channel's values and unit; missing ``position_error`` and ``velocity`` are computed from others."""
    if channel in record.channels:
        return record[channel], record.units[channel]
    if channel == "position_error" and "position_reference" in record.channels:
        return record["position_reference"] - record["position"], record.units["position"]
    if channel == "velocity" and "position" in record.channels:
        return np.gradient(record["position"], record.time), f"{record.units['position']}/s"
    return record[channel], ""  # raises, and lists the channels


def evenly(record: Record, values: Array) -> tuple[Array, Array]:
    """Return times and values of the signal on an even grid with the median spacing of the record.

    Raises
    ------
    InputError
        If there are too few samples.
    """
    first = np.flatnonzero(np.diff(record.time, prepend=-math.inf))  # a time may occur twice
    time = record.time[first]
    good = np.isfinite(values[first]) & np.isfinite(time)
    time, values = time[good], values[first][good]
    if time.size < FEWEST:
        raise InputError(f"spectrum: {time.size} samples are too few; give at least {FEWEST}")
    # Rows at events are between those of the grid: the usual spacing is the longest common one.
    spacing = float(np.quantile(np.diff(time), 0.9))
    with np.errstate(over="ignore"):
        count = float((time[-1] - time[0]) / spacing * (1.0 + 1e-9))
    if not 0.0 < count <= MOST:
        raise InputError(
            f"spectrum: {time.size} times from {time[0]:g} to {time[-1]:g} s make no even grid of up to {MOST}; fix "
            "them"
        )
    count = math.floor(count) + 1
    grid = np.arange(count, dtype=np.float64) * spacing + float(time[0])
    return grid, np.interp(grid, time, values)


def seen_at(frequency: float, rate: float) -> float:
    """Return the apparent frequency of a signal that is sampled at `rate`, Hz."""
    folded = math.fmod(frequency, rate)
    return min(folded, rate - folded)


def spectrum(
    record: Record,
    channel: str = "position_error",
    *,
    modes: Mapping[str, float] | None = None,
    resolution: float | None = None,
    start: float = 0.0,
    end: float = math.inf,
    name: str = "",
) -> Spectrum:
    """Return the power spectral density of a channel of a record.

    Parameters
    ----------
    record : Record
    channel : str
        A channel of the record; ``position_error`` is position_reference - position.
    modes : mapping of str to float, optional
        Known modes by name, Hz. One above half the sample rate is searched at its alias.
    resolution : float, optional
        Hz; a window is 1/resolution long. Default: 8 windows over the record.
    start, end : float
        s: the part of the record to use.
    name : str
        Of the record.

    Raises
    ------
    ParameterError, InputError
    """
    named = {f"modes[{label!r}]": f for label, f in (modes or {}).items()}
    for words, hertz in {**named, **({} if resolution is None else {"resolution": resolution})}.items():
        if not 0.0 < hertz < math.inf:
            raise ParameterError(f"spectrum: {words} = {hertz:g} Hz must be a finite number greater than 0")
    if not start < end:
        raise ParameterError(f"spectrum: start = {start:g} s must be before end = {end:g} s")
    values, unit = channel_of(record, channel)
    inside = (record.time >= start) & (record.time <= end)
    part = Record(record.time[inside], {channel: values[inside]}, {channel: unit})
    time, signal = evenly(part, part[channel])
    rate = 1.0 / float(time[1] - time[0])
    count = min(signal.size, round(rate / resolution) if resolution else 2 * signal.size // (SEGMENTS + 1))
    welch: Any = importlib.import_module("scipy.signal").welch
    frequency, density = welch(signal, rate, nperseg=max(count, FEWEST // 2), detrend="constant")
    known = {label: seen_at(f, rate) for label, f in (modes or {}).items()}
    variance = float(np.var(signal))
    found = _peaks(frequency, density, variance, known)
    return Spectrum(name, channel, unit, frequency, density, math.sqrt(variance), rate, found, known)


def _peaks(frequency: Array, density: Array, variance: float, modes: Mapping[str, float]) -> tuple[Peak, ...]:
    """Return the peaks, strongest first, with their modes."""
    if variance <= 0.0 or not np.any(density > 0.0):
        return ()
    signal: Any = importlib.import_module("scipy.signal")
    level = 10.0 * np.log10(np.maximum(density, 1e-12 * density.max()))
    # The first bins contain the motion itself and the remainder of the mean.
    places, about = signal.find_peaks(level[2:], prominence=PROMINENCE)
    out: list[Peak] = []
    for place, left, right in zip(places + 2, about["left_bases"] + 2, about["right_bases"] + 2, strict=True):
        low, high = _foot(level, int(place), int(left), -1), _foot(level, int(place), int(right), 1)
        power = float(np.sum(density[low : high + 1]) * frequency[1])
        at = float(np.average(frequency[place - 1 : place + 2], weights=density[place - 1 : place + 2]))
        out.append(Peak(at, math.sqrt(2.0 * power), power / variance, _nearest(at, modes)))
    return tuple(sorted(out, key=lambda p: -p.share))


def _foot(level: Array, place: int, base: int, step: int) -> int:
    """Return the end of a peak on one side: 20 dB below it, or its base."""
    i = place
    while i != base and level[i] > level[place] - 20.0:
        i += step
    return min(max(i, 0), level.size - 1)


def _nearest(frequency: float, modes: Mapping[str, float]) -> str:
    """Return the mode nearest to a peak, if near enough."""
    if not modes:
        return ""
    name = min(modes, key=lambda m: abs(modes[m] - frequency))
    return name if abs(modes[name] - frequency) <= NEAR * modes[name] else ""
