"""What a train that is not stiff, or a filter in the column of the torque, adds to the equation of a rigid axis.

A motor (Jm) and a load behind a spring, which swings at omega while the motor is held: the motor's acceleration a obeys
(1 + D²/omega²) (T - F) = J a + Jm/omega² D² a, D = d/dt. A lag tau in the column, besides its delay, is the same with
the other sign: T = J a + F + tau²/2 J D² a. So the second derivatives of acceleration and torque take part, their
coefficients small, where a record shows that it needs them: in few and short strokes they explain what friction does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.fit.smooth import seen_at
from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import stacked
from stickslip.machines.two_inertias import TwoInertias

Array = np.ndarray[Any, np.dtype[np.float64]]

USUAL = 1e-4
"""s²: one standard deviation of 1/omega², that of a load which swings at 16 Hz, and of tau²/2, that of a lag of 14 ms.
Thrice as much or a third gives the same numbers: a record that excites such a swing tells it."""
GIVES, SWINGS = 0.5, 0.8
"""Part of the misfit of a rigid axis that one which gives must leave at most, and one that swings of the least of both.
Of 198 logs of another program, belts and lags among them, 81 % of the inertias held beside a rigid axis, 95 % beside
these; on tuning steps, where little else tells them, the more held the less was needed."""
MAY_GIVE = 2.0 / 3.0
"""The same that the columns would leave at least, from which on a spring may be what is seen where it is not taken."""
HARDLY = 0.9
"""Part of the misfit of a rigid axis above which what the columns could leave at least is not worth their fits: of 271
records none was taken to give or to swing where they leave more than 0.82 so."""
ALIKE = 2.5
"""Times by which the swing's coefficient may be another one in another band: play swings differently in each."""
SURE_FREQUENCY, SURE_SHARE = 0.05, 0.03
"""Half-widths at least: part of the frequency, which the spring's damping moves up by as much, and the motor's part of
the inertia."""
TOLD_FREQUENCY, TOLD_SHARE, MOST_SHARE = 0.25, 0.15, 0.9
"""Half-widths up to which they are told; the motor's part at most, above which a load moves next to nothing. Of 690
logs of two other programs, 27 tell motor and load: 26 have a belt, of which 23 resonate within a tenth of what is
said, and one is clipped. Without the last two bounds four more, which warm up or saturate, would tell one."""


class Train(Enum):
    """What moves: one inertia, one that gives a little, or two that swing; its value is the number of columns."""

    RIGID = 0
    GIVES = 1
    SWINGS = 2


class Swing(NamedTuple):
    """What one band says of a load that swings: coefficients of the second derivatives of torque, s², and of
    acceleration, kg·m²·s² (kg·s²), and the inertia beside them, kg·m² (kg)."""

    torque: float
    acceleration: float
    inertia: float

    @property
    def antiresonance(self) -> float:
        """At which the load swings while the motor is held, Hz; nan where this is a lag of the torque's column."""
        return 1.0 / (2.0 * math.pi * math.sqrt(-self.torque)) if self.torque < 0.0 else math.nan

    @property
    def motor_share(self) -> float:
        """The motor's part of the inertia."""
        return self.acceleration / (-self.torque * self.inertia) if self.torque < 0.0 else math.nan


STILL = Swing(0.0, 0.0, 0.0)


def two_inertias(swings: Sequence[Swing]) -> TwoInertias | None:
    """Motor and load as the two widest bands say together, their intervals as wide as these and any narrower band that
    shows motor and load differ; None where they do not tell."""
    if len(swings) < 2:
        return None
    first, second, *narrower = swings
    seen = (first, second, *(s for s in narrower if 0.0 < s.motor_share < 1.0))
    frequency, share = (
        0.5 * (first.antiresonance + second.antiresonance),
        0.5 * (first.motor_share + second.motor_share),
    )
    frequencies, shares = [s.antiresonance for s in seen], [s.motor_share for s in seen]
    half = max(max(frequencies) - min(frequencies), SURE_FREQUENCY * frequency)
    most = max(max(shares) - min(shares), SURE_SHARE)
    if not (half <= TOLD_FREQUENCY * frequency and most <= TOLD_SHARE and most < share < MOST_SHARE - most):
        return None
    return TwoInertias(frequency, (frequency - half, frequency + half), share, (share - most, share + most))


def moves_a_load(swings: Sequence[Swing]) -> bool:
    """Whether what the two widest bands say of a swing leaves the motor less than `MOST_SHARE` of the inertia: with
    more, what bends the torque is no load."""
    shares = [s.motor_share for s in swings[:2] if s.torque < 0.0]
    return bool(shares) and 0.0 < sum(shares) / len(shares) < MOST_SHARE


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


def train_torque(records: Sequence[SlidingRows], swing: Swing) -> Array:
    """What a train that gives or swings adds to the torque of a rigid axis, N·m (N), shape (n,)."""
    added = np.zeros(stacked(records, "speed").size)
    if swing.acceleration:
        added += swing.acceleration * stacked(records, "snap")
    if swing.torque:
        added += swing.torque * np.concatenate([torque_bent(r) for r in records])
    return added


def swings_alike(swings: Sequence[Swing]) -> bool:
    """Whether the torque's coefficients of a swing are about the same in the two widest bands."""
    first, second = (*(s.torque for s in swings), 0.0, 0.0)[:2]
    return first * second > 0.0 and 1.0 / ALIKE < first / second < ALIKE


def torque_bent(rows: SlidingRows) -> Array:
    """Second derivative of the recorded torque, N·m/s² (N/s²), shape (n,)."""
    return seen_at(rows.signals.drive, rows.window.weights(2), rows.places)
