"""The fit of chosen orders together with the terms of the motion, and its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.identification.cogging.noise import Noise, long_strokes, memory, widened
from stickslip.identification.cogging.orders import Term, columns
from stickslip.identification.cogging.rows import Places, least_squares

Array = np.ndarray[Any, np.dtype[np.float64]]
Column = tuple[Array, float]
"""A column and the standard deviation of its coefficient."""

TURNS = 4
"""Number of fits, each with the motion, friction level and delay from the one before."""
STROKES = 4
"""Fewest strokes in motion for the intervals to include the differences between them."""
CARRIED = 0.1
"""Uncertain part of the effect of velocity and acceleration on an order: both are smoothed, and friction lags."""
FAST = 100.0
"""Order above which friction need not follow the velocity's oscillation: its period of 0.06 rad is several times the
usual pre-sliding distance."""


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
    """Number of columns before those of the terms."""

    def pair(self, term: Term) -> Array:
        """Return the cosine and sine coefficients of a term."""
        i = self.first + 2 * self.terms.index(term)
        return self.values[i : i + 2]

    def spread(self, term: Term) -> Array:
        """Return the covariance of a term's coefficients, shape (2, 2)."""
        i = self.first + 2 * self.terms.index(term)
        return self.covariance[i : i + 2, i : i + 2]


def fit(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """Solve least squares; for long strokes in motion, include the terms of the motion at each order."""
    if not long_strokes(places):
        return _short(places, terms, moving)
    if not moving:
        return _standing(places, terms)
    return _moved(places, terms, moving)


def _standing(places: Places, terms: Sequence[Term]) -> Fit:
    """Solve least squares at rest, where all strokes have the same noise."""
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
    places: Places, matrix: Array, terms: Sequence[Term], moving: Sequence[str], beside: Array,
    answers: Mapping[str, Column],
) -> Fit:  # fmt: skip
    """Solve least squares weighted by the noise, which depends on the speed.

    `beside`: columns of the motion's terms between the orders, shape (n, k), of the first k names. `answers` are not
    fitted: the torque at an order also moves the axis, so a fit would confuse them with cogging's noise. The intervals
    widen by their possible effect.
    """
    values = least_squares(matrix, places.torque)
    noise = places.torque - matrix @ values - beside @ values[2 : 2 + beside.shape[1]]
    count = matrix.shape[1]
    every = np.column_stack([matrix, *(column * size for column, size in answers.values()), places.torque])
    seen = Noise.of(places, noise, [n for _, n in terms]).whitened(every)
    r: Array = np.asarray(np.linalg.qr(np.concatenate(seen), mode="r"))
    inverse = np.asarray(np.linalg.inv(r[:count, :count]), dtype=np.float64)
    values = np.asarray(inverse @ r[:count, -1], dtype=np.float64)
    misfit = np.zeros(count)
    for own in seen:
        left = own[:, -1] - own[:, :count] @ values
        misfit += (own[:, :count].T @ left) ** 2 / np.maximum(np.sum(own[:, :count] ** 2, axis=0), 1e-300)
    residual = places.torque - matrix @ values
    found = _fit(terms, values, inverse @ inverse.T, misfit, len(seen), residual, moving)
    taken = inverse @ r[:count, count:-1]
    return replace(found, covariance=found.covariance + taken @ taken.T)


def _fit(
    terms: Sequence[Term], values: Array, covariance: Array, misfit: Array, strokes: int, residual: Array,
    moving: Sequence[str],
) -> Fit:  # fmt: skip
    """Build the fit, with intervals widened by the differences between strokes."""
    first = values.size - 2 * len(terms)
    orders = np.concatenate([np.zeros(first), np.repeat([n for _, n in terms], 2)])
    wide = widened(misfit, orders, strokes)
    return Fit(tuple(terms), values, wide[:, None] * covariance * wide, residual, tuple(moving), first)


# ---- in motion -------------------------------------------------------------------------------------------------------


class Laid(NamedTuple):
    """Columns of a fit in motion.

    `matrix`: all columns; `own`: the motion without its noise; `more`: the columns between `moving` and the terms.
    """

    matrix: Array
    own: Places
    more: dict[str, Array]


def _moved(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """Fit in motion.

    Velocity and acceleration are those of the waves at these orders, without noise; friction's ripple is proportional
    to its level; if several speeds distinguish it from a lag, the torque's delay is estimated.
    """
    late = "viscous" in moving and bool(terms)
    values, delay = least_squares(columns(places, terms, moving), places.torque), 0.0
    laid = _laid(places, terms, moving, values, delay)
    first = 2 + len(moving) + places.beside.shape[1]
    for _ in range(TURNS - 1):
        values = least_squares(laid.matrix, places.torque)
        delay += float(values[first]) if late else 0.0
        laid = _laid(places, terms, moving, values, delay)
    matrix, own, more = laid
    noisy = replace(places, velocity=places.velocity + places.swing[:, 0], acceleration=places.swing[:, 1])
    between = columns(noisy, (), moving)[:, 2:] - columns(own, (), moving)[:, 2:]
    answers = (
        _answers(places, own, more, dict(zip(moving, values[2:].tolist(), strict=False))) if late else {}
    )
    found = _weighted(places, matrix, terms, [*moving, *more], between, answers)
    if late:
        found.values[first] += delay
    return found


def _laid(places: Places, terms: Sequence[Term], moving: Sequence[str], values: Array, delay: float) -> Laid:
    """Return the columns with the motion, the level of friction and the delay from the previous fit."""
    own, fast = _motion(places, terms, delay)
    pairs = values[values.size - 2 * len(terms) :]
    matrix = columns(own, terms, moving)
    first = matrix.shape[1] - 2 * len(terms)
    ripple = _rippled(matrix[:, first:], terms, _level(own, moving, values))
    if "viscous" not in moving or not terms:
        return Laid(matrix, own, {})
    more = {"delay": -places.velocity * (_slopes(own, terms) @ pairs), **fast}
    if np.any(ripple):
        more["ripple_level"] = ripple @ pairs
    if np.any(ripple) and "curve" in moving:
        more["ripple_speed"] = _apart(places) * (
            (matrix[:, first:] - ripple) @ np.where(_odd(terms), pairs, 0.0)
        )
    return Laid(np.column_stack([matrix[:, :first], *more.values(), matrix[:, first:]]), own, more)


def _apart(places: Places) -> Array:
    """Return the speed over its mean, minus one."""
    speed = np.abs(places.velocity)
    return speed / float(np.mean(speed)) - 1.0


def _odd(terms: Sequence[Term]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return a mask of the terms' columns that belong to friction's ripple."""
    return np.repeat([part == "odd" for part, _ in terms], 2)


def _motion(places: Places, terms: Sequence[Term], delay: float) -> tuple[Places, dict[str, Array]]:
    """Return the places a delay earlier, and columns of the velocity of fast orders.

    The places have the velocity of slow orders and the acceleration of all.

    Friction does not follow a velocity that oscillates within the pre-sliding distance: its response in phase and in
    quadrature is then free.
    """
    orders = sorted({n for _, n in terms})
    seen, slow = places.motion(orders, delay), places.motion([n for n in orders if n <= FAST], delay)
    angle = places.angle - delay * places.velocity
    own = replace(places, angle=angle, velocity=slow[:, 0], acceleration=seen[:, 1])
    if not orders or orders[-1] <= FAST:
        return own, {}
    fast = seen - slow
    # Strokes too short for an oscillation show none, and a column of zeros contains no information.
    swings = {"fast_viscous": fast[:, 0], "fast_lag": fast[:, 1] / np.abs(places.velocity)}
    return own, {name: column for name, column in swings.items() if np.any(column)}


def _answers(
    places: Places, own: Places, more: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, Column]:
    """Return possible deviations of friction's response to an oscillating velocity from its steady slope.

    Few speeds do not determine how the response depends on the speed. Its size is that of the slope, and in quadrature
    that of friction which just follows an order of `FAST`.
    """
    speed, apart = np.abs(places.velocity), _apart(places)
    slope = float(np.sqrt(np.mean((values["viscous"] + 2.0 * values.get("curve", 0.0) * speed) ** 2)))
    behind = slope / FAST
    kinds: dict[str, Column] = {"swing": (own.velocity - places.velocity, slope)}
    if "inertia" in values:
        kinds["inertia"] = own.acceleration, behind / float(np.mean(speed))
    kinds |= {n: (more[n], size) for n, size in (("fast_viscous", slope), ("fast_lag", behind)) if n in more}
    shapes = {"bent": apart} | ({"bowed": apart**2 - float(np.mean(apart**2))} if "curve" in values else {})
    out = {"swing": kinds["swing"]}
    for name, (column, size) in kinds.items():
        out |= {f"{name}_{shape}": (column * by, size) for shape, by in shapes.items()}
    return out


def _rippled(waves: Array, terms: Sequence[Term], level: Array) -> Array:
    """Multiply the waves of friction's ripple by its level; return the change, shape (n, 2 k).

    Friction without ripple (such as bearings, whose friction may grow with the speed) makes the level of the rippling
    part vary by more than the whole: by how much is free, with the level and, for three speeds, with the speed."""
    added: Array = np.where(_odd(terms), waves * (level - 1.0)[:, None], 0.0)
    waves += added
    return added


def _level(places: Places, moving: Sequence[str], values: Array) -> Array:
    """Return friction's level at every place over its mean, shape (n,)."""
    carried = [1, *(2 + i for i, name in enumerate(moving) if name != "inertia")]
    level = places.direction * (columns(places, (), moving)[:, carried] @ values[carried])
    return level / float(np.mean(level)) if float(np.min(level)) > 0.0 else np.ones(len(places))


def _slopes(places: Places, terms: Sequence[Term]) -> Array:
    """Return the derivatives of the terms' columns by the angle, shape (n, 2 k)."""
    out = columns(places, terms, ())[:, 2 + places.beside.shape[1] :]
    slopes = np.empty_like(out)
    for i, (_, n) in enumerate(terms):
        slopes[:, 2 * i], slopes[:, 2 * i + 1] = -n * out[:, 2 * i + 1], n * out[:, 2 * i]
    return slopes


# ---- short strokes ---------------------------------------------------------------------------------------------------


def _short(places: Places, terms: Sequence[Term], moving: Sequence[str]) -> Fit:
    """Solve least squares for strokes too short to show the density of their noise.

    The covariance counts correlated places once. Added are the differences between the strokes (friction and the terms
    of the motion depend on the speed), and a share of the effect of velocity and acceleration on each order.
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
