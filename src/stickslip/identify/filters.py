"""Zero-phase filters and spectra, from scipy.signal, with types."""

# scipy.signal is typed in part only.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false, reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import signal

from stickslip.simulation._biquads import zero_phase

__all__ = ["ZeroPhase", "cross_spectrum", "decimated", "low_pass", "spectrum"]

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]


def low_pass(x: Array, corner: float, rate: float, order: int = 4) -> Array:
    """x behind a Butterworth low-pass run forwards and backwards; corner and rate in Hz."""
    b, a = signal.butter(order, corner, fs=rate)
    return np.asarray(signal.filtfilt(b, a, x), dtype=np.float64)


class ZeroPhase:
    """A Butterworth low-pass run forwards and backwards, for many series: `scipy.signal.sosfiltfilt`, laid out once."""

    def __init__(self, order: int, corner: float, rate: float) -> None:
        self.sections = signal.butter(order, corner, fs=rate, output="sos")
        self.start = signal.sosfilt_zi(self.sections)
        self.reach = 3 * (2 * len(self.sections) + 1)

    def __call__(self, x: Array) -> Array:
        """The series, turned over at its ends, behind the filter, shape (n,)."""
        reach = self.reach
        ends = 2.0 * x[0] - x[reach:0:-1], 2.0 * x[-1] - x[-2 : -reach - 2 : -1]
        y = np.concatenate([ends[0], x, ends[1]])
        zero_phase(self.sections, self.start, y)
        return y[reach:-reach]


def decimated(x: Array, factor: int) -> Array:
    """Every `factor`-th value behind a zero-phase Chebyshev low-pass at 0.8 of the new Nyquist frequency."""
    if factor == 1:
        return x
    sos = signal.cheby1(4, 0.05, 0.8 / factor, output="sos")
    return np.asarray(signal.sosfiltfilt(sos, x), dtype=np.float64)[::factor]


def spectrum(x: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Frequencies (Hz) and power density by Welch's method, Hann windows of `length` samples, half overlapping."""
    f, power = signal.welch(x, rate, window="hann", nperseg=length)
    return np.asarray(f, dtype=np.float64), np.asarray(power, dtype=np.float64)


def cross_spectrum(x: Array, y: Array, rate: float, length: int) -> Complex:
    """Cross power density conj(X) Y by Welch's method, Hann windows of `length` samples, half overlapping."""
    _, power = signal.csd(x, y, rate, window="hann", nperseg=length)
    return np.asarray(power, dtype=np.complex128)
