"""A table over the angle instead of harmonics: means of cells, linear between them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.identification.cogging.orders import Fold
from stickslip.identification.cogging.rows import Places

Array = np.ndarray[Any, np.dtype[np.float64]]

FINEST = 2048
"""Most cells per turn."""


def table_of(places: Places) -> tuple[Array, Array]:
    """Return the even and odd part at ``2 pi i / n``, shape (n,) each; gaps between measured cells are linear."""
    cells = int(min(FINEST, max(8, round(2.0 * math.pi / (2.0 * places.spacing)))))
    sides = [_side(places.at(places.direction == d), cells) for d in (1.0, -1.0)]
    return 0.5 * (sides[0] + sides[1]), 0.5 * (sides[0] - sides[1])


def _side(places: Places, cells: int) -> Array:
    """Return the means of one direction at the cells, shape (cells,)."""
    turn = 2.0 * math.pi
    angle = np.mod(places.angle, turn)
    cell = np.round(angle * cells / turn).astype(np.intp) % cells
    count = np.bincount(cell, minlength=cells)
    have = count > 0
    if not np.any(have):
        return np.zeros(cells)
    mean = np.bincount(cell, places.torque, cells)[have] / count[have]
    at = turn * np.arange(cells) / cells
    return np.interp(at, at[have], mean, period=turn)


def table_left_out(places: Places, fold: Fold) -> float:
    """Return the RMS on places left out."""
    number, total = fold(places), 0.0
    for f in range(int(number.max()) + 1):
        out = places.at(number == f)
        even, odd = table_of(places.at(number != f))
        at = 2.0 * math.pi * np.arange(even.size) / even.size
        for d in (1.0, -1.0):
            own = out.at(out.direction == d)
            said = np.interp(np.mod(own.angle, 2.0 * math.pi), at, even + d * odd, period=2.0 * math.pi)
            total += float(np.sum((own.torque - said) ** 2))
    return math.sqrt(total / len(places))
