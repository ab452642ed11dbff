"""Whether friction rises with velocity in another form than a level and a slope: ever more slowly, or ever faster.

A lubricant that thins, drag with the square of the speed, a motor whose torque constant saturates: certain sliding then
fits a level and a slope that are those of the recorded speeds alone. It shows where a term that *rises* with velocity
as a fall would fall, exp(-|v/vs|^d) with a negative size, explains what no fall explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.identify.regression.band_system import COULOMB, RISE, VISCOUS, Candidate, System
from stickslip.identify.regression.flexible import Train
from stickslip.identify.regression.sliding_rows import DIRECTION
from stickslip.identify.regression.strokes import stacked

Array = np.ndarray[Any, np.dtype[np.float64]]

CLEAR = 30.0
"""Logarithm of the likelihood by which the rise must explain the record better. Of 640 logs of other programs, 27 with
another form among them, 21 of these are found where two bands show it; of the others three, two of which tell a
wrong level."""
LESS, LEFT = 0.6, 0.05
"""Part of the misfit, and of Fc, that is left at most where friction's form explains the record."""
MOST = 0.95
"""Of the rows: the largest difference of the curves is taken among so many."""


def bent_in(system: System, candidates: Sequence[Candidate], weight: Array) -> tuple[float, Candidate | None]:
    """Part of Fc by which friction's curve bends in another way than any level, slope and fall, and the candidate that
    shows it: above 0 where friction rises ever faster, below 0 where ever more slowly, 0 and none where nothing shows.

    Parameters
    ----------
    system : System
    candidates : sequence of Candidate
        Of all falls of friction, those that rise instead among them.
    weight : array, shape (candidates,)
        Their probability; 0 of those that rise.
    """
    best = candidates[int(np.argmax(weight))]
    rising = [c for c in candidates if c.level >= 0 and fall_in(system, c) < RISE]
    bent = min(rising, key=lambda c: c.cost, default=best)
    if 0.5 * (best.cost - bent.cost) < CLEAR * system.noise * system.memory:
        return 0.0, None
    speed, curve = np.abs(stacked(system.records, "speed")), friction_of(system, bent)
    apart = float(np.quantile(np.abs(curve - friction_of(system, best)), MOST)) / system.fc
    # Between two ends a curve that rises ever faster lies below the straight line.
    quadratic = np.polynomial.Polynomial.fit(speed, curve, 2).convert().coef
    return float(np.copysign(apart, quadratic[-1] if quadratic.size > 2 else 1.0)), bent


def explains(system: System, bent: Candidate, best: Candidate) -> bool:
    """Whether that other form leaves hardly anything: then it is friction's, and what the axis accelerates with is told
    beside it. What a train that rings leaves is another thing."""
    left = bent.cost / system.columns.shape[0]
    return bent.cost < LESS**2 * best.cost and left < (LEFT * system.fc) ** 2


def swing_explains(system: System, bent: Candidate, best: Candidate, flexible: float) -> bool:
    """Whether a load that swings may be what bends the torque: a train that does is taken already, or would leave no
    more than the other form does; unless that form explains most of what is left, as no swing's part of it would.

    After a jog the load swings while the motor slows down, so that what it gives and takes goes with the speed.

    Parameters
    ----------
    system : System
    bent, best : Candidate
        The other form, and the likeliest level, slope and fall.
    flexible : float
        Part of the misfit of `best` that a train which swings would leave at least.
    """
    swings = system.train is not Train.RIGID or flexible**2 * best.cost <= bent.cost
    return swings and bent.cost >= LESS**2 * best.cost


def fall_in(system: System, c: Candidate) -> float:
    """The fall of friction of a candidate, in parts of its level."""
    level = c.values[COULOMB] / system.scale[COULOMB]
    return float(c.values[-1] / system.scale[c.columns[-1]] / max(abs(level), 1e-300))


def friction_of(system: System, c: Candidate) -> Array:
    """Level, slope and fall of friction in every row, in the direction of motion, N·m (N), shape (n,)."""
    own = np.flatnonzero(np.isin(c.columns, (VISCOUS, COULOMB)) | (c.columns >= system.core))
    torque = system.columns[:, c.columns[own]] @ c.values[own]
    return np.asarray(torque * stacked(system.records, "fixed")[:, DIRECTION], dtype=np.float64)
