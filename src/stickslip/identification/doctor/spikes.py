"""Spikes: one to three rows that stick out of a signal.

A torque that accelerates the axis sticks out, too: if the velocity changes with it, it is not a spike.
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
"""Channels whose signal shows in the axis's acceleration."""
CHANNELS = ("position", "velocity", "motor_torque", "friction_torque", "sensor_torque", "current", "voltage")
WINDOW = 7
"""Rows of the running median: anything wider than three of them is a pulse, not a spike."""
OUT_OF_RANGE = 4.0
"""Size of a spike in half ranges of the signal, whatever its neighbours; break-away of real axes stays below."""
ALONE, SIZE = 12.0, 0.3
"""Excess of a row over both its neighbours, relative to the usual excess, and half ranges, from which on a single row
is a spike. Break-away, impacts and ringing of real axes take several rows."""
JUMP = 20.0
"""Jump of a position relative to its usual step."""
FEW = 0.05
"""Greatest share of rows that are spikes; more are noise."""
BACK = 0.25
"""Greatest change of the signal across a spike, part of the spike's size."""
ABRUPT = 0.3
"""Least leap of a spike from row to row, part of its size; least size of a spike, part of its neighbours' range."""
ROWS, LATE = 3, 3
"""Rows over which a velocity is computed before and after a spike; greatest delay of a torque's column, rows."""
SEEN, SHARE = 90.0, 0.3
"""Percentile of the velocity's changes that a visible one must exceed; least share of the torque that it explains."""
SEVERAL, MOST = 8, 0.67
"""Number of candidates, and visible share of them, from which on those with a similar response, to `SHARE`, drive the
axis: responses to steps of a reference, where play or a delay hides the inertia."""
NAMED = 4


def spikes(view: View) -> Iterator[Finding]:
    """Yield a warning on rows that stick out of a signal."""
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
    """Return the number of spikes as text, and their size relative to usual values, or else to their neighbours."""
    usual = float(np.percentile(np.abs(np.delete(values, index)), 98))
    largest = float(values[index[np.argmax(np.abs(values[index]))]])
    runs = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1)
    many = "1 spike" if len(runs) == 1 else f"{len(runs)} spikes"
    if abs(largest) > usual:
        return f"{many} of up to {largest:.4g} {unit}, where {usual:.4g} is usual"
    apart = max(_away(values, run) for run in runs)
    return f"{many}, up to {apart:.4g} {unit} away from the rows before and after"


def _away(values: Array, run: Any) -> float:
    """Return the distance of a spike from the nearer of the usable rows before and after it."""
    before, after = int(run[0]) - 1, int(run[-1]) + 1
    while before >= 0 and not math.isfinite(values[before]):
        before -= 1
    while after < values.size and not math.isfinite(values[after]):
        after += 1
    beside = [values[k] for k in (before, after) if 0 <= k < values.size]
    return float(np.max(np.min(np.abs(values[run][:, None] - np.array(beside)), axis=1)))


def spike_rows(record: Record) -> Any:
    """Return the file's row numbers with a spike in any channel."""
    view = View(record)
    index = np.flatnonzero(view.usable)
    found = [index[_spikes_of(view, channel)] for channel in CHANNELS if view.has(channel)]
    return view.file_rows[np.unique(np.concatenate(found))] if found else np.empty(0, dtype=int)


def _spikes_of(view: View, channel: str) -> Any:
    """Return usable rows of a channel's spikes: they stick out, return to their level and do not move the axis."""
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
    # Anything with mass rises and falls over several rows, and a peak of ringing is among others.
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
    """Return the range of the rows next to each run, `ROWS` on either side."""
    away = np.arange(1, ROWS + 1)
    rows = np.concatenate((first[:, None] - away, last[:, None] + away), axis=1)
    return np.asarray(np.ptp(values[np.clip(rows, 0, values.size - 1)], axis=1))


def _travelled(view: View, first: Any, last: Any, size: Array) -> Any:
    """Return a mask of runs of the velocity in which the position moves faster by a similar amount."""
    rate = np.diff(view.values("position")) / np.diff(view.time)
    there = np.stack([rate[np.clip(k, 0, rate.size - 1)] for k in (first - 1, first, last - 1, last)])
    ends = np.stack([rate[np.clip(k, 0, rate.size - 1)] for k in (first - 2, last + 1)])
    return np.max((there - np.mean(ends, axis=0)) * np.sign(size), axis=0) >= SHARE * np.abs(size)


def _moving(view: View, torque: Array, first: Any, last: Any, sign: Array) -> Any:
    """Return a mask of runs of rows whose torque shows in the motion."""
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
    # The inertia in units of rows, from the rows with the greatest acceleration.
    inertia = float(np.median(_kick(driven, every, every)[strong] / usual[strong])) if np.any(strong) else 0.0
    usually = float(np.percentile(np.abs(usual), SEEN))
    given = np.abs(_kick(driven, first, last))
    # A column may be rows away from the torque that acted.
    shifts = range(-LATE, LATE + 1)
    late: Array = np.stack([_kick(position, first + k, last + k, sign) for k in shifts]).max(axis=0)
    kick, seen = _kick(position, first, last) * sign, late > usually
    if seen.size >= SEVERAL and float(np.mean(seen)) >= MOST:
        # The moving candidates determine the inertia themselves: each by what it adds to the torque next to it, since
        # that may change across it as well when the axis breaks away.
        added = _impulse(torque, first, last)
        return seen & (late / added >= SHARE * float(np.median(late[seen] / added[seen])))
    return (kick > usually) & (inertia * kick >= SHARE * given)


def _impulse(torque: Array, first: Any, last: Any) -> Array:
    """Return the sum that runs of rows add to the mean of their neighbouring rows."""
    beside = np.clip(np.stack([first - 1, last + 1]), 0, torque.size - 1)
    total = np.concatenate([[0.0], np.cumsum(torque)])
    added = total[last + 1] - total[first] - (last + 1 - first) * np.mean(torque[beside], axis=0)
    return np.maximum(np.abs(added), 1e-300)


def _kick(position: Array, first: Any, last: Any, sign: Any = 0.0) -> Array:
    """Return the velocity's change across runs of rows beyond its change next to them, per row.

    With a sign, it is the change towards that side, and at most the whole change: next to a kick there is none to the
    other side.
    """

    def way(begin: Any) -> Array:
        ends: Array = np.clip(np.stack([begin, begin + ROWS]), 0, position.size - 1)
        return position[ends[1]] - position[ends[0]]

    before, after = way(first - 1 - ROWS), way(last + 1)
    earlier, later = way(first - 1 - 2 * ROWS), way(last + 1 + ROWS)
    kick = after - before - 0.5 * (later - after + before - earlier)
    return kick if np.ndim(sign) == 0 else np.minimum(kick * sign, (after - before) * sign)


def sticking_out(values: Array, *, position: bool) -> Any:
    """Return the rows of spikes; none if there are more than `FEW`."""
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
