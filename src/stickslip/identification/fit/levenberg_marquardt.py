"""Least squares to full precision, and the global minimum: the Levenberg-Marquardt method from many starts.

With Moré's (1978) scaling; every trial step comes from one singular value decomposition of the Jacobian, without the
normal equations, which would square its condition number. Bounds are enforced by projection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError

Array = np.ndarray[Any, np.dtype[np.float64]]
Residuals = Callable[[Array], Array]
"""Model minus data at the coordinates, shape (n,); values that are not finite count as infinitely bad."""

Each = Callable[[Callable[[int], Array], Sequence[int]], Iterable[Array]]
"""Computes the columns of a Jacobian: in turn, or in parallel if they are expensive."""

MOST_TRIES = 60
"""Most failed damped steps."""
STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)


@dataclass(frozen=True, eq=False)
class Squares:
    """A sum of squares to be minimised between bounds.

    Attributes
    ----------
    residuals : callable
    lower, upper : array, shape (p,)
    difference : float
        Step of the coordinates for Jacobians; relative above 1. Less precise residuals require a larger one.
    each : callable
        Computes the columns of a Jacobian; `map`, or `stickslip.identification.fit.parallel.mapped`.
    at_all : callable, optional
        The residuals at several coordinates, shape (m, p), at once, shape (m, n): for residuals so cheap that the calls
        themselves would dominate.
    """

    residuals: Residuals
    lower: Array
    upper: Array
    difference: float = STEP
    each: Each = map
    at_all: Residuals | None = None

    def begin(self, start: Array) -> Step:
        """Return the starting point of a descent: the start, moved inside the bounds.

        Raises
        ------
        InputError
            If the residuals there are not finite.
        """
        u = np.clip(np.asarray(start, dtype=np.float64), self.lower, self.upper)
        r = self.residuals(u)
        cost = cost_of(r)
        if cost == math.inf:
            raise InputError(
                "the fit cannot start: the model gives no finite values there; give another start"
            )
        return Step(u, r, cost, 1e-3, 1)


@dataclass(frozen=True)
class Step:
    """A step: its end, the damping for the next one, and its number of evaluations."""

    u: Array
    residuals: Array
    cost: float
    damping: float
    evaluations: int


@dataclass(frozen=True)
class Optimum:
    """A minimum of the sum of squares.

    Attributes
    ----------
    u : array, shape (p,)
    cost : float
        Sum of squares.
    residuals : array, shape (n,)
    jacobian : array, shape (n, p)
        Zero columns for held coordinates.
    evaluations : int
        Calls of the residuals, including those for the Jacobian.
    """

    u: Array
    cost: float
    residuals: Array
    jacobian: Array
    evaluations: int


def cost_of(r: Array) -> float:
    """Return the sum of squares; infinite if a residual is not finite."""
    total = float(r @ r)
    return total if math.isfinite(total) else math.inf


def central_differences(squares: Squares, u: Array, free: Sequence[int]) -> Array:
    """Return the Jacobian by central differences inside the bounds, shape (n, p); error about 1e-10 of its scale."""
    residuals, step = squares.residuals, squares.difference

    def sides(i: int) -> tuple[Array, Array, float]:
        h = step * max(1.0, abs(float(u[i])))
        ahead, behind = u.copy(), u.copy()
        ahead[i] = min(u[i] + h, squares.upper[i])
        behind[i] = max(u[i] - h, squares.lower[i])
        return ahead, behind, ahead[i] - behind[i]

    def column(i: int) -> Array:
        ahead, behind, width = sides(i)
        return (residuals(ahead) - residuals(behind)) / width if width > 0.0 else 0.0 * residuals(u)

    if squares.at_all is None:
        return np.stack(list(squares.each(column, free)), axis=1)
    ahead, behind, widths = zip(*map(sides, free), strict=True)
    there = squares.at_all(np.array([*ahead, *behind]))
    width = np.array(widths)[:, None]
    difference = there[: len(free)] - there[len(free) :]
    # With equal bounds, the column is 0, or not finite if the residuals are not.
    return (difference / np.where(width > 0.0, width, 1.0)).T.copy()


def descend(
    squares: Squares,
    start: Array,
    *,
    held: Sequence[int] = (),
    iterations: int = 300,
    tolerance: float = 1e-15,
    jacobian_there: bool = True,
) -> Optimum:
    """Find the minimum reached from `start`.

    Parameters
    ----------
    squares : Squares
    start : array, shape (p,)
        Moved inside the bounds.
    held : sequence of int
        Coordinates that are held fixed.
    iterations : int
        Greatest number of Jacobians.
    tolerance : float
        Relative decrease of the sum of squares below which it stops.
    jacobian_there : bool
        Whether the Jacobian is recomputed at the minimum; otherwise it is that of the step before.

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If the residuals at the start are not finite.
    """
    here, lower, upper = squares.begin(start), squares.lower, squares.upper
    free = [i for i in range(here.u.size) if i not in held]
    evaluations = here.evaluations
    jacobian = np.zeros((here.residuals.size, here.u.size))
    scale, known = np.zeros(len(free)), False
    for _ in range(iterations if free else 0):
        jacobian[:, free] = central_differences(squares, here.u, free)
        evaluations, known = evaluations + 2 * len(free), True
        part = np.where(np.isfinite(jacobian[:, free]), jacobian[:, free], 0.0)
        scale = np.maximum(scale, np.linalg.norm(part, axis=0))
        inside = [
            i for i, g in enumerate(part.T @ here.residuals)
            if scale[i] > 0.0 and not (g > 0.0 and here.u[free[i]] <= lower[free[i]])
            and not (g < 0.0 and here.u[free[i]] >= upper[free[i]])
        ]  # fmt: skip
        if not inside:
            break
        model = Quadratic.of(part[:, inside], here.residuals, [free[i] for i in inside], scale[inside])
        step = downhill(squares, here, model, tolerance)
        evaluations += step.evaluations
        if step.cost >= here.cost:
            break
        gain, here, known = here.cost - step.cost, step, False
        if gain <= tolerance * here.cost or here.cost == 0.0:
            break
    if free and not known and jacobian_there:
        jacobian[:, free] = central_differences(squares, here.u, free)
        evaluations += 2 * len(free)
    return Optimum(here.u, here.cost, here.residuals, jacobian, evaluations)


@dataclass(frozen=True)
class Quadratic:
    """The sum of squares of the linearised residuals in some coordinates, by a singular value decomposition."""

    sizes: Array
    right: Array
    pull: Array
    places: Sequence[int]
    """Indices of these coordinates."""
    scale: Array
    """Their scales."""

    @staticmethod
    def of(columns: Array, r: Array, places: Sequence[int], scale: Array) -> Quadratic:
        """Decompose the Jacobian's columns once; every damping then costs one product."""
        # Reduced by QR first: the decomposition of a tall Jacobian itself is slower.
        both: Array = np.asarray(np.linalg.qr(np.column_stack([columns / scale, r]), "r"))
        left, sizes, right = np.linalg.svd(both[:, :-1], full_matrices=False)
        return Quadratic(sizes, right, left.T @ both[:, -1], places, scale)

    @staticmethod
    def normal(columns: Array, r: Array, places: Sequence[int], scale: Array) -> Quadratic:
        """Build it from the normal equations: faster at half the digits, enough for an inexact Jacobian."""
        scaled = columns / scale
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        sizes = np.sqrt(np.maximum(values, 1e-16 * max(float(values[-1]), 1e-300)))
        return Quadratic(sizes, vectors.T, vectors.T @ (scaled.T @ r) / sizes, places, scale)

    def step(self, u: Array, damping: float, longest: float) -> Array:
        """Return the end of the damped step from u; no coordinate moves by more than `longest`."""
        there = u.copy()
        scaled = -(self.right.T @ (self.sizes * self.pull / (self.sizes**2 + damping)))
        there[self.places] += np.clip(scaled / self.scale, -longest, longest)
        return there

    def expected(self, damping: float) -> float:
        """Return the expected decrease for that step."""
        s2 = self.sizes**2
        return float(np.sum(s2 * self.pull**2 * (s2 + 2.0 * damping) / (s2 + damping) ** 2))


def downhill(
    squares: Squares, here: Step, model: Quadratic, tolerance: float, tries: int = MOST_TRIES,
    longest: float = math.inf,
) -> Step:  # fmt: skip
    """Return the first step that lowers the cost, with damping increased at every failure; else the last failure.

    No coordinate moves by more than `longest`.
    """
    u, cost, damping = here.u, here.cost, here.damping
    growth, tried = 2.0, 0
    while True:
        trial = np.clip(model.step(u, damping, longest), squares.lower, squares.upper)
        r = squares.residuals(trial)
        new, expected = cost_of(r), model.expected(damping)
        tried += 1
        if new < cost:
            # Nielsen's (1999) rule: the better the model predicts the decrease, the less damping.
            ratio = (cost - new) / expected if expected > 0.0 else 1.0
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3), 1e-16)
            return Step(trial, r, new, damping, tried)
        stands = float(np.max(np.abs(trial - u))) <= 1e-15 * (1.0 + float(np.max(np.abs(u))))
        if tried == tries or stands or expected <= tolerance * cost:
            return Step(trial, r, new, damping, tried)
        damping, growth = damping * growth, min(growth * 2.0, 1e3)


def spread_starts(start: Array, lower: Array, upper: Array, count: int, reach: float) -> Array:
    """Return `count` starts: `start` itself, and a Latin hypercube over the bounds, at most `reach` from it."""
    if start.size == 0:  # everything is held
        return start[None, :]
    rng = np.random.default_rng(0)
    low, high = np.maximum(lower, start - reach), np.minimum(upper, start + reach)
    cells = np.stack([rng.permutation(max(count - 1, 0)) for _ in range(start.size)], axis=1)
    inside = (cells + rng.random(cells.shape)) / max(count - 1, 1)
    return np.vstack([start[None, :], low + inside * (high - low)])


def search(
    squares: Squares, starts: Array, *, rough: int = 15, polished: int = 6, tolerance: float = 1e-15
) -> list[Optimum]:
    """Find distinct minima, the best first: a short descent from every start, a full one from the best few.

    Raises
    ------
    InputError
        If no start gives finite residuals.
    """
    if len(starts) == 1:
        return [descend(squares, starts[0], tolerance=tolerance)]
    found: list[Optimum] = []
    for start in starts:
        inside = np.clip(start, squares.lower, squares.upper)
        if math.isfinite(cost_of(squares.residuals(inside))):
            found.append(descend(squares, inside, iterations=rough, tolerance=1e-6, jacobian_there=False))
    if not found:
        raise InputError(
            "the fit cannot start: the model gives no finite values at any start; give another start"
        )
    found.sort(key=lambda o: o.cost)
    full = [descend(squares, o.u, tolerance=tolerance) for o in distinct(found, 1e-3)[:polished]]
    full.sort(key=lambda o: o.cost)
    return distinct(full, 1e-4)


def distinct(optima: Sequence[Optimum], distance: float) -> list[Optimum]:
    """Return those farther than `distance` from every better one, in order."""
    kept: list[Optimum] = []
    for o in optima:
        if all(float(np.max(np.abs(o.u - k.u), initial=0.0)) > distance for k in kept):
            kept.append(o)
    return kept
