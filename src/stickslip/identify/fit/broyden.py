"""Least squares where an evaluation is dear: Levenberg and Marquardt's method on a Jacobian kept by secants.

Broyden's update (``broyden1965``) in the scale of the coordinates, differences anew only where it no longer leads
downhill (``madsen2004``, section 3.4). For fits of simulations: a step costs one of them, not 2 p + 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.fit.levenberg_marquardt import (
    MOST_TRIES,
    STEP,
    Quadratic,
    Residuals,
    cost_of,
    downhill,
)
from stickslip.identify.fit.parallel import mapped

__all__ = ["Secants", "descend_by_secants", "forward_differences"]

Array = np.ndarray[Any, np.dtype[np.float64]]

TRIES = 2
"""Damped steps that may fail on a Jacobian kept by secants before it is taken anew."""

WIDTH, NARROWEST = 3.0, 1e-3
"""Differences are as wide as changes the residuals by so many of their root mean squares in all, so that what is
rough below that does not matter; and at least this part of the widest."""
LONGEST = 0.5
"""Change of a coordinate in one step: beyond a factor of 1.6 a linear model of a simulation says little."""


def forward_differences(
    residuals: Residuals, u: Array, r: Array, lower: Array, upper: Array, widths: Array
) -> Array:
    """Jacobian at u, where the residuals are r, by one-sided differences inside the bounds, shape (n, p)."""

    def column(i: int) -> Array:
        there = u.copy()
        there[i] = u[i] + widths[i] if u[i] + widths[i] <= upper[i] else max(u[i] - widths[i], lower[i])
        width = float(there[i] - u[i])
        return (residuals(there) - r) / width if width != 0.0 else np.zeros(r.size)

    jacobian = np.stack(mapped(column, range(u.size)), axis=1) if u.size else np.zeros((r.size, 0))
    return np.where(np.isfinite(jacobian), jacobian, 0.0)


def descend_by_secants(
    residuals: Residuals,
    start: Array,
    lower: Array,
    upper: Array,
    *,
    held: Sequence[int] = (),
    evaluations: int = 200,
    tolerance: float = 1e-6,
    difference: float = STEP,
) -> tuple[Array, float]:
    """The minimum that is reached from `start`, as far as the tolerance asks.

    Parameters
    ----------
    residuals : callable
    start, lower, upper : array, shape (p,)
        The start is moved inside the bounds.
    held : sequence of int
        Coordinates that stay.
    evaluations : int
        About how many calls of the residuals at most.
    tolerance : float
        Relative decrease of the sum of squares below which it ends, on a fresh Jacobian.
    difference : float
        Of coordinates, for the first Jacobian; relative above 1. Later ones are narrower where that tells enough.

    Returns
    -------
    (array, shape (p,), float)
        Coordinates and sum of squares.

    Raises
    ------
    InputError
        If the residuals at the start are not finite.
    """
    search = Secants(residuals, start, lower, upper, held, difference)
    search.run(evaluations, tolerance)
    return search.u, search.cost


class Secants:
    """The state of a descent: where it stands, and the Jacobian it believes in."""

    def __init__(
        self, residuals: Residuals, start: Array, lower: Array, upper: Array, held: Sequence[int] = (),
        difference: float = STEP,
    ) -> None:  # fmt: skip
        self.residuals, self.difference = residuals, difference
        self.u = np.clip(np.asarray(start, dtype=np.float64), lower, upper)
        # A coordinate is held by bounds that leave it no room.
        stays = np.isin(np.arange(self.u.size), list(held))
        self.lower, self.upper = np.where(stays, self.u, lower), np.where(stays, self.u, upper)
        self.r = residuals(self.u)
        self.cost = cost_of(self.r)
        self.spent: int = 1
        if self.cost == math.inf:
            raise InputError(
                "the fit cannot start: the model gives no finite values there; give another start"
            )
        self.damping: float = 1e-3
        self.scale: Array = np.zeros(self.u.size)
        self.jacobian: Array = np.zeros((self.r.size, self.u.size))
        self.fresh = False

    def run(self, evaluations: int, tolerance: float) -> None:
        """Go on until so many residuals were called in all, or nothing is gained any more."""
        while self.spent < evaluations and self.step(tolerance):
            pass

    def step(self, tolerance: float) -> bool:
        """Go one step; False where one on differences taken at its begin gains too little to go on."""
        if not self.scale.any():
            self.refresh()
        sure = self.fresh
        if self.gain(tolerance) > tolerance * self.cost:
            return True
        if sure or self.cost == 0.0:
            return False
        self.refresh()
        return True

    def refresh(self) -> None:
        """Take the Jacobian anew."""
        widths = self.difference * np.maximum(1.0, np.abs(self.u))
        if self.scale.any():
            known = WIDTH * math.sqrt(self.cost / self.r.size) / np.maximum(self.scale, 1e-300)
            widths = np.clip(known, NARROWEST * widths, widths)
        self.jacobian = forward_differences(self.residuals, self.u, self.r, self.lower, self.upper, widths)
        self.spent, self.fresh = self.spent + self.u.size, True
        self.scale = np.maximum(self.scale, np.linalg.norm(self.jacobian, axis=0))

    def gain(self, tolerance: float) -> float:
        """Step downhill where the Jacobian leads there; by how much the sum of squares fell."""
        pull = self.jacobian.T @ self.r
        blocked = ((pull > 0.0) & (self.u <= self.lower)) | ((pull < 0.0) & (self.u >= self.upper))
        places = np.flatnonzero((self.scale > 0.0) & ~blocked)
        if not places.size:
            return 0.0
        model = Quadratic.normal(self.jacobian[:, places] / self.scale[places], self.r)
        there = downhill(
            self.residuals, self.u, self.cost, model, places.tolist(), self.scale[places], self.damping, self.lower,
            self.upper, tolerance, MOST_TRIES if self.fresh else TRIES, LONGEST,
        )  # fmt: skip
        self.spent += there.evaluations
        gain = self.cost - there.cost
        if gain <= 0.0:
            return 0.0
        # What was seen on the way corrects the Jacobian in that direction.
        moved = there.u - self.u
        weighted = self.scale**2 * moved
        if (size := float(weighted @ moved)) > 0.0:
            self.jacobian += np.outer(there.residuals - self.r - self.jacobian @ moved, weighted / size)
        self.u, self.r, self.cost = there.u, there.residuals, there.cost
        self.damping, self.fresh = there.damping, False
        return gain
