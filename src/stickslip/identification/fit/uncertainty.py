"""Uncertainty of parameters: weighted least squares from many starts, intervals and verdicts.

The noise level is in `stickslip.identification.fit.noise`, the search in `optimum`, profile intervals in `profile`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Estimate
from stickslip.identification.fit.levenberg_marquardt import (
    STEP,
    Optimum,
    Residuals,
    Squares,
    descend,
    distinct,
    search,
    spread_starts,
)
from stickslip.identification.fit.noise import Noise, as_noise, noise_of_fit, quantile
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.fit.profile import Profiles, inverse_root, long_run, profiles_of

Array = np.ndarray[Any, np.dtype[np.float64]]

RATIO = 2.0
"""Greatest upper/lower of an identified positive parameter."""
NOTHING = 1e-9
"""Part of the upper bound below which a lower bound is 0 in effect, the least of a positive parameter."""
SHARE = 0.1
"""Greatest half-width of an identified signed parameter, part of its scale (friction for torques)."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A least-squares fit and its estimates.

    Attributes
    ----------
    vector : Vector
    optimum : Optimum
        The best one found; ``optimum.u`` are its coordinates.
    others : tuple of Optimum
        Other minima that the noise does not distinguish from the best.
    noise : Noise
    covariance, correlation : array, shape (free parameters, free parameters)
        Covariance and correlation of the values; NaN where the noise or the direction is unknown.
    estimates : tuple of Estimate
    family : array, shape (m, vector.size)
        Coordinates of fits, along the profiles and elsewhere, that the noise does not distinguish from the best.
    """

    vector: Vector
    optimum: Optimum
    others: tuple[Optimum, ...]
    noise: Noise
    covariance: Array
    correlation: Array
    estimates: tuple[Estimate, ...]
    family: Array

    @property
    def u(self) -> Array:
        """Coordinates of the best fit."""
        return self.optimum.u

    @property
    def values(self) -> dict[str, float]:
        """Every parameter by name, including frozen ones."""
        return self.vector.named(self.optimum.u)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return math.sqrt(self.optimum.cost / max(self.optimum.residuals.size, 1))


def fit(
    residuals: Residuals,
    vector: Vector,
    *,
    noise: Noise | float | None = None,
    size: float = 1.0,
    signed_scale: float | Mapping[str, float] = math.nan,
    starts: int | Array = 12,
    reach: float = 3.0,
    profiles: bool = True,
    lags: int = 0,
    tolerance: float = 1e-15,
    difference: float = STEP,
    at_all: Residuals | None = None,
) -> Fit:
    """Fit by least squares from many starts, and judge which parameters the data determine.

    Parameters
    ----------
    residuals : callable
        ``residuals(u)``: model minus data at the vector's coordinates, shape (n,), each divided by its relative
        standard deviation, for a common noise level.
    vector : Vector
    noise : Noise or float, optional
        Standard deviation of a residual, in its unit.
    size : float
        Size of the data (such as the largest torque), against which a perfect fit is recognised.
    signed_scale : float or mapping of str to float
        Scale for the half-width of a parameter that may be negative: Fc for torques.
    starts : int or array, shape (m, vector.size)
        Number of starts, or the starts. 1 starts at the vector's own values only.
    reach : float
        Greatest distance of the other starts from the vector's, in coordinates.
    profiles : bool
        Follow the profile likelihood; otherwise intervals come from the covariance.
    lags : int
        Samples over which residuals are correlated; 0 if they are independent.
    tolerance : float
        Relative decrease of the sum of squares at which a descent stops.
    difference : float
        Step of the coordinates for Jacobians; larger for less precise residuals.
    at_all : callable, optional
        ``residuals`` at several coordinates at once (`Squares`).

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If there are no data, nothing is free, or the model gives no finite values at any start.
    """
    if not vector.free:
        raise InputError("every parameter is frozen; free at least one")
    known = as_noise(noise)
    squares = Squares(residuals, vector.lower, vector.upper, difference, at_all=at_all)
    if isinstance(starts, int):
        starts = spread_starts(vector.start, vector.lower, vector.upper, starts, reach=reach)
    optima = search(squares, starts, tolerance=tolerance)
    if optima[0].residuals.size == 0:
        raise InputError("no data to fit; give at least one point")
    optima, level, followed = follow_profiles(
        squares, optima, known, size=size, profiles=profiles, lags=lags, tolerance=tolerance
    )
    best = optima[0]
    threshold = quantile(level) * level.std**2 if level.known else math.inf
    others = tuple(o for o in optima[1:] if o.cost - best.cost < threshold)
    covariance, correlation = covariance_of(vector, best, level, lags)
    family = np.vstack([followed.family, *(o.u for o in others)])
    estimates = _estimates(vector, best, family, level, covariance, followed.bounds, signed_scale)
    return Fit(vector, best, others, level, covariance, correlation, estimates, family)


def follow_profiles(
    squares: Squares, optima: Sequence[Optimum], known: Noise | None, *, size: float, profiles: bool, lags: int,
    tolerance: float,
) -> tuple[Sequence[Optimum], Noise, Profiles]:  # fmt: skip
    """Return optima, best first, their noise and their profiles, restarted from every better minimum on a profile.

    The profiles are empty if none are requested, the noise is unknown, or the last of 8 rounds still met a better
    minimum.
    """
    level = noise_of_fit(optima[0].cost, optima[0].residuals.size, optima[0].u.size, known, size)
    for _ in range(8 if profiles else 0):
        if not level.known:
            break
        followed = profiles_of(squares, optima[0], level, lags, tolerance)
        if followed.better is None:
            return optima, level, followed
        found = descend(squares, followed.better, tolerance=tolerance)
        optima = distinct(sorted([found, *optima], key=lambda o: o.cost), 1e-4)
        level = noise_of_fit(optima[0].cost, optima[0].residuals.size, optima[0].u.size, known, size)
    return optima, level, Profiles({}, optima[0].u[None, :], None)


def covariance_of(vector: Vector, best: Optimum, noise: Noise, lags: int) -> tuple[Array, Array]:
    """Return covariance and correlation of the free values."""
    root, seen = inverse_root(best.jacobian)
    if lags > 0:
        inner = root.T @ long_run(best.jacobian * best.residuals[:, None], lags) @ root
        sizes, ways = np.linalg.eigh(0.5 * (inner + inner.T))
        root = root @ (ways * np.sqrt(np.maximum(sizes, 0.0)))
    else:
        root = root * noise.std
    change = vector.jacobian(best.u)
    moved = change @ root
    moved[np.any(change[:, ~seen] != 0.0, axis=1)] = math.nan
    # As squares: for two hardly distinguishable values, rounding would give correlations beyond 1.
    covariance = moved @ moved.T
    std = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(std, std)
    return covariance, correlation


# ---- estimates and verdicts ----------------------------------------------------------------------------------


def _estimates(
    vector: Vector, best: Optimum, family: Array, noise: Noise, covariance: Array,
    bounds: Mapping[int, tuple[float, float]], signed_scale: float | Mapping[str, float],
) -> tuple[Estimate, ...]:  # fmt: skip
    values = vector.values(best.u)
    elsewhere = np.array([vector.values(u) for u in family])
    width = math.sqrt(quantile(noise)) if noise.known else math.nan
    out: list[Estimate] = []
    for k, p in enumerate(vector.free):
        std = math.sqrt(covariance[k, k]) if covariance[k, k] >= 0.0 else math.inf
        std = std if noise.known else math.nan
        place = vector.coordinate_of(p.name)
        value = float(values[k])
        low, high = interval_of(p, value, width * std, bounds.get(place) if place is not None else None)
        # A fit on another parameter's profile counts as well: this parameter's profile may have left its valley.
        low, high = min(low, float(np.min(elsewhere[:, k]))), max(high, float(np.max(elsewhere[:, k])))
        scale = signed_scale.get(p.name, math.nan) if isinstance(signed_scale, Mapping) else signed_scale
        why = verdict_on(p, value, low, high, noise, scale)
        out.append(Estimate(p.name, p.par.unit, p.par.symbol, value, std, low, high, not why, why))
    return tuple(out)


def interval_of(
    p: Parameter, value: float, half: float, profile: tuple[float, float] | None
) -> tuple[float, float]:
    """Return a value's 95 % interval: its profile's, or from the half-width in its coordinate, within the bounds."""
    if profile is not None:
        ends = [math.exp(x) if p.logarithmic else x * p.scale for x in profile]
    elif p.logarithmic and math.isfinite(half):
        ends = [value * math.exp(-half / value), value * math.exp(min(half / value, 700.0))]
    else:
        ends = [value - half, value + half] if math.isfinite(half) else [-math.inf, math.inf]
    lowest = 0.0 if p.logarithmic else p.par.lower
    return max(ends[0], lowest), min(ends[1], p.par.upper)


def verdict_on(p: Parameter, value: float, low: float, high: float, noise: Noise, scale: float) -> str:
    """Return the reason why a parameter is not identified; empty if it is.

    Positive ones require upper/lower of at most 2, signed ones a half-width of at most 10 % of `scale`.
    """
    if not noise.known:
        return "the noise level is unknown: give it, or repeat measurements"
    if not (low <= value <= high and math.isfinite(low) and math.isfinite(high)):
        return "the data set no limit to it"
    if p.nonnegative:
        if low <= NOTHING * high:
            return "cannot be distinguished from 0"
        if high > RATIO * low:
            return f"the interval spans a factor of {high / low:.3g}; identified means at most {RATIO:g}"
        return ""
    return too_wide(0.5 * (high - low), p.par.unit, scale)


def too_wide(half: float, unit: str, scale: float) -> str:
    """Explain why a half-width is too wide for `scale`, the level of friction for a torque; empty if it is not.

    A level that is not positive is not friction and cannot be a scale.
    """
    torque, unit = unit in ("N·m", "N"), axis_unit(unit)
    if not 0.0 < scale < math.inf:
        level = "level of friction above 0" if torque else "size above 0"
        return f"no {level} was found with which its half-width of {half:.3g} {unit} can be compared"
    if half <= SHARE * scale:
        return ""
    what = "friction, " if torque else ""
    return f"the interval's half-width of {half:.3g} {unit} exceeds {100.0 * SHARE:g} % of {what}{scale:.3g} {unit}"
