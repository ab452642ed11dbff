"""Velocity from encoder edges: the position is exact where a count changes, and nowhere else.

Between two such edges the mean velocity is known, the better the more counts or samples separate them. A drive that
sticks and slips starts and stops within a sample, so nothing is filtered: a filter would round the corner at which the
contact breaks away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

LEAST = 1.5
"""Least distance of two edges, samples or counts, for the velocity between them to count."""
ALIKE = 3.0
"""Ratio of neighbouring velocities from which on the axis starts, stops or turns between the edges."""
REST = 0.01
"""Time without an edge after which only an upper limit of the velocity is known, s."""


@dataclass(frozen=True, eq=False)
class SeenVelocity:
    """The velocity until the next sample, with its uncertainty.

    Attributes
    ----------
    velocity : array, shape (n,)
        Mean from each sample to the next, rad/s (m/s); 0 after the last.
    doubt : array, shape (n,)
        Greatest error, rad/s: 0 in even motion, the limit due to one count where edges are rare, and infinite if the
        axis starts, stops or turns between two edges.
    """

    velocity: Array
    doubt: Array


def seen_velocity(time: Array, position: Array, count: float) -> SeenVelocity:
    """Estimate the velocity between the edges of an encoder.

    Parameters
    ----------
    time, position : array, shape (n,)
        s, equally spaced; rad (m).
    count : float
        Resolution of the position, rad (m); 0 if it is exact.
    """
    dt = float(np.median(np.diff(time)))
    at = np.flatnonzero(position[1:] != position[:-1])
    if count == 0.0 or at.size < 3:
        return SeenVelocity(np.append(np.diff(position) / dt, 0.0), np.zeros(position.size))
    edges, passed = 0.5 * (time[at] + time[at + 1]), 0.5 * (position[at] + position[at + 1])
    # It left or reached a rest within a count of its rest position.
    still, where = np.flatnonzero(np.diff(edges) >= REST), position[at[1:]]
    for i in (still, still + 1):
        passed[i] = where[still] + np.clip(passed[i] - where[still], -0.5 * count, 0.5 * count)
    kept = apart(edges / dt, passed / count, REST / dt)
    edges, passed = edges[kept], passed[kept]
    doubt = doubts(np.diff(edges), np.diff(passed), count)
    velocity = np.append(np.diff(np.interp(time, edges, passed)) / dt, 0.0)
    # An edge is in the middle between two samples: the greater uncertainty of both sides applies.
    before, after = (doubt[np.searchsorted(edges, time + part * dt)] for part in (0.25, 0.75))
    return SeenVelocity(velocity, np.maximum(before, after))


def apart(samples: Array, counts: Array, rest: float) -> list[int]:
    """Return edges far enough from the one before, in samples or counts, and the last before every rest."""
    x, y = samples.tolist(), counts.tolist()
    kept = [0]
    for i in range(1, len(x)):
        far = x[i] - x[kept[-1]] > LEAST or abs(y[i] - y[kept[-1]]) > LEAST
        if far or (i + 1 < len(x) and x[i + 1] - x[i] >= rest):
            kept.append(i)
    return kept


def doubts(gap: Array, travel: Array, count: float) -> Array:
    """Return the greatest velocity error, rad/s, before, between and after edges, shape (edges + 1,)."""
    speed = travel / gap
    doubt = np.where(gap >= REST, count / gap, 0.0)
    ratio = speed[1:] / np.where(speed[:-1] == 0.0, np.inf, speed[:-1])
    unlike = ~((ratio > 1.0 / ALIKE) & (ratio < ALIKE))
    changing = np.append(unlike, False) | np.append(False, unlike)
    doubt[changing & (gap < REST)] = np.inf
    return np.concatenate([[np.inf], doubt, [np.inf]])
