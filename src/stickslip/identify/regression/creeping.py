"""Rows in which the axis creeps with less friction than it has when it moves.

A motor that goes on alone within the play, or friction that only builds up with velocity (a steep slope through zero, a
train of many contacts): the level of friction is that of the faster rows, and these tell it alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.fit.smooth import root_mean_square
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


FAR = {"rotary": 0.35, "linear": 0.035}
"""rad, m: way behind a reversal from which on neither play nor pre-sliding (20 degrees at most) lets friction lack."""


class Creep(NamedTuple):
    """Speed up to which friction is missing, rad/s (m/s), and the part of its level that is; 0 where none is.

    `steady` where it is missing over ways that no play has: friction rises with the speed in another form than the
    law's.
    """

    speed: float = 0.0
    missing: float = 0.0
    steady: bool = False


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


def steady_lack(first: Sequence[SlidingRows], kept: Sequence[SlidingRows], skew: float, far: float) -> Creep:
    """What friction lacks, beside the level and slope of the `kept` rows, in slower ones that were left out although
    the axis had gone `far` since it turned, rad (m): at the speeds where most of it does. Nothing where the kept rows
    leave as much themselves, as a loop that chatters makes them: speeds then lack and exceed it by turns."""
    fixed, speed, gone = (stacked(first, name) for name in ("fixed", "speed", "gone"))
    slowest = float(np.min(np.abs(stacked(kept, "speed"))))
    slower = (gone > far) & (np.abs(speed) < slowest)
    fewest = max(FEWEST, SHARE * speed.size)
    if np.count_nonzero(slower) < fewest:
        return NOWHERE
    own, acted = stacked(kept, "fixed"), np.concatenate([r.torque(skew) for r in kept])
    values = least_squares(own, acted)
    level = float(values[DIRECTION])
    if level <= 0.0:
        return NOWHERE
    left = root_mean_square(acted - own @ values) / level
    torque = np.concatenate([r.torque(skew) for r in first])
    missing = -(torque - fixed @ values) * fixed[:, DIRECTION] / level
    octave = np.floor(np.log2(slowest / np.maximum(np.abs(speed), 1e-9 * slowest)))
    lacks = [
        float(np.median(missing[inside]))
        for k in np.unique(octave[slower])
        if np.count_nonzero(inside := slower & (octave == k)) >= fewest
    ]
    most = max(lacks, default=0.0)
    return Creep(slowest, most, steady=True) if most > max(MISSING, left) else NOWHERE
