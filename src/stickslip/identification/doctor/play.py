"""Backlash: after each reversal the motor travels without the load until the teeth meet and stop it abruptly.

The position must be the motor's. Play is distinguished from stick-slip and from an elastic drivetrain: the torque stays
below that of sliding until the teeth meet; the motor then loses a good part of its speed within two rows, while a
wound-up drivetrain brakes it over its whole oscillation; and this happens after the same travel at every reversal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.record import Record
from stickslip.identification.doctor.physics import line_of, usable
from stickslip.identification.doctor.view import Array, Smooth, View

ROW = 1e-3
"""Row period, s, to which a faster log is thinned out, since the limits below are in rows."""
REVERSALS = 3
ROWS = 15
"""Fewest rows of the travel."""
CREEPS = 0.01
"""Part of the usual speed below which the axis may stick and its velocity is the filter's."""
SHARE = 0.1
"""Part of the usual distance between two reversals within which play is searched."""
TURNS = 30
"""Rows before the axis creeps from which on the encoder's extreme is searched."""
COARSE = 0.17
"""Greatest travel of a row when the teeth meet, part of the free travel: an elastic drivetrain's swing is similar in
few rows."""
LONGER = 90.0
"""Percentile of the distances between reversals, of which `SHARE` is the least that counts: shorter ones are
overshoots."""
STEPS = 10.0
"""Least play, steps of the encoder."""
SEEN = 4.0
"""Least travel of the motor per row when the teeth meet, steps of the encoder."""
HARDLY = 0.9
"""Part of the greatest speed above which a row is still before the teeth meet."""
LOST = 0.35
"""Part of its speed that the motor loses, at three of four reversals."""
LEVEL = 0.0, 0.85
"""Torque of the motor alone, part of sliding friction: a jump out of stiction has more, a rebound less."""
ALIKE = 0.25
"""Greatest interquartile range of the travel over the reversals, part of its median."""
SLOWS, SUDDEN = 10, 0.5
"""Rows within which the whole speed is lost; least part of that loss in two rows: an elastic drivetrain brakes more
gradually."""
FREE = 0.1
"""Part of the speed at which the teeth meet, above which the motor has left presliding."""
QUANTILE = 1.96


@dataclass(frozen=True)
class DeadTravel:
    """Free travel of the motor after a reversal, from sliding until it takes the load along, in the position's unit.

    Attributes
    ----------
    value, std : float
    lower, upper : float
        95 % interval; includes the drivetrain's unwinding after the reversal, as much winding up when the teeth meet,
        and one row on both sides.
    reversals : int
        Number of reversals at which it was seen.
    """

    value: float
    std: float
    lower: float
    upper: float
    reversals: int


class Meeting(NamedTuple):
    """One reversal at which the teeth meet.

    Travel since the reversal and since sliding; travel of a row when the teeth meet; share of speed lost in two rows;
    torque of the free travel over sliding friction; share of the whole loss in these two rows.
    """

    gone: float
    free: float
    row: float
    lost: float
    level: float
    sudden: float


def backlash(view: View) -> Iterator[Finding]:
    """Yield a warning if the motor has dead travel after reversals."""
    found = dead_travel(view)
    if found is None:
        return
    unit = view.record.units["position"]
    message = (
        f"after reversals the motor travels about {found.value:.2g} {unit} ({found.lower:.2g} to {found.upper:.2g}) "
        f"before it takes the load along, seen at {found.reversals} reversals: backlash between motor and load"
    )
    remedy = (
        "remove the play or preload it; the friction at reversals is not the contact's: identify from sliding"
    )
    yield Finding("warning", "backlash", message, remedy=remedy)


def dead_travel(view: View) -> DeadTravel | None:
    """Return the dead travel of the motor at its reversals; None if the record shows none.

    Parameters
    ----------
    view : View
        View of a record with the motor's position and ``motor_torque``.
    """
    if view.torque_channel != "motor_torque" or not view.has("position"):
        return None
    # Teeth meet within milliseconds, not rows: a faster log is thinned out to that clock.
    step, view = view.step, _at_rate(view)
    smooth = usable(view)
    if smooth is None:
        return None
    inertia, friction, viscous, offset = line_of(smooth).values[:4].tolist()
    if not friction > 0.0:
        return None
    rest: Array = smooth.torque - inertia * smooth.acceleration - viscous * smooth.velocity - offset
    seen = list(_meetings(view, smooth, rest / friction, step))
    return _alike(seen, step) if len(seen) >= REVERSALS else None


def _at_rate(view: View) -> View:
    """Return the record thinned out to rows of at least `ROW`."""
    every = round(min(ROW / view.period, view.time.size)) if view.period > 0.0 else 1
    if every < 2:
        return view
    channels = {name: view.values(name)[::every] for name in ("position", "motor_torque")}
    units = {name: view.record.units[name] for name in channels}
    return View(Record(view.time[::every], channels, units))


def _meetings(view: View, smooth: Smooth, level: Array, step: float) -> Iterator[Meeting]:
    """Yield the greatest loss of speed after each reversal.

    `level`: torque over sliding friction; `step`: of the encoder.
    """
    v = smooth.velocity
    moving = np.flatnonzero(np.abs(v) > CREEPS * smooth.fast)
    turned = np.flatnonzero(np.diff(np.sign(v[moving])) != 0.0)
    # Last row of the old direction and first of the new one: the axis may stick between them.
    turns = list(zip(moving[turned].tolist(), moving[turned + 1].tolist(), strict=True))
    if len(turns) <= REVERSALS:
        return
    grid = view.time[0] + smooth.period * np.arange(v.size)
    position = np.asarray(np.interp(grid, view.time, view.values("position")), dtype=np.float64)
    ways = [float(abs(position[b] - position[a])) for (a, _), (b, _) in pairwise(turns)]
    far = SHARE * float(np.median(ways))
    long = SHARE * float(np.percentile(ways, LONGER))
    for before, way, ((a, start), (b, _)) in zip(ways, ways[1:], list(pairwise(turns))[1:], strict=False):
        # Only a stroke that started on the other flank crosses the whole play; an overshoot does not.
        if min(before, way) < long:
            continue
        side = 1.0 if v[start] > 0.0 else -1.0
        first = max(0, a - TURNS)
        begin = first + int(np.argmin(side * position[first : start + 1]))
        gone: Array = side * (position[begin:b] - position[begin])
        end = int(np.searchsorted(np.maximum.accumulate(gone), far)) + 4
        if ROWS <= end <= gone.size:
            yield from _meeting(gone[: end + SLOWS], side * level[begin:b], SEEN * step)


def _meeting(gone: Array, level: Array, seen: float) -> Iterator[Meeting]:
    """Yield the two rows with the greatest loss of speed; below `seen` per row it is the encoder's steps."""
    rows = np.diff(gone)
    drop = (np.minimum(rows[:-3], rows[1:-2]) - rows[3:])[: 1 - SLOWS]
    k = int(np.argmax(drop))
    near = rows[k : k + 3]
    speed = float(np.max(near))
    if not speed > seen:
        return
    # The last row that the teeth have hardly slowed.
    last = k + int(np.flatnonzero(near >= HARDLY * speed)[-1])
    if not gone[last + 1] > 0.0:
        return
    slow = np.flatnonzero(rows[:last] < FREE * speed)
    slid = int(slow[-1]) + 1 if slow.size else 0
    met, inside = float(gone[last + 1]), float(np.mean(level[slid : last + 1]))
    whole = max(float(np.max(rows[: last + 1]) - np.min(rows[last : last + SLOWS])), 1e-300)
    yield Meeting(met, met - float(gone[slid]), speed, float(drop[k]) / speed, inside, float(drop[k]) / whole)


def _alike(seen: list[Meeting], step: float) -> DeadTravel | None:
    """Combine all reversals if they agree; else None."""
    gone, free, row, lost, level, sudden = np.array(seen).T
    low, width, high = np.percentile(gone, [25, 50, 75]).tolist()
    certain = np.percentile(lost, 25) >= LOST and np.median(sudden) >= SUDDEN
    alone = LEVEL[0] <= np.median(level) <= LEVEL[1]
    if not (certain and alone) or width < STEPS * step or high - low > ALIKE * width:
        return None
    chance = QUANTILE * (high - low) / 1.35 / math.sqrt(len(seen))
    further = math.hypot(chance, float(np.median(row)))
    value = float(np.median(free))
    if float(np.median(row)) > COARSE * value:
        return None
    half = max(width - value, 0.0) + further
    return DeadTravel(value, half / QUANTILE, max(value - half, 0.0), value + half, len(seen))
