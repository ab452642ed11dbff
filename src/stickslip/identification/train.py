"""Motor and load behind a spring, if sliding shows that the axis is not rigid.

With the motor held, the load oscillates at omega; the motor's acceleration a then obeys (1 + D²/omega²) (T - F) = J a +
Jm/omega² D² a, D = d/dt. The second derivatives of the torque and of the acceleration therefore determine omega and the
motor's inertia Jm. They are taken from the two widest windows, in which noise of the torque biases them least; the
difference between both is the uncertainty.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.identification.sliding import SlidingPosterior
from stickslip.machines.two_inertias import TwoInertias

Array = np.ndarray[Any, np.dtype[np.float64]]

DAMPED = 0.05
"""Least relative half-width of the frequency: the spring's damping shifts it by as much."""
SURE_SHARE = 0.03
"""Least half-width of the motor's share of the inertia."""
MOST_FREQUENCY, MOST_SHARE = 0.25, 0.15
"""Greatest half-widths, of the frequency relative, at which motor and load count as determined."""


def two_inertias(found: SlidingPosterior) -> TwoInertias | None:
    """Return motor and load determined by the two widest windows; None if these do not determine them."""
    if not found.compliance:
        return None
    widths = sorted({b.width for b in found.rows.blocks})[-2:]
    seen = [_seen_in(found, w) for w in widths]
    if len(seen) < 2 or any(s is None for s in seen):
        return None
    (f0, s0), (f1, s1) = ((s[0], s[1]) for s in seen if s is not None)
    frequency, share = 0.5 * (f0 + f1), 0.5 * (s0 + s1)
    half, most = max(abs(f0 - f1), DAMPED * frequency), max(abs(s0 - s1), SURE_SHARE)
    if not (half <= MOST_FREQUENCY * frequency and most <= MOST_SHARE and most < share < 1.0 - most):
        return None
    return TwoInertias(frequency, (frequency - half, frequency + half), share, (share - most, share + most))


def _seen_in(found: SlidingPosterior, width: int) -> tuple[float, float] | None:
    """Return the load's frequency, Hz, and the motor's inertia share in one window width; None without a load."""
    rows, fit = found.rows, found.fits[0]
    mine = np.isin(rows.block, [i for i, b in enumerate(rows.blocks) if b.width == width])
    bent = np.concatenate([b.torque(fit.skew, 2) for b in rows.blocks if b.width == width])
    columns = np.column_stack([
        rows.acceleration[mine], rows.sign[mine], rows.velocity[mine], np.ones(int(mine.sum())), rows.jerk[mine],
        rows.snap[mine], bent,
    ])  # fmt: skip
    root = np.sqrt(fit.noise.weight[mine])
    size = np.linalg.norm(columns, axis=0)
    if columns.shape[0] < 3 * columns.shape[1] or not np.all(size > 0.0):
        return None
    solver: Any = np.linalg.lstsq
    values: Array = solver(columns / size * root[:, None], fit.torque[mine] * root, rcond=None)[0] / size
    inertia, snap, torque = float(values[0]), float(values[5]), float(values[6])
    if torque >= 0.0 or inertia <= 0.0:
        return None
    return 1.0 / (2.0 * math.pi * math.sqrt(-torque)), snap / (-torque * inertia)
