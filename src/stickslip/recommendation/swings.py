"""Analyse oscillations of an axis: number of swings, whether they persist, and share of fast motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel

Array = np.ndarray[Any, np.dtype[np.float64]]

SHRINKS = 0.7
"""Share of the largest earlier swing: a smaller last swing is part of a decaying sequence."""
HELD = 3.0
"""Counts: a loop detects that the axis has left a count only at a neighbouring one, so it holds it within three."""


def reversals(velocity: Array, trigger: float) -> int:
    """Count the changes of sign between velocities beyond a trigger."""
    sides = np.sign(velocity[np.abs(velocity) > trigger])
    return int(np.sum(sides[1:] != sides[:-1]))


@kernel()
def turning_points(position: Any, swing: float) -> Any:
    """Return the positions after which the axis reverses by more than a swing, including the start."""
    ends, n, side = np.empty(position.size), 0, 0
    low = high = position[0]
    for x in position:
        if side >= 0 and x < high - swing:
            ends[n] = high
            n, side, low = n + 1, -1, x
        elif side <= 0 and x > low + swing:
            ends[n] = low
            n, side, high = n + 1, 1, x
        high, low = max(high, x), min(low, x)
    return ends[:n]


def turns(position: Array, swing: float) -> int:
    """Count the turning points after which the position reverses by more than a swing."""
    return max(turning_points(position, swing).size - 1, 0)


def repeats(position: Array, swing: float) -> bool:
    """Whether swings persist, as in a limit cycle; jumps that decrease end at rest.

    Fewer than two whole swings are assumed to persist.
    """
    sizes = np.abs(np.diff(turning_points(position, swing)[1:]))
    return sizes.size < 2 or float(sizes[-1]) > SHRINKS * float(np.max(sizes[:-1]))


def back_and_forth(position: Array) -> float:
    """Return the smaller of the largest rise and the largest fall, rad: 0 for creep or a jump in one direction.

    For a limit cycle this is the whole swing, wherever the record starts and ends.
    """
    rise = position - np.minimum.accumulate(position)
    fall = np.maximum.accumulate(position) - position
    return min(float(rise.max()), float(fall.max()))


def between_counts(counts: float) -> float:
    """Return the unavoidable motion of an axis at rest, rad; `counts` per revolution, 0: exact."""
    return HELD * 2.0 * math.pi / counts if counts else 0.0


def above(velocity: Array, corner: float, sample_time: float) -> float:
    """Return the RMS of motion above a corner, Hz, by the spectrum of the whole motion."""
    spectrum = np.fft.rfft(velocity)
    fast = np.fft.rfftfreq(velocity.size, sample_time) > corner
    return math.sqrt(2.0 * float(np.sum(np.abs(spectrum[fast]) ** 2))) / velocity.size
