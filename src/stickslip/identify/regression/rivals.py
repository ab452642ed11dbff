"""Which order of a torque over the position it is, where several explain what is left about as well.

Windows hide a high order but in the slowest rows, and those of a move that turns round lie so close together that many
orders go through them. The rows as they were logged, which no window has smoothed, show it at several times the speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import memory_of

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.int64]]

RESOLVED = 2.5
"""Phase of a wave (rad) from one logged row to the next, up to which they show it."""
APART = 8.0
"""Twice the logarithm of how much likelier the one is, from which on it is told from the other."""
CLEARLY = 1.5
"""Times the power that the other must leave besides: a wave that fades with velocity fits its neighbours in part."""
NEXT = 1.5
"""Times the windows' spacing up to which one row follows another."""
FEWEST = 100
"""Rows, below which they tell nothing."""


class Slow(NamedTuple):
    """Logged rows of certain sliding that are slow: positions, velocities, torques that are left, and strokes."""

    position: Array
    speed: Array
    torque: Array
    stroke: Places


def told_as_logged(
    records: Sequence[SlidingRows], smooth: Array, orders: Sequence[float]
) -> tuple[float, list[float]]:
    """The likeliest of some orders by the rows as they were logged, and those that it is not told from.

    Parameters
    ----------
    records : sequence of SlidingRows
    smooth : array, shape (n,)
        Torque in their rows that is not over the position, N·m (N).
    orders : sequence of float
        Cycles a radian (m); the likeliest by the windows first, which stays so among those not told apart.
    """
    left = not_out(records, smooth, orders)
    # The lower the highest that is left, the faster rows show them all.
    while 1 < len(left) < len(orders):
        orders, left = left, not_out(records, smooth, left)
    return left[0], left[1:]


def not_out(records: Sequence[SlidingRows], smooth: Array, orders: Sequence[float]) -> list[float]:
    """Those of some orders that no other explains clearly better than, the first first if it is among them."""
    ends = np.cumsum([0, *(r.time.size for r in records)])
    seen = [
        rows_as_logged(r, smooth[a:b], max(orders))
        for r, a, b in zip(records, ends[:-1], ends[1:], strict=True)
    ]
    position, speed, torque = (
        np.concatenate([getattr(s, name) for s in seen]) for name in ("position", "speed", "torque")
    )
    if torque.size < FEWEST:
        return list(orders)
    first = np.cumsum([0, *(int(s.stroke[-1]) + 1 if s.stroke.size else 0 for s in seen[:-1])])
    stroke = np.concatenate([s.stroke + f for s, f in zip(seen, first, strict=True)])
    waves = {order: beside(position, speed, torque, order) for order in orders}
    power = {order: float(left @ left) for order, left in waves.items()}
    best = min(orders, key=lambda order: power[order])
    independent = torque.size / memory_of(waves[best], stroke)
    most = power[best] * max(CLEARLY, math.exp(APART / independent))
    alike = [order for order in orders if power[order] < most or order == best]
    return alike if alike[0] == orders[0] else [best, *(order for order in alike if order != best)]


def rows_as_logged(record: SlidingRows, smooth: Array, order: float) -> Slow:
    """Position, velocity, torque left and stroke of the logged rows of certain sliding that are slow enough."""
    logged = record.signals.logged
    after = np.searchsorted(record.time, logged.time)
    inside = (after > 0) & (after < record.time.size)
    after, before = np.where(inside, after, 1), np.where(inside, after - 1, 0)
    inside &= record.stroke[after] == record.stroke[before]
    inside &= record.time[after] - record.time[before] < NEXT * record.spacing
    speed = np.interp(logged.time, record.time, record.speed)
    row = float(np.median(np.diff(logged.time)))
    kept = inside & (2.0 * math.pi * order * np.abs(speed) * row < RESOLVED)
    known = np.interp(logged.time, record.time, smooth) + record.signals.loss * speed
    stroke = np.unique(record.stroke[before][kept], return_inverse=True)[1].astype(np.int64)
    return Slow(logged.position[kept], speed[kept], (logged.drive - known)[kept], stroke)


def beside(position: Array, speed: Array, torque: Array, order: float) -> Array:
    """What a wave of one order leaves of a torque, N·m (N), shape (n,): one that lags, since the skew may be wrong."""
    angle = 2.0 * math.pi * order * position
    wave = np.column_stack([np.cos(angle), np.sin(angle)])
    columns = np.column_stack([wave, wave * (speed / np.max(np.abs(speed)))[:, None]])
    return torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
