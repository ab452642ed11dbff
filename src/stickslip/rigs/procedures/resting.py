"""Whether an axis that should slide stood meanwhile, as far as its encoder tells."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOW, RESTING = 0.2, 0.02
"""Of the mean speed, below which the axis all but stands; share of the time from which it sticks and slips."""
COUNTS = 3.0
"""Of the encoder, over which a speed is taken at least: a count more or less at both ends is then no rest."""


def resting(time: Array, position: Array, velocity: float, resolution: float) -> float:
    """Share of the time in which the axis all but stands.

    Parameters
    ----------
    time, position : array, shape (n,)
        s and rad, of a run at constant velocity.
    velocity : float
        Its mean, rad/s, with its sign.
    resolution : float
        Of the encoder, rad: rests that are shorter than `COUNTS` of it take at that velocity are not seen.
    """
    if time.size < 2:
        return 0.0
    row = float(np.median(np.diff(time)))
    rows = max(1, math.ceil(COUNTS * resolution / (abs(velocity) * row)))
    if time.size < rows + 3:
        return 0.0
    speed = (position[rows:] - position[:-rows]) / (time[rows:] - time[:-rows]) / velocity
    return float(np.mean(speed < SLOW))
