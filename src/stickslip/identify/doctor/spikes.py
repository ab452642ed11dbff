"""Spikes: single rows, up to three, that stick out of a signal and are back at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.finding import Finding
from stickslip.identify.doctor.view import Array, View, row
from stickslip.readers.cut import range_words
from stickslip.record import Record

__all__ = ["spike_rows", "spikes", "sticking_out"]

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
NAMED = 4


def spikes(view: View) -> Iterator[Finding]:
    """Rows that stick out of a signal."""
    for channel in CHANNELS:
        if not view.has(channel):
            continue
        index = np.flatnonzero(view.usable)[
            sticking_out(view.values(channel), position=channel == "position")
        ]
        if not index.size:
            continue
        values, unit = view.record[channel], view.record.units[channel]
        usual = float(np.percentile(np.abs(np.delete(values, index)), 98))
        largest = float(values[index[np.argmax(np.abs(values[index]))]])
        message = (
            f"{channel} has {index.size} spikes of up to {largest:.4g} {unit}, where {usual:.4g} is usual"
        )
        rows = view.file_rows[index]
        remedy = "leave them out with --leave-out spikes"
        if index.size <= NAMED:
            remedy += f", or by their rows: {range_words(rows)}"
        yield Finding("warning", "spikes", message, row(int(index[0]), view), remedy)


def spike_rows(record: Record) -> Any:
    """Numbers in the file of the rows that have a spike in any channel."""
    view = View(record)
    index = np.flatnonzero(view.usable)
    found = [
        index[sticking_out(view.values(channel), position=channel == "position")]
        for channel in CHANNELS
        if view.has(channel)
    ]
    return view.file_rows[np.unique(np.concatenate(found))] if found else np.empty(0, dtype=int)


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
