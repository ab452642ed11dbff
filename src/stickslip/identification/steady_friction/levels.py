"""Levels of constant velocity in a motion, from the fastest of a staircase to its slowest.

A velocity is the slope of the position over a window. The errors due to an encoder's counts, cogging and noise are
small for a fast level over 50 ms, and for a slow one only over seconds: every window is tried, and of overlapping
levels the longest is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.record import encoder_step
from stickslip.identification.fit.noise import white_std

Array = np.ndarray[Any, np.dtype[np.float64]]

WINDOW, WIDER, WIDEST = 0.05, 3.0, 0.1
"""First window, s; ratio of each window to the one before; greatest part of the record that a window spans."""
END = 0.1
"""Part of a level, at most one window, that is left out at its end: the axis may already brake there."""
LEAST_COUNTS = 20.0
"""Least travel of a level, counts of the encoder: its velocity is then known to a twentieth."""
SWING = 0.3
"""Greatest RMS fluctuation of the velocity, part of its mean."""
OVERLAP = 0.1
"""Greatest part of a level that a longer one may cover."""


@dataclass(frozen=True, slots=True)
class Level:
    """Rows (first and last) of nearly constant velocity, and the reason not to average over them, if any."""

    first: int
    last: int
    why: str = ""


def find_levels(time: Array, position: Array, tolerance: float, shortest: float) -> list[Level]:
    """Find the rows in which the velocity stays within the tolerance of its mean, in time order.

    Parameters
    ----------
    time, position : array, shape (n,)
        s and rad (m).
    tolerance : float
        Part of the velocity by which its mean over a window may vary.
    shortest : float
        Least duration, s.

    Returns
    -------
    list of Level
        Those without a reason overlap each other by at most a tenth.
    """
    found: list[tuple[int, int, float]] = []
    span, row = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    window = WINDOW
    while window <= max(WINDOW, WIDEST * span):
        stride = max(1, int((window - WINDOW) / (20.0 * row)))
        rows = np.arange(0, time.size, stride)
        speed = slope_of(time, position, window)[rows]
        # The window blurs the ends of a level over half its length.
        margin = 0.5 * (window - WINDOW)
        for a, b in level_runs(time[rows], speed, tolerance):
            begin, end = float(time[rows[a]]), float(time[rows[b]])
            braking = margin + min(WINDOW, END * (end - begin))
            first, last = np.searchsorted(time, [begin + margin, end - braking]).tolist()
            last = min(last, time.size - 1)
            if last > first and time[last] - time[first] >= max(shortest, window):
                found.append((first, last, window))
        window *= WIDER
    return select_longest(time, position, found)


def select_longest(time: Array, position: Array, found: list[tuple[int, int, float]]) -> list[Level]:
    """Return the longest of overlapping levels; those that cannot be averaged have the reason."""
    count = encoder_step(position)
    noise = max(count / math.sqrt(12.0), white_std(position))
    fine = slope_of(time, position, WINDOW)
    free = np.ones(time.size, dtype=np.bool_)
    kept: list[Level] = []
    for first, last, window in sorted(found, key=lambda f: time[f[0]] - time[f[1]]):
        if np.mean(free[first : last + 1]) < 1.0 - OVERLAP:
            continue
        why = find_fault(time, position, fine, first, last, window, count, noise)
        free[first : last + 1] = False
        kept.append(Level(first, last, why))
    return sorted(kept, key=lambda s: s.first)


def find_fault(
    time: Array, position: Array, fine: Array, first: int, last: int, window: float, count: float, noise: float
) -> str:  # fmt: skip
    """Return the reason why the mean torque of a level is not that of its velocity; empty if it is."""
    travel = abs(float(position[last] - position[first]))
    if travel < LEAST_COUNTS * count:
        return f"travels {travel / count:.0f} counts of the encoder"
    if window == WINDOW:
        return ""
    velocity = travel / float(time[last] - time[first])
    # A slope has two positions, each with its noise.
    own = 2.0 * (noise / WINDOW) ** 2
    swing = math.sqrt(max(float(np.var(fine[first : last + 1])) - own, 0.0)) / velocity
    return (
        "" if swing <= SWING else f"its velocity swings by {100.0 * swing:.0f} % (RMS): it sticks and slips"
    )


def slope_of(time: Array, position: Array, window: float = WINDOW) -> Array:
    """Return the slope of the position over a window (s) around every sample, rad/s."""
    before = np.maximum(np.searchsorted(time, time - 0.5 * window), 0)
    after = np.minimum(np.searchsorted(time, time + 0.5 * window, side="right"), time.size) - 1
    before, after = (
        np.minimum(before, np.maximum(after - 1, 0)),
        np.maximum(after, np.minimum(before + 1, time.size - 1)),
    )
    width = time[after] - time[before]
    return np.where(
        width > 0.0, (position[after] - position[before]) / np.where(width > 0.0, width, 1.0), 0.0
    )


def level_runs(time: Array, speed: Array, tolerance: float) -> list[tuple[int, int]]:
    """Return the longest runs (first, last) in which the velocity stays within the tolerance of their middle."""
    runs: list[tuple[int, int]] = []
    values = speed.tolist()
    first = 0
    while first < len(values) - 1:
        low = high = values[first]
        last = first
        while last + 1 < len(values):
            lower, higher = min(low, values[last + 1]), max(high, values[last + 1])
            if higher - lower > tolerance * abs(lower + higher):
                break
            low, high, last = lower, higher, last + 1
        if last > first and low + high != 0.0:  # a standstill has no tolerance and is skipped as a whole
            runs.append((first, last))
        first = last + 1
    # A ramp is split into many short runs; a level one outlasts its neighbours.
    return [(a, b) for a, b in runs if abs(_drift(time[a : b + 1], speed[a : b + 1])) <= tolerance]


def _drift(time: Array, speed: Array) -> float:
    """Return the change of the velocity from the first to the last third of a run, over its mean."""
    third = max(time.size // 3, 1)
    mean = float(np.mean(speed))
    return float(np.mean(speed[-third:]) - np.mean(speed[:third])) / mean if mean else math.inf
