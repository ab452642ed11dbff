"""Rows in which the axis creeps with less friction than it has when it moves.

A motor that goes on alone within the play, or friction that only builds up with velocity (a steep slope through zero, a
train of many contacts): the level of friction is that of the faster rows, and these tell it alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.regression.band_system import least_squares
from stickslip.identify.regression.sliding_rows import DIRECTION, FEWEST, SlidingRows
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

CREEPING = (0.0, 0.01, 0.03, 0.1)
"""Of the highest speed: between these friction is looked at; the axis moves above the last."""
SHARE = 0.01
"""Of all rows, that must creep with too little friction."""
MOVING = 1.0 / 3.0
"""Of all rows, that must move: the few of a tuning step accelerate, and tell the level worse than those that creep."""
MISSING = 0.15
"""Part of the level that must be missing in more than half of such rows. Of ordinary logs it was in 15 of 411 with
play and in 9 of 1,683 others (1070000, 1120000, and 1080000 with exponent 1)."""


class Creep(NamedTuple):
    """Speed up to which friction is missing, rad/s (m/s), and the part of its level that is; 0 where none is."""

    speed: float = 0.0
    missing: float = 0.0


NOWHERE = Creep()


def creep_of(records: Sequence[SlidingRows], skew: float) -> Creep:
    """Whether friction is missing where the axis creeps, and up to which speed.

    Parameters
    ----------
    records : sequence of SlidingRows
    skew : float
        s by which the column of the torque lies behind the torque that acted.
    """
    fixed, speed = stacked(records, "fixed"), np.abs(stacked(records, "speed"))
    top = float(np.max(speed))
    moves = speed > CREEPING[-1] * top
    if np.count_nonzero(moves) < max(FEWEST, MOVING * speed.size):
        return NOWHERE
    torque = np.concatenate([r.torque(skew) for r in records])
    values = least_squares(fixed[moves], torque[moves])
    level = float(values[DIRECTION])
    if level <= 0.0:
        return NOWHERE
    missing = -(torque - fixed @ values) * fixed[:, DIRECTION] / level
    limit, lacking = 0.0, np.zeros(speed.size, dtype=np.bool_)
    for low, high in itertools.pairwise(CREEPING):
        inside = (speed >= low * top) & (speed < high * top)
        if np.any(inside) and float(np.median(missing[inside])) > MISSING:
            limit, lacking = high * top, lacking | inside
    return Creep(limit, float(np.median(missing[lacking]))) if np.mean(lacking) >= SHARE else NOWHERE
