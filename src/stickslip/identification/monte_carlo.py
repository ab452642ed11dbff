"""Parameters drawn from the uncertainty of an identification: bands around curves, and plants for robustness tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.core.errors import ParameterError
from stickslip.identification.estimate import Estimate
from stickslip.models.model import Model
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

WIDEST = math.log(3.0)
"""Largest standard deviation of a positive parameter's logarithm: the data then determine only its order of
magnitude."""
PER_STD = 3.92
"""Width of a 95 % interval in standard deviations."""


def draw_values(estimates: Sequence[Estimate], correlation: Array, count: int, seed: int = 0) -> Array:
    """Draw values of all estimates, shape (count, n); those without a spread keep their value.

    Positive ones are drawn log-normally, with the standard deviation of their 95 % interval; if the interval contains
    0, each side has its own.
    """
    z: Array = np.random.default_rng(seed).standard_normal((count, len(estimates)))
    return spread_values(estimates, correlation, z)


def spread_values(estimates: Sequence[Estimate], correlation: Array, z: Array) -> Array:
    """Return values of the estimates for independent standard normal numbers `z`, shape (count, n)."""
    n = len(estimates)
    known = np.where(np.isfinite(correlation), correlation, np.eye(n)) if correlation.size else np.eye(n)
    known = 0.5 * (known + known.T)
    level, vectors = np.linalg.eigh(known)
    z = z * np.sqrt(np.maximum(level, 0.0)) @ vectors.T
    out = np.empty((len(z), n))
    for i, e in enumerate(estimates):
        if e.value > 0.0 and e.lower > 0.0:
            out[:, i] = e.value * np.exp(log_spread(e) * z[:, i])
        elif e.value > 0.0 and e.lower == 0.0:
            above = min(math.log(max(e.upper / e.value, 1.0)) / (0.5 * PER_STD), WIDEST)
            out[:, i] = e.value * np.exp(np.where(z[:, i] > 0.0, above, WIDEST) * z[:, i])
        else:
            out[:, i] = e.value + (e.std if math.isfinite(e.std) else 0.0) * z[:, i]
    # The shares of GMS's elements add up to 1 (thesis eq. 2.19); the law refuses others.
    shares = [i for i, e in enumerate(estimates) if e.name.startswith("alpha[")]
    if shares and math.isclose(math.fsum(estimates[i].value for i in shares), 1.0, abs_tol=1e-6):
        out[:, shares] /= np.sum(out[:, shares], axis=1, keepdims=True)
    return out


def log_spread(e: Estimate) -> float:
    """Return the standard deviation of a positive parameter's logarithm."""
    if math.isfinite(e.upper):
        return min(math.log(e.upper / e.lower) / PER_STD, WIDEST)
    return min(e.std / e.value, WIDEST) if math.isfinite(e.std) else WIDEST


def draw_models(
    model: Model, estimates: Sequence[Estimate], correlation: Array, count: int, seed: int = 0,
    plausible: Callable[[dict[str, float]], None] = lambda named: None,
) -> list[tuple[Model, Mapping[str, float]]]:  # fmt: skip
    """Draw models, each with all drawn values by name.

    Draws that the law refuses are left out; an element ``k[1]`` of a list replaces that element. `plausible` may change
    drawn values before the law is built.
    """
    names = [e.name for e in estimates]
    out: list[tuple[Model, Mapping[str, float]]] = []
    for row in draw_values(estimates, correlation, count, seed):
        named = dict(zip(names, (float(x) for x in row), strict=True))
        plausible(named)
        try:
            out.append((with_values(model, named), named))
        except ParameterError:
            continue
    return out


def with_values(model: Model, named: Mapping[str, float]) -> Model:
    """Return the model with other values of those parameters that are its own."""
    values: dict[str, Any] = {
        k: list(v) if isinstance(v, tuple) else v  # type: ignore[reportUnknownArgumentType]
        for k, v in model.parameters._asdict().items()
    }
    lists = {k for k, v in values.items() if isinstance(v, list)}
    for name, value in named.items():
        whole, _, place = name.partition("[")
        if whole in lists and place:
            values[whole][int(place.rstrip("]"))] = value
        elif name in values:
            values[name] = value
    if "alpha" in lists:
        # Shares add up to 1.
        total = sum(values["alpha"])
        values["alpha"] = [a / total for a in values["alpha"]]
    return Model(model.law, **values)


def resisting_torque(model: Model, velocity: Array) -> Array:
    """Return the torque at constant velocities (break-away at 0, towards the positive side), N·m, shape (n,)."""
    side = np.where(velocity < 0.0, -1.0, 1.0)
    return Steady(model.law, velocity, side).torque(np.asarray(model.law.pack(model.parameters), np.float64))


def curve_band(
    model: Model, estimates: Sequence[Estimate], correlation: Array, velocity: Array, count: int = 200, seed: int = 0
) -> Array:  # fmt: skip
    """Return the torque of drawn laws at constant velocities, shape (draws, velocities); percentiles make a band."""
    steady = Steady(model.law, velocity, np.where(velocity < 0.0, -1.0, 1.0))
    drawn = draw_models(model, estimates, correlation, count, seed)
    curves = [steady.torque(np.asarray(m.law.pack(m.parameters), np.float64)) for m, _ in drawn]
    return np.array(curves) if curves else np.full((1, velocity.size), np.nan)
