"""Cogging and ripple: a torque that repeats over the position. Its orders are searched in the residual torque."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

HIGHEST = 50
"""Highest order searched: cycles per turn, or waves within the range of a shorter motion."""
PERIOD = 1.5
"""Length of the longest wave of a short motion, in ranges of motion."""
MOST = 4
"""Orders added at a time, the strongest first."""


PREFIX = "cogging "
"""Start of the name of an order; its wave number follows."""


def order_of(cycles: float) -> Alternative:
    """Return the alternative of a torque that repeats `cycles` times per 2π rad of position (m of a linear axis)."""

    def both(rows: SlidingRows) -> Array:
        def of_record(r: SlidingRecord) -> Array:
            angle = cycles * (r.position + r.origin)
            return np.column_stack([np.sin(angle), np.cos(angle)])

        # Every round of a search evaluates the same waves.
        key = f"wave {cycles!r}"
        if key not in rows.kept:
            rows.kept[key] = rows.see(of_record)
        return rows.kept[key]

    return Alternative(
        f"{PREFIX}{cycles:.4g}", both, absent=0.0005, present=(0.1,), odds=0.02, lags=True, removable=True,
        wave_number=cycles, cause=f"cogging of order {cycles:.3g}", remedy="record a whole turn, slowly",
    )  # fmt: skip


def named_orders(names: Iterable[str]) -> list[Alternative]:
    """Return the orders among the names of alternatives ("cogging 4"); others are ignored."""
    return [order_of(float(n.removeprefix(PREFIX))) for n in names if n.startswith(PREFIX)]


def candidates(rows: SlidingRows, period: float | None) -> Array:
    """Return the wave numbers to search, rad⁻¹ (m⁻¹): harmonics of `period`, or of the range if that is shorter."""
    whole = 2.0 * np.pi if period is None else period
    numbers = np.arange(1.0, HIGHEST + 1.0)
    if 2.0 * rows.range > whole:
        return numbers * 2.0 * np.pi / whole
    return numbers[:-11] * 2.0 * np.pi / max(PERIOD * rows.range, 1e-300)


def find_orders(
    rows: SlidingRows, root: Array, torque: Array, beside: Array, level: float, numbers: Sequence[float]
) -> list[float]:
    """Return the wave numbers that the torque shows besides some columns, the strongest first (matching pursuit).

    Parameters
    ----------
    rows : SlidingRows
    root : array, shape (n,)
        Square roots of the rows' weights.
    torque : array, shape (n,)
    beside : array, shape (n, k)
        Columns that also explain the torque.
    level : float
        Fc, N·m (N).
    numbers : sequence of float
        Wave numbers to search.
    """
    q = np.linalg.qr(beside * root[:, None])[0]
    left = root * torque
    left = left - q @ (q.T @ left)
    waves = [order_of(x).columns(rows) * level * root[:, None] for x in numbers]
    waves = [w - q @ (q.T @ w) for w in waves]
    found: list[float] = []
    for _ in range(MOST):
        gains = [_gain(w, left) for w in waves]
        k = int(np.argmax(gains))
        # Every candidate has the same prior probability.
        if gains[k] < 2.0 * np.log(len(numbers)) or numbers[k] in found:
            break
        found.append(float(numbers[k]))
        own = np.linalg.qr(waves[k])[0]
        left = left - own @ (own.T @ left)
        waves = [w - own @ (own.T @ w) for w in waves]
    return found


def _gain(wave: Array, left: Array) -> float:
    """Return twice the logarithm of the evidence for a wave."""
    a = wave.T @ wave + np.eye(2) / 0.1**2
    b = wave.T @ left
    return float(b @ np.linalg.solve(a, b)) - float(np.log(np.linalg.det(a) * 0.1**4))
