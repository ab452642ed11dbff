"""What a train that is not stiff, or a filter in the column of the torque, adds to the equation of a rigid axis.

A motor (Jm) and a load behind a spring, which swings at omega while the motor is held: the motor's acceleration a obeys
(1 + D²/omega²) (T - F) = J a + Jm/omega² D² a, D = d/dt. A lag tau in the column, besides its delay, is the same with
the other sign: T = J a + F + tau²/2 J D² a. So the second derivatives of acceleration and torque take part, their
coefficients small, where a record shows that it needs them: in few and short strokes they explain what friction does.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any

import numpy as np

from stickslip.identify.fit.smooth import seen_at
from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

USUAL = 1e-4
"""s²: one standard deviation of 1/omega², that of a load which swings at 16 Hz, and of tau²/2, that of a lag of 14 ms.
Thrice as much or a third gives the same numbers: a record that excites such a swing tells it."""
GIVES, SWINGS = 0.5, 0.8
"""Part of the misfit of a rigid axis that one which gives must leave at most, and one that swings of the least of both.
Of 198 logs of another program, belts and lags among them, 81 % of the inertias held beside a rigid axis, 95 % beside
these; on tuning steps, where little else tells them, the more held the less was needed."""
HARDLY = 0.9
"""Part of the misfit of a rigid axis above which what the columns could leave at least is not worth their fits: of 271
records none was taken to give or to swing where they leave more than 0.82 so."""
ALIKE = 2.5
"""Times by which the swing's coefficient may be another one in another band: play swings differently in each."""


class Train(Enum):
    """What moves: one inertia, one that gives a little, or two that swing; its value is the number of columns."""

    RIGID = 0
    GIVES = 1
    SWINGS = 2


def flexible_columns(records: Sequence[SlidingRows], inertia: float, train: Train) -> tuple[Array, Array]:
    """The columns, shape (n, 0 to 2), and the standard deviation of each coefficient.

    Parameters
    ----------
    records : sequence of SlidingRows
    inertia : float
        About, kg·m² (kg).
    train : Train
    """
    columns = np.zeros((stacked(records, "speed").size, train.value))
    if train is not Train.RIGID:
        columns[:, 0] = stacked(records, "snap")
    if train is Train.SWINGS:
        columns[:, 1] = np.concatenate([torque_bent(r) for r in records])
    return columns, USUAL * np.array([inertia, 1.0])[: train.value]


def swings_alike(coefficients: Sequence[float]) -> bool:
    """Whether the torque's coefficients, s², of a swing are about the same in the two widest bands."""
    first, second = (*coefficients, 0.0, 0.0)[:2]
    return first * second > 0.0 and 1.0 / ALIKE < first / second < ALIKE


def torque_bent(rows: SlidingRows) -> Array:
    """Second derivative of the recorded torque, N·m/s² (N/s²), shape (n,)."""
    return seen_at(rows.signals.drive, rows.window.weights(2), rows.places)
