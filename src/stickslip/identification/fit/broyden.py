"""Least squares for expensive evaluations: the Levenberg-Marquardt method with a Jacobian updated by secants.

Broyden's update (``broyden1965``) in the scale of the coordinates; new differences only if the Jacobian no longer leads
downhill (``madsen2004``, section 3.4). For fits of simulations: a step costs one of them, not 2 p + 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.identification.fit.levenberg_marquardt import MOST_TRIES, Quadratic, Squares, downhill
from stickslip.identification.fit.parallel import mapped

Array = np.ndarray[Any, np.dtype[np.float64]]

TRIES = 2
"""Failed damped steps on an updated Jacobian after which it is recomputed."""

WIDTH, NARROWEST = 3.0, 1e-3
"""Width of differences: the residuals change by this multiple of their root mean square, above their roughness; least
part of the widest."""
LONGEST = 0.5
"""Largest change of a coordinate in one step: beyond a factor of 1.6 a linear model of a simulation is inaccurate."""


def forward_differences(squares: Squares, u: Array, r: Array, widths: Array) -> Array:
    """Return the Jacobian at u, with residuals r, by one-sided differences inside the bounds, shape (n, p)."""

    def column(i: int) -> Array:
        there = u.copy()
        up = u[i] + widths[i]
        there[i] = up if up <= squares.upper[i] else max(u[i] - widths[i], squares.lower[i])
        width = float(there[i] - u[i])
        return (squares.residuals(there) - r) / width if width != 0.0 else np.zeros(r.size)

    jacobian = np.stack(mapped(column, range(u.size)), axis=1) if u.size else np.zeros((r.size, 0))
    return np.where(np.isfinite(jacobian), jacobian, 0.0)


def descend_by_secants(
    squares: Squares,
    start: Array,
    *,
    held: Sequence[int] = (),
    evaluations: int = 200,
    tolerance: float = 1e-6,
) -> tuple[Array, float]:
    """Find the minimum reached from `start`, to the tolerance.

    Parameters
    ----------
    squares : Squares
        Its differences are those of the first Jacobian; later ones are narrower if the residuals allow it.
    start : array, shape (p,)
        Moved inside the bounds.
    held : sequence of int
        Coordinates that are held fixed.
    evaluations : int
        Approximate limit on calls of the residuals.
    tolerance : float
        Relative decrease of the sum of squares below which it stops, with a fresh Jacobian.

    Returns
    -------
    (array, shape (p,), float)
        Coordinates and sum of squares.

    Raises
    ------
    InputError
        If the residuals at the start are not finite.
    """
    search = Secants(squares, start, held)
    search.run(evaluations, tolerance)
    return search.u, search.cost


class Secants:
    """The state of a descent: the present point and its approximate Jacobian."""

    def __init__(self, squares: Squares, start: Array, held: Sequence[int] = ()) -> None:
        self.here = squares.begin(start)
        # A coordinate is held by equal bounds.
        stays = np.isin(np.arange(self.u.size), list(held))
        self.squares = replace(
            squares,
            lower=np.where(stays, self.u, squares.lower),
            upper=np.where(stays, self.u, squares.upper),
        )
        self.spent: int = 1
        self.scale: Array = np.zeros(self.u.size)
        self.jacobian: Array = np.zeros((self.here.residuals.size, self.u.size))
        self.fresh = False

    @property
    def u(self) -> Array:
        """The present coordinates, shape (p,)."""
        return self.here.u

    @property
    def cost(self) -> float:
        """The present sum of squares."""
        return self.here.cost

    def run(self, evaluations: int, tolerance: float) -> None:
        """Continue until the residuals were called this often in all, or the decrease is below the tolerance."""
        while self.spent < evaluations and self.step(tolerance):
            pass

    def step(self, tolerance: float) -> bool:
        """Take one step; return False if a step with fresh differences decreases too little."""
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
        """Recompute the Jacobian."""
        here = self.here
        widths = self.squares.difference * np.maximum(1.0, np.abs(here.u))
        if self.scale.any():
            known = WIDTH * math.sqrt(here.cost / here.residuals.size) / np.maximum(self.scale, 1e-300)
            widths = np.clip(known, NARROWEST * widths, widths)
        self.jacobian = forward_differences(self.squares, here.u, here.residuals, widths)
        self.spent, self.fresh = self.spent + here.u.size, True
        self.scale = np.maximum(self.scale, np.linalg.norm(self.jacobian, axis=0))

    def gain(self, tolerance: float) -> float:
        """Take a downhill step if the Jacobian provides one; return the decrease of the sum of squares."""
        here, r = self.here, self.here.residuals
        pull = self.jacobian.T @ r
        blocked = ((pull > 0.0) & (here.u <= self.squares.lower)) | (
            (pull < 0.0) & (here.u >= self.squares.upper)
        )
        places = np.flatnonzero((self.scale > 0.0) & ~blocked)
        if not places.size:
            return 0.0
        model = Quadratic.normal(self.jacobian[:, places], r, places.tolist(), self.scale[places])
        there = downhill(self.squares, here, model, tolerance, MOST_TRIES if self.fresh else TRIES, LONGEST)
        self.spent += there.evaluations
        gain = here.cost - there.cost
        if gain <= 0.0:
            return 0.0
        # The observed change corrects the Jacobian in that direction.
        moved = there.u - here.u
        weighted = self.scale**2 * moved
        if (size := float(weighted @ moved)) > 0.0:
            self.jacobian += np.outer(there.residuals - r - self.jacobian @ moved, weighted / size)
        self.here, self.fresh = there, False
        return gain
