"""Spikes: single rows, up to three, that stick out of a signal and are back at once.

A torque that accelerates the axis sticks out, too: where the velocity changes with it, it is no spike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.identification.doctor.view import Array, View, row
from stickslip.readers.cut import range_words

DRIVING = ("motor_torque", "sensor_torque", "current", "voltage")
"""Channels that the axis follows with its acceleration."""
CHANNELS = ("position", "velocity", "motor_torque", "friction_torque", "sensor_torque", "current", "voltage")
WINDOW = 7
"""Rows of the running median: what is wider than three of them is a pulse, no spike."""
OUT_OF_RANGE = 4.0
"""Half ranges of the signal that a spike sticks out, whatever its neighbours do; a wrist that breaks loose: 2.5."""
ALONE, SIZE = 12.0, 0.3
"""Times the usual excess of a row over both its neighbours, and half ranges, from which on a single row is a spike.
Break-away, impacts and ringing of real axes (a robot's wrist: 5, EMPS: 3) take several rows."""
JUMP = 20.0
"""Times the usual step of a position."""
FEW = 0.05
"""Share of the rows up to which they are spikes; more are noise."""
BACK = 0.25
"""Of what a spike sticks out, by which the signal may have changed across it."""
ABRUPT = 0.3
"""Of what a spike sticks out, by which it leaps from row to row at least; over how far its neighbours lie apart."""
ROWS, LATE = 3, 3
"""Over which a velocity is taken, before and after a spike; by which a torque's column may lie off."""
SEEN, SHARE = 90.0, 0.3
"""Percentile of the changes of velocity that one must exceed to be seen, and the share of the torque that it explains,
at least. Of 251 simulated logs of servo axes 50 had false spikes without these and `BACK`, and 2 with them;
of five spikes put into each of them, five times as high as the signal, 99.6 and 99.0 % were found."""
SEVERAL, MOST = 8, 0.67
"""Of that which sticks out, and the part of them that is seen, from which on those drive the axis that move it alike,
to `SHARE`: answers to steps of a reference, where play or a delay hides the inertia. With these and `ABRUPT` 17 of 419
logs have 87 false spikes in the torque (30 had 650), and 98.9 % of 2140 put in are found (99.2)."""
NAMED = 4


def spikes(view: View) -> Iterator[Finding]:
    """Rows that stick out of a signal."""
    for channel in CHANNELS:
        if not view.has(channel) or (channel == "current" and view.from_current):
            continue
        index = np.flatnonzero(view.usable)[_spikes_of(view, channel)]
        if not index.size:
            continue
        values, unit = view.record[channel], view.record.units[channel]
        message = f"{channel} has {_size_of(values, index, unit)}"
        rows = view.file_rows[index]
        remedy = f"leave them out with {name_option('leave_out', 'spikes')}"
        if index.size <= NAMED:
            remedy += f", or by their rows: {range_words(rows)}"
        yield Finding("warning", "spikes", message, row(int(index[0]), view), remedy)


def _size_of(values: Array, index: Any, unit: str) -> str:
    """How many spikes there are, and how large beside what is usual; beside their neighbours where they are less."""
    usual = float(np.percentile(np.abs(np.delete(values, index)), 98))
    largest = float(values[index[np.argmax(np.abs(values[index]))]])
    runs = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1)
    many = "1 spike" if len(runs) == 1 else f"{len(runs)} spikes"
    if abs(largest) > usual:
        return f"{many} of up to {largest:.4g} {unit}, where {usual:.4g} is usual"
    apart = max(_away(values, run) for run in runs)
    return f"{many}, up to {apart:.4g} {unit} away from the rows before and after"


def _away(values: Array, run: Any) -> float:
    """How far a spike sticks out of the nearer one of the usable rows before and after it."""
    before, after = int(run[0]) - 1, int(run[-1]) + 1
    while before >= 0 and not math.isfinite(values[before]):
        before -= 1
    while after < values.size and not math.isfinite(values[after]):
        after += 1
    beside = [values[k] for k in (before, after) if 0 <= k < values.size]
    return float(np.max(np.min(np.abs(values[run][:, None] - np.array(beside)), axis=1)))


def spike_rows(record: Record) -> Any:
    """Numbers in the file of the rows that have a spike in any channel."""
    view = View(record)
    index = np.flatnonzero(view.usable)
    found = [index[_spikes_of(view, channel)] for channel in CHANNELS if view.has(channel)]
    return view.file_rows[np.unique(np.concatenate(found))] if found else np.empty(0, dtype=int)


def _spikes_of(view: View, channel: str) -> Any:
    """Usable rows of a channel's spikes: what sticks out, comes back to where it was and does not move the axis."""
    values = view.values(channel)
    rows = sticking_out(values, position=channel == "position")
    if not rows.size:
        return rows
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    first, last = np.array([r[0] for r in runs]), np.array([r[-1] for r in runs])
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, values.size - 1)
    level = 0.5 * (values[before] + values[after])
    out = np.array([values[r][np.argmax(np.abs(values[r] - at))] for r, at in zip(runs, level, strict=True)])
    size = np.abs(out - level)
    spike = np.abs(values[after] - values[before]) <= BACK * size
    # What has mass comes and goes over several rows, and a peak of what rings is among others.
    leaps = np.abs(np.stack([values[first] - values[before], values[last] - values[after]]))
    spike &= np.min(leaps, axis=0) >= ABRUPT * size
    spike &= _beside(values, first, last) <= size / ABRUPT
    if channel == "velocity" and view.has("position"):
        spike &= ~_travelled(view, first, last, out - level)
    if channel in DRIVING:
        spike &= ~_moving(view, values, first, last, np.sign(out - level))
    kept = [run for run, keep in zip(runs, spike, strict=True) if keep]
    return np.concatenate(kept) if kept else rows[:0]


def _beside(values: Array, first: Any, last: Any) -> Array:
    """How far apart the rows beside each run are, `ROWS` on either side."""
    away = np.arange(1, ROWS + 1)
    rows = np.concatenate((first[:, None] - away, last[:, None] + away), axis=1)
    return np.asarray(np.ptp(values[np.clip(rows, 0, values.size - 1)], axis=1))


def _travelled(view: View, first: Any, last: Any, size: Array) -> Any:
    """Of runs of rows of the velocity, whether the position moves as much faster there; mask."""
    rate = np.diff(view.values("position")) / np.diff(view.time)
    there = np.stack([rate[np.clip(k, 0, rate.size - 1)] for k in (first - 1, first, last - 1, last)])
    ends = np.stack([rate[np.clip(k, 0, rate.size - 1)] for k in (first - 2, last + 1)])
    return np.max((there - np.mean(ends, axis=0)) * np.sign(size), axis=0) >= SHARE * np.abs(size)


def _moving(view: View, torque: Array, first: Any, last: Any, sign: Array) -> Any:
    """Of runs of rows, whether the torque that sticks out there is seen in the motion; mask."""
    every = np.arange(torque.size)
    if view.has("position"):
        position = view.values("position")
        good = np.delete(every, sticking_out(position, position=True))
        position = np.interp(every, good, position[good])
    elif view.has("velocity"):
        position = np.cumsum(view.values("velocity"))
    else:
        return np.zeros(first.size, dtype=bool)
    usual, driven = _kick(position, every, every), np.cumsum(np.cumsum(torque - np.median(torque)))
    strong = np.abs(usual) >= max(float(np.percentile(np.abs(usual), 95)), 1e-300)
    # The inertia in units of rows, from the rows that accelerate most.
    inertia = float(np.median(_kick(driven, every, every)[strong] / usual[strong])) if np.any(strong) else 0.0
    usually = float(np.percentile(np.abs(usual), SEEN))
    given = np.abs(_kick(driven, first, last))
    # A column may lie rows beside the torque that acted.
    shifts = range(-LATE, LATE + 1)
    late: Array = np.stack([_kick(position, first + k, last + k, sign) for k in shifts]).max(axis=0)
    kick, seen = _kick(position, first, last) * sign, late > usually
    if seen.size >= SEVERAL and float(np.mean(seen)) >= MOST:
        # They tell the inertia that they move themselves: by what each adds to the torque beside it, since that may
        # change across it as well, where the axis breaks loose.
        added = _impulse(torque, first, last)
        return seen & (late / added >= SHARE * float(np.median(late[seen] / added[seen])))
    return (kick > usually) & (inertia * kick >= SHARE * given)


def _impulse(torque: Array, first: Any, last: Any) -> Array:
    """What runs of rows add to the mean of the rows beside each, summed up."""
    beside = np.clip(np.stack([first - 1, last + 1]), 0, torque.size - 1)
    total = np.concatenate([[0.0], np.cumsum(torque)])
    added = total[last + 1] - total[first] - (last + 1 - first) * np.mean(torque[beside], axis=0)
    return np.maximum(np.abs(added), 1e-300)


def _kick(position: Array, first: Any, last: Any, sign: Any = 0.0) -> Array:
    """By how much the velocity changes across runs of rows, beyond what it changes beside them, per row; with a sign
    to that side, and no more than it changes at all: beside a kick there is none to the other side."""

    def way(begin: Any) -> Array:
        ends: Array = np.clip(np.stack([begin, begin + ROWS]), 0, position.size - 1)
        return position[ends[1]] - position[ends[0]]

    before, after = way(first - 1 - ROWS), way(last + 1)
    earlier, later = way(first - 1 - 2 * ROWS), way(last + 1 + ROWS)
    kick = after - before - 0.5 * (later - after + before - earlier)
    return kick if np.ndim(sign) == 0 else np.minimum(kick * sign, (after - before) * sign)


def sticking_out(values: Array, *, position: bool) -> Any:
    """Rows of spikes; none where there would be more than `FEW`."""
    if values.size < 50:
        return np.empty(0, dtype=int)
    low, high = np.percentile(values, [2.0, 98.0])
    half = 0.5 * float(high - low)
    half = half if half > 0.0 else 0.5 * float(np.ptp(values))
    half_window = WINDOW // 2
    padded = np.pad(values, half_window, mode="edge")
    away = np.abs(values - np.median(np.lib.stride_tricks.sliding_window_view(padded, WINDOW), axis=1))
    steps = np.diff(values)
    if position:
        out = away > max(JUMP * float(np.percentile(np.abs(steps), 95)), 0.02 * half, 1e-12)
    else:
        # A row beyond both its neighbours, on the same side.
        excess = np.zeros(values.size)
        turning = steps[:-1] * steps[1:] < 0.0
        excess[1:-1] = np.where(turning, np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])), 0.0)
        usual = float(np.percentile(excess, 99))
        alone = (excess > ALONE * usual) & (excess > SIZE * half) & (away > SIZE * half)
        out = (away > OUT_OF_RANGE * half) | alone
    rows = np.flatnonzero(out)
    return rows if half > 0.0 and rows.size <= FEW * values.size else rows[:0]
