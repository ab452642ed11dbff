"""A map against records in motion: whether it explains their torque or must not be applied, and the torque's source."""

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
"""Fewest rows per period of the strongest order for a map to be visible in a record."""
CORNER = 100.0
"""Corner of the zero-phase low-pass on torque, angle and map, Hz."""
STEADY = 0.05
"""Greatest unexplained part of a torque's variation for a line in the velocity to indicate a speed controller."""
STRETCHES = 16
STILL = 1e-6
"""Greatest variance of a constant velocity, part of its square."""
LATE = 5
"""Greatest offset of the velocity's column relative to the torque's, rows, in either direction."""
MOVES = 0.2
"""Part of the usual speed below which friction may be changing sign and is not judged."""
LONGEST = 100_000
"""Most rows in the search for delays."""
DELAYS = 10
"""Greatest offset of the recorded torque in either direction, tenths of a row."""


@dataclass(frozen=True)
class Motion:
    """A record in motion: RMS of the residual torque on its second half, after a fit to the first half."""

    with_map: float
    without: float
    friction: float
    inertia: float
    speed: float
    visible: bool
    delay: float = 0.0
    """Delay of the recorded torque, s."""


def in_motion(record: Record, torque: str, found: PositionMap) -> Motion | None:
    """Fit torque = map + friction sgn(v) + inertia dv/dt on the first half of a record, and judge it on the second.

    The acceleration is the recorded velocity's or the angle's, whichever has the smaller residual on the first half:
    rows with delayed time stamps of a computer corrupt a second derivative of the angle; a velocity from the drive only
    lags.

    Return None for a record that does not move faster than `FASTEST`.
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
    """Return the residual of friction and inertia where they are fitted, with the best delay of the map."""
    solve = np.linalg.pinv(matrix[fitted])

    def left(torque: Array) -> tuple[float, float, Array]:
        values = solve @ torque[fitted]
        squares = (torque - matrix @ values) ** 2
        return math.sqrt(float(np.mean(squares[fitted]))), math.sqrt(float(np.mean(squares[judged]))), values

    tries = [(delay, *left(torque)) for delay, torque in after.items()]
    delay, least, with_map, values = min(tries, key=lambda one: one[1])
    return least, Motion(with_map, left(torque)[1], float(values[0]), float(values[1]), math.nan, True, delay)


class Spectral:
    """A zero-phase low-pass with exact derivatives, by the Fourier transform; its ends are invalid."""

    def __init__(self, size: int, period: float) -> None:
        hertz = np.fft.rfftfreq(size, period)
        self.size, self.shape, self.along = size, 1.0 / (1.0 + (hertz / CORNER) ** 4), 2j * math.pi * hertz

    def __call__(self, x: Array, derivatives: int = 0, delay: float = 0.0) -> Array:
        """Return the filtered signal, with this number of derivatives, delayed by `delay` s."""
        factor = self.shape * self.along**derivatives * np.exp(-delay * self.along)
        return np.fft.irfft(np.fft.rfft(x) * factor, self.size)


def speed_control(record: Record, torque: str) -> tuple[float, float] | None:
    """Return slope and unexplained share of a line of torque over velocity that a speed controller made; None without.

    A controller's torque decreases with the measured speed and is a line of it in each segment; friction increases with
    it.
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
