"""The motion along which a setting is tested: that of a log, one of a file, or a slow sinusoid.

`identify` stores the motion of its first record in ``[trajectory]`` of model.toml: up to `POINTS` points of the
reference (of the position, if the log has none), joined by cubics, from the `LONGEST` seconds with the most motion and
reversals. A setting can then be tested without the log.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_file, name_option
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

LONGEST = 8.0
"""Longest part of a log that is stored, s."""
POINTS = 800
"""Most points that are stored."""
RUN_UP = 0.1
"""Duration of the ramp from (or to) rest of a motion that starts (or ends) under way, s."""
HOLD = 1.0
"""Time at rest after the motion, s, of which the second half is scored."""
STEEPEST = 3.0
"""Greatest slope of a cubic at a point, as a multiple of the mean velocity between its two points, without
overshoot."""
REST = 0.01
"""Part of the greatest speed below which a motion's start or end is at rest."""
WINDOW = 0.02
"""Averaging time of a recorded speed, s."""
REFERENCES = ("position_reference", "reference")


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion as points joined by cubic Hermite pieces.

    Attributes
    ----------
    time, position, velocity : array, shape (n,)
        s, increasing; rad; rad/s.
    source : str
        Origin of the motion, as text.
    """

    time: Array
    position: Array
    velocity: Array
    source: str = ""

    def __post_init__(self) -> None:
        sizes = {self.time.size, self.position.size, self.velocity.size}
        if len(sizes) != 1 or self.time.size < 2:
            raise InputError(
                f"the motion {self.source!r} has {self.time.size} times, {self.position.size} positions and "
                f"{self.velocity.size} velocities; give as many of each, at least 2"
            )
        if not all(np.all(np.isfinite(x)) for x in (self.time, self.position, self.velocity)):
            raise InputError(
                f"the motion {self.source!r} has values that are not finite; leave those points out"
            )
        if np.any(np.diff(self.time) <= 0.0):
            raise InputError(f"the times of the motion {self.source!r} do not ascend; sort its points")
        if not np.ptp(self.position) > 0.0:
            raise InputError(f"the motion {self.source!r} stands still; give one that moves the axis")

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def amplitude(self) -> float:
        """Half the distance between its outermost positions, rad."""
        return 0.5 * float(np.ptp(self.position))

    @property
    def top_speed(self) -> float:
        """Greatest speed, rad/s."""
        return float(np.max(np.abs(self.velocity)))

    def sampled(self, sample_time: float) -> Array:
        """Return position, velocity and acceleration at every sample, shape (n, 3).

        The motion starts from rest at 0 and is followed by `HOLD` seconds at rest.
        """
        interpolate: Any = importlib.import_module("scipy.interpolate")
        time, position, velocity = self._from_rest_to_rest()
        velocity = without_overshoot(time, position, velocity)
        curve = interpolate.CubicHermiteSpline(time - time[0], position - position[0], velocity)
        t = sample_time * np.arange(math.ceil((time[-1] - time[0] + HOLD) / sample_time))
        held = np.minimum(t, time[-1] - time[0])
        out = np.stack([np.asarray(curve(held, order), dtype=np.float64) for order in range(3)], axis=1)
        out[t >= time[-1] - time[0], 1:] = 0.0
        return out

    def _from_rest_to_rest(self) -> tuple[Array, Array, Array]:
        """Return the points, with a ramp of the velocity where the motion does not start or end at rest."""
        t, x, v = self.time, self.position, self.velocity.copy()
        for end in (0, -1):
            v[end] = v[end] if abs(v[end]) > REST * self.top_speed else 0.0
        if v[0] != 0.0:
            t = np.concatenate([[t[0] - RUN_UP], t])
            x, v = np.concatenate([[x[0] - 0.5 * RUN_UP * v[0]], x]), np.concatenate([[0.0], v])
        if v[-1] != 0.0:
            t = np.concatenate([t, [t[-1] + RUN_UP]])
            x, v = np.concatenate([x, [x[-1] + 0.5 * RUN_UP * v[-1]]]), np.concatenate([v, [0.0]])
        return t, x, v

    def table(self) -> dict[str, Any]:
        """Return plain data for a file."""
        span, top = float(np.ptp(self.position)), self.top_speed or 1.0
        return {
            "source": self.source,
            "time": [float(f"{t:.7g}") for t in self.time - self.time[0]],
            "position": _rounded(self.position, 1e-7 * span),
            "velocity": _rounded(self.velocity, 1e-5 * top),
        }


def without_overshoot(time: Array, position: Array, velocity: Array) -> Array:
    """Return the velocities at the points, rad/s, lowered where a cubic would go back between two points.

    A velocity averaged over a few milliseconds is too high where a motion starts or ends: the cubic then overshoots the
    rest position and returns by as much as a contact's presliding distance, and a feedforward compensates a reversal
    that was never commanded. Between velocities of opposite sign the motion turns, and its cubic turns once.
    """
    mean, given = np.diff(position) / np.diff(time), np.asarray(velocity, dtype=np.float64)
    while True:
        turns = given[:-1] * given[1:] < 0.0
        low = np.where(turns, -np.inf, STEEPEST * np.minimum(mean, 0.0))
        high = np.where(turns, np.inf, STEEPEST * np.maximum(mean, 0.0))
        kept = given.copy()
        kept[:-1] = np.clip(kept[:-1], low, high)
        kept[1:] = np.clip(kept[1:], low, high)
        if np.array_equal(kept, given):
            return kept
        given = kept


def _rounded(values: Array, step: float) -> list[float]:
    """Return the values without digits below a power of ten near `step`."""
    digits = -math.floor(math.log10(step))
    return [float(x) for x in np.round(values, digits)]


def motion_in(content: Mapping[str, Any], file: str) -> Motion | None:
    """Return the motion in a model's file; None if it has none.

    Raises
    ------
    InputError
        If its table is damaged.
    """
    table: Any = content.get("trajectory")
    if table is None:
        return None
    try:
        columns = [
            np.array(table[name], dtype=np.float64).ravel() for name in ("time", "position", "velocity")
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{name_file(file)}: its table [trajectory] cannot be read ({error}); identify the axis again"
        ) from None
    return Motion(*columns, source=str(table.get("source", file)))


def motion_of(record: Record, source: str = "") -> Motion:
    """Return the motion of a record: its reference, or if it has none its position, smoothed over some rows.

    Raises
    ------
    InputError
        If it does not move.
    """
    name = next((n for n in REFERENCES if n in record.channels), "position")
    time, position = record.time, np.asarray(record[name], dtype=np.float64)
    known = np.isfinite(position) & np.isfinite(time)
    time, position = time[known], position[known]
    begin, end = _telling(time, position)
    rows = (time >= begin) & (time <= end)
    time, position = time[rows], position[rows]
    if time.size < 2:
        raise InputError(
            f"{source or 'the record'} has too few rows for a motion; give {name_option('motion')} or "
            f"{name_option('amplitude')}"
        )
    every = max((time[-1] - time[0]) / (POINTS - 1), float(np.median(np.diff(time))))
    count = max(2, 1 + round((time[-1] - time[0]) / every))
    at: Array = np.linspace(float(time[0]), float(time[-1]), count)
    if name == "position":
        position = _smoothed(position, max(1, round(every / float(np.median(np.diff(time))))))
    step = 0.5 * float(at[1] - at[0])
    before, here, behind = (np.interp(at + shift, time, position) for shift in (-step, 0.0, step))
    velocity = (behind - before) / (np.minimum(at + step, time[-1]) - np.maximum(at - step, time[0]))
    where = {"position": "position"}.get(name, "reference")
    return Motion(at, here, velocity, f"{where} of {source}, {begin:.4g} to {end:.4g} s" if source else where)


def speeds_of(records: Sequence[Record]) -> dict[str, list[float]]:
    """Return the quantiles (0, 0.1, ..., 1) of the recorded speeds by direction, rad/s, each averaged over `WINDOW`.

    Less than a thousandth of the greatest speed is rest.
    """
    found: list[Array] = []
    for record in records:
        known = np.isfinite(record["position"]) & np.isfinite(record.time)
        time, position = record.time[known], record["position"][known]
        if time.size < 2:
            continue
        begin, end = float(time[0]), float(time[-1])
        grid: Array = np.linspace(begin, end, max(2, 1 + round((end - begin) / WINDOW)))
        found.append(np.diff(np.interp(grid, time, position)) / (grid[1] - grid[0]))
    return speeds_in(np.concatenate(found) if found else np.zeros(0))


def speeds_in(velocity: Array) -> dict[str, list[float]]:
    """Return the quantiles (0, 0.1, ..., 1) of the speeds in either direction, by "positive" and "negative"."""
    rest = 1e-3 * float(np.max(np.abs(velocity), initial=0.0))
    out: dict[str, list[float]] = {}
    for side, name in ((1.0, "positive"), (-1.0, "negative")):
        moving = side * velocity[side * velocity > rest]
        if moving.size >= 10:
            out[name] = [float(f"{v:.4g}") for v in np.quantile(moving, np.linspace(0.0, 1.0, 11))]
    return out


def _telling(time: Array, position: Array) -> tuple[float, float]:
    """Return start and end of the `LONGEST` seconds with the most travel and reversals, from rest if possible."""
    if time.size < 2 or time[-1] - time[0] <= LONGEST:
        return float(time[0]) if time.size else 0.0, float(time[-1]) if time.size else 0.0
    grid = np.arange(time[0], time[-1], 0.02)
    steps = np.diff(np.interp(grid, time, position))
    still = np.abs(steps) < 0.01 * np.max(np.abs(steps))
    moving = np.sign(np.where(still, 0.0, steps))
    last = moving[moving != 0.0]
    turns = np.zeros(steps.size)
    turns[np.flatnonzero(moving)[1:][np.diff(last) != 0.0]] = 1.0
    way = np.concatenate(
        [[0.0], np.cumsum(np.abs(steps) / (np.sum(np.abs(steps)) or 1.0) + turns / (turns.sum() or 1.0))]
    )
    width = round(LONGEST / 0.02)
    score = way[width:] - way[:-width]
    resting = still[: score.size] if np.any(still[: score.size]) else np.ones(score.size, dtype=bool)
    best = int(np.argmax(np.where(resting, score, -1.0)))
    return float(grid[best]), float(min(grid[best] + LONGEST, time[-1]))


def _smoothed(values: Array, rows: int) -> Array:
    """Return the running mean over about twice `rows`, shorter at the ends."""
    width = 2 * rows + 1
    total = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(values.size)
    half = np.minimum(np.minimum(index, values.size - 1 - index), width // 2)
    return (total[index + half + 1] - total[index - half]) / (2 * half + 1)


def sinusoid(amplitude: float, frequency: float) -> Motion:
    """Return two periods of a slow sinusoid that starts at rest at its turning point, rad and Hz."""
    t = np.linspace(0.0, 2.0 / frequency, 401)
    w = 2.0 * math.pi * frequency
    velocity = amplitude * w * np.sin(w * t)
    velocity[[0, -1]] = 0.0
    return Motion(
        t, amplitude * (1.0 - np.cos(w * t)), velocity, f"sinusoid, {amplitude:g} at {frequency:g} Hz"
    )
