"""Zero-phase filters and spectra.

They are scipy.signal's, digit for digit (a test says so); importing that, with scipy.stats behind it, takes as long as
all else of a small identification.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel

__all__ = ["cross_spectrum", "decimated", "low_pass", "spectrum"]

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

RIPPLE = 0.05
"""Of the Chebyshev filter's pass band, dB."""


def low_pass(x: Array, corner: float, rate: float, order: int = 4, edge: int = 0) -> Array:
    """x behind a Butterworth low-pass run forwards and backwards; corner and rate in Hz, even order."""
    return both_ways(x, butterworth(order, 2.0 * corner / rate), edge)


def decimated(x: Array, factor: int) -> Array:
    """Every `factor`-th value behind a zero-phase Chebyshev low-pass at 0.8 of the new Nyquist frequency."""
    if factor == 1:
        return x
    return both_ways(x, chebyshev(4, 0.8 / factor))[::factor]


def butterworth(order: int, corner: float) -> Array:
    """Sections of a Butterworth low-pass of even order; the corner is relative to the Nyquist frequency."""
    angle = math.pi * (np.arange(order // 2) + 0.5) / order
    return digital(-np.sin(angle) + 1j * np.cos(angle), corner, 1.0)


def chebyshev(order: int, corner: float) -> Array:
    """Sections of a Chebyshev low-pass of the first kind, even order; the corner as in `butterworth`."""
    epsilon = math.sqrt(10.0 ** (0.1 * RIPPLE) - 1.0)
    width = math.asinh(1.0 / epsilon) / order
    angle = math.pi * (np.arange(order // 2) + 0.5) / order
    poles = -math.sinh(width) * np.sin(angle) + 1j * math.cosh(width) * np.cos(angle)
    return digital(poles, corner, 1.0 / math.sqrt(1.0 + epsilon * epsilon))


def digital(poles: Complex, corner: float, gain: float) -> Array:
    """Sections b0, b1, b2, a1, a2 of the low-pass with these poles (of each pair one) and that gain at rest.

    Bilinear transform with the corner prewarped: Oppenheim and Schafer, Discrete-Time Signal Processing, 7.1.
    """
    warped = math.tan(0.5 * math.pi * corner) * poles
    z = (1.0 + warped) / (1.0 - warped)
    a1, a2 = -2.0 * z.real, np.abs(z) ** 2
    level = 0.25 * (1.0 + a1 + a2)
    level[0] *= gain
    return np.column_stack([level, 2.0 * level, level, a1, a2])


def both_ways(x: Array, sections: Array, edge: int = 0) -> Array:
    """x filtered forwards and backwards; both ends are prolonged by their mirror image, turned about the end.

    `edge` is by how many samples: 0 for three times the taps.

    Raises
    ------
    ValueError
        If x is not longer than what is prolonged.
    """
    edge = edge or 3 * (2 * sections.shape[0] + 1)
    x = np.ascontiguousarray(x, dtype=np.float64)
    if x.size <= edge:
        raise ValueError(f"a signal of {x.size} samples is too short for this filter; it needs {edge + 1}")
    long = np.concatenate([2.0 * x[0] - x[edge:0:-1], x, 2.0 * x[-1] - x[-2 : -edge - 2 : -1]])
    for _ in range(2):
        run(long, sections)
        long = long[::-1].copy()
    return long[edge:-edge].copy()


@kernel()
def run(x: Any, sections: Any) -> None:
    """Filter x in place, section by section, as if it had been at its first value for ever."""
    for s in range(sections.shape[0]):
        b0, b1, b2, a1, a2 = sections[s]
        rest = (b0 + b1 + b2) / (1.0 + a1 + a2) * x[0]
        z2 = b2 * x[0] - a2 * rest
        z1 = b1 * x[0] - a1 * rest + z2
        for i in range(x.size):
            y = b0 * x[i] + z1
            z1 = b1 * x[i] - a1 * y + z2
            z2 = b2 * x[i] - a2 * y
            x[i] = y


def spectrum(x: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Frequencies (Hz) and power density by Welch's method, Hann windows of `length` samples, half overlapping."""
    power = cross_spectrum(x, x, rate, length)
    return np.arange(power.size) * rate / length, power.real


def cross_spectrum(x: Array, y: Array, rate: float, length: int) -> Complex:
    """Cross power density conj(X) Y by Welch's method, Hann windows of `length` samples, half overlapping.

    One-sided, each piece without its mean; Welch 1967.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(length) / length)

    def pieces(values: Array) -> Complex:
        parts = np.lib.stride_tricks.sliding_window_view(values, length)[:: length - length // 2]
        return np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window, axis=1)

    power = np.mean(pieces(x).conj() * pieces(y), axis=0) / (rate * float(window @ window))
    power[1 : -1 if length % 2 == 0 else None] *= 2.0
    return power
