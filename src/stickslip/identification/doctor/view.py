"""What the checks look at: the usable rows of a record, on an even grid, filtered without phase."""

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
"""Of a stroke, behind its reversal, in which friction may build up: pre-sliding, play, a load that is wound up. In
three slow sines it was a tenth; behind it what a torque once a turn explained was a thousandth of what it had been."""
MOVES, MOST_TRAVEL = 0.05, 0.95
"""Part of the usual speed of a direction above which the axis moves in it; and the part of the travel in a direction
below whose speed that much of it is travelled."""
BOTH_WAYS, NEVER = 0.05, 1e-3
"""Parts of the travel in one direction: from which on the travel in the other is motion in its own right (a test that
creeps forward and runs back), and below which it is what a stop swings back."""
MAX_ROWS = 200_000
"""Rows of the even grid: longer records are looked at more coarsely."""


@dataclass(frozen=True, slots=True)
class Column:
    """How a channel was read: the column in the file, whether anybody states its unit, whether its name says that it
    is a command, and whether a profile says the unit."""

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
        s
    position, velocity, acceleration, torque : array, shape (n,)
        Zero-phase filtered alike; torque is empty where the record has none.
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
        """Rows in which the axis moves: faster than `MOVES` of `fast`, or of the usual speed of a slower direction."""
        v = self.velocity
        if min(self.travel) < BOTH_WAYS * max(self.travel):
            return np.asarray(np.abs(v) > MOVES * self.fast)
        forward, backward = (MOVES * min(self.fast, self.usual_speed(sign)) for sign in (1.0, -1.0))
        return np.asarray((v > forward) | (v < -backward))

    @cached_property
    def standstill(self) -> float:
        """Rows that the axis usually does not move for, before it moves again; 0 where it always does."""
        turns = np.flatnonzero(np.diff(self.moving))
        stops = turns[np.argmax(self.moving[turns]) :] if turns.size else turns
        return float(np.median(np.diff(stops)[::2])) if stops.size > 1 else 0.0

    @cached_property
    def gone_on(self) -> Mask:
        """Where the axis has gone `BUILDS_UP` of its stroke since it turned, mask."""
        first = np.flatnonzero(np.diff(np.sign(self.velocity), prepend=0.0) != 0.0)
        last = np.append(first[1:], self.velocity.size) - 1
        stroke = np.repeat(np.arange(first.size), last - first + 1)
        start, end = self.position[first], self.position[last]
        gone = np.abs(self.position[-stroke.size :] - start[stroke])
        after = np.asarray(gone > BUILDS_UP * np.abs(end - start)[stroke])
        return np.concatenate([np.zeros(self.velocity.size - after.size, dtype=np.bool_), after])


def is_number(values: Array) -> Mask:
    """Where values are finite, and not so large that their square overflows; mask."""
    return np.asarray(np.abs(np.nan_to_num(values, nan=np.inf)) < 1e100)


class View:
    """A record as the checks see it."""

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
        """Columns that no channel is made of, with a unit of torque, force, current or a share."""
        return list(self.record.meta.get("reading", {}).get("drives", []))

    def stated(self, channel: str) -> bool:
        """Whether anybody states the channel's unit."""
        return self.columns[channel].stated if channel in self.columns else True

    def commanded(self, channel: str) -> bool:
        """Whether the column's name says that it is a command."""
        if channel == "motor_torque" and self.from_current:
            channel = "current"
        return channel in self.columns and self.columns[channel].commanded

    def name(self, channel: str) -> str:
        """The channel's column in the file, for a remedy."""
        return self.columns[channel].name if channel in self.columns else channel

    def mapped(self, channel: str, unit: str) -> str:
        """The option that reads the channel in another unit; "-" turns the sign of the present one."""
        # A torque that was computed from the current has no column of its own.
        if channel == "motor_torque" and self.from_current:
            channel = "current"
        if unit == "-":
            own = self.columns[channel].unit if channel in self.columns else self.record.units[channel]
            unit = own[1:].lstrip() if own.startswith("-") else f"-{own}"
        return name_columns(**{channel: f"{self.name(channel)}:{unit}"})

    @property
    def from_current(self) -> bool:
        """Whether the motor's torque was computed from the current: what one shows the other does, too."""
        return self.has("motor_torque") and "motor_torque" not in self.columns and "current" in self.columns

    @cached_property
    def file_rows(self) -> Any:
        """The number in the file of every row, from 1."""
        return file_rows(self.record)

    def has(self, channel: str) -> bool:
        """Whether the record has the channel."""
        return channel in self.record.channels

    @property
    def linear(self) -> bool:
        """Whether the axis moves along a line."""
        units = self.record.units
        return (units.get("position") or units.get("velocity", "")) in ("m", "m/s")

    @property
    def effort(self) -> str:
        """The unit of what drives the axis, as `--map` takes it."""
        return "N" if self.linear else "Nm"

    @cached_property
    def torque_channel(self) -> str:
        """What drives the axis: the motor's torque, a measured friction, or nothing."""
        return next((c for c in ("motor_torque", "friction_torque") if self.has(c)), "")

    @cached_property
    def usable(self) -> Any:
        """Rows whose time ascends and whose main channels are numbers, mask."""
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
        """Usable values of a channel."""
        return self.record[channel][self.usable]

    @cached_property
    def period(self) -> float:
        """The usual distance of two samples, s."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else math.nan

    @cached_property
    def step(self) -> float:
        """The step of the position's encoder, in the position's unit; 0 where there is none."""
        return encoder_step(self.values("position")) if self.has("position") else 0.0

    @cached_property
    def sliding(self) -> SlidingPosterior | None:
        """What gross sliding says; None where the record has none, or no position and torque of a motor."""
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
        """Filtered signals; None where there is too little to filter."""
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
        """The velocity's own column, filtered as `smooth` is; of short steps the filter takes half."""
        return self.filtered("velocity", self.smooth.velocity.size if self.smooth else 0)

    def filtered(self, channel: str, count: int) -> Array:
        """A channel at so many even times, zero-phase filtered, shape (count,)."""
        grid = np.linspace(float(self.time[0]), float(self.time[-1]), count)
        raw = np.interp(grid, self.time, self.values(channel))
        begin = raw[0] if channel == "position" else 0.0
        return ZeroPhase(butterworth_poles(2), 0.08, 2.0, reach=30)(raw - begin) + begin


def row(index: int, view: View) -> str:
    """Where a row of the record is: its number in the file, from 1, and its time if that is known."""
    number = view.file_rows[index]
    if math.isfinite(view.record.time[index]):
        return f"row {number}, t = {view.record.time[index]:.6g} s"
    return f"row {number}"
