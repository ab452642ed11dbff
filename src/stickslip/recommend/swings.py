"""Swings of an axis to and fro: how many there are, whether they go on undiminished, how much of a motion is fast."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel

Array = np.ndarray[Any, np.dtype[np.float64]]

SHRINKS = 0.7
"""Of the largest swing before it: a last swing below that is one of a sequence that decays."""
HELD = 3.0
"""Counts: a loop sees that the axis has left a count only in one of its neighbours, and holds it within these three."""


def reversals(velocity: Array, trigger: float) -> int:
    """Changes of sign between velocities beyond a trigger."""
    sides = np.sign(velocity[np.abs(velocity) > trigger])
    return int(np.sum(sides[1:] != sides[:-1]))


@kernel()
def turning_points(position: Any, swing: float) -> Any:
    """Positions after which the axis goes back by more than a swing, the one it starts out from included."""
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
    """Turning points after which the position goes back by more than a swing."""
    return max(turning_points(position, swing).size - 1, 0)


def repeats(position: Array, swing: float) -> bool:
    """Whether swings go on undiminished, as those of a limit cycle do; jumps that become smaller end at rest.

    What cannot be told, from fewer than two whole swings, is taken to go on.
    """
    sizes = np.abs(np.diff(turning_points(position, swing)[1:]))
    return sizes.size < 2 or float(sizes[-1]) > SHRINKS * float(np.max(sizes[:-1]))


def back_and_forth(position: Array) -> float:
    """The smaller of the largest rise and the largest fall, rad: 0 of a creep or a jump in one direction.

    A limit cycle has its whole swing so, wherever the record cuts it.
    """
    rise = position - np.minimum.accumulate(position)
    fall = np.maximum.accumulate(position) - position
    return min(float(rise.max()), float(fall.max()))


def between_counts(counts: float) -> float:
    """What no loop can keep an axis at rest from going to and fro by, rad; `counts` per revolution, 0: exact."""
    return HELD * 2.0 * math.pi / counts if counts else 0.0


def above(velocity: Array, corner: float, sample_time: float) -> float:
    """RMS of what is faster than a corner, Hz, by the spectrum of the whole motion."""
    spectrum = np.fft.rfft(velocity)
    fast = np.fft.rfftfreq(velocity.size, sample_time) > corner
    return math.sqrt(2.0 * float(np.sum(np.abs(spectrum[fast]) ** 2))) / velocity.size
