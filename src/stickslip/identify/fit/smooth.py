"""A Gaussian window over a regular record: the record itself, and its derivatives, as seen through that window.

Derivatives come from the window's own (the weak form of a differential equation: whatever the signal, the integral of
window times derivative is minus that of the window's derivative times signal). What is seen at a row depends on rows
within `Window.reach` alone, so that rows near a reversal, at rest or in doubt are left out without a trace.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.int64]]

CORNER = 0.1325
"""Corner frequency (-3 dB) of a Gaussian window times its width: sqrt(ln 2) / (2 pi)."""
REACH = 4.5
"""Widths after which the window ends."""
BLOCK = 1 << 14
"""Rows of a block of a long series, at least."""
GATHERED = 1 << 16
"""Numbers that are gathered at a time where only some rows are asked for."""
NARROWEST = 1.5
"""Rows of the narrowest window whose derivatives are still those of a Gaussian."""


@dataclass(frozen=True)
class Window:
    """A Gaussian window.

    Attributes
    ----------
    width : float
        Standard deviation, s; at least `NARROWEST` rows.
    period : float
        From row to row, s.
    """

    width: float
    period: float

    @property
    def reach(self) -> int:
        """Rows on either side."""
        return max(3, math.ceil(REACH * self.width / self.period))

    @property
    def corner(self) -> float:
        """Its corner frequency, Hz."""
        return CORNER / self.width

    def weights(self, derivative: int = 0, late: float = 0.0) -> Array:
        """What each row within reach counts, shape (2 reach + 1 or more,): sum(w x) is the derivative at the middle.

        Exact for a constant, and for the power of the derivative's order (4 at most). With `late` the window lies so
        many seconds behind the row (derivative 0).
        """
        reach = self.reach + math.ceil(abs(late) / self.period)
        t = np.arange(-reach, reach + 1) * self.period - late
        x = t / self.width
        bell = np.exp(-0.5 * x * x)
        bell /= bell.sum()
        if derivative == 0:
            return bell
        if derivative == 1:
            return x * bell / (x * bell @ t)
        if derivative == 2:
            w = (x * x - 1.0) * bell
            w -= bell * w.sum()
            return w / (w @ (0.5 * t * t))
        if derivative == 3:
            w = (x**3 - 3.0 * x) * bell
            w -= self.weights(1) * (w @ t)
            return w / (w @ (t**3 / 6.0))
        w = (x**4 - 6.0 * x * x + 3.0) * bell
        w -= bell * w.sum()
        w -= self.weights(2) * (w @ (0.5 * t * t))
        return w / (w @ (t**4 / 24.0))

    def noise(self, derivative: int) -> float:
        """Standard deviation of the derivative where the rows have independent noise of standard deviation 1."""
        return float(np.linalg.norm(self.weights(derivative)))


def seen(series: Array, *weights: Array) -> list[Array]:
    """The series, shape (n,), through each set of weights, at every row; the ends are continued by their last value."""
    reach = max(w.size for w in weights) // 2
    size = 1 << (series.size + 4 * reach).bit_length()
    block = max(BLOCK, 1 << (16 * reach).bit_length())
    # A long series goes in blocks that overlap by the reach: they stay in the processor's cache.
    size, step = (size, series.size) if size <= 8 * block else (block, block - 2 * reach)
    count = -(-series.size // step)
    padded = np.pad(series, (reach, reach + size + count * step - series.size), mode="edge")
    frames = np.lib.stride_tricks.sliding_window_view(padded, size)[: count * step : step]
    spectrum = np.fft.rfft(frames, axis=1)
    out: list[Array] = []
    for w in weights:
        full = np.fft.irfft(spectrum * np.fft.rfft(w[::-1], size), size, axis=1)
        begin = reach + w.size // 2
        out.append(full[:, begin : begin + step].ravel()[: series.size])
    return out


def seen_at(series: Array, weights: Array, places: Rows) -> Array:
    """The same through one set of weights, at some rows alone, shape (places,)."""
    reach = weights.size // 2
    # Asked for often and of few rows: `np.pad` alone would take half of the time.
    padded = np.concatenate([np.full(reach, series[0]), series, np.full(reach, series[-1])])
    frames = np.lib.stride_tricks.sliding_window_view(padded, weights.size)
    count = max(1, GATHERED // weights.size)
    parts = [frames[places[i : i + count]] @ weights for i in range(0, places.size, count)]
    return np.concatenate(parts) if parts else np.zeros(0)


def root_mean_square(x: Array) -> float:
    """Of a series."""
    return float(np.sqrt(np.mean(x * x)))
