"""Backlash: after each reversal the motor travels without the load, until the teeth meet and stop it at once.

The position must be the motor's. What distinguishes play from stick-slip and from an elastic drivetrain: until then the
torque stays below that of sliding, the motor then loses a good part of its speed within two rows, where a wound-up
drivetrain brakes it over its whole oscillation, and it does so after the same travel at every reversal.
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
"""s of a row, for which what follows is counted in rows. Of 23 machines with play of another simulator, logged at 4
kHz, 10 are found, and none was; every interval holds the gap."""
REVERSALS = 3
ROWS = 15
"""Rows, at least, of the travel that is looked at."""
CREEPS = 0.01
"""Of the usual speed, up to which the axis may stick, and its velocity be the filter's."""
SHARE = 0.1
"""Of the usual way between two reversals, within which play is sought."""
TURNS = 30
"""Rows before the axis creeps, from which on the encoder's extreme is sought."""
COARSE = 0.17
"""Of the free travel, that a row may be when the teeth meet: an elastic drivetrain's swing in few rows looks alike."""
LONGER = 90.0
"""Percentile of the ways, of which `SHARE` is a way that counts: shorter ones are overshoots."""
STEPS = 10.0
"""Steps of the encoder that the play must last."""
SEEN = 4.0
"""Steps of the encoder in a row, at least, at which the motor travels when the teeth meet."""
HARDLY = 0.9
"""Of the greatest speed, above which a row lies before the meeting, most of it."""
LOST = 0.35
"""Part of its speed that the motor loses, at three reversals of four."""
LEVEL = 0.0, 0.85
"""Of sliding friction, that the motor alone has: a jump out of stiction has more, a rebound less."""
ALIKE = 0.25
"""Spread of the travel over the reversals, between quartiles, of its median."""
SLOWS, SUDDEN = 10, 0.5
"""Rows within which it has lost what it loses, and the part of that which two of them take, at least: an elastic
drivetrain took 0.38 at most, play 0.56 at least (seeds 8000 to 8019 of `benchmarks/ordinary_logs.py`)."""
FREE = 0.1
"""Of the speed at which the teeth meet, from which on the motor has left its friction before sliding."""
QUANTILE = 1.96


@dataclass(frozen=True)
class DeadTravel:
    """Free travel of the motor after a reversal, from where it slides until it takes the load along, in the position's
    unit.

    Attributes
    ----------
    value, std : float
    lower, upper : float
        95 % interval: what the drivetrain unwinds after the reversal, as much winding up where the teeth meet, and a
        row on both sides.
    reversals : int
        At which it was seen.
    """

    value: float
    std: float
    lower: float
    upper: float
    reversals: int


class Meeting(NamedTuple):
    """One reversal: travel since it and since sliding, that of a row when the teeth meet; share of speed lost in two
    rows; torque of the free travel over sliding friction; share of the whole loss that the two rows take."""

    gone: float
    free: float
    row: float
    lost: float
    level: float
    sudden: float


def backlash(view: View) -> Iterator[Finding]:
    """A dead travel after reversals."""
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
    """The dead travel of the motor at its reversals; None where the record shows none.

    Parameters
    ----------
    view : View
        Of a record with the motor's position and ``motor_torque``.
    """
    if view.torque_channel != "motor_torque" or not view.has("position"):
        return None
    # Teeth meet in milliseconds, not in rows: a faster log is looked at as one of that clock.
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
    """The record with every so many of its rows that one lasts `ROW` at least."""
    every = round(min(ROW / view.period, view.time.size)) if view.period > 0.0 else 1
    if every < 2:
        return view
    channels = {name: view.values(name)[::every] for name in ("position", "motor_torque")}
    units = {name: view.record.units[name] for name in channels}
    return View(Record(view.time[::every], channels, units))


def _meetings(view: View, smooth: Smooth, level: Array, step: float) -> Iterator[Meeting]:
    """Of each way after a reversal, where the motor loses most speed; `level`: torque over sliding friction; `step`: of
    the encoder."""
    v = smooth.velocity
    moving = np.flatnonzero(np.abs(v) > CREEPS * smooth.fast)
    turned = np.flatnonzero(np.diff(np.sign(v[moving])) != 0.0)
    # The last row of the old way, and the first of the new one: the axis may stick between them.
    turns = list(zip(moving[turned].tolist(), moving[turned + 1].tolist(), strict=True))
    if len(turns) <= REVERSALS:
        return
    grid = view.time[0] + smooth.period * np.arange(v.size)
    position = np.asarray(np.interp(grid, view.time, view.values("position")), dtype=np.float64)
    ways = [float(abs(position[b] - position[a])) for (a, _), (b, _) in pairwise(turns)]
    far = SHARE * float(np.median(ways))
    long = SHARE * float(np.percentile(ways, LONGER))
    for before, way, ((a, start), (b, _)) in zip(ways, ways[1:], list(pairwise(turns))[1:], strict=False):
        # Only a way that began on the other flank has the whole play before it; an overshoot has not.
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
    """Where two rows lose most speed; slower than `seen` a row, none is told from the encoder's steps."""
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
    """What all reversals say, where they say the same."""
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
