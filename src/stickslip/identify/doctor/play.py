"""Backlash: after each reversal the motor travels a stretch without the load's friction, which then comes at once.

The position must be the motor's. Friction before sliding rises with the travel from the first; in play the torque is
that of the motor alone, level, until the teeth meet.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from stickslip.finding import Finding
from stickslip.identify.doctor._view import Array, Smooth, View
from stickslip.identify.doctor.physics import line_of, usable

__all__ = ["backlash"]

REVERSALS = 3
POINTS = 60
"""Of the travel after a reversal, evenly in its logarithm."""
SHARE = 0.1
"""Of the usual way between two reversals, within which play is sought."""
FULL, LEVEL, RISE = 0.85, 0.7, 0.12
"""Of sliding friction: what the torque comes to behind the play, most that it may be inside, most by which it may rise
there. An elastic contact rises by 0.8 between a fifth and three fifths of the way to 0.85."""
EARLY, LATE = 0.2, 0.6
ROWS, STEPS = 15.0, 10.0
"""Rows of the even grid, and steps of the encoder, that the play must last: less is the filter's blur."""
ALIKE = 0.5
"""Spread of the play over the reversals, between quartiles, of its median."""
EXPLAINED = 0.8


def backlash(view: View) -> Iterator[Finding]:
    """A dead travel after reversals."""
    smooth = usable(view)
    if smooth is None or view.torque_channel != "motor_torque" or "position" not in view.record.channels:
        return
    found = _dead_travel(smooth, view.step)
    if found is None:
        return
    width, level = found
    unit = view.record.units["position"]
    message = (
        f"after reversals the axis travels about {width:.2g} {unit} with {100.0 * level:.0f} % of the sliding "
        "friction, then all of it comes at once: backlash between motor and load"
    )
    remedy = (
        "remove the play or preload it; the friction at reversals is not the contact's: identify from sliding"
    )
    yield Finding("warning", "backlash", message, remedy=remedy)


def _dead_travel(smooth: Smooth, step: float) -> tuple[float, float] | None:
    """Width of the play, and the torque inside over sliding friction; None where nothing says that there is any."""
    fit = line_of(smooth)
    inertia, friction, viscous, offset = fit.values[:4].tolist()
    if not friction > 0.0 or fit.explained < EXPLAINED:
        return None
    torque = smooth.torque - inertia * smooth.acceleration - viscous * smooth.velocity - offset
    q, v = smooth.position, smooth.velocity
    turns = np.flatnonzero(np.sign(v[1:]) * np.sign(v[:-1]) < 0.0) + 1
    ways = [(a, b) for a, b in pairwise(turns.tolist()) if b - a > ROWS]
    if len(ways) < REVERSALS:
        return None
    usual = float(np.median([abs(q[b] - q[a]) for a, b in ways]))
    travel = np.geomspace(max(step, 1e-4 * SHARE * usual), SHARE * usual, POINTS)
    shapes: list[Array] = []
    rows: list[Array] = []
    for a, b in ways:
        gone: Array = np.maximum.accumulate(np.abs(q[a:b] - q[a]))
        if gone[-1] < travel[-1]:
            continue
        side = 1.0 if q[b] > q[a] else -1.0
        over: Array = side / friction * torque[a:b]
        shapes.append(np.interp(travel, gone, over))
        rows.append(np.interp(travel, gone, np.arange(b - a, dtype=np.float64)))
    if len(shapes) < REVERSALS:
        return None
    return _plateau(travel, np.array(shapes), np.median(np.array(rows), axis=0), step)


def _plateau(travel: Array, shapes: Array, rows: Array, step: float) -> tuple[float, float] | None:
    middle = np.median(shapes, axis=0)
    end = _reached(travel, middle, FULL)
    if end is None or end < STEPS * step or float(np.interp(end, travel, rows)) < ROWS:
        return None
    early, late = (float(np.interp(part * end, travel, middle)) for part in (EARLY, LATE))
    # It may fall: what the motor needs to turn round passes.
    if not (abs(late) <= LEVEL and abs(early) <= FULL and late - early <= RISE):
        return None
    level = late
    widths = np.array([w for s in shapes if (w := _reached(travel, s, 0.5 * (1.0 + level))) is not None])
    if widths.size < REVERSALS:
        return None
    low, width, high = np.percentile(widths, [25, 50, 75]).tolist()
    return (width, max(level, 0.0)) if high - low <= ALIKE * width else None


def _reached(travel: Array, shape: Array, level: float) -> float | None:
    """Travel from which on the shape is at a level for the first time after having been below it."""
    above = np.flatnonzero(shape >= level)
    if not above.size or above[0] == 0:
        return None
    i = int(above[0])
    part = (level - shape[i - 1]) / (shape[i] - shape[i - 1])
    return float(travel[i - 1] + part * (travel[i] - travel[i - 1]))
