"""Weights of the rows: their variance, and the number of rows that carry the same information.

The variance of a row has three parts: its block's own variance, a share proportional to the inertia torque, and near
the ends of a stroke the uncertainty of friction that builds up. Student weights reduce outliers (Lange, Little and
Taylor 1989). Repeated misfit is no new observation: weights are divided by the long-run variance within a stroke and by
the design effect of strokes with the same misfit in the same state (Kish 1965), and bounded if all samples of a window
share one count of the column.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.rows import Block, SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.int64]]

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution: a tenth of the rows may be outliers without much effect."""
LEAST = 0.001
"""Least standard deviation of a torque, as a part of Fc."""
END, WAY = 0.3, 0.003
"""Standard deviation of friction at a stroke's end, part of Fc; distance over which it decays, part of the range."""
ITERATIONS = 8
LAGS, UNCORRELATED = 60, 0.05
"""Greatest lag of the misfit's correlation, rows; correlation below which rows count as independent."""
CELLS = 8.0
"""Cells per usual size of a state's coordinate (speed, acceleration, jerk)."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Weights of all rows.

    Attributes
    ----------
    weight : array, shape (n,)
        Information of a row: one over its variance and over the number of rows with the same information.
    accelerating : float
        Misfit at the greatest acceleration, N·m (N).
    """

    weight: Array
    accelerating: float


def noise_of(rows: SlidingRows, residual: Array, inertia: float, friction: float) -> Noise:
    """Estimate the weights of all rows from a residual torque.

    Parameters
    ----------
    rows : SlidingRows
    residual : array, shape (n,)
        Residual torque, N·m (N).
    inertia, friction : float
        Approximate values of the axis.
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
    """Return a block's standard deviation, its share of the inertia torque, and the Student weights of its rows."""
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
    """Return the number of a stroke's rows that carry the same information: at least 2, since windows overlap."""
    total, count = float(z @ z), 1.0
    for lag in range(1, min(LAGS, z.size // 4)):
        same = strokes[lag:] == strokes[:-lag]
        rho = float((z[lag:] * z[:-lag])[same].sum()) / max(total, 1e-300)
        if rho < UNCORRELATED:
            break
        count += 2.0 * rho
    return max(count, 2.0)


def _states(rows: SlidingRows) -> Integers:
    """Return the cell of speed, acceleration and jerk of every row, shape (n,)."""
    scaled = zip((rows.velocity, rows.acceleration, rows.jerk), rows.largest, strict=True)
    cells = np.column_stack([np.floor(CELLS * np.clip(x / size, -1.2, 1.2)) for x, size in scaled])
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()


def _repeated(z: Array, strokes: Integers, state: Integers) -> Array:
    """Return the design effect 1 + ρ (m - 1) of m strokes with correlated misfit in a row's state, shape (n,)."""
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
    """Return the greatest weight of a row: rows whose windows see one count of the torque column share its rounding."""
    step = block.record.torque_step
    if step <= 0.0:
        return np.full(block.centres.size, np.inf)
    m = int(block.half / block.record.period)
    seen = np.lib.stride_tricks.sliding_window_view(block.record.drive, 2 * m + 1)[block.centres - m]
    alone = np.ptp(seen, axis=1) < 1.5 * step
    value = np.where(alone, np.round(np.abs(block.record.drive[block.centres]) / step), -1.0)
    index = np.unique(value, return_inverse=True)[1]
    return np.where(alone, 12.0 / step**2 / np.bincount(index)[index], np.inf)
