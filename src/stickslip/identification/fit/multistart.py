"""Starts of a separable search: only the nonlinear parameters are drawn at random.

Separable least squares (Golub and Pereyra 1973): for drawn values of the nonlinear parameters (Stribeck velocities,
shape factors) the best values of the linear ones (torque levels, viscous friction) are computed. Which parameters are
linear is tested numerically, for any law.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from stickslip.identification.fit.parameter_vector import Vector

Array = np.ndarray[Any, np.dtype[np.float64]]
Values = Callable[[Array], Array]

REACH = 4.0
"""Greatest distance of drawn nonlinear parameters from the vector's start, in coordinates."""
LARGEST = 1e150
"""Largest number in a column of the linear part: the square of a larger one overflows."""
ITERATIONS = 100
"""Most iterations of the linear part of a start: its active set changes once in each. (SciPy's reflective method can
halve its step without end because of rounding.) A start that requires more is kept as it then is."""


def linear_parameters(model: Values, values: Array, candidates: Sequence[int]) -> list[int]:
    """Return the places in `values` in which the model is jointly affine: no second difference, alone or mixed."""
    size = np.maximum(np.abs(values), 1e-3 * np.max(np.abs(values)))
    chosen: list[int] = []
    here = model(values)
    for i in candidates:
        if all(_affine(model, values, here, size, i, j) for j in [*chosen, i]):
            chosen.append(i)
    return chosen


def _affine(model: Values, values: Array, here: Array, size: Array, i: int, j: int) -> bool:
    a, b, both = values.copy(), values.copy(), values.copy()
    a[i] += 0.37 * size[i]
    b[j] += 0.53 * size[j]
    both[i] += 0.37 * size[i]
    both[j] += 0.53 * size[j]
    bend = model(both) - model(a) - model(b) + here
    reach = np.max(np.abs(model(both))) + np.max(np.abs(here))
    return bool(np.max(np.abs(bend)) <= 1e-9 * reach)


def separable_starts(model: Values, target: Array, vector: Vector, count: int) -> Array:
    """Return starts for a vector without shares: its own, and `count` with the linear parameters solved for.

    Parameters
    ----------
    model : callable
        Model values for values of the free parameters, in the scale of `target`.
    target : array, shape (n,)
    vector : Vector
    count : int

    Returns
    -------
    array, shape (count + 1, vector.size)
    """
    first = vector.start
    values = vector.values(first)
    single = [i for i, p in enumerate(vector.free) if not p.shares]
    linear = linear_parameters(model, values, single)
    rng = np.random.default_rng(0)
    low, high = np.maximum(vector.lower, first - REACH), np.minimum(vector.upper, first + REACH)
    upper = [vector.free[i].par.upper for i in linear]
    # A level of 0 is at its bound there.
    floor = [min(1e-9 * float(np.max(np.abs(target))), 0.5 * upper[k]) if vector.free[i].logarithmic
             else vector.free[i].par.lower for k, i in enumerate(linear)]  # fmt: skip
    bounds = (np.array(floor), np.array(upper))
    out = [first]
    for _ in range(count):
        u = low + rng.random(first.size) * (high - low)
        drawn = vector.values(u)
        drawn[linear] = 0.0
        base = model(drawn)
        columns = (
            np.stack([model(drawn + np.eye(drawn.size)[i]) - base for i in linear], axis=1)
            if linear
            else None
        )
        # Exponents drawn far away make powers whose squares overflow: such a start stays as drawn.
        if columns is not None and np.all(np.abs(columns) < LARGEST):
            drawn[linear] = bounded_solution(columns, target - base, *bounds)
        if all(math.isfinite(x) for x in drawn):
            out.append(vector.coordinates(dict(zip(vector.names, drawn.tolist(), strict=True))))
    return np.array(out)


def bounded_solution(columns: Array, target: Array, lower: Array, upper: Array) -> Array:
    """Solve least squares within bounds by an active set (Stark and Parker 1995), at most `ITERATIONS` changes of it.

    Parameters
    ----------
    columns : array, shape (n, m)
    target : array, shape (n,)
    lower, upper : array, shape (m,)

    Returns
    -------
    array, shape (m,)
        Inside the bounds; the best so far if the iterations did not suffice.
    """
    optimize: Any = importlib.import_module("scipy.optimize")  # it carries no types
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solved = optimize.lsq_linear(
        columns / scale, target, (lower * scale, upper * scale), method="bvls", max_iter=ITERATIONS
    )
    return np.clip(solved.x / scale, lower, upper)
