"""What an encoder says of the velocity: its position is exact where a count changes, and nowhere else.

Between two such edges the mean velocity is known, the better the more counts or samples lie between them. A drive
that sticks and slips starts and stops within a sample, so that nothing is filtered: a filter would round the corner
at which the contact breaks away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

LEAST = 1.5
"""Samples or counts that two edges must lie apart for the velocity between them to count."""
ALIKE = 3.0
"""Ratio of neighbouring velocities from which the axis is starting, stopping or turning between the edges."""
REST = 0.01
"""s without an edge after which only an upper limit of the velocity is known."""


@dataclass(frozen=True, eq=False)
class SeenVelocity:
    """The velocity until the next sample, as far as it is known.

    Attributes
    ----------
    velocity : array, shape (n,)
        Mean from each sample to the next, rad/s (m/s); 0 after the last.
    doubt : array, shape (n,)
        How far it may be wrong, rad/s: 0 where the axis moves evenly, what one count allows where edges are rare, and
        infinite where the axis starts, stops or turns between two edges.
    """

    velocity: Array
    doubt: Array


def seen_velocity(time: Array, position: Array, count: float) -> SeenVelocity:
    """Velocity between the edges of an encoder.

    Parameters
    ----------
    time, position : array, shape (n,)
        s, equally spaced; rad (m).
    count : float
        Resolution of the position, rad (m); 0 where it is exact.
    """
    dt = float(np.median(np.diff(time)))
    at = np.flatnonzero(position[1:] != position[:-1])
    if count == 0.0 or at.size < 3:
        return SeenVelocity(np.append(np.diff(position) / dt, 0.0), np.zeros(position.size))
    edges, passed = 0.5 * (time[at] + time[at + 1]), 0.5 * (position[at] + position[at + 1])
    # It left a rest, or came to it, within a count of the position at which it rested.
    still, where = np.flatnonzero(np.diff(edges) >= REST), position[at[1:]]
    for i in (still, still + 1):
        passed[i] = where[still] + np.clip(passed[i] - where[still], -0.5 * count, 0.5 * count)
    kept = apart(edges / dt, passed / count, REST / dt)
    edges, passed = edges[kept], passed[kept]
    doubt = doubts(np.diff(edges), np.diff(passed), count)
    velocity = np.append(np.diff(np.interp(time, edges, passed)) / dt, 0.0)
    # An edge lies in the middle between two samples: what is known on either side of it holds for them together.
    before, after = (doubt[np.searchsorted(edges, time + part * dt)] for part in (0.25, 0.75))
    return SeenVelocity(velocity, np.maximum(before, after))


def apart(samples: Array, counts: Array, rest: float) -> list[int]:
    """Edges that lie far enough from the one before, in samples or in counts, and the last before every rest."""
    x, y = samples.tolist(), counts.tolist()
    kept = [0]
    for i in range(1, len(x)):
        far = x[i] - x[kept[-1]] > LEAST or abs(y[i] - y[kept[-1]]) > LEAST
        if far or (i + 1 < len(x) and x[i + 1] - x[i] >= rest):
            kept.append(i)
    return kept


def doubts(gap: Array, travel: Array, count: float) -> Array:
    """How far the velocity between edges may be wrong, rad/s, shape (edges + 1,): before, between and after them."""
    speed = travel / gap
    doubt = np.where(gap >= REST, count / gap, 0.0)
    ratio = speed[1:] / np.where(speed[:-1] == 0.0, np.inf, speed[:-1])
    unlike = ~((ratio > 1.0 / ALIKE) & (ratio < ALIKE))
    changing = np.append(unlike, False) | np.append(False, unlike)
    doubt[changing & (gap < REST)] = np.inf
    return np.concatenate([[np.inf], doubt, [np.inf]])
