"""An alternative explanation of a record: columns of the regression, and the prior size of their coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

Unit = Literal["inertia", "friction", "noise", "torque", "skew"]
"""Scale of a coefficient: the inertia, Fc, the misfit at the greatest acceleration, 1, or a skew of one row."""

HIDDEN, SLIGHT, LARGE = 0.001, 0.01, 0.1
"""Relative standard deviations of coefficients: of an effect too small to show, of a slight effect, and of one that a
user would name. Nothing is exactly absent; the steps are decades."""
USUAL_ODDS = 0.1
"""Prior probability of an effect."""


@dataclass(frozen=True)
class Alternative:
    """One effect that could make numbers of the plain model wrong.

    Attributes
    ----------
    name : str
        "cogging 4", "drift", ...
    columns : callable
        ``columns(rows)``, shape (n, k): functions of the motion or of the model, never of the measured torque (such
        a column would explain the torque's own noise).
    unit : str
        Scale of the coefficients.
    absent : float
        Their standard deviation without the effect: small, not 0.
    present : tuple
        Their possible standard deviations with the effect, equally likely; numbers, or arguments of `shape`.
    odds : float
        Prior probability of the effect.
    splits : str
        A number of which the axis then has two values ("inertia", "fc"): their difference adds to its uncertainty.
    lags : bool
        Whether the columns are made by `SlidingRows.see` and change fast: a delayed torque column then shifts them too.
    curve : callable, optional
        ``curve(speed, rows)``, shape (m, k): the columns in steady forward motion at some speeds, if they are part of
        the friction curve.
    even : callable, optional
        ``even(speed, rows)``, shape (m, k): the columns' contribution to steady motion at some speeds, equal in both
        directions: a law with a single curve represents friction that differs by direction as a constant torque.
    removable : bool
        Whether `SlidingRows.see` alone makes the columns, so their torque can be subtracted from a record.
    shape : callable, optional
        ``shape(level, k)``: standard deviations of the k coefficients at one level.
    compliant : bool
        Whether motor and load then do not move as one: contact parameters that only reversals determine are then those
        of the spring or the gap as well.
    of_model : bool
        Whether the columns depend on a first model of the torque, which differs from start to start.
    wave_number : float
        Wave number of a torque that repeats over the position, rad⁻¹ (m⁻¹); 0 for others.
    cause : str
        Description for the report: "<cause> explains 62 % of the width".
    remedy : str
        The recording that would exclude it.
    """

    name: str
    columns: Callable[[SlidingRows], Array]
    unit: Unit = "friction"
    absent: Any = HIDDEN
    present: tuple[Any, ...] = (SLIGHT, LARGE)
    odds: float = USUAL_ODDS
    splits: str = ""
    lags: bool = False
    curve: Callable[[Array, SlidingRows], Array] | None = None
    even: Callable[[Array, SlidingRows], Array] | None = None
    removable: bool = False
    shape: Callable[[Any, int], Array] | None = None
    compliant: bool = False
    of_model: bool = False
    wave_number: float = 0.0
    cause: str = ""
    remedy: str = ""

    @property
    def levels(self) -> tuple[Any, ...]:
        """All standard deviations, the one of its absence first."""
        return (self.absent, *self.present)

    def std(self, level: int, count: int) -> Array:
        """Return the standard deviations of `count` coefficients at a level, shape (count,)."""
        x = self.levels[level]
        return np.full(count, float(x)) if self.shape is None else self.shape(x, count)

    def log_odds(self, level: int) -> float:
        """Return the logarithm of a level's prior probability."""
        return float(np.log(self.odds / len(self.present) if level else 1.0 - self.odds))


def legendre(x: Array, degrees: range) -> Array:
    """Return the Legendre polynomials of some degrees on [-1, 1], shape (n, len(degrees))."""
    every = np.polynomial.legendre.legvander(np.clip(x, -1.0, 1.0), degrees[-1])
    return np.asarray(every[:, degrees.start :], dtype=np.float64)


def braking(record: SlidingRecord) -> Array:
    """Return 1 where the axis slows down, else 0, shape (samples,)."""
    return (record.velocity * record.acceleration < 0.0).astype(np.float64)
