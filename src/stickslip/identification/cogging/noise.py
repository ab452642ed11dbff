"""Noise of a torque over the angle: the spectral density of the residual at each order, stroke by stroke.

A loop that controls a speed removes slow noise from the torque and keeps fast noise, depending on the speed: white
noise, equal in all strokes, would be far too large at low orders. Differences between the strokes beyond their noise
widen the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.cogging.rows import Places
from stickslip.identification.fit.student import student_quantile

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.intp]]

LAGS = 60
FADED = 0.05
"""Correlation of the residual below which places count as independent."""
LONG = 400
"""Fewest places of a stroke to determine the density of its noise."""
MOST = 0.95
"""Least share of the places in such strokes."""
UNEVEN = 4.0
"""Greatest ratio of a stroke's steps, between deciles, to determine it."""
BAND = 24
"""Fewest bins on each side over which a density is averaged; a quarter of the bin's number if that is more."""
NORMAL = 1.96
BESIDE = 2
"""Bins on each side of a fitted order, whose noise the fit has reduced."""


def memory(residual: Array, stroke: Integers) -> float:
    """Return the places over which a residual is correlated within a stroke: the factor on the variance of a mean."""
    power, total = float(residual @ residual), 1.0
    for lag in range(1, min(LAGS, residual.size - 1)):
        same = stroke[lag:] == stroke[:-lag]
        share = float(np.sum((residual[lag:] * residual[:-lag])[same])) / max(power, 1e-300)
        if share < FADED:
            break
        total += 2.0 * share
    return total


def long_strokes(places: Places) -> list[Integers]:
    """Return the rows of strokes that determine the density of their noise; none if too many places are in others."""
    edges = np.flatnonzero(np.diff(places.stroke) != 0) + 1
    rows = [r for r in np.split(np.arange(len(places)), edges) if r.size >= LONG and _even(places.angle[r])]
    return rows if sum(r.size for r in rows) >= MOST * len(places) else []


def _even(angle: Array) -> bool:
    low, high = np.percentile(np.abs(np.diff(angle)), [10, 90]).tolist()
    return high < UNEVEN * low


@dataclass(frozen=True, eq=False)
class Noise:
    """Rows of each long stroke, and the density of its noise."""

    rows: tuple[Integers, ...]
    density: tuple[Array, ...]

    @classmethod
    def of(cls, places: Places, noise: Array, orders: Sequence[float]) -> Noise:
        """Estimate the density from the residual of a fit of these orders, shape (n,)."""
        rows = long_strokes(places)
        spacing = [float(np.ptp(places.angle[r])) / (r.size - 1.0) for r in rows]
        fitted = np.array([0.0, *sorted(set(orders))]) / (2.0 * math.pi)
        return cls(
            tuple(rows), tuple(density_of(noise[r], fitted * d) for r, d in zip(rows, spacing, strict=True))
        )

    def whitened(self, columns: Array) -> list[Array]:
        """Return the columns of each stroke, shape (m, k), by orders, in standard deviations of the noise at each."""
        return self._weighted(columns, -0.5)

    def spread(self, columns: Array) -> list[Array]:
        """Return the noise covariance of the products of each stroke's columns with the torque, shape (k, k)."""
        return [x.T @ x for x in self._weighted(columns, 0.5)]

    def _weighted(self, columns: Array, power: float) -> list[Array]:
        out: list[Array] = []
        for rows, density in zip(self.rows, self.density, strict=True):
            size = 2 * (density.size - 1)
            weight = np.full(density.size, 2.0 / size)
            weight[[0, -1]] = 1.0 / size
            waves = np.fft.rfft(columns[rows], size, axis=0)
            waves *= (np.sqrt(weight) * np.maximum(density, 1e-300) ** power)[:, None]
            out.append(np.concatenate([waves.real, waves.imag]))
        return out


def density_of(residual: Array, fitted: Array) -> Array:
    """Return the power of each Fourier bin per place, without the bins near `fitted` (periods per place).

    The number of places is padded to a power of two, shape (power / 2 + 1,).
    """
    taper = np.hanning(residual.size)
    size = 1 << math.ceil(math.log2(residual.size))
    power = np.abs(np.fft.rfft(taper * residual, size)) ** 2 / float(taper @ taper)
    fine = size / residual.size
    number = np.arange(power.size)
    free = np.ones(power.size)
    for one in np.unique(fitted):
        free[np.abs(number - one * size) <= BESIDE * fine] = 0.0
    reach = np.maximum(math.ceil(BAND * fine), number // 4)
    low, high = np.maximum(number - reach, 0), np.minimum(number + reach + 1, power.size)
    sums, counts = (np.concatenate([[0.0], np.cumsum(x)]) for x in (free * power, free))
    count = counts[high] - counts[low]
    out = (sums[high] - sums[low]) / np.maximum(count, 1.0)
    return np.where(count > 0.0, out, float(np.mean(power)))


def excess(misfit: Array, orders: Array, strokes: int) -> Array:
    """Return the differences between strokes in variances of their noise, at least 1, shape (k,).

    `misfit`: each column's squared size in the residual, in variances, summed over the strokes.

    An order in both parts has the same residual for cosine and sine in a stroke; for levels the mean is used.
    """
    out = np.ones(orders.size)
    levels = np.flatnonzero(orders == 0.0)
    if strokes > levels.size:
        out[levels] = max(1.0, float(misfit[0]) / (strokes - levels.size))
    for n in np.unique(orders[orders > 0.0]):
        own = np.flatnonzero(orders == n)
        if 2 * strokes > own.size:
            parts = own.size / 2.0
            out[own] = max(1.0, float(np.sum(misfit[own])) / parts / (2 * strokes - own.size))
    return out


def widened(misfit: Array, orders: Array, strokes: int) -> Array:
    """Return the factors on standard deviations, with Student's quantile for few strokes."""
    out = np.sqrt(excess(misfit, orders, strokes))
    for n in np.unique(orders[orders > 0.0]):
        own = np.flatnonzero(orders == n)
        freedom = 2 * strokes - own.size
        if freedom > 0 and np.any(out[own] > 1.0):
            out[own] *= student_quantile(freedom) / NORMAL
    return out
