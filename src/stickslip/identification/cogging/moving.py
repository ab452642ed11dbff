"""A map against records in motion: whether it explains their torque, or must not be applied; who made the torque."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.record import Record
from stickslip.identification.cogging.rows import FASTEST, velocity_of
from stickslip.machines.position_map import PositionMap

Array = np.ndarray[Any, np.dtype[np.float64]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]

SAMPLES = 8.0
"""Rows of a period of the strongest order, at least, for a map to be visible in a record."""
CORNER = 100.0
"""Hz, of the zero-phase low-pass on torque, angle and map."""
STEADY = 0.05
"""Part of a torque's variation that a straight line in the velocity leaves, where a speed controller made it."""
STRETCHES = 16
STILL = 1e-6
"""Variance of a constant velocity, of its square."""
LATE = 5
"""Rows by which the velocity's column may be ahead of the torque's, or behind."""
MOVES = 0.2
"""Of the usual speed, below which friction may pass from one side to the other: not judged."""
LONGEST = 100_000
"""Rows, of which delays are sought."""
DELAYS = 10
"""Tenths of a row by which the torque may be recorded late or early, each way."""


@dataclass(frozen=True)
class Motion:
    """A record in motion. RMS of the torque that is left on its second half, the first one having been fitted."""

    with_map: float
    without: float
    friction: float
    inertia: float
    speed: float
    visible: bool
    delay: float = 0.0
    """s by which the torque is recorded late."""


def in_motion(record: Record, torque: str, found: PositionMap) -> Motion | None:
    """Torque = map + friction sgn(v) + inertia dv/dt: fitted on the first half, judged on the second.

    The acceleration is the recorded velocity's or the angle's, whichever leaves less on the first half: rows that a
    computer stamps late spoil a second derivative of the angle, a velocity made in the drive only lags.

    None for a record that does not move faster than `FASTEST`.
    """
    t, q = record.time, record["position"]
    v = velocity_of(record)
    speed = float(np.median(np.abs(v)))
    if speed <= FASTEST or t.size < 200 or not found.even.order:
        return None
    strongest = found.even.order[int(np.argmax(found.even.amplitude))]
    period = float(np.median(np.diff(t)))
    if strongest * speed * period > 2.0 * math.pi / SAMPLES:
        return Motion(math.nan, math.nan, math.nan, math.nan, speed, False)
    grid = np.arange(t[0], t[-1], period)[:LONGEST]
    spectral = Spectral(grid.size, period)
    angle = np.interp(grid, t, q)
    drift = (angle[-1] - angle[0]) / (grid[-1] - grid[0])
    rest = angle - angle[0] - drift * (grid - grid[0])
    y, known = spectral(np.interp(grid, t, record[torque])), found.beside(angle) + found.offset
    after = {float(d): y - spectral(known, 0, d) for d in np.arange(-DELAYS, DELAYS + 1) * 0.1 * period}
    ways = [(drift + spectral(rest, 1, d), spectral(rest, 2, d), {d: x}) for d, x in after.items()]
    if "velocity" in record.channels:
        own = np.interp(grid, t, record["velocity"])
        mean = float(np.mean(own))
        swing = own - mean
        late = np.arange(-10 * LATE, 10 * LATE + 1) * 0.1 * period
        ways += [(mean + spectral(swing, 0, d), spectral(swing, 1, d), after) for d in late]
    inner = np.abs(grid - 0.5 * (grid[0] + grid[-1])) < 0.48 * (grid[-1] - grid[0])
    inner &= np.abs(drift + spectral(rest, 1)) > MOVES * speed
    first = np.arange(grid.size) < grid.size // 2
    tries = [
        _judged(np.column_stack([spectral(np.sign(v)), a]), y, x, inner & first, inner & ~first)
        for v, a, x in ways
    ]
    return replace(min(tries, key=lambda one: one[0])[1], speed=speed)


def _judged(
    matrix: Array, torque: Array, after: Mapping[float, Array], fitted: Flags, judged: Flags
) -> tuple[float, Motion]:
    """What friction and inertia leave where they are fitted, with the delay of the map that leaves least."""
    solve = np.linalg.pinv(matrix[fitted])

    def left(torque: Array) -> tuple[float, float, Array]:
        values = solve @ torque[fitted]
        squares = (torque - matrix @ values) ** 2
        return math.sqrt(float(np.mean(squares[fitted]))), math.sqrt(float(np.mean(squares[judged]))), values

    tries = [(delay, *left(torque)) for delay, torque in after.items()]
    delay, least, with_map, values = min(tries, key=lambda one: one[1])
    return least, Motion(with_map, left(torque)[1], float(values[0]), float(values[1]), math.nan, True, delay)


class Spectral:
    """A zero-phase low-pass with exact derivatives, by the Fourier transform; its ends are not to be used."""

    def __init__(self, size: int, period: float) -> None:
        hertz = np.fft.rfftfreq(size, period)
        self.size, self.shape, self.along = size, 1.0 / (1.0 + (hertz / CORNER) ** 4), 2j * math.pi * hertz

    def __call__(self, x: Array, derivatives: int = 0, delay: float = 0.0) -> Array:
        """The signal, filtered, differentiated so often, later by so many s."""
        factor = self.shape * self.along**derivatives * np.exp(-delay * self.along)
        return np.fft.irfft(np.fft.rfft(x) * factor, self.size)


def speed_control(record: Record, torque: str) -> tuple[float, float] | None:
    """Slope, and share left, of the straight line of a torque over the velocity that a speed controller made.

    A controller's torque falls as the measured speed rises and is a straight line of it, stretch by stretch; friction
    rises with it.
    """
    if "velocity" not in record.channels:
        return None
    v, y = record["velocity"], record[torque]
    best: tuple[float, float] | None = None
    for rows in np.array_split(np.arange(v.size), STRETCHES):
        for late in range(-LATE, LATE + 1):
            own = rows[(rows - late >= 0) & (rows - late < v.size)]
            along = v[own - late]
            if own.size < 20:
                continue
            (vv, vy), (_, yy) = np.cov(along, y[own])
            if yy <= 0.0 or vv <= STILL * float(np.mean(along**2)):
                continue
            slope, left = vy / vv, max(0.0, 1.0 - vy**2 / (vv * yy))
            if slope < 0.0 and math.sqrt(left) < STEADY and (best is None or left < best[1]):
                best = float(slope), left
    return best
