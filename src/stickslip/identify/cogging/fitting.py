"""The fit of chosen orders, with what the motion carries, and how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.identify.cogging.noise import Noise, excess, long_strokes, memory
from stickslip.identify.cogging.orders import Term, columns
from stickslip.identify.cogging.rows import Places, least_squares

__all__ = ["Fit", "fit"]

Array = np.ndarray[Any, np.dtype[np.float64]]

TURNS = 4
"""Fits, each with the motion, the level of friction and the delay that the one before shows."""
STROKES = 4
"""Strokes in motion, from which on the intervals hold what they differ by."""
CARRIED = 0.1
"""Of what velocity and acceleration take out of an order, not believed: both are smoothed, and friction lags."""
FAST = 100.0
"""Order, beyond which friction need not follow the velocity's swing: a period of 0.06 rad is several times the travel
before sliding of a usual contact."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Terms with their values: ``values`` in the order of `columns`, with their covariance."""

    terms: tuple[Term, ...]
    values: Array
    covariance: Array
    residual: Array
    moving: tuple[str, ...]
    """Names of the columns after constant and direction."""
    first: int
    """Columns before those of the terms."""

    def pair(self, term: Term) -> Array:
        """Cosine and sine of a term."""
        i = self.first + 2 * self.terms.index(term)
        return self.values[i : i + 2]

    def spread(self, term: Term) -> Array:
        """Their covariance, shape (2, 2)."""
        i = self.first + 2 * self.terms.index(term)
        return self.covariance[i : i + 2, i : i + 2]


def fit(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """Least squares; in long strokes in motion with what the motion carries at each order."""
    if not long_strokes(places):
        return _short(places, terms, moving)
    if not moving:
        return _standing(places, terms)
    return _moved(places, terms, moving)


def _standing(places: Places, terms: Sequence[Term]) -> Fit:
    """Least squares: at rest one noise is that of all strokes."""
    matrix = columns(places, terms, ())
    values = least_squares(matrix, places.torque)
    residual: Array = places.torque - matrix @ values
    noise = Noise.of(places, residual, [n for _, n in terms])
    spread, misfit = noise.spread(matrix), np.zeros(values.size)
    for rows, own in zip(noise.rows, spread, strict=True):
        misfit += (matrix[rows].T @ residual[rows]) ** 2 / np.maximum(np.diag(own), 1e-300)
    inverse = np.linalg.inv(matrix.T @ matrix)
    return _fit(terms, values, inverse @ sum(spread) @ inverse, misfit, len(spread), residual, ())


def _weighted(
    places: Places, matrix: Array, terms: Sequence[Term], moving: Sequence[str], beside: Array
) -> Fit:
    """Least squares weighted by the noise, which the speed changes.

    `beside`: columns of what the motion carries between the orders, shape (n, k), of the first k names.
    """
    values = least_squares(matrix, places.torque)
    noise = places.torque - matrix @ values - beside @ values[2 : 2 + beside.shape[1]]
    seen = Noise.of(places, noise, [n for _, n in terms]).whitened(np.column_stack([matrix, places.torque]))
    every = np.concatenate(seen)
    r: Array = np.asarray(np.linalg.qr(every, mode="r"))
    values = np.asarray(np.linalg.solve(r[:-1, :-1], r[:-1, -1]), dtype=np.float64)
    inverse = np.asarray(np.linalg.inv(r[:-1, :-1]), dtype=np.float64)
    misfit = np.zeros(values.size)
    for own in seen:
        left = own[:, -1] - own[:, :-1] @ values
        misfit += (own[:, :-1].T @ left) ** 2 / np.maximum(np.sum(own[:, :-1] ** 2, axis=0), 1e-300)
    residual = places.torque - matrix @ values
    return _fit(terms, values, inverse @ inverse.T, misfit, len(seen), residual, moving)


def _fit(
    terms: Sequence[Term], values: Array, covariance: Array, misfit: Array, strokes: int, residual: Array,
    moving: Sequence[str],
) -> Fit:  # fmt: skip
    """Intervals wider by what the strokes differ by."""
    first = values.size - 2 * len(terms)
    orders = np.concatenate([np.zeros(first), np.repeat([n for _, n in terms], 2)])
    wide = np.sqrt(excess(misfit, orders, strokes))
    return Fit(tuple(terms), values, wide[:, None] * covariance * wide, residual, tuple(moving), first)


# ---- in motion -------------------------------------------------------------------------------------------------------


def _moved(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """With velocity and acceleration as the waves of these orders show them, which holds no noise; with friction's
    ripple following its level; and, where several speeds tell it from a lag, with the delay of the torque."""
    own, lagging = _motion(places, terms)
    late = "viscous" in moving and bool(terms)
    names = [*moving, *(("delay", *lagging) if late else ())]
    matrix, delay = columns(places, terms, moving), 0.0
    values = least_squares(matrix, places.torque)
    first = matrix.shape[1] - 2 * len(terms)
    for _ in range(TURNS):
        pairs, level = values[values.size - 2 * len(terms) :], _level(places, moving, values)
        acted = replace(own, angle=places.angle - delay * places.velocity)
        matrix = columns(acted, terms, moving)
        for i, (part, _) in enumerate(terms):
            if part == "odd":
                matrix[:, first + 2 * i : first + 2 * i + 2] *= level[:, None]
        if late:
            slope = -places.velocity * (_slopes(acted, terms) @ pairs)
            beside = np.column_stack([slope, *lagging.values()])
            matrix = np.column_stack([matrix[:, :first], beside, matrix[:, first:]])
        values = least_squares(matrix, places.torque)
        delay += float(values[first]) if late else 0.0
    noisy = replace(places, velocity=places.velocity + places.swing[:, 0], acceleration=places.swing[:, 1])
    between = columns(noisy, (), moving)[:, 2:] - columns(own, (), moving)[:, 2:]
    found = _weighted(places, matrix, terms, names, between)
    if late:
        found.values[first] += delay - float(values[first])
    return found


def _motion(places: Places, terms: Sequence[Term]) -> tuple[Places, dict[str, Array]]:
    """Places with the velocity of slow orders and the acceleration of all, and columns of the velocity of fast ones.

    Friction does not follow a velocity that swings within its travel before sliding: what it does there, in phase and
    behind, is left free.
    """
    orders = sorted({n for _, n in terms})
    seen, slow = places.motion(orders), places.motion([n for n in orders if n <= FAST])
    own = replace(places, velocity=slow[:, 0], acceleration=seen[:, 1])
    if not orders or orders[-1] <= FAST:
        return own, {}
    fast = seen - slow
    return own, {"fast_viscous": fast[:, 0], "fast_lag": fast[:, 1] / np.abs(places.velocity)}


def _level(places: Places, moving: Sequence[str], values: Array) -> Array:
    """Friction's level at every place over its mean, shape (n,)."""
    carried = [1, *(2 + i for i, name in enumerate(moving) if name != "inertia")]
    level = places.direction * (columns(places, (), moving)[:, carried] @ values[carried])
    return level / float(np.mean(level)) if float(np.min(level)) > 0.0 else np.ones(len(places))


def _slopes(places: Places, terms: Sequence[Term]) -> Array:
    """Derivatives of the terms' columns by the angle, shape (n, 2 k)."""
    out = columns(places, terms, ())[:, 2 + places.beside.shape[1] :]
    slopes = np.empty_like(out)
    for i, (_, n) in enumerate(terms):
        slopes[:, 2 * i], slopes[:, 2 * i + 1] = -n * out[:, 2 * i + 1], n * out[:, 2 * i]
    return slopes


# ---- short strokes ---------------------------------------------------------------------------------------------------


def _short(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """Least squares in strokes too short to show the density of their noise.

    The covariance counts correlated places once. To it come what the strokes differ by (friction and what the motion
    carries change with the speed), and a share of what velocity and acceleration took out of each order.
    """
    matrix = columns(places, terms, moving)
    q, r = np.linalg.qr(matrix)
    values: Array = np.asarray(np.linalg.solve(r, q.T @ places.torque), dtype=np.float64)
    residual = places.torque - matrix @ values
    free = max(1, len(places) - matrix.shape[1])
    variance = float(residual @ residual) / free * memory(residual, places.stroke)
    inverse = np.linalg.inv(r)
    first = matrix.shape[1] - 2 * len(terms)
    covariance = variance * inverse @ inverse.T
    strokes = np.unique(places.stroke)
    if moving and strokes.size >= STROKES:
        sums = np.array([matrix[places.stroke == s].T @ residual[places.stroke == s] for s in strokes])
        spread = inverse @ inverse.T @ sums.T
        covariance = covariance + strokes.size / (strokes.size - 1.0) * spread @ spread.T
    carried: Array = matrix[:, 2:first] @ values[2:first]
    for i in range(first, matrix.shape[1], 2):
        own = matrix[:, i : i + 2]
        share = CARRIED * np.linalg.solve(own.T @ own, own.T @ (carried - float(np.mean(carried))))
        covariance[i : i + 2, i : i + 2] += float(share @ share) * np.eye(2)
    return Fit(tuple(terms), values, covariance, residual, tuple(moving), first)
