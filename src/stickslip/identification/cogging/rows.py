"""Conversion of records to places: angle, torque and direction of a standstill map or of a slow rotation.

At a place where the axis stood, friction has the sign of the motion towards it; after a reversal it keeps its old sign
for a while, so places shortly after one are left out. Rows of one place are not independent: they are averaged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]
Integers = np.ndarray[Any, np.dtype[np.intp]]

FASTEST = 1.0
"""Greatest speed, rad/s; above it the rotor's inertia, not the motor, carries the cogging."""
AFTER = 0.1, 0.02
"""Travel left out after a reversal: rad, and part of the stroke, whichever is less."""
GAP = 5.0
"""Median time steps without a row that end a place."""
STANDS = 8
"""Fewest places of a standstill map."""
SETTLES = 20
"""Rows of a place above which its first half, the approach, is left out."""
CELLS = 8192
"""Cells per turn in which rows of a rotation are averaged."""
PART = 16
"""Divisor of a stroke for averaging the velocity on each side: friction lags behind faster changes."""
WINDOW = 0.01
"""Window of a velocity on each side, s."""
CLOSED = 1.5
"""Widest gap between the last angle of a turn and the first, in median spacings: places scatter by half of one."""


@dataclass(frozen=True, eq=False)
class Places:
    """Data of a fit, in the order of measurement.

    Attributes
    ----------
    angle : array, shape (n,)
        rad
    torque : array, shape (n,)
        Torque or current.
    direction : array, shape (n,)
        +1 or -1.
    velocity, acceleration : array, shape (n,)
        rad/s, a running mean along the stroke, and rad/s²; 0 at standstill.
    stroke : array of int, shape (n,)
        Number of the motion without reversal.
    width : array, shape (n,)
        Angle over which the rows were averaged, rad; 0 at standstill.
    time : array, shape (n,)
        s, with the records in sequence.
    swing : array, shape (n, 2)
        Velocity without its running mean, rad/s, and acceleration, rad/s², from neighbouring rows; 0 at standstill.
    """

    angle: Array
    torque: Array
    direction: Array
    velocity: Array
    acceleration: Array
    stroke: Integers
    width: Array
    time: Array
    swing: Array

    def __len__(self) -> int:
        return int(self.angle.size)

    def at(self, rows: Any) -> Places:
        """Return some of the rows."""
        return type(self)(*(getattr(self, n)[rows] for n in self.__dataclass_fields__))

    @property
    def beside(self) -> Array:
        """Columns of other torque components, shape (n, k)."""
        return np.zeros((len(self), 0))

    def damping(self, order: float) -> Array:
        """Return the attenuation of a wave of this order by the mean over `width`, shape (n,)."""
        return np.sinc(order * self.width / (2.0 * math.pi))

    def motion(self, orders: Sequence[float], late: float = 0.0) -> Array:
        """Return velocity and acceleration without their noise: running mean and waves of these orders, shape (n, 2).

        `late`: time before each place at which the waves are evaluated, s.
        """
        out = np.column_stack([self.velocity, np.zeros(len(self))])
        edges = np.flatnonzero(np.diff(self.stroke) != 0) + 1
        for rows in np.split(np.arange(len(self)), edges):
            if rows.size > 2 * (2 * len(orders) + 1):
                seen = waves_of(self.angle[rows], orders)
                sizes = least_squares(seen, self.swing[rows])
                then = self.angle[rows] - late * self.velocity[rows]
                out[rows] += (seen if late == 0.0 else waves_of(then, orders)) @ sizes
        return out

    @property
    def spacing(self) -> float:
        """Median angle between neighbours of a stroke, rad."""
        steps = np.abs(np.diff(self.angle))[np.diff(self.stroke) == 0]
        return float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else math.inf


def waves_of(angle: Array, orders: Sequence[float]) -> Array:
    """Return ones, then cosines and sines of these orders, shape (n, 2 k + 1)."""
    angles = np.outer(angle, orders)
    return np.column_stack([np.ones(angle.size), np.cos(angles), np.sin(angles)])


def least_squares(matrix: Array, right: Array) -> Array:
    """Solve least squares by an orthogonal factor that is not formed: the right side is transformed with the matrix."""
    r: Array = np.asarray(np.linalg.qr(np.column_stack([matrix, right]), mode="r"))
    count: int = matrix.shape[1]
    turned: Array = r[:count, count] if right.ndim == 1 else r[:count, count:]
    return np.asarray(np.linalg.solve(r[:count, :count], turned), dtype=np.float64)


def places_of(record: Record, torque: str) -> tuple[Places, bool]:
    """Return the places of a record, and whether it is a standstill map."""
    t, q, y = record.time, record["position"], record[torque]
    good = np.isfinite(t) & np.isfinite(q) & np.isfinite(y)
    t, q, y = t[good], q[good], y[good]
    if t.size < 2 * STANDS:
        raise InputError(
            f"a record of {t.size} rows shows no torque over the angle; record a revolution each way"
        )
    reference = next(
        (record[c][good] for c in ("position_reference", "reference") if c in record.channels), None
    )
    group = _stands(t, q, reference)
    if group is None:
        velocity = velocity_of(record)[good]
        return _rotation(t - t[0], q, y, velocity), False
    return _standing(group, t - t[0], q, y, q if reference is None else reference), True


def velocity_of(record: Record) -> Array:
    """Return the recorded velocity, or the slope of the position over `WINDOW` on each side, rad/s."""
    if "velocity" in record.channels:
        return record["velocity"]
    t, q = record.time, record["position"]
    reach = max(1, round(WINDOW / max(float(np.median(np.diff(t))), 1e-9)))
    rows = np.arange(t.size)
    low, high = np.maximum(rows - reach, 0), np.minimum(rows + reach, t.size - 1)
    return (q[high] - q[low]) / np.maximum(t[high] - t[low], 1e-9)


def joined(parts: Sequence[Places]) -> Places:
    """Join all records, with their strokes and times numbered consecutively."""
    count, late, out = 0, 0.0, list[Places]()
    for p in parts:
        out.append(replace(p, stroke=p.stroke + count, time=p.time + late))
        count += int(p.stroke.max(initial=-1)) + 1
        late = float(out[-1].time.max(initial=late))
    return Places(*(np.concatenate([getattr(p, n) for p in out]) for n in Places.__dataclass_fields__))


def bounds_of(places: Places, records: Sequence[Record]) -> tuple[float, float]:
    """Return the smallest and largest angle of a map, rad; a whole turn apart if its last place adjoins its first.

    Rows left out near a reversal count: the axis was there, and harmonics extend over their width.
    """
    low, high = float(places.angle.min()), float(places.angle.max())
    about = AFTER[0] + 3.0 * places.spacing
    for angle in (r["position"] for r in records):
        low = min(low, max(float(np.nanmin(angle)), low - about))
        high = max(high, min(float(np.nanmax(angle)), high + about))
    turn = 2.0 * math.pi
    if 0.0 < low + turn - high <= CLOSED * places.spacing < 0.5 * turn:
        high = low + turn
    return low, high


# ---- standstill ------------------------------------------------------------------------------------------------------


def _stands(t: Array, q: Array, reference: Array | None) -> Integers | None:
    """Return the number of every row's place, -1 for none; None if the record is not a standstill map."""
    if reference is not None:
        new = np.concatenate([[True], np.abs(np.diff(reference)) > 1e-9])
        if STANDS <= np.count_nonzero(new) <= 0.5 * t.size:
            return np.cumsum(new) - 1
    steps = np.diff(t)
    new = np.concatenate([[True], steps > GAP * float(np.median(steps))])
    if np.count_nonzero(new) >= max(STANDS, t.size // 50) and np.count_nonzero(new) <= 0.5 * t.size:
        return np.cumsum(new) - 1
    still = np.concatenate([np.diff(q) == 0.0, [False]])
    still = still | np.concatenate([[False], still[:-1]])
    starts = np.concatenate([[True], (np.diff(q) != 0.0)]) & still
    group = np.where(still, np.cumsum(starts) - 1, -1)
    lasting = np.bincount(group[group >= 0]) >= SETTLES if np.any(still) else np.zeros(0, dtype=bool)
    kept = (group >= 0) & lasting[np.maximum(group, 0)] if lasting.size else np.zeros(t.size, dtype=bool)
    if np.count_nonzero(lasting) < STANDS or np.count_nonzero(kept) < 0.5 * t.size:
        return None
    return np.where(kept, group, -1)


def _standing(group: Integers, t: Array, q: Array, y: Array, way: Array) -> Places:
    """Return the mean of every place, with the direction of the motion towards it."""
    names, at = np.unique(group[group >= 0], return_inverse=True)
    rows = np.flatnonzero(group >= 0)
    size = np.bincount(at)
    inside = np.arange(rows.size) - np.concatenate([[0], np.cumsum(size)[:-1]])[at]
    used = (size[at] <= SETTLES) | (inside >= size[at] // 2)
    rows, at = rows[used], at[used]
    count = np.bincount(at, minlength=names.size)

    def mean(x: Array) -> Array:
        return np.bincount(at, x[rows], minlength=names.size) / count

    return _settled(mean(q), mean(y), mean(way), mean(t))


def _settled(angle: Array, torque: Array, way: Array, time: Array) -> Places:
    """Return places with directions and strokes, without those shortly after a reversal."""
    step = np.diff(way, prepend=way[0])
    if step.size > 1:
        step[0] = step[1]
    sign = np.sign(step)
    for i in range(1, sign.size):  # without motion, the last direction applies
        if sign[i] == 0.0:
            sign[i] = sign[i - 1]
    stroke = np.concatenate([[0], np.cumsum(np.diff(sign) != 0.0)]).astype(np.intp)
    first = np.asarray(np.searchsorted(stroke, np.arange(int(stroke[-1]) + 1)), dtype=np.intp)
    start = way[np.maximum(first - 1, 0)]
    gone = np.abs(way - start[stroke])
    keep = (sign != 0.0) & (gone >= min(AFTER[0], AFTER[1] * float(np.ptp(way))))
    zeros = np.zeros(np.count_nonzero(keep))
    return Places(
        angle[keep], torque[keep], sign[keep], zeros, zeros, stroke[keep], zeros, time[keep],
        np.zeros((zeros.size, 2)),
    )  # fmt: skip


# ---- rotation --------------------------------------------------------------------------------------------------------


def _rotation(t: Array, q: Array, y: Array, velocity: Array) -> Places:
    """Average slow rows in motion over cells of the angle within a stroke."""
    slope = np.gradient(velocity, t + 1e-12 * np.arange(t.size))
    reach = max(1, round(WINDOW / max(float(np.median(np.diff(t))), 1e-9)))
    reach = min(reach, (t.size - 1) // 2)
    kernel = np.ones(2 * reach + 1) / (2 * reach + 1)
    acceleration = np.convolve(slope, kernel, "same")
    speed = np.abs(velocity)
    usual = float(np.median(speed[speed > 0.0])) if np.any(speed > 0.0) else 0.0
    moving = (speed <= FASTEST) & (speed > 0.1 * min(usual, FASTEST))
    turns = np.flatnonzero(np.diff(np.sign(velocity)) != 0.0)
    for k in range(-reach, reach + 2):  # where slopes span a reversal
        moving[np.clip(turns + k, 0, t.size - 1)] = False
    if not np.any(moving):
        none = np.zeros(0)
        return Places(none, none, none, none, none, np.zeros(0, dtype=np.intp), none, none, np.zeros((0, 2)))
    sign = np.sign(velocity)
    stroke = (
        np.cumsum(np.concatenate([[True], (np.diff(sign) != 0.0) | (np.diff(moving.astype(int)) != 0)])) - 1
    )
    cell = np.floor(q * CELLS / (2.0 * math.pi)).astype(np.int64)
    key = np.concatenate([[True], (np.diff(cell) != 0) | (np.diff(stroke) != 0)])
    at = np.cumsum(key) - 1
    count = np.bincount(at)
    means = [np.bincount(at, x) / count for x in (q, y, velocity, acceleration, t, *_swing(t, q, velocity).T)]
    first = np.flatnonzero(key)
    used, number = moving[first], stroke[first]
    begin = np.array([q[np.searchsorted(stroke, s)] for s in range(int(stroke[-1]) + 1)])
    far = np.abs(means[0] - begin[number]) >= min(AFTER[0], AFTER[1] * float(np.ptp(q)))
    keep = used & far
    angle, torque, v, a, time, rate, slope = (m[keep] for m in means)
    for stretch in np.split(np.arange(v.size), np.flatnonzero(np.diff(number[keep]) != 0) + 1):
        v[stretch] = _smooth(v[stretch], max(1, stretch.size // PART))
    spread = np.bincount(at, (q - means[0][at]) ** 2) / count
    # A uniform spread of this width has this variance.
    width = np.sqrt(12.0 * spread[keep])
    return Places(
        angle, torque, np.sign(v), v, a, number[keep].astype(np.intp), width, time,
        np.column_stack([rate - v, slope]),
    )  # fmt: skip


def _swing(t: Array, q: Array, velocity: Array) -> Array:
    """Return velocity and acceleration by polynomials over `WINDOW` on each side, flat to high orders, shape (n, 2)."""
    step = float(np.median(np.diff(t)))
    reach = max(3, round(WINDOW / max(step, 1e-9)))
    out = np.column_stack([velocity, np.zeros(t.size)])
    if t.size <= 2 * reach:
        return out
    slope, bow = np.linalg.pinv(np.vander(np.arange(-reach, reach + 1), 5, increasing=True))[1:3]
    inner = slice(reach, t.size - reach)
    (rate, curve), (pace, uneven) = (
        (np.convolve(x, slope[::-1], "valid"), 2.0 * np.convolve(x, bow[::-1], "valid"))
        for x in (q - q[0], t - t[0])
    )
    rate = rate / pace
    out[inner] = np.column_stack([rate, (curve - rate * uneven) / pace**2])
    gaps = np.flatnonzero(np.diff(t) > GAP * step)
    for k in range(1 - reach, reach + 1):  # next to a gap a row has no neighbours
        rows = np.clip(gaps + k, 0, t.size - 1)
        out[rows] = np.column_stack([velocity[rows], np.zeros(rows.size)])
    return out


def _smooth(x: Array, reach: int) -> Array:
    """Return the mean over `reach` neighbours on both sides, as far as they exist."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    low = np.maximum(np.arange(x.size) - reach, 0)
    high = np.minimum(np.arange(x.size) + reach + 1, x.size)
    return (total[high] - total[low]) / (high - low)
