"""Covariance and profile-likelihood intervals of a least-squares fit, in its coordinates.

Profiles: Venzon and Moolgavkar (1988), Raue et al. (2009). Correlated residuals: Newey and West (1987).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.noise import Noise, quantile
from stickslip.identify.optimum import Optimum, Residuals, descend

__all__ = ["inverse_information", "long_run", "profile_bounds"]

Array = np.ndarray[Any, np.dtype[np.float64]]

FARTHEST = 12.0
"""How far a profile is followed: a factor of 160,000 in a logarithmic coordinate."""


def inverse_information(jacobian: Array) -> tuple[Array, Any]:
    """Inverse of J'J and, per coordinate, whether the data determine it at all to first order."""
    size = np.linalg.norm(jacobian, axis=0)
    weights = np.where(size > 0.0, size, 1.0)
    _, s, vt = np.linalg.svd(jacobian / weights, full_matrices=False)
    kept = s > 1e-13 * max(float(s[0]) if s.size else 0.0, 1e-300)
    inverse = (vt[kept].T / s[kept] ** 2) @ vt[kept]
    lost = np.sum(vt[~kept] ** 2, axis=0) + (vt.shape[0] < vt.shape[1]) * (1.0 - np.sum(vt**2, axis=0))
    return inverse / np.outer(weights, weights), (lost < 1e-8) & (size > 0.0)


def long_run(scores: Array, lags: int) -> Array:
    """Covariance of the sum of correlated scores (n, p), Bartlett's window: Newey and West 1987."""
    total = scores.T @ scores
    for lag in range(1, min(lags, scores.shape[0] - 1) + 1):
        part = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    return total


def profile_bounds(
    residuals: Residuals, best: Optimum, noise: Noise, lower: Array, upper: Array, lags: int
) -> tuple[dict[int, tuple[float, float]], Array | None]:
    """Interval of every coordinate by its profile, and a start for a better minimum if one was met on the way."""
    inverse, seen = inverse_information(best.jacobian)
    target = np.full(best.u.size, quantile(noise) * noise.std**2)
    if lags > 0:
        robust = np.diag(inverse @ long_run(best.jacobian * best.residuals[:, None], lags) @ inverse)
        with np.errstate(invalid="ignore", divide="ignore"):
            target = np.where(seen, quantile(noise) * robust / np.diag(inverse), target)
    out: dict[int, tuple[float, float]] = {}
    for i in range(best.u.size):
        ends: list[float] = []
        for side in (-1.0, 1.0):
            valley = inverse[:, i] / inverse[i, i] if inverse[i, i] > 0.0 else np.eye(best.u.size)[i]
            first = math.sqrt(max(float(target[i] * inverse[i, i]), 0.0)) if seen[i] else 1.0
            end, better = _profile_end(
                residuals, best, i, side, float(target[i]), min(max(first, 1e-9), 1.0), valley, lower, upper
            )
            if better is not None:
                return out, better
            ends.append(end)
        out[i] = (ends[0], ends[1])
    return out, None


def _profile_end(
    residuals: Residuals, best: Optimum, i: int, side: float, target: float, first: float, valley: Array,
    lower: Array, upper: Array,
) -> tuple[float, Array | None]:  # fmt: skip
    """Where the profile of coordinate i has risen by `target` on one side; infinite where it never does."""
    origin = float(best.u[i])
    edge = float(upper[i] if side > 0.0 else lower[i])
    farthest = min(abs(edge - origin), FARTHEST)
    near, rise_near, start = 0.0, 0.0, best.u

    def rise(distance: float, guess: Array) -> Optimum:
        # Along the valley first; where it bends too much for that, from where the search stands.
        straight = guess.copy()
        straight[i] = origin + side * distance
        along = guess + np.clip(valley * (straight[i] - guess[i]), -1.0, 1.0)
        along[i] = straight[i]
        best_here: Optimum | None = None
        for begin in (along, straight):
            try:
                found = descend(residuals, begin, lower, upper, held=(i,), iterations=40, tolerance=1e-9)
            except InputError:  # not finite there
                continue
            if best_here is None or found.cost < best_here.cost:
                best_here = found
            if best_here.cost - best.cost < target:
                break
        return best_here or Optimum(straight, math.inf, best.residuals, best.jacobian, 0)

    distance = min(first, farthest)
    if farthest <= 0.0:
        return side * math.inf, None
    while True:
        point = rise(distance, start)
        gain = point.cost - best.cost
        if gain < -1e-6 * target:
            return 0.0, point.u
        if gain >= target:
            break
        if distance >= farthest:
            return side * math.inf, None
        near, rise_near, start = distance, gain, point.u
        distance = min(2.0 * distance, farthest)
    # The root of the rise is nearly linear in the distance.
    far, rise_far = distance, gain
    for _ in range(12):
        a, b = math.sqrt(max(rise_near, 0.0)), math.sqrt(min(rise_far, 1e6 * target))
        part = (math.sqrt(target) - a) / (b - a)
        x = near + min(max(part, 0.05), 0.95) * (far - near)
        point = rise(x, start)
        gain = point.cost - best.cost
        if gain < -1e-6 * target:
            return 0.0, point.u
        if gain < target:
            near, rise_near, start = x, gain, point.u
        else:
            far, rise_far = x, gain
        if abs(gain - target) < 0.01 * target or far - near < 1e-3 * far:
            return origin + side * x, None
    return origin + side * far, None
