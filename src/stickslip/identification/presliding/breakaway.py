"""Break-away torque from slow torque ramps: thesis 4.3.1.1.1 and 4.3.2.1.1.

It is the torque at which the velocity first exceeds a threshold, by angle and direction; its mean and spread; and its
dependence on the ramp rate (thesis 2.1.1: break-away decreases as the torque rises faster). If the axis sticks and
slips while the torque rises, only the first break of a ramp counts, since later ones follow recent motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit, name_option
from stickslip.core.record import Record, encoder_step
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.fit.student import student_quantile
from stickslip.identification.steady_friction.levels import slope_of

WINDOW = 0.02
"""Window of a velocity if the record has none, s."""
RAMP = 0.7
"""Least rise of the torque at rest, part of the break-away torque, that proves a ramp: stick-slip of an axis that
follows a reference shows less. So does a ramp from a held torque (against gravity), which cannot be distinguished from
a motion; neither is therefore refused."""
RETURNED = 0.7
"""Part of the break-away torque to which the torque must return for the next break-away in its direction to be the
first of another ramp."""
COUNTS = 3.0
"""Least motion within `WINDOW`, counts of the encoder, as opposed to creep or noise."""

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class Break:
    """One break-away.

    Time (s), angle (rad), direction (+1, -1), torque (N·m, in its direction) and ramp rate (N·m/s). `risen`: part of
    the torque by which it rose in its direction since the axis came to rest; `doubt`: error due to rows and threshold
    (N·m); `first`: whether it is the first of its ramp.
    """

    time: float
    angle: float
    direction: int
    torque: float
    rate: float
    risen: float = math.inf
    doubt: float = 0.0
    first: bool = True

    @property
    def ramped(self) -> bool:
        """Whether a torque ramp from rest caused it."""
        return self.risen >= RAMP


def find_breaks(
    record: Record, *, torque: str = "motor_torque", threshold: float = 0.01, rest: float = 0.05
) -> tuple[Break, ...]:
    """Find every transition from rest to motion.

    Parameters
    ----------
    record : Record
        Channels ``position``, the torque's, and ``velocity`` if there is one.
    torque : str
        Motor side or sensor side.
    threshold : float
        Velocity above which the axis moves, rad/s; at rest it stays below a fifth of it.
    rest : float
        Time that the axis must rest before, s.
    """
    time, position, load = record.time, record["position"], record[torque]
    v = record["velocity"] if "velocity" in record.channels else slope_of(time, position, WINDOW)
    found: list[Break] = []
    quiet_since, ready = math.nan, False
    first = 0  # first row of the rest
    for k in range(time.size):
        i = k
        if abs(v[i]) < 0.2 * threshold:
            first = first if ready or not math.isnan(quiet_since) else i
            quiet_since = float(time[i]) if math.isnan(quiet_since) else quiet_since
            ready = ready or float(time[i]) - quiet_since >= rest
        elif abs(v[i]) > threshold:
            if ready:
                if "velocity" not in record.channels:
                    i = departure(time, position, i, threshold)
                rows = np.flatnonzero((time <= time[i]) & (time >= time[i] - rest))
                width = float(time[rows[-1]] - time[rows[0]])
                rate = float(load[rows[-1]] - load[rows[0]]) / width if width > 0.0 else math.nan
                # The torque changed between two rows, and before the motion was detected.
                doubt = abs(float(load[k] - load[i])) + abs(rate) * float(time[i] - time[max(i - 1, 0)])
                found.append(broken(time, position, load, first, i, int(np.sign(v[k])), abs(rate), doubt))
            quiet_since, ready = math.nan, False
        else:
            quiet_since = math.nan
    return firsts_marked(found, time, load)


def broken(
    time: Array, position: Array, load: Array, first: int, at: int, direction: int, rate: float, doubt: float
) -> Break:
    """Return the break-away at a row, after a rest from row `first` on."""
    since = direction * load[min(first, at) : at + 1]
    size = float(since[-1])
    risen = float(since[-1] - np.min(since)) / size if size > 0.0 else 0.0
    return Break(float(time[at]), float(position[at]), direction, size, rate, risen, doubt)


def firsts_marked(breaks: Sequence[Break], time: Array, load: Array) -> tuple[Break, ...]:
    """Mark break-aways before which the torque had not returned since an earlier one in their direction."""
    out: list[Break] = []
    for b in breaks:
        before = next((a for a in reversed(out) if a.first), None)
        first = before is None or before.direction != b.direction
        if before is not None and not first:
            between = b.direction * load[(time >= before.time) & (time <= b.time)]
            first = float(np.min(between)) <= RETURNED * before.torque
        out.append(replace(b, first=first))
    return tuple(out)


def departure(time: Array, position: Array, seen: int, threshold: float) -> int:
    """Return the last sample at rest before a motion that the slope over a window detects at a sample."""
    near = np.flatnonzero(np.abs(time - time[seen]) <= WINDOW).tolist()
    first, last = int(near[0]), int(near[-1]) + 1
    for k in range(first, last):
        if abs(float(position[k]) - float(position[first])) > 0.5 * threshold * WINDOW:
            return max(k - 1, first)
    return seen


def identify_breakaway(
    records: Record | Sequence[Record],
    *,
    torque: str = "motor_torque",
    threshold: float = 0.01,
    rest: float = 0.05,
) -> Identification:
    """Identify the mean break-away torque of each direction, with its interval and spread.

    Returns
    -------
    Identification
        Estimates fs_positive, fs_negative (directions that occur) and, with three ramp rates or more, rate_effect: the
        change per tenfold ramp rate. ``details["breaks"]`` lists every break-away.

    Raises
    ------
    InputError
        If the axis never breaks away.

    Notes
    -----
    The first break-away of every ramp counts. If fewer than half of these follow a torque ramp from rest
    (`Break.ramped`), nothing counts as identified, and a note reports it: the record is most likely that of a motion.
    """
    several = [records] if isinstance(records, Record) else list(records)
    every = [b for r in several for b in find_breaks(r, torque=torque, threshold=threshold, rest=rest)]
    breaks = [b for b in every if b.first]
    step = max(encoder_step(r[torque]) for r in several)
    if not breaks:
        raise InputError(
            f"the axis never breaks away: its velocity does not pass {threshold:g} {axis_unit('rad/s')} from "
            "rest; ramp the "
            "torque higher or lower the threshold"
        )
    ramps = sum(b.ramped for b in breaks)
    estimates: list[Estimate] = []
    misfit: dict[str, float] = {}
    for direction, word in ((1, "positive"), (-1, "negative")):
        own = [b for b in breaks if b.direction == direction]
        values = np.array([b.torque for b in own])
        if values.size:
            systematic = math.hypot(float(np.mean([b.doubt for b in own])), step)
            estimates.append(mean_estimate(f"fs_{word}", values, systematic))
            misfit[f"spread_{word}_Nm"] = float(np.std(values, ddof=1)) if values.size > 1 else math.nan
    rate = rate_effect(breaks)
    if rate is not None:
        estimates.append(rate)
    notes = [
        f"{len(breaks)} break-aways from channel {torque!r}, velocity threshold {threshold:g} {axis_unit('rad/s')}."
    ]
    if len(every) > len(breaks):
        notes.append(
            f"{len(every) - len(breaks)} more, where the axis stuck again and slipped while the torque rose on, are "
            "left out: the first of a ramp is break-away."
        )
    if 2 * ramps < len(breaks):
        estimates = [replace(e, identified=False, verdict="few torque ramps from rest") for e in estimates]
    elif rate is not None and (rate.lower > 0.0 or rate.upper < 0.0):
        notes.append(
            f"Break-away depends on the ramp rate: {rate.value:.3g} {axis_unit('N·m')} per tenfold rate."
        )
    notes += ramp_notes(len(breaks), ramps) + count_notes(several, threshold)
    few = tuple(["Repeat the ramp at other angles; one break-away has no spread."] if len(breaks) < 3 else [])
    return Identification(
        "breakaway", None, tuple(estimates), np.eye(len(estimates)), misfit, tuple(notes), few,
        (angle_picture(breaks, estimates),), {"breaks": breaks, "later": [b for b in every if not b.first]},
    )  # fmt: skip


def ramp_notes(found: int, ramps: int) -> list[str]:
    """Report that only some of the break-aways followed a torque ramp."""
    if ramps == found:
        return []
    if 2 * ramps >= found:
        return [f"{found - ramps} of them followed no torque ramp from rest, and may lie elsewhere."]
    return [
        f"Only {ramps} of them followed a torque ramp from rest, so that nothing counts as identified: is it the "
        f"record of a motion? Then take {name_option('method', 'axis')}. In a break-away record the torque "
        "rises slowly while the "
        "axis rests until it moves, then goes back until it rests (`stickslip rig run breakaway`). Where it was ramped "
        f"from a torque held, less than {1.0 - RAMP:.0%} of the break-away torque is to be held for it to count."
    ]


def count_notes(records: Sequence[Record], threshold: float) -> list[str]:
    """Report that a few encoder counts exceed the threshold."""
    steps = [encoder_step(r["position"]) for r in records if "velocity" not in r.channels]
    enough = COUNTS * max(steps, default=0.0) / WINDOW
    if enough < 1.25 * threshold:
        return []
    return [
        f"Fewer than {COUNTS:g} counts of the encoder within {WINDOW:g} s pass the threshold, so that creep or noise "
        f"may be taken for a break-away: try {name_option('threshold', f'{enough:.2g}')}."
    ]


def mean_estimate(name: str, values: Array, systematic: float = 0.0) -> Estimate:
    """Return a mean with its Student interval and a half-width (N·m) that repeats do not show; not below 0."""
    mean = float(np.mean(values))
    if values.size < 2:
        return Estimate(
            name, "N·m", "F_S", max(mean, 0.0), math.nan, 0.0, math.inf, False, "one break-away has no spread"
        )
    std = float(np.std(values, ddof=1)) / math.sqrt(values.size)
    half = math.hypot(student_quantile(values.size - 1) * std, systematic)
    low, high = max(mean - half, 0.0), max(mean + half, 0.0)
    why = "" if high <= 2.0 * low else "the break-aways scatter too much for their number"
    if not mean > 0.0:
        why = (
            "the torque at the break-away does not act in its direction: something else (gravity, a hand) moved the "
            "axis, or this is not the torque that did"
        )
    std = math.hypot(std, systematic / 1.96)
    return Estimate(name, "N·m", "F_S", max(mean, 0.0), std, low, high, not why, why)


def rate_effect(breaks: Sequence[Break]) -> Estimate | None:
    """Return the change of the break-away torque per tenfold ramp rate, N·m; None with fewer than three rates."""
    usable = [b for b in breaks if math.isfinite(b.rate) and b.rate > 0.0]
    rates = np.log10(np.array([b.rate for b in usable]))
    if len(usable) < 4 or float(np.ptp(rates)) < 0.3:
        return None
    sides = np.array([[b.direction > 0, b.direction < 0] for b in usable], dtype=np.float64)
    matrix = np.column_stack([rates, sides[:, np.any(sides, axis=0)]])
    values = np.array([b.torque for b in usable])
    inverse: Any = np.linalg.pinv(matrix.T @ matrix)
    solved: Any = inverse @ matrix.T @ values
    dof = len(usable) - matrix.shape[1]
    if dof < 1:
        return None
    std = math.sqrt(float(np.sum((matrix @ solved - values) ** 2)) / dof * float(inverse[0, 0]))
    half = student_quantile(dof) * std
    value = float(solved[0])
    why = "" if half <= 0.05 * float(np.mean(values)) else "the break-aways scatter too much for their number"
    return Estimate("rate_effect", "N·m", "dF_S", value, std, value - half, value + half, not why, why)


def turned(angles: Sequence[float]) -> Array:
    """Return angles in degrees; within one revolution if they exceed one."""
    degrees = np.degrees(np.array(angles))
    return np.mod(degrees, 360.0) if np.any(np.abs(degrees) > 400.0) else degrees


def angle_picture(breaks: Sequence[Break], estimates: Sequence[Estimate]) -> Picture:
    """Draw the break-away torque over the angle (thesis figures 4.5, 4.27, 4.28)."""
    traces: list[Trace] = []
    for direction, kind, word in ((1, "points", "positive"), (-1, "open points", "negative")):
        chosen = [b for b in breaks if b.direction == direction]
        if chosen:
            angle = turned([b.angle for b in chosen])
            traces.append(Trace(f"{word} direction", angle, np.array([b.torque for b in chosen]), kind))
    angles = turned([b.angle for b in breaks])
    ends = np.array([np.min(angles), np.max(angles)])
    means = [e for e in estimates if e.name.startswith("fs_")]
    for e in means:
        traces.append(Trace(f"mean, {e.name[3:]}", ends, np.full(2, e.value)))
    words = ", ".join(f"{e.name[3:]} {e.value:.4g} {axis_unit('N·m')}" for e in means)
    label = f"break-away torque ({axis_unit('N·m')})"
    return Picture(
        "breakaway", "Break-away torque", f"Mean: {words}", "angle (degrees)", label, tuple(traces)
    )  # fmt: skip
