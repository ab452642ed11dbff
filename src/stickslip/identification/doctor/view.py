"""The common view of all checks: the usable rows of a record, on an even grid, filtered without phase shift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_columns
from stickslip.core.record import Record, encoder_step
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.filters import ZeroPhase, butterworth_poles
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.machines.servo import ServoAxis
from stickslip.readers.cut import file_rows

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

MAIN = ("position", "velocity", "motor_torque", "friction_torque", "current")
BUILDS_UP = 0.3
"""Part of a stroke after its reversal in which friction may build up: pre-sliding, play, a load that is wound up."""
MOVES, MOST_TRAVEL = 0.05, 0.95
"""Part of a direction's usual speed above which the axis moves in it; part of the travel that is made below the usual
speed."""
BOTH_WAYS, NEVER = 0.05, 1e-3
"""Parts of the travel in one direction: above the first, travel in the other is genuine motion (a test that creeps
forward and runs back); below the second, it is the rebound of a stop."""
MAX_ROWS = 200_000
"""Most rows of the even grid: longer records are resampled more coarsely."""


@dataclass(frozen=True, slots=True)
class Column:
    """How a channel was read.

    The column in the file, its unit and whether it is stated, whether the name indicates a command, and whether a
    profile sets the unit.
    """

    name: str
    unit: str
    stated: bool
    commanded: bool = False
    by_profile: bool = False


@dataclass(frozen=True, eq=False)
class Smooth:
    """Filtered signals on an even grid.

    Attributes
    ----------
    period : float
        Sample period, s.
    position, velocity, acceleration, torque : array, shape (n,)
        Zero-phase filtered alike; torque is empty if the record has none.
    """

    period: float
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array

    @cached_property
    def fast(self) -> float:
        """The speed that is exceeded 5 % of the time."""
        return float(np.percentile(np.abs(self.velocity), 95)) if self.velocity.size else 0.0

    @cached_property
    def travel(self) -> tuple[float, float]:
        """Longest travel forward and longest travel backward, rad (m)."""
        q = self.position
        forward, backward = q - np.minimum.accumulate(q), np.maximum.accumulate(q) - q
        return float(np.max(forward)), float(np.max(backward))

    def usual_speed(self, sign: float) -> float:
        """Return the speed below which `MOST_TRAVEL` of the travel in one direction is made, rad/s (m/s)."""
        speed = np.sort(sign * self.velocity)
        travelled = np.cumsum(np.maximum(speed, 0.0))
        return float(speed[np.searchsorted(travelled, MOST_TRAVEL * travelled[-1])])

    @cached_property
    def moving(self) -> Mask:
        """Mask of moving rows: faster than `MOVES` of `fast`, or of the usual speed of a slower direction."""
        v = self.velocity
        if min(self.travel) < BOTH_WAYS * max(self.travel):
            return np.asarray(np.abs(v) > MOVES * self.fast)
        forward, backward = (MOVES * min(self.fast, self.usual_speed(sign)) for sign in (1.0, -1.0))
        return np.asarray((v > forward) | (v < -backward))

    @cached_property
    def standstill(self) -> float:
        """Usual length of a standstill, rows; 0 without standstills."""
        turns = np.flatnonzero(np.diff(self.moving))
        stops = turns[np.argmax(self.moving[turns]) :] if turns.size else turns
        return float(np.median(np.diff(stops)[::2])) if stops.size > 1 else 0.0

    @cached_property
    def gone_on(self) -> Mask:
        """Mask of rows after `BUILDS_UP` of their stroke."""
        first = np.flatnonzero(np.diff(np.sign(self.velocity), prepend=0.0) != 0.0)
        last = np.append(first[1:], self.velocity.size) - 1
        stroke = np.repeat(np.arange(first.size), last - first + 1)
        start, end = self.position[first], self.position[last]
        gone = np.abs(self.position[-stroke.size :] - start[stroke])
        after = np.asarray(gone > BUILDS_UP * np.abs(end - start)[stroke])
        return np.concatenate([np.zeros(self.velocity.size - after.size, dtype=np.bool_), after])


def is_number(values: Array) -> Mask:
    """Return a mask of values that are finite and whose square does not overflow."""
    return np.asarray(np.abs(np.nan_to_num(values, nan=np.inf)) < 1e100)


class View:
    """A record with the derived data that the checks use."""

    def __init__(self, record: Record, estimate: EstimateSliding = estimate_sliding) -> None:
        self.record, self.estimate = record, estimate

    @cached_property
    def columns(self) -> dict[str, Column]:
        """How every channel was read; a record that was not read from a file states its units."""
        listed: list[dict[str, Any]] = self.record.meta.get("reading", {}).get("columns", [])
        return {
            c["channel"]: Column(
                c["column"],
                c["unit"],
                c["source"] != "assumed",
                c.get("commanded", False),
                c["source"] == "profile",
            )
            for c in listed
        }

    @property
    def unused_drives(self) -> list[str]:
        """Unused columns with a unit of torque, force, current or a share."""
        return list(self.record.meta.get("reading", {}).get("drives", []))

    def stated(self, channel: str) -> bool:
        """Return whether the channel's unit is stated."""
        return self.columns[channel].stated if channel in self.columns else True

    def commanded(self, channel: str) -> bool:
        """Return whether the column's name indicates a command."""
        if channel == "motor_torque" and self.from_current:
            channel = "current"
        return channel in self.columns and self.columns[channel].commanded

    def name(self, channel: str) -> str:
        """Return the channel's column in the file, for a remedy."""
        return self.columns[channel].name if channel in self.columns else channel

    def mapped(self, channel: str, unit: str) -> str:
        """Return the option that reads the channel in another unit; "-" inverts the present sign."""
        # A torque that was computed from the current has no column of its own.
        if channel == "motor_torque" and self.from_current:
            channel = "current"
        if unit == "-":
            own = self.columns[channel].unit if channel in self.columns else self.record.units[channel]
            unit = own[1:].lstrip() if own.startswith("-") else f"-{own}"
        return name_columns(**{channel: f"{self.name(channel)}:{unit}"})

    @property
    def from_current(self) -> bool:
        """Whether the motor's torque was computed from the current: findings on one apply to the other."""
        return self.has("motor_torque") and "motor_torque" not in self.columns and "current" in self.columns

    @cached_property
    def file_rows(self) -> Any:
        """The number in the file of every row, from 1."""
        return file_rows(self.record)

    def has(self, channel: str) -> bool:
        """Return whether the record has the channel."""
        return channel in self.record.channels

    @property
    def linear(self) -> bool:
        """Whether the axis is linear."""
        units = self.record.units
        return (units.get("position") or units.get("velocity", "")) in ("m", "m/s")

    @property
    def effort(self) -> str:
        """The unit of the drive's torque or force, as `--map` accepts it."""
        return "N" if self.linear else "Nm"

    @cached_property
    def torque_channel(self) -> str:
        """Channel that drives the axis: the motor's torque, a measured friction, or ""."""
        return next((c for c in ("motor_torque", "friction_torque") if self.has(c)), "")

    @cached_property
    def usable(self) -> Any:
        """Mask of rows whose times increase and whose main channels are finite."""
        time = self.record.time
        good = is_number(time)
        for channel in MAIN:
            if self.has(channel):
                good &= is_number(self.record[channel])
        if self.has("event"):
            good &= ~(self.record["event"] > 0.5)
        safe = np.where(good, time, -math.inf)
        before = np.maximum.accumulate(np.concatenate(([-math.inf], safe[:-1])))
        return good & (time > before)

    @cached_property
    def time(self) -> Array:
        """Usable times, s."""
        return self.record.time[self.usable]

    def values(self, channel: str) -> Array:
        """Return usable values of a channel."""
        return self.record[channel][self.usable]

    @cached_property
    def period(self) -> float:
        """Median sample period, s."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else math.nan

    @cached_property
    def step(self) -> float:
        """The step of the position's encoder, in the position's unit; 0 if there is none."""
        return encoder_step(self.values("position")) if self.has("position") else 0.0

    @cached_property
    def sliding(self) -> SlidingPosterior | None:
        """Estimate from gross sliding; None without gross sliding, or without the position and torque of a motor."""
        if self.torque_channel != "motor_torque" or not self.has("position"):
            return None
        motion = "linear" if self.linear else "rotary"
        torque = self.values("motor_torque")
        try:
            return self.estimate(
                [Experiment("record", self.time, self.values("position"), torque)],
                ServoAxis(motion=motion, drive_side="load"),
            )
        except (InputError, np.linalg.LinAlgError):
            return None

    @cached_property
    def smooth(self) -> Smooth | None:
        """Filtered signals; None if there are too few samples to filter."""
        if self.time.size < 30 or not (self.has("position") or self.has("velocity")):
            return None
        span = float(self.time[-1] - self.time[0])
        count = min(round(span / self.period) + 1, MAX_ROWS)
        if count < 30:
            return None
        period = span / (count - 1)
        with np.errstate(all="ignore"):
            if self.has("position"):
                position = self.filtered("position", count)
                velocity = np.gradient(position, period)
            else:
                velocity = self.filtered("velocity", count)
                position = np.cumsum(velocity) * period
            torque = self.filtered(self.torque_channel, count) if self.torque_channel else np.empty(0)
            out = Smooth(period, position, velocity, np.gradient(velocity, period), torque)
        every = (out.position, out.velocity, out.acceleration, out.torque)
        return out if all(np.isfinite(values).all() for values in every) else None

    @cached_property
    def given_velocity(self) -> Array:
        """The velocity's own column, filtered as in `smooth`, which halves short steps."""
        return self.filtered("velocity", self.smooth.velocity.size if self.smooth else 0)

    def filtered(self, channel: str, count: int) -> Array:
        """Return a channel at `count` even times, zero-phase filtered, shape (count,)."""
        grid = np.linspace(float(self.time[0]), float(self.time[-1]), count)
        raw = np.interp(grid, self.time, self.values(channel))
        begin = raw[0] if channel == "position" else 0.0
        return ZeroPhase(butterworth_poles(2), 0.08, 2.0, reach=30)(raw - begin) + begin


def row(index: int, view: View) -> str:
    """Return a row's number in the file, from 1, and its time if that is known."""
    number = view.file_rows[index]
    if math.isfinite(view.record.time[index]):
        return f"row {number}, t = {view.record.time[index]:.6g} s"
    return f"row {number}"
