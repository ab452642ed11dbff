"""The friction curve has another form: viscous friction that levels off, drag, a fall of no exponential form."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative

Array = np.ndarray[Any, np.dtype[np.float64]]

BUMPS, WIDTH = 6, 1.5
"""Bumps over the logarithm of speed, and octaves from one to the next: a decade and a half below the highest speed."""
REMEDY = "record constant speeds, at least three a decade"


def octaves(velocity: Array, fastest: float) -> Array:
    """Bumps (hat functions) over the logarithm of speed, the last one reaching down to rest, shape (n, 6)."""
    x = np.log2(np.maximum(np.abs(velocity), 1e-9 * fastest) / fastest) / WIDTH
    return np.maximum(0.0, 1.0 - np.abs(np.maximum(x, 1.0 - BUMPS)[:, None] + np.arange(BUMPS)))


ALTERNATIVES = (
    Alternative(
        "drag", lambda rows: rows.see(lambda r: r.velocity * np.abs(r.velocity)) / rows.fastest**2, present=(0.3,),
        curve=lambda v, rows: (v**2 / rows.fastest**2)[:, None],
        cause="drag with the square of speed", remedy=REMEDY,
    ),
    Alternative(
        "another curve", lambda rows: rows.see(lambda r: r.sign[:, None] * octaves(r.velocity, rows.fastest)),
        absent=0.002, present=(0.01, 0.05), odds=0.2, curve=lambda v, rows: octaves(v, rows.fastest),
        cause="a friction curve of another form", remedy=REMEDY,
    ),
)  # fmt: skip
