"""Covariance and profile-likelihood intervals of a least-squares fit, in its coordinates.

Profiles: Venzon and Moolgavkar (1988), Raue et al. (2009). Correlated residuals: Newey and West (1987).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.fit.levenberg_marquardt import Optimum, Squares, descend
from stickslip.identification.fit.noise import Noise, quantile

Array = np.ndarray[Any, np.dtype[np.float64]]

FARTHEST = 12.0
"""Greatest distance that a profile is followed: a factor of 160,000 in a logarithmic coordinate."""


def inverse_information(jacobian: Array) -> tuple[Array, Any]:
    """Return the inverse of J'J and, per coordinate, whether the data determine it to first order."""
    root, seen = inverse_root(jacobian)
    return root @ root.T, seen


def inverse_root(jacobian: Array) -> tuple[Array, Any]:
    """Return R with R R' = inverse of J'J, and the second result of `inverse_information`."""
    size = np.linalg.norm(jacobian, axis=0)
    weights = np.where(size > 0.0, size, 1.0)
    _, s, vt = np.linalg.svd(jacobian / weights, full_matrices=False)
    kept = s > 1e-13 * max(float(s[0]) if s.size else 0.0, 1e-300)
    lost = np.sum(vt[~kept] ** 2, axis=0) + (vt.shape[0] < vt.shape[1]) * (1.0 - np.sum(vt**2, axis=0))
    return vt[kept].T / s[kept] / weights[:, None], (lost < 1e-8) & (size > 0.0)


def long_run(scores: Array, lags: int) -> Array:
    """Return the covariance of the sum of correlated scores (n, p), Bartlett's window: Newey and West 1987."""
    n = scores.shape[0]
    reach = min(lags, n - 1)
    # All lags at once, by the spectrum; padded against wrap-around.
    length = 1 << (n + reach).bit_length()
    window = np.zeros(length)
    window[: reach + 1] = 1.0 - np.arange(reach + 1) / (lags + 1.0)
    window[length - reach :] = window[1 : reach + 1][::-1]
    spectrum = np.fft.rfft(scores, length, axis=0)
    weight = np.fft.rfft(window).real / length
    weight[1:-1] *= 2.0
    return np.real((spectrum.conj().T * weight) @ spectrum)


@dataclass(frozen=True)
class Profiles:
    """Profiles of a fit.

    Attributes
    ----------
    bounds : mapping of int to (float, float)
        Interval of each coordinate; infinite if the data set no limit.
    family : array, shape (m, p)
        Coordinates found along the profiles that the noise does not distinguish from the best fit.
    better : array, shape (p,), or None
        A start for a better minimum, if one was found; then the rest is incomplete.
    """

    bounds: dict[int, tuple[float, float]]
    family: Array
    better: Array | None


def profiles_of(
    squares: Squares, best: Optimum, noise: Noise, lags: int, tolerance: float = 1e-15
) -> Profiles:
    """Follow the profile of every coordinate to both sides.

    `best` is the minimum to a part `tolerance` of its sum of squares: a smaller decrease is not another minimum.
    """
    inverse, seen = inverse_information(best.jacobian)
    target = np.full(best.u.size, quantile(noise) * noise.std**2)
    if lags > 0:
        robust = np.diag(inverse @ long_run(best.jacobian * best.residuals[:, None], lags) @ inverse)
        with np.errstate(invalid="ignore", divide="ignore"):
            # Negative because of rounding: then the noise alone counts.
            ratio = quantile(noise) * robust / np.diag(inverse)
            target = np.where(seen & (ratio > 0.0), ratio, target)
    reach: dict[tuple[int, float], float] = {}
    family = [best.u]
    # The least determined coordinate first: a better minimum, which restarts everything, is found on its profile.
    order = sorted(range(best.u.size), key=lambda i: -inverse[i, i] if seen[i] else -math.inf)
    # A second round continues from fits on other profiles that are beyond the reach of the first one.
    for again in (False, True):
        for i in order:
            valley = inverse[:, i] / inverse[i, i] if inverse[i, i] > 0.0 else np.eye(best.u.size)[i]
            first = math.sqrt(max(float(target[i] * inverse[i, i]), 0.0)) if seen[i] else 1.0
            for side in (-1.0, 1.0):
                edge = float(squares.upper[i] if side > 0.0 else squares.lower[i])
                farthest = min(abs(edge - float(best.u[i])), FARTHEST)
                begin = max(family, key=lambda u: side * float(u[i] - best.u[i])) if again else best.u
                near = side * float(begin[i] - best.u[i])
                if again and near <= 1.01 * reach[i, side]:
                    continue
                profile = Profile(squares, best, i, side, float(target[i]), valley, tolerance)
                reach[i, side] = profile.end(min(max(first, 1e-9), 1.0, farthest), farthest, near, begin)
                family += profile.family
                if profile.better is not None:
                    return Profiles({}, np.array(family), profile.better)
    bounds = {
        i: (float(best.u[i]) - reach[i, -1.0], float(best.u[i]) + reach[i, 1.0]) for i in range(best.u.size)
    }
    return Profiles(bounds, np.array(family), None)


class Profile:
    """One side of the profile of coordinate i: the least sum of squares with it held at a distance."""

    def __init__(
        self, squares: Squares, best: Optimum, i: int, side: float, target: float, valley: Array,
        tolerance: float,
    ) -> None:  # fmt: skip
        self.squares, self.best, self.i, self.side = squares, best, i, side
        self.target, self.valley = target, valley
        self.accuracy = max(1e-9, 0.1 * tolerance)
        self.slack = max(1e-6 * target, tolerance * best.cost)
        self.family: list[Array] = []
        self.better: Array | None = None

    def end(self, step: float, farthest: float, near: float, start: Array) -> float:
        """Return the distance at which the sum of squares has risen by the target; infinite if it does not.

        The search goes outwards from `near`, where `start` is a fit that has risen by less.
        """
        if farthest <= near:
            return math.inf
        rise_near, distance = 0.0, min(near + step, farthest)
        while (gain := self.rise(distance, start)) < self.target:
            if self.better is not None:
                return math.nan
            near, rise_near, start = distance, gain, self.family[-1]
            step *= 2.0
            if distance >= farthest:
                return math.inf
            distance = min(near + step, farthest)
        return self._root(near, rise_near, distance, gain, start)

    def _root(self, near: float, rise_near: float, far: float, rise_far: float, start: Array) -> float:
        for _ in range(12):
            # The root of the rise is nearly linear in the distance.
            a, b = math.sqrt(max(rise_near, 0.0)), math.sqrt(min(rise_far, 1e6 * self.target))
            part = (math.sqrt(self.target) - a) / (b - a)
            x = near + min(max(part, 0.05), 0.95) * (far - near)
            gain = self.rise(x, self.family[-1] if self.family else start)
            if self.better is not None:
                return math.nan
            if gain < self.target:
                near, rise_near = x, gain
            else:
                far, rise_far = x, gain
            if abs(gain - self.target) < 0.01 * self.target or far - near < 1e-3 * far:
                return x
        return far

    def rise(self, distance: float, guess: Array) -> float:
        """Return the rise of the sum of squares above its minimum; infinite if the model is not finite."""
        # Along the valley first; if that bends too much, from the present point.
        straight = guess.copy()
        straight[self.i] = self.best.u[self.i] + self.side * distance
        along = guess + np.clip(self.valley * (straight[self.i] - guess[self.i]), -1.0, 1.0)
        along[self.i] = straight[self.i]
        gain = math.inf
        for begin in (along, straight):
            try:
                found = descend(
                    self.squares, begin, held=(self.i,), iterations=100, tolerance=self.accuracy,
                    jacobian_there=False,
                )  # fmt: skip
            except InputError:  # not finite there
                continue
            gain = min(gain, found.cost - self.best.cost)
            if gain < self.target:
                self.family.append(found.u)
                if gain < -self.slack:
                    self.better = found.u
                break
        return gain
