"""Velocities for a motion that is known by its points alone.

Where the points lie so dense that they show a smooth motion: the derivative through five of them, whose cubic pieces
have its acceleration to the second order in their distance. Elsewhere (corners, dwells, a few points): a monotone
cubic, which does not overshoot them (Fritsch and Butland 1984). At both ends the motion rests.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

NEIGHBOURS = 5
"""Points of a derivative."""
ALIKE, BENT = 0.1, 0.1
"""Parts of the slope, and of its change from one side of a point to the other, by which the derivatives through three
points and through five may differ where the points show a smooth motion."""
AS_MUCH = 0.7
"""Part of the bend at a turning point that it is at its neighbours at least, and the other way round."""
STEEPEST = 3.0
"""Times the slope on either side: up to there a cubic between two points stays between them (Fritsch and Carlson)."""


def velocities_through(t: Array, x: Array) -> Array:
    """Velocities at the points of a motion, rad/s.

    Parameters
    ----------
    t : array, shape (n,)
        s, ascending; two points at least.
    x : array, shape (n,)
        rad

    Returns
    -------
    array, shape (n,)
        0 at both ends.
    """
    slope = np.diff(x) / np.diff(t)
    found = monotone(t, slope)
    if t.size < NEIGHBOURS:
        return found
    through = derivatives(t, x)[1:-1]
    smooth = shown_smooth(t, slope, through)
    found[1:-1][smooth] = through[smooth]
    return found


def monotone(t: Array, slope: Array) -> Array:
    """Weighted harmonic means of the slopes on both sides; 0 at a turning point, along a dwell and at both ends."""
    h = np.diff(t)
    before, after = slope[:-1], slope[1:]
    same = before * after > 0.0
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    inner = np.zeros(max(t.size - 2, 0))
    inner[same] = (w1 + w2)[same] / (w1[same] / before[same] + w2[same] / after[same])
    return np.concatenate([[0.0], inner, [0.0]])


def derivatives(t: Array, x: Array) -> Array:
    """At every point, of the polynomial through the five next to it, rad/s, shape (n,)."""
    n = t.size
    first = np.clip(np.arange(n) - NEIGHBOURS // 2, 0, n - NEIGHBOURS)
    rows = first[:, None] + np.arange(NEIGHBOURS)
    own = rows == np.arange(n)[:, None]
    nodes, away = t[rows], t[rows] - t[:, None]
    # Barycentric weights: of the others w_j / w_0 / (t_0 - t_j), of the point itself what makes them add up to 0.
    apart = nodes[:, :, None] - nodes[:, None, :] + np.eye(NEIGHBOURS)
    weight = 1.0 / np.prod(apart, axis=2)
    others = np.where(own, 0.0, weight / np.where(own, 1.0, -away))
    return np.asarray(np.sum(others * (x[rows] - x[:, None]), axis=1) / weight[own], dtype=np.float64)


def shown_smooth(t: Array, slope: Array, through: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether a smooth motion shows at each inner point, of which `through` is the derivative, shape (n - 2,)."""
    h = np.diff(t)
    before, after = slope[:-1], slope[1:]
    change = after - before
    parabola = (h[1:] * before + h[:-1] * after) / (h[1:] + h[:-1])
    off = np.abs(through - parabola)
    largest = np.maximum(np.abs(before), np.abs(after))
    least = np.minimum(np.abs(before), np.abs(after))
    onward = (before * after > 0.0) & (through * after > 0.0) & (np.abs(through) <= STEEPEST * least)
    # Over a turning point the motion bends one way, and at its neighbours about as much.
    bend = change / (h[1:] + h[:-1])
    sides = np.concatenate([[0.0], bend, [0.0]])
    one_way = np.ones(bend.size, dtype=np.bool_)
    for beside in (sides[:-2], sides[2:]):
        one_way &= (beside * bend > 0.0) & (np.abs(beside) > AS_MUCH * np.abs(bend))
        one_way &= np.abs(bend) > AS_MUCH * np.abs(beside)
    return (onward & (off <= ALIKE * largest)) | (one_way & (off <= BENT * np.abs(change)))
