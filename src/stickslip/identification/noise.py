"""How much each row says: its variance, and how many rows say the same.

The variance of a row is its block's own, a share of what accelerates, and next to the ends of a stroke what building up
friction leaves unsure. Heavy tails are met by Student weights (Lange, Little and Taylor 1989). What repeats is no new
observation: weights are divided by the long-run variance within a stroke, by the design effect of strokes that leave
the same misfit in the same state (Kish 1965), and bounded where all samples of a window share one count of the column.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.rows import Block, SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.int64]]

FREEDOM = 4.0
"""Of Student's distribution: outliers of a tenth of the rows hardly count."""
LEAST = 0.001
"""Of Fc: no torque is known better."""
END, WAY = 0.3, 0.003
"""Part of Fc that is unsure at a stroke's end, and part of the range over which it fades."""
ITERATIONS = 8
LAGS, UNCORRELATED = 60, 0.05
"""Rows up to which misfit is correlated at most, and the correlation that is none."""
CELLS = 8.0
"""Cells a state's coordinate (speed, acceleration, jerk over its usual size) is divided into."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Weights of all rows.

    Attributes
    ----------
    weight : array, shape (n,)
        Information of a row, one over its variance and over how many rows say the same.
    accelerating : float
        Misfit where the axis accelerates most, N·m (N).
    """

    weight: Array
    accelerating: float


def noise_of(rows: SlidingRows, residual: Array, inertia: float, friction: float) -> Noise:
    """Weights that a residual torque suggests.

    Parameters
    ----------
    rows : SlidingRows
    residual : array, shape (n,)
        N·m (N)
    inertia, friction : float
        About those of the axis.
    """
    weight, highest = np.zeros(residual.size), 0.0
    near_end = rows.at_centres(lambda r: np.minimum(r.since, r.until)) / max(WAY * rows.range, 1e-300)
    unsure = (END * friction * np.exp(-near_end)) ** 2
    pushed = (inertia * rows.acceleration) ** 2
    state = _states(rows)
    for number, block in enumerate(rows.blocks):
        mine = rows.block == number
        r, extra, push = residual[mine], unsure[mine], pushed[mine]
        size, share, student = _variance(r, extra, push, LEAST * friction)
        base = size**2 + share * push
        z = np.sqrt(student / base) * r
        strokes = rows.stroke[mine]
        same = _correlated(z, strokes) * _repeated(z, strokes, state[mine])
        weight[mine] = np.minimum(student / (base * same), _rounded(block))
        highest = max(highest, float(np.sqrt(size**2 + share * (inertia * rows.largest[1]) ** 2)))
    # The widths see the same record: together they count as one of them (a composite likelihood).
    widths = len({b.width for b in rows.blocks})
    return Noise(weight / widths, highest)


def _variance(r: Array, extra: Array, push: Array, least: float) -> tuple[float, float, Array]:
    """Standard deviation of a block, its share of what accelerates, and Student weights of its rows."""
    size, share = max(1.4826 * float(np.median(np.abs(r))), least), 0.0
    hard = push > np.median(push)
    student = np.ones(r.size)
    for _ in range(ITERATIONS):
        base = size**2 + share * push
        trust = 1.0 / (1.0 + extra / base)
        student = (FREEDOM + 1.0) / (FREEDOM + r**2 / (base + extra)) * trust
        squares = student * r**2
        soft_r, hard_r = (float(np.sum(squares[x]) / max(np.sum(trust[x]), 1e-9)) for x in (~hard, hard))
        gained = float(np.mean(push[hard]) - np.mean(push[~hard])) if hard.any() and not hard.all() else 0.0
        share = max((hard_r - soft_r) / gained, 0.0) if gained > 0.0 else 0.0
        left = float(np.sum(squares) / max(np.sum(trust), 1e-9) - share * np.mean(push))
        size = max(np.sqrt(max(left, 0.0)), least)
    return float(size), share, student


def _correlated(z: Array, strokes: Integers) -> float:
    """How many rows of a stroke say the same: twice at least, since windows overlap."""
    total, count = float(z @ z), 1.0
    for lag in range(1, min(LAGS, z.size // 4)):
        same = strokes[lag:] == strokes[:-lag]
        rho = float((z[lag:] * z[:-lag])[same].sum()) / max(total, 1e-300)
        if rho < UNCORRELATED:
            break
        count += 2.0 * rho
    return max(count, 2.0)


def _states(rows: SlidingRows) -> Integers:
    """Cell of speed, acceleration and jerk that every row lies in, shape (n,)."""
    scaled = zip((rows.velocity, rows.acceleration, rows.jerk), rows.largest, strict=True)
    cells = np.column_stack([np.floor(CELLS * np.clip(x / size, -1.2, 1.2)) for x, size in scaled])
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()


def _repeated(z: Array, strokes: Integers, state: Integers) -> Array:
    """How many strokes leave the same misfit in a row's state: 1 + ρ (m - 1) of m strokes, shape (n,)."""
    cell = np.unique(state, return_inverse=True)[1]
    both = np.unique(np.column_stack([cell, strokes]), axis=0, return_inverse=True)[1].ravel()
    sums, parts, numbers = np.bincount(cell, z), np.bincount(both, z), np.bincount(both)
    owner = np.zeros(parts.size, dtype=np.int64)
    owner[both] = cell
    count, squares = np.bincount(cell), np.bincount(owner, parts**2)
    own = np.bincount(owner, numbers.astype(np.float64) ** 2)
    pairs = float(np.sum(count**2 - own))
    rho = float(np.sum(sums**2 - squares)) / max(pairs, 1.0) / max(float(np.mean(z * z)), 1e-300)
    return np.asarray(1.0 + min(max(rho, 0.0), 1.0) * (np.bincount(owner)[cell] - 1.0), dtype=np.float64)


def _rounded(block: Block) -> Array:
    """The most that a row may weigh: rows whose windows see one count of the torque column share its rounding."""
    step = block.record.torque_step
    if step <= 0.0:
        return np.full(block.centres.size, np.inf)
    m = int(block.half / block.record.period)
    seen = np.lib.stride_tricks.sliding_window_view(block.record.drive, 2 * m + 1)[block.centres - m]
    alone = np.ptp(seen, axis=1) < 1.5 * step
    value = np.where(alone, np.round(np.abs(block.record.drive[block.centres]) / step), -1.0)
    index = np.unique(value, return_inverse=True)[1]
    return np.where(alone, 12.0 / step**2 / np.bincount(index)[index], np.inf)
