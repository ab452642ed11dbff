"""No rigid axis: the inertia differs between narrow windows (high frequencies) and wide ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative, legendre
from stickslip.identification.rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]

REMEDY = "record longer moves with gentler accelerations, in which motor and load move as one"


def coupled(rows: SlidingRows) -> Array:
    """Return smooth joint functions of velocity, acceleration and jerk, shape (n, 12)."""
    scaled = zip((rows.velocity, rows.acceleration, rows.jerk), rows.largest, strict=True)
    v, a, j = (np.clip(x / size, -1.0, 1.0) for x, size in scaled)
    p, r = legendre(v, range(4)), legendre(a, range(4))
    mixed = [p[:, k] * r[:, m] for k in range(4) for m in range(1, 4) if k + m < 5]
    return np.column_stack([*mixed, *(p[:, k] * r[:, m] * j for k in range(2) for m in range(2))])


def usual(rows: SlidingRows) -> Array:
    """Return the plain model's own columns at their usual sizes: misfit that does not average out, shape (n, 5)."""
    top_v, top_a, top_j = rows.largest
    return np.column_stack([
        rows.acceleration / top_a, rows.jerk / top_j, rows.velocity / top_v, rows.sign, np.ones(rows.sign.size),
    ])  # fmt: skip


ALTERNATIVES = (
    Alternative(
        "inertia by frequency", lambda rows: (rows.acceleration * rows.band)[:, None], "inertia",
        absent=0.001, present=(0.02, 0.2), odds=0.2, splits="inertia", compliant=True,
        cause="an inertia that differs with frequency", remedy=REMEDY,
    ),
    Alternative(
        "in step with the acceleration", lambda rows: rows.acceleration[:, None], "inertia",
        absent=0.002, present=(0.01,), cause="a torque in step with the acceleration", remedy=REMEDY,
    ),
    Alternative(
        "no single inertia", coupled, present=(0.01, 0.1), compliant=True,
        cause="motor and load that do not move as one", remedy=REMEDY,
    ),
    Alternative(
        "lasting misfit", usual, "noise", absent=0.1, present=(0.5,), odds=0.02,
        cause="misfit that repeats from move to move", remedy="record more moves, unlike each other",
    ),
)  # fmt: skip
