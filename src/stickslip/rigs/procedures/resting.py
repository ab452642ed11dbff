"""Detect rest of an axis that should slide, within the resolution of its encoder."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOW, RESTING = 0.2, 0.02
"""Share of the mean speed below which the axis counts as resting; share of the time above which it sticks and slips."""
COUNTS = 3.0
"""Encoder counts over which a speed is computed, at least: an error of one count at both ends is then not a rest."""


def resting(time: Array, position: Array, velocity: float, resolution: float) -> float:
    """Return the share of the time in which the axis is nearly at rest.

    Parameters
    ----------
    time, position : array, shape (n,)
        s and rad, of a run at constant velocity.
    velocity : float
        Mean velocity, rad/s, with sign.
    resolution : float
        Of the encoder, rad: rests shorter than the time of `COUNTS` counts at that velocity are not detected.
    """
    if time.size < 2:
        return 0.0
    row = float(np.median(np.diff(time)))
    rows = max(1, math.ceil(COUNTS * resolution / (abs(velocity) * row)))
    if time.size < rows + 3:
        return 0.0
    speed = (position[rows:] - position[:-rows]) / (time[rows:] - time[:-rows]) / velocity
    return float(np.mean(speed < SLOW))
