"""Whether friction is missing where the axis creeps: a motor that goes on alone within the play, or friction that grows
less than in proportion to velocity. The level of friction is then one number for creeping and another for moving."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.identify.regression.band_system import least_squares
from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

CREEPING, MOVING = (0.01, 0.03), 0.1
"""Of the highest speed: below which the axis creeps (two looks at it), and above which it moves."""
FEWEST, SHARE = 30, 0.01
"""Rows that must move, and the share of all that must creep."""
MISSING = 0.15
"""Part of the level that must be missing in more than half of the creeping rows. Of 1,900 ordinary logs it was in no
log without play (`benchmarks/ordinary_logs.py`)."""
DIRECTION = 2  # its column


def missing_where_it_creeps(
    records: Sequence[SlidingRows], skew: float, orders: Sequence[float], pendulum: bool
) -> float:
    """Part of the level of friction that is missing in the rows in which the axis creeps; 0 where none is.

    Parameters
    ----------
    records : sequence of SlidingRows
    skew : float
        s by which the column of the torque lies behind the torque that acted.
    orders : sequence of float
        Cycles a radian (m) of the torque over the position that was found.
    pendulum : bool
        Whether gravity turns with the angle.
    """
    speed = np.abs(stacked(records, "speed"))
    top = float(np.max(speed))
    moves, looks = speed > MOVING * top, [speed < creeping * top for creeping in CREEPING]
    looks = [creeps for creeps in looks if np.mean(creeps) >= SHARE]
    if np.count_nonzero(moves) < FEWEST or not looks:
        return 0.0
    columns = columns_of(records, orders, pendulum)
    torque = np.concatenate([r.torque(skew) for r in records])
    values = least_squares(columns[moves], torque[moves])
    level = float(values[DIRECTION])
    if level <= 0.0:
        return 0.0
    missing = -(torque - columns @ values) * columns[:, DIRECTION] / level
    most = max(float(np.median(missing[creeps])) for creeps in looks)
    return most if most > MISSING else 0.0


def columns_of(records: Sequence[SlidingRows], orders: Sequence[float], pendulum: bool) -> Array:
    """Acceleration, velocity, direction, 1, gravity that turns, torque over the position; shape (n, p)."""
    position = stacked(records, "position")
    gravity = [np.column_stack([np.sin(position), np.cos(position)])] if pendulum else []
    waves = [np.concatenate([r.around(order) for r in records]) for order in orders]
    return np.concatenate([stacked(records, "fixed"), *gravity, *waves], axis=1)
