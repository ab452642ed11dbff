"""Draw measured and model torque over time and velocity, and the residual."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from stickslip.identification.estimate import Identification, Picture, Trace
from stickslip.identification.monte_carlo import resisting_torque
from stickslip.report.plots import envelope, quantity
from stickslip.report.sliding_torque import Sliding

Array = np.ndarray[Any, np.dtype[np.float64]]

PART, BEGINS = 8, 40
"""The most informative segment is an eighth of its record; eight are compared."""
CLOUD = 900
"""Most points of a picture over velocity."""
BINS, FEWEST = 24, 8
"""Bins of speed for the medians at the curve, and fewest rows of a bin."""
GAP = 3.0
"""Multiple of the usual row distance above which a line is interrupted."""


def units(motion: str) -> tuple[str, str, str]:
    """Return the units of torque, speed and position."""
    return ("N", "m/s", "m") if motion == "linear" else ("N·m", "rad/s", "rad")


def stretch(sliding: Sliding, motion: str) -> Picture:
    """Draw measured and model torque in the segment of the first record with motion in both directions and the largest
    torque."""
    time, torque = sliding.whole[0]
    own = sliding.record == 0
    first, last = telling(sliding, time, torque)
    inside, rows = (time >= first) & (time <= last), own & (sliding.time >= first) & (sliding.time <= last)
    return over_time(
        "torque-stretch", "Measured and model torque: a segment", sliding, motion,
        (time[inside], torque[inside]), (sliding.time[rows], sliding.model[rows]),
    )  # fmt: skip


def whole_record(sliding: Sliding, motion: str, number: int = 0, name: str = "") -> Picture:
    """Draw the same for a whole record."""
    own = sliding.record == number
    which = f" ({name})" if name else ""
    return over_time(
        f"torque-whole-{number + 1}", f"Measured and model torque: the whole record{which}", sliding, motion,
        sliding.whole[number], (sliding.time[own], sliding.model[own]),
    )  # fmt: skip


def telling(sliding: Sliding, time: Array, torque: Array) -> tuple[float, float]:
    """Return start and end of that segment, s."""
    length = float(time[-1] - time[0]) / PART
    own = sliding.record == 0
    at, side = sliding.time[own], np.sign(sliding.velocity[own])
    best, where = -1.0, float(time[0])
    for begin in np.linspace(float(time[0]), float(time[-1]) - length, BEGINS).tolist():
        moving = side[(at >= begin) & (at <= begin + length)]
        if moving.size == 0:
            continue
        ways = min(np.mean(moving > 0.0), np.mean(moving < 0.0))
        strain = float(np.std(torque[(time >= begin) & (time <= begin + length)]))
        score = strain * moving.size * (1.0 if ways > 0.1 else 0.3)
        best, where = max((best, where), (score, begin))
    return where, where + length


def over_time(
    name: str, title: str, sliding: Sliding, motion: str, measured: tuple[Array, Array], model: tuple[Array, Array]
) -> Picture:  # fmt: skip
    """Draw both lines; the model's only where it gives a torque."""
    unit = units(motion)[0]
    off = f"{100.0 * sliding.relative:.3g} % ({quantity(sliding.rms, unit)} RMS) off"
    message = (
        f"The model is {off} in gross sliding; its line is interrupted at rest and around reversals."
        if sliding.certain
        else f"The model is {off}, standstills and reversals included."
    )
    word = "force" if motion == "linear" else "torque"
    return Picture(
        name, title.replace("Torque", word.capitalize()), message, "time (s)", f"{word} ({unit})",
        (Trace("measured", *envelope(*measured), "wide"), Trace("model", *with_gaps(*model))),
    )  # fmt: skip


def with_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """Return thinned values, with NaN where rows are missing."""
    if time.size < 3:
        return time, values
    steps = np.diff(time)
    ends = time[:-1][steps > GAP * float(np.median(steps))]
    x, y = envelope(time, values)
    piece = np.searchsorted(ends, x, side="left")
    cuts = np.flatnonzero(np.diff(piece)) + 1
    return np.insert(x, cuts, np.nan), np.insert(y, cuts, np.nan)


def over_velocity(sliding: Sliding, found: Identification, motion: str) -> Picture | None:
    """Draw torque minus inertia torque over velocity, with the law's curve."""
    model, mechanics = found.model, found.details.get("mechanics")
    if model is None or model.law.steady is None or mechanics is None:
        return None
    torque, speed, _ = units(motion)
    step = max(1, math.ceil(sliding.time.size / CLOUD))
    x, y = sliding.velocity[::step], (sliding.measured - sliding.inertial)[::step]
    grid = [np.linspace(low, high, 120) for low, high in sides_of(sliding.velocity)]
    v = np.concatenate(grid)
    curve = resisting_torque(model, v) + mechanics.offset
    cuts = np.cumsum([g.size for g in grid])[:-1]
    word = "force" if motion == "linear" else "torque"
    mass = "mass" if motion == "linear" else "inertia"
    spread = quantity(sliding.rms, torque)
    lifts, less = (" and lifts", " and gravity") if mechanics.gravity else ("", "")
    return Picture(
        "torque-velocity", f"{word.capitalize()} minus inertia {word}{lifts} over velocity",
        f"Measured {word} minus {mass} times acceleration{less} deviates by {spread} RMS from the law's curve.",
        f"velocity ({speed})", f"{word} less {mass} part ({torque})",
        (Trace("model", np.insert(v, cuts, np.nan), np.insert(curve, cuts, np.nan)), Trace("measured", x, y, "cloud")),
    )  # fmt: skip


def sides_of(velocity: Array) -> list[tuple[float, float]]:
    """Return the smallest and largest speed in each direction of motion."""
    out: list[tuple[float, float]] = []
    for side in (-1.0, 1.0):
        speed = side * velocity[side * velocity > 0.0]
        if speed.size:
            out.append((side * float(speed.min()), side * float(speed.max())))
    return [(min(p), max(p)) for p in out]


def friction_points(sliding: Sliding, offset: float) -> list[tuple[Array, Array]]:
    """Return medians of the friction torque over bins of speed, for positive and negative direction."""
    top = float(np.max(np.abs(sliding.velocity)))
    slow = max(float(np.min(np.abs(sliding.velocity))), 1e-3 * top)
    edges = np.geomspace(slow, top * (1.0 + 1e-9), BINS + 1)
    out: list[tuple[Array, Array]] = []
    for side in (1.0, -1.0):
        speed = side * sliding.velocity
        friction = side * (sliding.measured - sliding.inertial - offset)
        points = [
            (float(np.median(speed[inside])), float(np.median(friction[inside])))
            for low, high in itertools.pairwise(edges.tolist())
            if np.count_nonzero(inside := (speed >= low) & (speed < high)) >= FEWEST
        ]
        table = np.array(points).reshape(-1, 2)
        out.append((table[:, 0], table[:, 1]))
    return out
