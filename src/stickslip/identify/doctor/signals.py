"""Each signal by itself: missing values, flat tops, steps of the encoder, wrapped angles."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.finding import Finding
from stickslip.identify.doctor.spikes import sticking_out
from stickslip.identify.doctor.view import Array, View, is_number, row
from stickslip.readers.cut import RANGE, jumps

WINDOW = 0.1
"""s: the window over which a slow speed is told from the counts it gives."""
SLOW_ERROR = 0.05
PILED = 5
"""Times as often as values beside it that an extreme occurs where peaks are cut off; a rounded sine's: 2.4 times."""
WORTH_A_WORD = 1e-4
"""Part of the fast speed below which that speed is of no interest: the step is the file's rounding, no encoder's."""


def missing(view: View) -> Iterator[Finding]:
    """Values that are no numbers."""
    for channel in ("time", *view.record.channels):
        values = view.record[channel]
        bad = np.flatnonzero(~is_number(values))
        if not bad.size:
            continue
        share = bad.size / values.size
        where = row(int(bad[0]), view)
        message = f"{channel} has {bad.size} missing or infinite values ({100 * share:.3g} %)"
        if share > 0.2:
            yield Finding(
                "error", "nan", message, where, f"log it again, or leave it out with --map {channel}=none"
            )
        else:
            yield Finding("warning", "nan", message, where, "these rows are left out")


def saturated(view: View) -> Iterator[Finding]:
    """Flat tops: a limit of the drive or of the converter is reached."""
    for channel in ("motor_torque", "friction_torque", "sensor_torque", "current", "voltage", "velocity"):
        if not view.has(channel):
            continue
        values = view.values(channel)
        tops = _flat_tops(values)
        if tops is None:
            continue
        share, first, limits = tops
        index = int(np.flatnonzero(view.usable)[first])
        unit = view.record.units[channel]
        yield Finding(
            "warning",
            "saturation",
            f"{channel} sits at its limit of {limits} {unit} in {100 * share:.3g} % of the rows",
            row(index, view),
            "reduce the demand, or leave these rows out with --leave-out A:B: what was cut off is lost",
        )


def _flat_tops(values: Array) -> tuple[float, int, str] | None:
    """Share of rows at an extreme, the first, and the extremes; None where they are no flat tops."""
    size = float(np.max(np.abs(values), initial=0.0))
    if values.size < 50 or size <= 0.0:
        return None
    still = np.abs(np.diff(values)) <= 1e-9 * size
    held = _held(values, still)
    at_any = np.zeros(values.size, dtype=bool)
    limits: list[float] = []
    for extreme in (float(np.max(values)), float(np.min(values))):
        at = np.abs(values - extreme) <= 1e-9 * size
        often = np.count_nonzero(at) >= 8 * held
        flat = _longest(at[1:] & still) >= 5 * held - 1
        if often and abs(extreme) > 0.2 * size and (flat or _piled_up(values, at, extreme)):
            at_any |= at
            limits.append(extreme)
    if not limits:
        return None
    # A commanded staircase or a coarse encoder stands still elsewhere, too.
    elsewhere = still & ~at_any[1:]
    if held == 1 and np.count_nonzero(elsewhere) > 0.2 * max(1, np.count_nonzero(~at_any)):
        return None
    said = " and ".join(f"{limit:.4g}" for limit in sorted(limits))
    return float(np.mean(at_any)), int(np.flatnonzero(at_any)[0]), said


def _held(values: Array, still: Any) -> int:
    """Rows for which every value stands, where a slower clock wrote the column; 1 where there is no such clock."""
    starts = np.concatenate(([0], np.flatnonzero(~still) + 1))
    lengths = np.diff(starts)
    usual = int(np.median(lengths)) if lengths.size > 20 else 1
    return usual if usual > 1 and float(np.mean(np.abs(lengths - usual) <= 1)) > 0.8 else 1


def _piled_up(values: Array, at: Any, extreme: float) -> bool:
    """Whether the extreme occurs far more often than any value near it: short peaks that were cut off."""
    near = values[(np.abs(values - extreme) < 0.05 * float(np.ptp(values))) & ~at]
    _, counts = np.unique(near, return_counts=True)
    return bool(near.size >= PILED and np.count_nonzero(at) >= PILED * int(np.max(counts, initial=1)))


def supply(view: View) -> Iterator[Finding]:
    """A voltage that stays as it is while the axis turns to and fro: the supply's, not the drive's."""
    smooth = view.smooth
    if smooth is None or not view.has("voltage"):
        return
    values, moving = view.values("voltage"), smooth.velocity[smooth.moving]
    low, high = np.percentile(values, [1.0, 99.0])
    forth = float(np.mean(moving > 0.0)) if moving.size else 0.0
    if 0.1 < forth < 0.9 and low > 0.0 and high - low < 0.2 * high:
        message = (
            f"voltage stays between {low:.3g} and {high:.3g} V while the axis turns to and fro: the supply's"
        )
        name = shlex.quote(f"supply={view.name('voltage')}")
        yield Finding("warning", "supply-voltage", message, remedy=f"say --map {name} --map voltage=none")


def _longest(mask: Any) -> int:
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def quantised(view: View) -> Iterator[Finding]:
    """The step of the position and the lowest speed it supports."""
    if not view.has("position") or view.smooth is None:
        return
    step = view.step
    if step <= 0.0:
        return
    lowest = step / (WINDOW * SLOW_ERROR)
    fast = view.smooth.fast
    unit = view.record.units["position"]
    message = (
        f"position moves in steps of {step:.4g} {unit}; below {lowest:.3g} {unit}/s a speed computed from"
        f" {WINDOW:g} s of it is more than {100 * SLOW_ERROR:g} % uncertain"
    )
    if lowest > 0.3 * fast and fast > 0.0:
        yield Finding(
            "warning",
            "quantisation",
            f"{message}; most of the record is slower than {max(fast, lowest):.3g} {unit}/s",
            remedy="use a finer encoder, or leave the slow part of the curve to faster motion",
        )
    elif lowest > WORTH_A_WORD * fast:
        yield Finding("note", "quantisation", message)


def wrapped(view: View) -> Iterator[Finding]:
    """Jumps by a whole turn."""
    if not view.has("position") or view.time.size < 30:
        return
    values = view.values("position")
    spiky = sticking_out(values, position=True)
    if spiky.size:  # a jump that comes back at once is a spike
        values = np.delete(values, spiky)
    rows = np.delete(np.flatnonzero(view.usable), spiky)
    at, sizes = jumps(values)
    if not at.size:
        return
    index = int(rows[at[0] + 1])
    size = float(np.median(sizes))
    unit = view.record.units["position"]
    turn = next((t for t in (2.0 * math.pi, 360.0, 1.0, math.pi) if abs(size / t - 1.0) < 0.05), None)
    if turn is not None or size > RANGE * float(np.ptp(values)):
        yield Finding(
            "error",
            "position-wrap",
            f"position jumps {at.size} times by {size:.4g} {unit}: it is counted within one turn",
            row(index, view),
            "say --unwrap to count it on, or log the position without overflow",
        )
    else:
        yield Finding(
            "warning",
            "position-jump",
            f"position jumps {at.size} times by about {size:.4g} {unit}",
            row(index, view),
            f"leave these rows out, such as --leave-out {view.file_rows[index]}, or check the encoder",
        )
