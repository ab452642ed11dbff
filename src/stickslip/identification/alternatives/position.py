"""A torque or friction that depends on the position: a spring, an unbalance, a tight spot, unresolved cogging."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from stickslip.core.messages import name_option
from stickslip.identification.alternatives.alternative import Alternative, legendre
from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

WAVES, PERIOD = 24, 1.5
"""Number of waves, and their longest wavelength in ranges: longer than the range, since the function is not
periodic."""
SIZES, SCALES = (0.01, 0.03, 0.1), (1.0, 4.0, 16.0)
"""Size of a random function over the position, part of Fc; number of its waves within the range."""
REMEDY = f"map the torque over the position ({name_option('method', 'cogging')}), or record over a longer way"


def waves(rows: SlidingRows) -> Array:
    """Return sines and cosines over the position, shape (n, 2 WAVES)."""
    base = 2.0 * np.pi / max(PERIOD * rows.range, 1e-300)

    def of_record(record: SlidingRecord) -> Array:
        angle = base * np.arange(1, WAVES + 1) * (0.5 * rows.range * (rows.place(record) + 1.0))[:, None]
        return np.stack([np.sin(angle), np.cos(angle)], axis=2).reshape(angle.shape[0], -1)

    return rows.see(of_record)


def smoothness(level: tuple[float, float], count: int) -> Array:
    """Return the waves' standard deviations for a random function of given size and waves within the range."""
    size, scale = level
    share = 1.0 / (1.0 + (np.repeat(np.arange(1, count // 2 + 1), 2) / scale) ** 2)
    return np.maximum(size * share / np.sqrt(np.sum(share[::2] ** 2)), 1e-5)


ALTERNATIVES = (
    Alternative(
        "torque over position", lambda rows: rows.see(lambda r: legendre(rows.place(r), range(1, 7))),
        absent=0.0005, present=(0.01, 0.1), odds=0.2, lags=True, removable=True,
        cause="a torque that depends on the position", remedy=REMEDY,
    ),
    Alternative(
        "waves over position", waves, absent=(0.0005, 4.0),
        present=tuple(itertools.product(SIZES, SCALES)), odds=0.2, lags=True, removable=True, shape=smoothness,
        cause="a torque that repeats over the position", remedy=REMEDY,
    ),
    Alternative(
        "friction over position",
        lambda rows: rows.see(lambda r: r.sign[:, None] * legendre(rows.place(r), range(1, 5))),
        absent=0.0005, present=(0.01, 0.1), odds=0.2, lags=True, removable=True,
        cause="friction that depends on the position", remedy=REMEDY,
    ),
)  # fmt: skip
