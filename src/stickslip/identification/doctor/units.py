"""Units: evidence in the numbers against the assumed units."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.identification.doctor.view import Array, View

DEG, REV, RPM = math.pi / 180.0, 2.0 * math.pi, 2.0 * math.pi / 60.0
POSITION = {"deg": DEG, "rev": REV, "mm": 1e-3, "um": 1e-6}
STATED = re.compile(r"\[\s*([^\]]*[^\]\s\d][^\]]+?)\s*\]|(?i:\(\s*((?:user )?units?(?:/\w+)?)\s*\))")
"""Unit stated in a column's name: not an axis' number or letter."""
AMBIGUOUS: dict[str, str] = dict.fromkeys(
    ("1/s", "s-1", "1/sec"), "revolutions a second in some drives' tools and radians in others"
)
LIKELY = {
    "time": "ms", "position": "rev", "velocity": "rev/s", "motor_torque": "Nm", "friction_torque": "Nm", "current": "A",
}  # fmt: skip
VELOCITY = {"deg/s": DEG, "rpm": RPM, "rev/s": REV, "mm/s": 1e-3, "mm/min": 1e-3 / 60}
TIME = {"ms": 1e-3, "us": 1e-6}
LINEAR_ONLY = ("mm", "um", "mm/s", "mm/min")
FOLLOWS, MOVES_ALIKE, THAT_UNIT = 0.95, 5.0, 0.01
"""Correlation from which on a position follows its reference; greatest ratio of their travels in the same unit, since a
weak loop that holds a weight moves less; tolerance of a unit's ratio, below the 5 % between gear ratios and units."""
BITS = (10, 25)
FEW_PLACES = 200
"""Fewest different positions to distinguish a grid from one nearly as fine: phases turn once or more over them."""
LEAST = (0.5, 2.5)
"""Least and greatest distance of the nearest two positions, counts."""
ON_THE_GRID = 0.8
"""Mean of the phases' unit vectors on a grid: higher if a file rounds to half a count, 0 by chance."""


def assumed(view: View) -> Iterator[Finding]:
    """Yield findings on units that are not stated."""
    main = ("time", "position", "velocity", "motor_torque", "friction_torque", "current")
    quiet = [c for c in main if not view.stated(c)]
    for channel in list(quiet):
        if match := STATED.search(view.name(channel)):
            quiet.remove(channel)
            stated = match[1] or match[2]
            which = AMBIGUOUS.get(stated.lower(), "which is none that is known")
            message = f"{view.name(channel)!r} is in {stated!r}, {which}"
            remedy = f"say which it is, such as {view.mapped(channel, LIKELY[channel])}"
            yield Finding("error", "unknown-unit", message, remedy=remedy)
    if quiet:
        listed = ", ".join(
            f"{view.name(c)!r} as {c} in {'s' if c == 'time' else view.record.units[c]}" for c in quiet
        )
        channel = quiet[-1]
        yield Finding(
            "warning",
            "assumed-unit",
            f"the file states no unit that is known; taken were {listed}",
            remedy=f"say them, such as {view.mapped(channel, 'UNIT')}",
        )


def counted(view: View) -> Iterator[Finding]:
    """Yield a finding on whole numbers instead of an angle or a length: counts."""
    if in_counts(view):
        values = view.values("position")
        level = "warning" if view.stated("position") else "error"
        unit = view.record.units["position"]
        message = (
            f"every position is a whole number, from {np.min(values):.0f} to {np.max(values):.0f}: counts"
            f" rather than {unit}"
        )
        yield Finding(
            level,
            "position-unit",
            message,
            remedy=f"say {view.mapped('position', 'counts')}{_more(view, 'counts_per_rev', 'N')}",
        )


def in_counts(view: View) -> bool:
    """Return whether every position is a whole number: findings on its unit then have this one remedy."""
    if not view.has("position"):
        return False
    values = view.values("position")
    return _whole(values) and float(np.ptp(values)) >= 10.0


def _more(view: View, number: str, value: str) -> str:
    """Return the option of a drive parameter, unless it is given."""
    given = view.record.meta.get("reading", {}).get("drive", {})
    return "" if number in given else f" and {name_option(number, value)}"


def degrees(view: View) -> Iterator[Finding]:
    """Yield a finding if the position seems to be in degrees instead of rad.

    Its resolution divides 360 as an encoder does, and not 2 pi, or its reference moves by multiples of 360 / 8. It is a
    warning if the file states rad.
    """
    if not view.has("position") or view.record.units["position"] != "rad":
        return
    level, step = "warning" if view.stated("position") else "error", view.step
    remedy = f"say {view.mapped('position', 'deg')}, if it is so"
    counts = 360.0 / step if step > 0.0 else 0.0
    if not (_counts_of_encoder(counts) and not _counts_of_encoder(2.0 * math.pi / step)):
        counts = _binary_counts(view.values("position"), 360.0)
    if counts:
        message = (
            f"the position's step of {360.0 / counts:.6g} is a turn of 360 over {counts:.0f} counts: degrees"
            " rather than rad"
        )
        yield Finding(level, "position-unit", message, remedy=remedy)
        return
    way = float(np.ptp(view.values("position_reference"))) if view.has("position_reference") else 0.0
    if way > 0.0 and view.record.units["position_reference"] == "rad" and _eighths(way):
        message = f"the reference goes over {way:.6g}, whole eighths of a turn in degrees: degrees, not rad?"
        yield Finding("warning", "position-unit", message, remedy=remedy)


def turns(view: View) -> Iterator[Finding]:
    """Yield a warning on a resolution of 1/1024, 1/2048, ...: turns. Some drives have such a step in rad."""
    if not view.has("position") or view.record.units["position"] != "rad" or in_counts(view):
        return
    if counts := _binary_counts(view.values("position"), 1.0):
        message = (
            f"the position's step of {1.0 / counts:.6g} is 1 over {counts:.0f} counts: turns rather than rad"
        )
        remedy = f"say {view.mapped('position', 'rev')}, if it is so"
        yield Finding("warning", "position-unit", message, remedy=remedy)


def reference_scale(view: View) -> Iterator[Finding]:
    """Yield a finding if a position follows its reference at another scale: one of the two has another unit."""
    unit = view.record.units.get("position")
    if not unit or not view.has("position_reference") or view.record.units["position_reference"] != unit:
        return
    both: Array = np.stack([view.values("position"), view.values("position_reference")])
    both = both[:, np.isfinite(both).all(axis=0)]
    spread = both.std(axis=1) if both.shape[1] else np.zeros(2)
    if not np.min(spread) > 0.0:
        return
    # Normalise first: absurd numbers overflow when squared.
    away: Array = (both - both.mean(axis=1, keepdims=True)) / spread[:, None]
    alike: Array = away[0] * away[1]
    times = float(spread[0] / spread[1])
    if not float(np.mean(alike)) > FOLLOWS or 1.0 / MOVES_ALIKE < times < MOVES_ALIKE:
        return
    farther = times if times > 1.0 else 1.0 / times
    message = (
        f"the position follows its reference, {farther:.4g} times as {'far' if times > 1.0 else 'little'}"
    )
    linear = unit == "m"
    for name, size in POSITION.items():
        if (name in LINEAR_ONLY) != linear:
            continue
        for channel, expected in (("position", 1.0 / size), ("position_reference", size)):
            if abs(math.log(times / expected)) < THAT_UNIT:
                level = "warning" if view.stated(channel) else "error"
                said = f"{message}: {channel} in {name} rather than {unit}"
                remedy = f"say {view.mapped(channel, name)}, or {view.mapped(channel, unit)} if it is right"
                yield Finding(level, f"{channel.replace('_', '-')}-unit", said, remedy=remedy)
                return
    yield Finding(
        "warning", "reference-scale", f"{message}, where both are taken in {unit}",
        remedy="check both units and whether one is on the other side of a gear",
    )  # fmt: skip


def explained(ratio: float, view: View) -> list[tuple[str, str, str]]:
    """Return the units that explain a ratio, fewest changes first: code, description, remedy."""
    linear = view.record.units["position"] == "m"
    found: list[tuple[float, str, str, str]] = []
    options = itertools.product(
        [("", 1.0), *POSITION.items()], [("", 1.0), *VELOCITY.items()], [("", 1.0), *TIME.items()]
    )
    for (q, by_q), (v, by_v), (t, by_t) in options:
        changed = [(c, u) for c, u in (("position", q), ("velocity", v), ("time", t)) if u]
        off = math.log(ratio / (by_q / (by_v * by_t)))
        if (
            not changed
            or abs(off) > 0.03
            or any((u in LINEAR_ONLY) != linear for _, u in changed if u not in TIME)
        ):
            continue
        # A stated unit is wrong less often.
        cost = len(changed) + 0.5 * sum(view.stated(c) for c, _ in changed)
        says = " and ".join(f"{c} in {u}" for c, u in changed)
        remedy = " ".join(view.mapped(c, u) for c, u in changed)
        found.append((cost, f"{changed[0][0]}-unit", says, remedy))
    return [(code, says, remedy) for _, code, says, remedy in sorted(found, key=lambda f: f[0])]


def too_fast(view: View) -> Iterator[Finding]:
    """Yield a finding on implausible speeds."""
    smooth = view.smooth
    if smooth is None or not view.has("position") or (in_counts(view) and not view.stated("position")):
        return
    angle = view.record.units["position"] == "rad"
    doubtful, absurd = (1000.0, 10000.0) if angle else (20.0, 1000.0)
    if smooth.fast > doubtful:
        said = f"{smooth.fast / RPM:.3g} rpm" if angle else f"{smooth.fast:.3g} m/s"
        level = "error" if smooth.fast > absurd and not view.stated("position") else "warning"
        example = "deg" if angle else "mm"
        yield Finding(
            level,
            "position-unit",
            f"the axis would move at {said}; the unit of position or time may be wrong",
            remedy=f"say {view.mapped('position', example)}, or the unit of time",
        )


def torque_scale(view: View) -> Iterator[Finding]:
    """Yield a finding on a torque that is a share of the rated torque: whole numbers or tenths of percent."""
    if not view.has("motor_torque") or view.stated("motor_torque") or "motor_torque" not in view.columns:
        return
    asked = f"{_more(view, 'rated_torque', 'TORQUE')}, or {view.mapped('motor_torque', view.effort)} if it is right"
    values = view.values("motor_torque")
    peak = float(np.max(np.abs(values), initial=0.0))
    tenths = peak <= 500.0 and _whole(10.0 * values)
    if peak > 20.0 and (_whole(values) or tenths):
        kind = "whole numbers" if _whole(values) else "multiples of 0.1"
        unit = "permille" if _whole(values) and peak > 100.0 else "percent"
        message = (
            f"torques are {kind} up to {peak:.6g}: a share of the rated torque (per mille, percent) or counts"
            f" rather than {'N' if view.linear else 'N·m'}"
        )
        yield Finding(
            "error",
            "torque-unit",
            message,
            remedy=f"say {view.mapped('motor_torque', unit)}{asked}",
        )
    elif not _more(view, "rated_torque", "TORQUE"):
        message = f"a rated torque is given, and {view.name('motor_torque')!r}, which states no unit, is no share of it"
        remedy = f"say {view.mapped('motor_torque', 'percent')} (or permille){asked}"
        yield Finding("error", "torque-unit", message, remedy=remedy)


def _whole(values: Array) -> bool:
    """Return whether all of many different values are whole numbers."""
    return bool(
        values.size and np.unique(values[:5000]).size > 5 and np.all(np.abs(values - np.round(values)) < 1e-6)
    )


def _counts_of_encoder(count: float) -> bool:
    """Return whether this many steps per turn are an encoder's: a power of two, or four times hundreds of lines."""
    near = round(count)
    if near < 100 or abs(count - near) > 2e-4 * near:
        return False
    return near & (near - 1) == 0 or (near % 400 == 0 and near <= 40000 and not _decimal(360.0 / near))


def _binary_counts(values: Array, turn: float) -> int:
    """Return the counts per `turn` of an encoder, a power of two, that fit every position; 0 if none do.

    A file may round the positions by less than half a count.
    """
    places: Array = np.unique(values[np.isfinite(values)])
    size = float(np.max(np.abs(places), initial=0.0))
    apart = np.diff(places)
    apart = apart[apart > 1e-9 * size]
    if apart.size < FEW_PLACES:
        return 0
    least = float(np.partition(apart, 2)[2])
    for bits in range(*BITS):
        step = turn / 2**bits
        # 32-bit floats have steps of a power of two as well.
        told = step > 16.0 * float(np.spacing(np.float32(size)))
        if told and LEAST[0] * step < least < LEAST[1] * step and _on(places, step):
            return 2**bits
    return 0


def _on(places: Array, step: float) -> bool:
    """Return whether positions are on a grid of this step, with any offset: whether its phases agree."""
    phase: Array = 2.0 * math.pi * places / step
    return math.hypot(float(np.mean(np.cos(phase))), float(np.mean(np.sin(phase)))) > ON_THE_GRID


def _eighths(way: float) -> bool:
    """Return whether a travel is a multiple of 45 and not a plausible request in rad."""
    return round(way / 45.0) >= 1 and abs(way / 45.0 - round(way / 45.0)) < 1e-5


def _decimal(step: float) -> bool:
    """Return whether a step is that of a number printed with few digits."""
    exponent = math.floor(math.log10(step) + 1e-9)
    return abs(step / 10.0**exponent - 1.0) < 1e-6
