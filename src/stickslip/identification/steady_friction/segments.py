"""Constant-velocity segments of records, and the friction torque of each: thesis 4.3.1.1.2.

The first 20 degrees of a segment are dropped, or a fifth of it if that is less, and the torque is averaged over whole
revolutions, which averages out its dependence on the position. For shorter ones that dependence adds to the standard
deviation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit, name_option
from stickslip.core.record import Record, encoder_step
from stickslip.identification.steady_friction.levels import Level, find_levels, level_runs, slope_of
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.rigs.procedures.resting import RESTING, resting

__all__ = ["Dropped", "Segment", "constant_velocity_segments", "segments_of", "sliding_points", "slope_of"]

Array = np.ndarray[Any, np.dtype[np.float64]]

REVOLUTION = 2.0 * math.pi
TRANSIENT, SHARE = math.radians(20.0), 0.2
"""Travel dropped at the start of a segment: rad, and part of its travel, whichever is less."""
BINS = 120
"""Parts of a segment with equal weight."""
PARTS = 8
"""Parts of a segment whose spread gives the uncertainty of its mean without whole revolutions."""
LINEARITY = 1e-4
"""Least relative uncertainty of a torque: no sensor or current is more linear."""
STANDING = 0.7
"""Share of the time at rest above which the mean torque is no longer friction."""
SAME, CREEP = 0.1, 0.05
"""Relative velocity difference within which a shorter piece of a level is not reported; part of the slowest level's
velocity below which a dropped part is not a level."""
NAMED = 6
"""Most velocities that a note lists."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a record at constant velocity.

    Attributes
    ----------
    start, end : float
        Time, s, without the transient.
    velocity, torque : float
        Means over the whole revolutions, rad/s and N·m.
    std : float
        Standard deviation of the mean torque: from the spread of the revolutions if there are at least 3, else of eight
        parts of the segment; half the difference of its halves if that is more.
    revolutions : int
        Number of whole revolutions averaged; 0 if the travel was shorter than one.
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


@dataclass(frozen=True, slots=True)
class Dropped:
    """A part of a record at nearly constant velocity (s, rad/s) that is not a segment, and the reason."""

    start: float
    end: float
    velocity: float
    why: str


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
        Channels ``position`` and the torque's; the velocity is the reference's if the record has
        ``velocity_reference``, else the slope of the position (`stickslip.identification.steady_friction.levels`).
    torque : str
        Channel of the torque: motor side or sensor side, one at a time.
    tolerance : float
        Relative variation of the velocity allowed within a segment.
    transient : float
        Displacement dropped at the start of each segment, rad; a fifth of the segment if that is less.
    revolution : float
        Displacement after which friction repeats, rad (2 pi; a pitch for a linear axis).
    shortest : float
        Least duration after the transient, s.

    Returns
    -------
    tuple of Segment
        In order of time; `segments_of` also returns the parts left out.

    Raises
    ------
    InputError
        If a channel is missing or the record is empty.
    """
    options = {"tolerance": tolerance, "transient": transient, "revolution": revolution, "shortest": shortest}
    return segments_of(record, torque=torque, **options)[0]


def segments_of(
    record: Record, *, torque: str = "motor_torque", tolerance: float = 0.05, transient: float = TRANSIENT,
    revolution: float = REVOLUTION, shortest: float = 0.2,
) -> tuple[tuple[Segment, ...], tuple[Dropped, ...]]:  # fmt: skip
    """Return the segments of `constant_velocity_segments`, and the parts at constant velocity that are not segments."""
    if len(record) < 3:
        raise InputError(f"the record has {len(record)} samples; a constant-velocity segment needs many")
    time, position = record.time, record["position"]
    if "velocity_reference" in record.channels:
        found = [Level(a, b) for a, b in level_runs(time, record["velocity_reference"], tolerance)]
    else:
        found = find_levels(time, position, tolerance, 0.5 * shortest)
    segments: list[Segment] = []
    dropped: list[Dropped] = []
    for run in found:
        first, last = run.first, run.last
        moved = np.abs(position[first : last + 1] - position[first])
        begin = first + int(np.argmax(moved >= min(transient, SHARE * float(moved[-1]))))
        why = run.why
        if not why and time[last] - time[begin] < shortest:
            why = f"lasts less than {shortest:g} s after its transient"
        if why:
            mean = float((position[last] - position[first]) / (time[last] - time[first]))
            dropped.append(Dropped(float(time[first]), float(time[last]), mean, why))
        elif moved[-1] > 0.0:
            segments.append(_averaged(time, position, record[torque], begin, last, revolution))
    return tuple(segments), tuple(dropped)


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
    parts = turns if turns >= 3 else PARTS
    place = np.minimum(parts * np.abs(x - x[0]) / max(abs(float(x[-1] - x[0])), 1e-300), parts - 0.5).astype(
        np.int64
    )
    means = np.array([float(np.mean(y[place == k])) for k in range(parts) if np.any(place == k)])
    std = float(np.std(means, ddof=1)) / math.sqrt(means.size) if means.size > 1 else math.nan
    if (
        means.size > 1
    ):  # a drift is no spread: halves that differ are as far from the truth as from each other
        halves = np.array_split(means, 2)
        std = max(std, 0.5 * abs(float(np.mean(halves[1]) - np.mean(halves[0]))))
    mean = even_mean(x, y)
    velocity = float((x[-1] - x[0]) / (t[-1] - t[0]))
    return Segment(float(t[0]), float(t[-1]), velocity, mean, std, turns, abs(float(x[-1] - x[0])))


def even_mean(x: Array, y: Array) -> float:
    """Return the mean of y over time with equal weight for every part of x: for a rippling speed or stick-slip.

    A mean over x itself would count only the slips, whose torque belongs to their higher speed.
    """
    parts = min(BINS, x.size // 4)
    travel = float(x[-1] - x[0])
    if parts < 2 or travel == 0.0:
        return float(np.mean(y))
    place = np.clip(parts * (x - x[0]) / travel, 0.0, parts - 1.0).astype(np.int64)
    count = np.bincount(place, minlength=parts)
    sums = np.bincount(place, weights=y, minlength=parts)
    return float(np.mean(sums[count > 0] / count[count > 0]))


def sliding_points(
    records: Record | Sequence[Record], *, torque: str = "motor_torque", **options: Any
) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Return the points of the sliding curve from records of constant velocities, one side (motor or sensor) at a time.

    Parameters
    ----------
    records : Record or sequence of Record
    torque : str
        Channel: ``motor_torque`` or the sensor's.
    **options
        Options of `constant_velocity_segments`.

    Returns
    -------
    points : SlidingPoints
        Weighted by their standard deviations if every segment has one.
    notes : tuple of str
        The parts averaged, the parts dropped with the reasons, and those shorter than a revolution.

    Raises
    ------
    InputError
        If no record has a segment; the message lists those that were dropped.
    """
    several = [records] if isinstance(records, Record) else list(records)
    segments: list[Segment] = []
    dropped: list[Dropped] = []
    stuck: list[Segment] = []
    for record in several:
        found, left = segments_of(record, torque=torque, **options)
        slid, stood, sticking = _standing(record, found)
        segments += _with_systematic_errors(record, torque, slid, options.get("revolution", REVOLUTION))
        dropped += [d for d in (*left, *stood) if _worth_naming(d, slid)]
        stuck += sticking
    if not segments:
        integrated = all("position" in r.meta.get("derived", {}) for r in several)
        table = (
            f"; of a table of steady points leave times and {name_option('sample_time')} out"
            if integrated
            else ""
        )
        raise InputError(f"{_none_found(dropped)}{table}")
    std = np.array([s.std for s in segments])
    usable = bool(np.all(np.isfinite(std) & (std > 0.0)))
    points = SlidingPoints(
        np.array([s.velocity for s in segments]), np.array([s.torque for s in segments]), std if usable else None,
        absolute=usable,
    )  # fmt: skip
    return points, tuple(_notes(segments, dropped, stuck, torque, linear=several[0].units["position"] == "m"))


def _worth_naming(dropped: Dropped, segments: Sequence[Segment]) -> bool:
    """Return whether a dropped part is a level of its own: neither a piece of another one nor creep at rest."""
    slowest = min((abs(s.velocity) for s in segments), default=0.0)
    piece = any(abs(dropped.velocity - s.velocity) <= SAME * abs(s.velocity) for s in segments)
    return not piece and abs(dropped.velocity) > CREEP * slowest


def _standing(
    record: Record, segments: Iterable[Segment]
) -> tuple[list[Segment], list[Dropped], list[Segment]]:
    """Return the segments that slid, those mostly at rest, and which of the first showed stick-slip."""
    count = encoder_step(record["position"])
    slid: list[Segment] = []
    stood: list[Dropped] = []
    stuck: list[Segment] = []
    for s in segments:
        inside = (record.time >= s.start) & (record.time <= s.end)
        share = resting(record.time[inside], record["position"][inside], s.velocity, count)
        if share > STANDING:
            stood.append(Dropped(s.start, s.end, s.velocity, f"stands {100.0 * share:.0f} % of the time"))
            continue
        slid.append(s)
        if share > RESTING:
            stuck.append(s)
    return slid, stood, stuck


def _with_systematic_errors(
    record: Record, torque: str, segments: Sequence[Segment], revolution: float
) -> list[Segment]:
    """Add the errors that the spread within a segment does not show: counts, scale and position.

    A segment of less than a revolution contains a part of the dependence on the angle. The deviation of such a part's
    mean from the whole mean is taken from the slowest segment with a whole revolution, or the longest.
    """
    step = encoder_step(record[torque])
    own = step / math.sqrt(12.0 * PARTS)
    whole = [s for s in segments if s.revolutions > 0]
    shown = (
        min(whole, key=lambda s: abs(s.velocity))
        if whole
        else max(segments, key=lambda s: s.travel, default=None)
    )
    if shown is None:
        return []
    rows = (record.time >= shown.start) & (record.time <= shown.end)
    x = np.abs(record["position"][rows] - record["position"][rows][0])
    profile = _profile(x, record[torque][rows], min(shown.travel, revolution))
    out: list[Segment] = []
    for s in segments:
        part = s.travel / min(shown.travel, revolution)
        angle = _part_spread(profile, part, closed=bool(whole)) if s.revolutions == 0 else 0.0
        linear = LINEARITY * s.torque
        out.append(replace(s, std=math.sqrt(s.std**2 + own**2 + angle**2 + linear**2)))
    return out


def _profile(x: Array, y: Array, length: float) -> Array:
    """Return the mean of y in equal parts of a length of x, shape (BINS or fewer,)."""
    bins = max(min(BINS, x.size // 4), 1)
    place = np.minimum(bins * x / max(length, 1e-300), bins - 0.5).astype(np.int64)
    inside = x <= length
    count = np.bincount(place[inside], minlength=bins)
    sums = np.bincount(place[inside], weights=y[inside], minlength=bins)
    return sums[count > 0] / count[count > 0]


def _part_spread(profile: Array, part: float, *, closed: bool) -> float:
    """Return the standard deviation of the means over a part of a profile; a closed one is a whole revolution."""
    width = max(1, round(part * profile.size))
    if width >= profile.size:
        return 0.0
    around = np.concatenate([profile, profile[: width - 1]]) if closed else profile
    means = np.convolve(around, np.full(width, 1.0 / width), mode="valid")
    return float(np.std(means))


def _none_found(dropped: Sequence[Dropped]) -> str:
    """Return the message that there is no segment, with the dropped parts."""
    said = f"; dropped: {_listed_drops(dropped)}" if dropped else ""
    return (
        f"no segment of constant velocity to average the torque over{said}; record longer ones, or identify the whole "
        f"axis from its motion ({name_option('method', 'axis')})"
    )


def _notes(
    segments: Sequence[Segment], dropped: Sequence[Dropped], stuck: Sequence[Segment], torque: str, *, linear: bool
) -> list[str]:  # fmt: skip
    """Return notes on the parts averaged, dropped, and shorter than a revolution."""
    first = "a fifth" if linear else "20 degrees or a fifth, whichever is less,"
    notes = [
        f"{len(segments)} segments of constant velocity from channel {torque!r}, the first {first} of each dropped."
    ]
    unit = "m/s" if linear else "rad/s"
    if dropped:
        notes.append(f"Left out: {_listed_drops(dropped, unit)}.")
    if stuck:
        notes.append(
            f"Stuck and slipped at {_listed([s.velocity for s in stuck])} {unit}: the torque there is the mean of both."
        )
    short = [] if linear else [s.velocity for s in segments if s.revolutions == 0]
    if short:
        notes.append(
            f"{len(short)} of them travel less than a revolution ({_listed(short)} {unit}): what depends on position "
            "is not averaged out, and adds to their uncertainty."
        )
    return notes


def _listed_drops(dropped: Sequence[Dropped], unit: str = "") -> str:
    """Return the dropped parts as text, grouped by reason."""
    reasons: dict[str, list[float]] = {}
    for d in dropped:
        reasons.setdefault(d.why, []).append(d.velocity)
    unit = unit or axis_unit("rad/s")
    parts = [f"{_listed(v)} {unit} ({why})" for why, v in list(reasons.items())[:NAMED]]
    more = sum(len(v) for v in list(reasons.values())[NAMED:])
    return "; ".join(parts) + (f"; {more} more" if more else "")


def _listed(velocities: Sequence[float]) -> str:
    shown = ", ".join(f"{v:.3g}" for v in velocities[:NAMED])
    return f"{shown}, and {len(velocities) - NAMED} more" if len(velocities) > NAMED else shown
