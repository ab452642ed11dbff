"""A friction curve of another form: viscous friction that levels off, drag, a fall that is not exponential."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative

Array = np.ndarray[Any, np.dtype[np.float64]]

BUMPS, WIDTH = 6, 1.5
"""Number of bumps over the logarithm of speed; their spacing, octaves. They reach 7.5 octaves below the highest
speed."""
REMEDY = "record constant speeds, at least three a decade"


def octaves(velocity: Array, fastest: float) -> Array:
    """Return bumps (hat functions) over the logarithm of speed, the last one extended to rest, shape (n, 6)."""
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
