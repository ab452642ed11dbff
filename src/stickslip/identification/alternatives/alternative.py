"""What a reason to doubt a number is: columns of the regression, and how large their coefficients may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

Unit = Literal["inertia", "friction", "noise", "torque", "skew"]
"""What a coefficient is relative to: the inertia, Fc, the misfit where it accelerates most, 1, or a row of skew."""

HIDDEN, SLIGHT, LARGE = 0.001, 0.01, 0.1
"""Relative standard deviations of coefficients: of what is there but does not show, of a slight effect, and of one that
a user would call by its name. Nothing is exactly absent; a decade lies between each."""
USUAL_ODDS = 0.1
"""Probability of an effect before the record is looked at."""


@dataclass(frozen=True)
class Alternative:
    """One reason why numbers of the plain model could be wrong.

    Attributes
    ----------
    name : str
        "cogging 4", "drift", ...
    columns : callable
        ``columns(rows)``, shape (n, k): functions of the motion or of the model, never of the measured torque (such
        a column would explain the torque's own noise).
    unit : str
        What the coefficients are relative to.
    absent : float
        Their standard deviation where the effect is not there: small, not 0.
    present : tuple
        The standard deviations that they may have where it is, equally likely; numbers, or what `shape` takes.
    odds : float
        Probability that it is there.
    splits : str
        A number of which the axis then has two ("inertia", "fc"): it is as unsure as these differ.
    lags : bool
        Whether the columns are made by `SlidingRows.see` and change fast: a late torque column then shifts them too.
    curve : callable, optional
        ``curve(speed, rows)``, shape (m, k): what the columns are in steady motion forward at some speeds, where they
        are part of the friction curve.
    even : callable, optional
        ``even(speed, rows)``, shape (m, k): what the columns add to steady motion at some speeds, the same in both
        directions: friction that differs by direction is a constant torque to a law that has one curve.
    removable : bool
        Whether `SlidingRows.see` alone makes the columns: their torque can be taken out of a record.
    shape : callable, optional
        ``shape(level, k)``: standard deviations of the k coefficients at one level.
    compliant : bool
        Whether motor and load then do not move as one: what reversals alone show of a contact is then the spring's or
        the gap's as well.
    of_model : bool
        Whether the columns are made of a first model of the torque, another one from every start.
    wave_number : float
        rad⁻¹ (m⁻¹) of a torque that repeats over the position; 0 of others.
    cause : str
        What it is, for the report: "<cause> explains 62 % of the width".
    remedy : str
        What to record to exclude it.
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
        """Standard deviations, that of its absence first."""
        return (self.absent, *self.present)

    def std(self, level: int, count: int) -> Array:
        """Standard deviations of so many coefficients at a level, shape (count,)."""
        x = self.levels[level]
        return np.full(count, float(x)) if self.shape is None else self.shape(x, count)

    def log_odds(self, level: int) -> float:
        """Logarithm of a level's probability before the record is looked at."""
        return float(np.log(self.odds / len(self.present) if level else 1.0 - self.odds))


def legendre(x: Array, degrees: range) -> Array:
    """Legendre polynomials of some degrees on [-1, 1], shape (n, len(degrees))."""
    every = np.polynomial.legendre.legvander(np.clip(x, -1.0, 1.0), degrees[-1])
    return np.asarray(every[:, degrees.start :], dtype=np.float64)


def braking(record: SlidingRecord) -> Array:
    """1 where the axis slows down, else 0."""
    return (record.velocity * record.acceleration < 0.0).astype(np.float64)
