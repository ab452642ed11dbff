"""Constant-velocity segments of records, and the friction torque of each: thesis 4.3.1.1.2.

The first 20 degrees of a segment are dropped, and the torque is averaged over whole revolutions, so that what
depends on the position averages out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.sliding import SlidingPoints
from stickslip.record import Record

__all__ = ["Segment", "constant_velocity_segments", "sliding_points"]

Array = np.ndarray[Any, np.dtype[np.float64]]

REVOLUTION = 2.0 * math.pi
TRANSIENT = math.radians(20.0)
BINS = 120
"""Stretches of a segment that count alike."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of constant velocity.

    Attributes
    ----------
    start, end : float
        Time, s, without the transient.
    velocity, torque : float
        Means over the whole revolutions, rad/s and N·m.
    std : float
        Of the mean torque: from the spread of the revolutions where there are at least 3, else of eight parts of
        the segment.
    revolutions : int
        Whole revolutions averaged; 0 where the travel was shorter than one.
    travel : float
        Displacement averaged over, rad.
    """

    start: float
    end: float
    velocity: float
    torque: float
    std: float
    revolutions: int
    travel: float


def constant_velocity_segments(
    record: Record,
    *,
    torque: str = "motor_torque",
    tolerance: float = 0.05,
    transient: float = TRANSIENT,
    revolution: float = REVOLUTION,
    shortest: float = 0.2,
) -> tuple[Segment, ...]:
    """Find the constant-velocity segments of a record.

    Parameters
    ----------
    record : Record
        Channels ``position`` and the torque's; the velocity is the reference's where the record has
        ``velocity_reference``, else the slope of the position over 1 % of a revolution or 50 ms.
    torque : str
        Channel of the torque: motor side or sensor side, one at a time.
    tolerance : float
        Part by which the velocity may vary within a segment.
    transient : float
        Displacement dropped at the start of each segment, rad.
    revolution : float
        Displacement after which friction repeats, rad (2 pi; a pitch for a linear axis).
    shortest : float
        Least duration after the transient, s.

    Returns
    -------
    tuple of Segment
        In time's order; stretches shorter than the transient and `shortest` are left out.

    Raises
    ------
    InputError
        If a channel is missing or the record is empty.
    """
    if len(record) < 3:
        raise InputError(f"the record has {len(record)} samples; a constant-velocity segment needs many")
    time, position = record.time, record["position"]
    speed = (
        record["velocity_reference"] if "velocity_reference" in record.channels else slope_of(time, position)
    )
    found: list[Segment] = []
    for first, last in level_runs(time, speed, tolerance):
        moved = np.abs(position[first : last + 1] - position[first])
        inside = np.flatnonzero(moved >= transient)
        if inside.size == 0:
            continue
        begin = first + int(inside[0])
        if time[last] - time[begin] < shortest:
            continue
        found.append(_averaged(time, position, record[torque], begin, last, revolution))
    return tuple(found)


def slope_of(time: Array, position: Array, window: float = 0.05) -> Array:
    """Slope of the position over a window (s) around every sample, rad/s."""
    before = np.maximum(np.searchsorted(time, time - 0.5 * window), 0)
    after = np.minimum(np.searchsorted(time, time + 0.5 * window, side="right"), time.size) - 1
    before, after = (
        np.minimum(before, np.maximum(after - 1, 0)),
        np.maximum(after, np.minimum(before + 1, time.size - 1)),
    )
    width = time[after] - time[before]
    return np.where(
        width > 0.0, (position[after] - position[before]) / np.where(width > 0.0, width, 1.0), 0.0
    )


def level_runs(time: Array, speed: Array, tolerance: float) -> list[tuple[int, int]]:
    """Longest runs (first, last) in which the velocity stays within the tolerance of their own middle."""
    runs: list[tuple[int, int]] = []
    first = 0
    while first < speed.size - 1:
        low = high = float(speed[first])
        last = first
        while last + 1 < speed.size:
            value = float(speed[last + 1])
            low, high = min(low, value), max(high, value)
            if high - low > 2.0 * tolerance * abs(0.5 * (low + high)):
                break
            last += 1
        middle = 0.5 * (float(np.min(speed[first : last + 1])) + float(np.max(speed[first : last + 1])))
        if last > first and middle != 0.0:
            runs.append((first, last))
            first = last + 1
        else:
            first += 1
    # A ramp is cut into many short runs; a level one outlasts its neighbours.
    return [(a, b) for a, b in runs if abs(_drift(time[a : b + 1], speed[a : b + 1])) <= tolerance]


def _drift(time: Array, speed: Array) -> float:
    """Change of the velocity from the first to the last third of a run, over its mean."""
    third = max(time.size // 3, 1)
    mean = float(np.mean(speed))
    return float(np.mean(speed[-third:]) - np.mean(speed[:third])) / mean if mean else math.inf


def _averaged(
    time: Array, position: Array, torque: Array, first: int, last: int, revolution: float
) -> Segment:
    travel = abs(float(position[last] - position[first]))
    turns = int(travel / revolution)
    end = last
    if turns > 0:
        moved = np.abs(position[first : last + 1] - position[first])
        end = first + int(np.searchsorted(np.maximum.accumulate(moved), turns * revolution))
        end = min(end, last)
    t, y, x = time[first : end + 1], torque[first : end + 1], position[first : end + 1]
    parts = turns if turns >= 3 else 8
    place = np.minimum(parts * np.abs(x - x[0]) / max(abs(float(x[-1] - x[0])), 1e-300), parts - 0.5).astype(
        np.int64
    )
    means = np.array([float(np.mean(y[place == k])) for k in range(parts) if np.any(place == k)])
    std = float(np.std(means, ddof=1)) / math.sqrt(means.size) if means.size > 1 else math.nan
    mean = even_mean(x, y)
    velocity = float((x[-1] - x[0]) / (t[-1] - t[0]))
    return Segment(float(t[0]), float(t[-1]), velocity, mean, std, turns, abs(float(x[-1] - x[0])))


def even_mean(x: Array, y: Array) -> float:
    """Mean of y over time, every stretch of x counting alike: the speed may ripple, and the axis stick and slip.

    A mean over x itself would count the slips only, and their torque is that of the speed which they reach.
    """
    stretches = min(BINS, x.size // 4)
    travel = float(x[-1] - x[0])
    if stretches < 2 or travel == 0.0:
        return float(np.mean(y))
    place = np.clip(stretches * (x - x[0]) / travel, 0.0, stretches - 1.0).astype(np.int64)
    count = np.bincount(place, minlength=stretches)
    sums = np.bincount(place, weights=y, minlength=stretches)
    return float(np.mean(sums[count > 0] / count[count > 0]))


def sliding_points(
    records: Record | Sequence[Record], *, torque: str = "motor_torque", **options: Any
) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Points of the sliding curve from records of constant velocities, one side (motor or sensor) at a time.

    Parameters
    ----------
    records : Record or sequence of Record
    torque : str
        Channel: ``motor_torque`` or the sensor's.
    **options
        Of `constant_velocity_segments`.

    Returns
    -------
    points : SlidingPoints
        Weighted by their standard deviations where every segment has one.
    notes : tuple of str
        What was averaged, and what was less than a revolution.

    Raises
    ------
    InputError
        If no record has a segment.
    """
    several = [records] if isinstance(records, Record) else list(records)
    segments = [s for r in several for s in constant_velocity_segments(r, torque=torque, **options)]
    if not segments:
        raise InputError(
            "no stretch of constant velocity is longer than the transient of 20 degrees; record longer ones, "
            "or identify the whole axis from its motion"
        )
    std = np.array([s.std for s in segments])
    short = [s for s in segments if s.revolutions == 0]
    notes = [
        f"{len(segments)} segments of constant velocity from channel {torque!r}, first 20 degrees dropped."
    ]
    if short:
        listing = ", ".join(f"{s.velocity:.3g}" for s in short[:6]) + (", ..." if len(short) > 6 else "")
        notes.append(
            f"{len(short)} of them travel less than a revolution ({listing} rad/s): what depends on position is "
            "not averaged out."
        )
    usable = bool(np.all(np.isfinite(std) & (std > 0.0)))
    points = SlidingPoints(
        np.array([s.velocity for s in segments]), np.array([s.torque for s in segments]), std if usable else None
    )  # fmt: skip
    return points, tuple(notes)
