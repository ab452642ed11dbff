"""Checks of single signals: missing values, flat tops, steps of the encoder, wrapped angles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from stickslip.core.finding import Finding, times
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import encoder_step
from stickslip.identification.doctor.spikes import LATE, sticking_out
from stickslip.identification.doctor.view import Array, Mask, View, is_number, row
from stickslip.readers.cut import FEWEST as PIECE
from stickslip.readers.cut import RANGE, jumps

WINDOW = 0.1
"""Window over which a slow speed is computed from counts, s."""
SLOW_ERROR = 0.05
PILED = 5
"""Frequency of a cut-off extreme relative to values near it; that of a rounded sine is about half of it."""
OUTRUN = 1.01
"""Ratio of the position's speed to a velocity at its limit; a commanded plateau is not a limit."""
NEAR, AT_ONCE, ELSEWHERE = 0.05, 3.0, 0.2
"""Part of the range that is near an extreme; steps of a rounded column above which a limit is reached at once; share of
rows at rest elsewhere above which an extreme must stand out from all values of its size."""
COUNTED, SOURCE, REPEATED, CATCHES_UP, FEWEST = 3.0, 20, 0.15, 1.15, 50
"""Least movement per row, steps of the encoder, for its position to be new; greatest number of rows that a slow source
repeats, fewer than at a stop; least share of repeated rows; least ratio of a new position's step to the movement per
row; fewest rows."""
FEW_STRETCHES, LONG_PART, GOES = 3, 0.3, 0.1
"""Most segments at a limit that a remedy lists; least share of the rows for a part without a limit to be useful; least
share of its rows that must move."""
LOST = 1.5
"""Ratio of a time step to the period above which a row is missing."""
LEAPS = 99.0
"""Percentile of the torque's changes that a leap exceeds."""
SMALLEST = 1e-12
"""Smallest plausible signal, rad, N·m, A, ...: below the resolution of encoders (nrad) and of torque and current
sensors."""
WORTH_A_WORD = 1e-4
"""Part of the fast speed below which a speed is irrelevant: the step is the file's rounding, not an encoder's."""


def missing(view: View) -> Iterator[Finding]:
    """Yield findings on missing or infinite values."""
    for channel in ("time", *view.record.channels):
        values = view.record[channel]
        bad = np.flatnonzero(~is_number(values))
        if not bad.size:
            continue
        share = bad.size / values.size
        where = row(int(bad[0]), view)
        message = f"{channel} has {bad.size} missing or infinite values ({100 * share:.3g} %)"
        if share > 0.2:
            without = (
                ""
                if channel in ("time", "position")
                else f", or leave it out with {name_columns(**{channel: 'none'})}"
            )
            yield Finding("error", "nan", message, where, f"log it again{without}")
        else:
            yield Finding("warning", "nan", message, where, "these rows are left out")


def too_small(view: View) -> Iterator[Finding]:
    """Yield errors on implausibly small signals, whose squares and quotients underflow or overflow."""
    for channel in ("position", "velocity", "motor_torque", "friction_torque", "current", "voltage"):
        if not view.has(channel):
            continue
        values = np.abs(view.record[channel])
        largest = float(np.max(values, initial=0.0, where=is_number(values)))
        if 0.0 < largest < SMALLEST:
            unit = view.record.units[channel]
            message = f"{channel} never exceeds {largest:.3g} {unit}, which no axis has"
            remedy = f"state its unit, such as {view.mapped(channel, unit)}, or log it again"
            yield Finding("error", "too-small", message, remedy=remedy)


def saturated(view: View) -> Iterator[Finding]:
    """Yield findings on flat tops: a limit of the drive or the converter is reached."""
    for channel in ("motor_torque", "friction_torque", "sensor_torque", "current", "voltage", "velocity"):
        if not view.has(channel) or (channel == "current" and view.from_current):
            continue
        values = view.values(channel)
        if values.size and not np.ptp(values) > 0.0:
            continue  # A constant signal is not cut off: its own check reports it.
        tops = _flat_tops(values)
        if tops is None or (channel == "velocity" and not _outrun(view, values, tops[0])):
            continue
        at, limits = tops
        share, unit = float(np.mean(at)), view.record.units[channel]
        if view.commanded(channel):
            yield _limited_command(channel, limits, unit, share)
            continue
        yield _cut_off(view, channel, at, f"{limits} {unit}")


def _cut_off(view: View, channel: str, at: Mask, limits: str) -> Finding:
    """Return the finding that a signal is at its limit: rows, segments and remedy."""
    indices = np.flatnonzero(at)
    stretches = np.split(indices, np.flatnonzero(np.diff(indices) > PIECE) + 1)
    number = view.file_rows[view.usable]
    ranges = [f"{number[s[0]]}:{number[s[-1]]}" for s in stretches]
    many = len(ranges) > FEW_STRETCHES
    of = f"{len(ranges)} stretches" if len(ranges) > 1 else "one stretch"
    message = (
        f"{channel} sits at its limit of {limits} in {100 * float(np.mean(at)):.3g} % of the rows: {indices.size} rows "
        f"in {of}{', first ' if many else ' of rows '}{ranges[0] if many else ', '.join(ranges)}"
    )
    gentler = "slower moves" if channel == "velocity" else "gentler accelerations"
    remedy = f"what was cut off is lost: record again with {gentler}"
    if bool(np.all(at)):
        return Finding("warning", "saturation", message, remedy=remedy)
    if not many:
        return Finding(
            "warning", "saturation", message,
            remedy=f"{remedy}, or leave these rows out with {name_option('leave_out', *ranges)}",
        )  # fmt: skip
    begin, end = _longest_without(view, stretches, at.size)
    if end > begin:
        part = name_option("rows", f"{number[begin]}:{number[end - 1]}")
        return Finding(
            "warning", "saturation", message, remedy=f"{remedy}, or use the longest part without, {part}"
        )
    remedy += " or a higher limit: too little is left between these stretches to leave them out"
    return Finding("warning", "saturation", message, remedy=remedy)


def _longest_without(view: View, stretches: Sequence[Any], count: int) -> tuple[int, int]:
    """Return the first row of the longest part outside all segments and the row after its last.

    0, 0 if the part is short or the axis hardly moves in it.
    """
    begins = np.array([0, *(s[-1] + 1 for s in stretches)])
    ends = np.array([*(s[0] for s in stretches), count])
    best = int(np.argmax(ends - begins))
    begin, end = int(begins[best]), int(ends[best])
    smooth = view.smooth
    if smooth is None or end - begin < LONG_PART * count:
        return 0, 0
    size = smooth.moving.size
    there = smooth.moving[begin * size // count : end * size // count]
    return (begin, end) if float(np.mean(there)) >= GOES else (0, 0)


def _limited_command(channel: str, limits: str, unit: str, share: float) -> Finding:
    """Return the finding that a command is at its drive's limit: nothing of it was cut off afterwards."""
    message = (
        f"{channel} is commanded and stands at the drive's own limit of {limits} {unit} in {100 * share:.3g} % of the "
        "rows: this is what acts, nothing is lost"
    )
    remedy = f"keep these rows; where {name_option('loop')} gives the controller, give it this limit, too"
    return Finding("note", "saturation", message, remedy=remedy)


def _outrun(view: View, velocity: Array, at: Mask) -> bool:
    """Return whether the position moves faster where the velocity is at its extreme; True without a position."""
    smooth = view.smooth
    if smooth is None or not view.has("position"):
        return True
    grid = view.time[0] + smooth.period * np.arange(smooth.velocity.size)
    faster = np.abs(np.interp(view.time[at], grid, smooth.velocity)) > OUTRUN * np.abs(velocity[at])
    return float(np.mean(faster)) > 0.5


def _flat_tops(values: Array) -> tuple[Mask, str] | None:
    """Return a mask of the rows at an extreme, and the extremes as text; None if there are no flat tops."""
    size = float(np.max(np.abs(values), initial=0.0))
    if values.size < 50 or size <= 0.0:
        return None
    still = np.abs(np.diff(values)) <= 1e-9 * size
    held = _held(values, still)
    at_any = np.zeros(values.size, dtype=bool)
    limits: list[float] = []
    step = encoder_step(values)
    for extreme in (float(np.max(values)), float(np.min(values))):
        at = np.abs(values - extreme) <= 1e-9 * size
        if np.count_nonzero(at) < 8 * held or abs(extreme) <= 0.2 * size:
            continue
        # A rounded peak is reached in single steps; a limit at once.
        into = np.abs(np.diff(values))[at[1:] & ~at[:-1]]
        steps = (
            float(np.median(into)) / step if step > 0.0 and into.size else math.inf if step <= 0.0 else 0.0
        )
        flat = _longest(at[1:] & still) >= 5 * held - 1 and steps > 1.5
        beside = _piled_up(values, at, extreme, NEAR * float(np.ptp(values)))
        # A commanded staircase or a coarse encoder also rests elsewhere, at levels of similar size.
        if held == 1 and np.count_nonzero(still & ~at[1:]) > ELSEWHERE * np.count_nonzero(~at):
            beside = _piled_up(values, at, extreme, 0.5 * abs(extreme))
            flat = (
                flat and AT_ONCE < steps < math.inf and _piled_up(values, at, extreme, (AT_ONCE + 0.5) * step)
            )
        if beside or flat:
            at_any |= at
            limits.append(extreme)
    if not limits:
        return None
    said = " and ".join(f"{limit:.4g}" for limit in sorted(limits))
    return at_any, said


def _held(values: Array, still: Any) -> int:
    """Return the number of rows that every value lasts in a column with a slower clock; 1 without such a clock."""
    starts = np.concatenate(([0], np.flatnonzero(~still) + 1))
    lengths = np.diff(starts)
    usual = int(np.median(lengths)) if lengths.size > 20 else 1
    return usual if usual > 1 and float(np.mean(np.abs(lengths - usual) <= 1)) > 0.8 else 1


def _piled_up(values: Array, at: Any, extreme: float, within: float) -> bool:
    """Return whether the extreme occurs far more often than any value near it: short peaks that were cut off."""
    near = values[(np.abs(values - extreme) < within) & ~at]
    _, counts = np.unique(near, return_counts=True)
    return bool(near.size >= PILED and np.count_nonzero(at) >= PILED * int(np.max(counts, initial=1)))


def supply(view: View) -> Iterator[Finding]:
    """Yield a warning if a voltage is constant while the axis moves back and forth: the supply's, not the drive's."""
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
        remedy = f"say {name_columns(supply=view.name('voltage'), voltage='none')}"
        yield Finding("warning", "supply-voltage", message, remedy=remedy)


def repeated(view: View) -> Iterator[Finding]:
    """Yield a warning if rows repeat earlier measurements: the file is written faster than its source."""
    smooth = view.smooth
    if smooth is None or not view.has("position"):
        return
    time = view.time
    grid: Array = np.linspace(float(time[0]), float(time[-1]), smooth.velocity.size)
    speed = np.abs(np.interp(time[1:], grid, smooth.velocity))
    moves = (speed > 0.05 * smooth.fast) & (speed * np.diff(time) > COUNTED * view.step)
    steps = np.abs(np.diff(view.values("position")))
    stands = _briefly(steps == 0.0, SOURCE)
    if np.count_nonzero(moves) < FEWEST or float(np.mean(stands[moves])) < REPEATED:
        return
    # An axis that stops and goes on does not catch up.
    late = np.flatnonzero((stands & moves)[:-1] & ~stands[1:]) + 1
    if not late.size or float(np.median(steps[late] / (speed * np.diff(time))[late])) < CATCHES_UP:
        return
    share, channel = float(np.mean(stands[moves])), view.torque_channel
    again = np.abs(np.diff(view.values(channel or "position")))[moves & stands]
    both = channel != "" and np.count_nonzero(again == 0.0) > 0.9 * again.size
    rows: list[int] = np.flatnonzero(view.usable).tolist()
    where = row(rows[int(np.argmax(moves & stands)) + 1], view)
    message = (
        f"position stands in {100 * share:.3g} % of the rows in which the axis moves by more than {COUNTED:g} steps:"
        f" it is new once in {1.0 / (1.0 - share):.2g} rows, "
        + ("as is the torque" if both else "the torque is not")
    )
    remedy = "log at the rate of the source, or keep the rows whose position is new"
    yield Finding("warning", "repeated-rows", message, where, remedy)


def _briefly(mask: Any, longest: int) -> Mask:
    """Return where a mask is True for at most `longest` consecutive rows."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    out = np.zeros(mask.size, dtype=np.bool_)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        out[begin:end] = end - begin <= longest
    return out


def _longest(mask: Any) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def quantised(view: View) -> Iterator[Finding]:
    """Yield the position's step and the lowest speed that it supports."""
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
    """Yield a finding on jumps of the position, by whole turns or otherwise."""
    if not view.has("position") or view.time.size < 30:
        return
    values = view.values("position")
    spiky = sticking_out(values, position=True)
    if spiky.size:  # A jump that is undone at once is a spike.
        values = np.delete(values, spiky)
    rows = np.delete(np.flatnonzero(view.usable), spiky)
    at, sizes = jumps(values)
    if not at.size:
        return
    size = float(np.median(sizes))
    unit = view.record.units["position"]
    turn = next((t for t in (2.0 * math.pi, 360.0, 1.0, math.pi) if abs(size / t - 1.0) < 0.05), None)
    wraps = turn is not None or size > RANGE * float(np.ptp(values))
    if not wraps:
        # During a missing row the axis moves on.
        lost = np.diff(view.record.time[rows])[at] > LOST * view.period
        at = at[~(lost | _driven(view, values, at, spiky))]
        if not at.size:
            return
    index = int(rows[at[0] + 1])
    if wraps:
        yield Finding(
            "error",
            "position-wrap",
            f"position jumps {times(at.size)} by {size:.4g} {unit}: {_counted_within(size, unit, turn)}",
            row(index, view),
            f"say {name_option('unwrap', True)} to count it on, or log the position without overflow",
        )
    else:
        yield Finding(
            "warning",
            "position-jump",
            f"position jumps {times(at.size)} by about {size:.4g} {unit}",
            row(index, view),
            f"leave these rows out, such as {name_option('leave_out', f'{view.file_rows[index]}')}, or check "
            "the encoder",
        )


def _counted_within(size: float, unit: str, turn: float | None) -> str:
    """Describe a position that jumps by its whole range: counted within a turn, or by a counter of some turns."""
    if turn is not None:
        return "it is counted within one turn"
    turns = f", after {size / math.tau:.4g} turns" if unit == "rad" else ""
    return f"its counter starts anew{turns}"


def _driven(view: View, position: Array, at: Any, spiky: Any) -> Any:
    """Return for each jump of a position without spikes whether a torque leap to the same side drives it.

    That is a step of the reference; a controller responds to an encoder's jump in the opposite direction.
    """
    if view.torque_channel != "motor_torque":
        return np.zeros(at.size, dtype=bool)
    leaps: Array = np.diff(np.delete(view.values("motor_torque"), spiky))
    leaps[np.abs(leaps) <= np.percentile(np.abs(leaps), LEAPS)] = 0.0
    near = leaps[np.clip(at[:, None] + np.arange(-LATE, LATE + 1), 0, leaps.size - 1)]
    first = near[np.arange(at.size), np.argmax(near != 0.0, axis=1)]
    return first * (position[at + 1] - position[at]) > 0.0
