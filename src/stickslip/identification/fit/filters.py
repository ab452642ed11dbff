"""Zero-phase filters and spectra, replacing those of scipy.signal, whose import is slow.

Low-passes are second-order sections of the bilinear transform with prewarped corner (``oppenheim1999``, section 7.1;
see `docs/decisions/0019-filters-of-our-own.md`). Tests compare all of them to scipy.signal.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.simulation.biquads import zero_phase

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

RIPPLE = 0.05
"""Ripple in the pass band of the filter of `decimated`, dB."""
PASSES = np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
"""A section without effect."""


def butterworth_poles(order: int) -> Complex:
    """Return the poles above the real axis of the analogue Butterworth low-pass with corner 1 rad/s and even order."""
    if order < 2 or order % 2:
        raise InputError(f"order {order} of a low-pass must be even, 2 or more")
    angle = math.pi * (2.0 * np.arange(order // 2) + order + 1.0) / (2.0 * order)
    return np.exp(1j * angle)


def chebyshev_poles(order: int, ripple: float) -> Complex:
    """Return the poles above the real axis of the analogue Chebyshev low-pass of the first kind; `ripple` in dB."""
    angle = math.pi * (2.0 * np.arange(order // 2) + 1.0) / (2.0 * order)
    flat = math.asinh(1.0 / math.sqrt(10.0 ** (0.1 * ripple) - 1.0)) / order
    return -math.sinh(flat) * np.sin(angle) + 1j * math.cosh(flat) * np.cos(angle)


class ZeroPhase:
    """A low-pass applied forwards and backwards, for many series; it passes a constant unchanged.

    Parameters
    ----------
    poles : array, shape (m,)
        Poles of the analogue low-pass with the corner 1 rad/s, those above the real axis.
    corner, rate : float
        Hz; the corner below half the rate.
    reach : int, optional
        Number of values by which a series is extended at its ends by odd reflection; scipy.signal's default if None.

    Raises
    ------
    InputError
        If the corner is not between 0 and half the rate.
    """

    def __init__(self, poles: Complex, corner: float, rate: float, reach: int | None = None) -> None:
        if not 0.0 < corner < 0.5 * rate:
            raise InputError(
                f"corner {corner:g} Hz of a low-pass must be above 0 and below {0.5 * rate:g} Hz, half the rate"
            )
        s = math.tan(math.pi * corner / rate) * poles
        z = (1.0 + s) / (1.0 - s)
        ones, a1, a2 = np.ones(z.size), -2.0 * z.real, np.abs(z) ** 2
        b = 0.25 * (1.0 + a1 + a2)
        sections = np.column_stack([b, 2.0 * b, b, ones, a1, a2])
        # A section without effect makes their number even.
        self.sections = np.vstack([sections, PASSES]) if z.size % 2 else sections
        # Steady state of a section for a constant input of 1.
        self.start = np.column_stack([1.0 - self.sections[:, 0], self.sections[:, 2] - self.sections[:, 5]])
        self.reach = 3 * (2 * z.size + 1) if reach is None else reach

    def __call__(self, x: Array) -> Array:
        """Return the filtered series, extended at its ends by odd reflection, shape (n,)."""
        reach = min(self.reach, x.size - 1)
        ends = 2.0 * x[0] - x[reach:0:-1], 2.0 * x[-1] - x[-2 : -reach - 2 : -1]
        y = np.concatenate([ends[0], x, ends[1]])
        zero_phase(self.sections, self.start, y)
        return y[reach : y.size - reach]


def low_pass(x: Array, corner: float, rate: float, order: int = 4) -> Array:
    """Filter x by a Butterworth low-pass forwards and backwards; corner and rate in Hz."""
    return ZeroPhase(butterworth_poles(order), corner, rate)(x)


def decimated(x: Array, factor: int) -> Array:
    """Return every `factor`-th value after a zero-phase Chebyshev low-pass at 0.8 of the new Nyquist frequency."""
    return x if factor == 1 else ZeroPhase(chebyshev_poles(4, RIPPLE), 0.8 / factor, 2.0)(x)[::factor]


def spectrum(x: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Return frequencies (Hz) and power density by Welch's method, Hann windows of `length` samples, half overlap."""
    f = np.asarray(np.fft.rfftfreq(min(length, x.size), 1.0 / rate), dtype=np.float64)
    return f, np.asarray(cross_spectrum(x, x, rate, length).real, dtype=np.float64)


def cross_spectrum(x: Array, y: Array, rate: float, length: int) -> Complex:
    """Return the cross power density conj(X) Y by Welch's method, Hann windows of `length` samples, half overlap."""
    length = min(length, x.size)
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(length) / length)

    def transformed(series: Array) -> Complex:
        pieces = np.lib.stride_tricks.sliding_window_view(series, length)[:: length - length // 2]
        return np.fft.rfft(window * (pieces - np.mean(pieces, axis=1, keepdims=True)))

    power = np.mean(np.conj(transformed(x)) * transformed(y), axis=0) / (rate * np.sum(window**2))
    power[1 : power.size - (length % 2 == 0)] *= 2.0  # Negative frequencies; zero and Nyquist have none.
    return power
