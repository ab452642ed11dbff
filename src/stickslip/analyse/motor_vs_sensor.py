"""Compare motor torque with sensor torque: friction of the bearings in between; thesis figures 4.5, 4.8, 4.10, 4.31,
4.34.

The motor's torque moves the whole axis; a torque sensor measures the friction disk alone. During sliding their
difference is the friction of the parts in between, plus the torque of the inertia. The thesis finds it "similar to the
Coulomb with viscous friction".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.analyse.spectrum import channel_of
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

WINDOW = 0.1
"""Averaging time of both torques, s: the sensor's noise exceeds the difference of interest."""
MOVES = 1e-3
"""rad/s below which the axis counts as at rest."""
FEWEST = 8


@dataclass(frozen=True)
class Point:
    """Means over one record while it moves in one direction: velocity (rad/s), torques (N·m)."""

    name: str
    velocity: float
    motor: float
    sensor: float


@dataclass(frozen=True, eq=False)
class Sides:
    """The two torques of one or more records.

    Attributes
    ----------
    points : tuple of Point
        One per record and direction.
    velocity, motor, sensor : array, shape (n,)
        Averages over 0.1 s in motion, rad/s and N·m; the motor torque without J dv/dt if an inertia was given.
    coulomb, viscous, offset : float
        The difference as coulomb sign(v) + viscous v + offset: N·m, N·m·s/rad, N·m. ``viscous`` and ``offset`` are 0 if
        there is only one speed or one direction.
    residual : float
        RMS of the residual of the difference, N·m.
    correlation : float
        Of the two torques, separately for each direction: 1 if their shapes agree.
    """

    points: tuple[Point, ...]
    velocity: Array
    motor: Array
    sensor: Array
    coulomb: float
    viscous: float
    offset: float
    residual: float
    correlation: float

    def difference(self, velocity: Array) -> Array:
        """Return the fitted difference at velocities, N·m."""
        return self.coulomb * np.sign(velocity) + self.viscous * velocity + self.offset

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, without the samples."""
        return {
            "points": [vars(p) for p in self.points], "coulomb": self.coulomb, "viscous": self.viscous,
            "offset": self.offset, "residual": self.residual, "correlation": self.correlation,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        rows = [
            f"{p.name}: {p.velocity:+.4g} rad/s, motor {p.motor:+.4f}, sensor {p.sensor:+.4f}, "
            f"difference {p.motor - p.sensor:+.4f} N·m"
            for p in self.points
        ]
        law = f"{self.coulomb:.4g} N·m sign(v) + {self.viscous:.4g} N·m·s/rad v + {self.offset:.2g} N·m"
        return [
            *rows,
            f"motor minus sensor: {law}, residual {self.residual:.2g} N·m RMS",
            f"correlation of the shapes: {self.correlation:.3f}",
        ]


def sides(records: Mapping[str, Record], inertia: float = 0.0) -> Sides:
    """Compare ``motor_torque`` with ``sensor_torque`` while the axis slides.

    Parameters
    ----------
    records : mapping of str to Record
        By name; channels ``position`` or ``velocity``, ``motor_torque``, ``sensor_torque``.
    inertia : float
        kg·m²: its torque is subtracted from the motor's; 0 for motion at constant velocity.

    Raises
    ------
    InputError
        If a record has no sensor, or none moves.
    """
    if not 0.0 <= inertia < math.inf:
        raise ParameterError(f"sides: inertia = {inertia:g} kg·m² must be a finite number of 0 or more")
    points: list[Point] = []
    parts: list[Array] = []
    for name, record in records.items():
        table = _averaged(record, inertia)
        parts.append(table)
        for sign in (1.0, -1.0):
            rows = table[sign * table[:, 0] > 0.0]
            if len(rows):
                points.append(Point(name, *(float(x) for x in rows.mean(axis=0))))
    table = np.concatenate(parts) if parts else np.empty((0, 3))
    if len(table) < FEWEST:
        raise InputError(
            f"sides: {len(table)} averages of {WINDOW:g} s in motion are too few; give records that slide for longer"
        )
    v, motor, sensor = table.T
    coulomb, viscous, offset = _fit(v, motor - sensor)
    left = motor - sensor - (coulomb * np.sign(v) + viscous * v + offset)
    return Sides(
        tuple(points), v, motor, sensor, coulomb, viscous, offset, math.sqrt(float(np.mean(left**2))),
        _alike(v, motor, sensor),
    )  # fmt: skip


def _averaged(record: Record, inertia: float) -> Array:
    """Return velocity, motor and sensor torque, averaged over windows of motion in one direction; shape (n, 3)."""
    v, _ = channel_of(record, "velocity")
    sensor = record["sensor_torque"]
    if not np.any(np.isfinite(sensor)):
        raise InputError("sides: sensor_torque has no numbers; give a record of a rig with a torque sensor")
    window = np.floor((record.time - record.time[0]) / WINDOW).astype(np.int64)
    edges = np.flatnonzero(np.diff(window, prepend=-1))
    counts = np.diff(np.append(edges, v.size))

    def mean(x: Array) -> Array:
        return np.add.reduceat(x, edges) / counts

    speed = mean(v)
    # The mean acceleration over a window is the change of velocity from window to window.
    motor = mean(record["motor_torque"])
    if speed.size > 1:
        motor = motor - inertia * np.gradient(speed, WINDOW)
    way = np.where(np.abs(speed) > MOVES, np.sign(speed), 0.0)
    beside = np.pad(way, 1)
    # A window next to a reversal or a stop contains two kinds of motion; the last one may be incomplete.
    steady = (way != 0.0) & (beside[:-2] == way) & (beside[2:] == way)
    return np.column_stack([speed, motor, mean(sensor)])[steady]


def _fit(v: Array, difference: Array) -> tuple[float, float, float]:
    """Return Coulomb, viscous and constant part of the difference, as far as the motion separates them."""
    columns, places = [np.sign(v)], [0]
    if np.ptp(np.abs(v)) > 0.1 * float(np.max(np.abs(v))):
        columns.append(v)
        places.append(1)
    if v.min() < 0.0 < v.max():
        columns.append(np.ones_like(v))
        places.append(2)
    found = np.linalg.lstsq(np.column_stack(columns), difference, rcond=None)[0]
    out = [0.0, 0.0, 0.0]
    for place, value in zip(places, found, strict=True):
        out[place] = float(value)
    return out[0], out[1], out[2]


def _alike(v: Array, motor: Array, sensor: Array) -> float:
    """Return the smallest correlation over the directions; NaN if neither torque changes."""
    found: list[float] = []
    for sign in (1.0, -1.0):
        rows = sign * v > 0.0
        if rows.sum() > 2 and np.ptp(motor[rows]) > 0.0 and np.ptp(sensor[rows]) > 0.0:
            found.append(float(np.corrcoef(motor[rows], sensor[rows])[0, 1]))
    return min(found, default=math.nan)
