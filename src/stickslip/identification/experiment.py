"""A record as the identification of an axis sees it: one motion, what drove it, and the loop around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_columns, name_loop
from stickslip.core.record import Record
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.recorded_input.simulation import Loop, control_signal

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

DRIVES = {
    "torque": "torque", "motor_torque": "torque", "current": "current", "torque_percent": "rated_torque",
    "voltage": "voltage",
}  # fmt: skip
"""Channels that may hold the drive's signal, in the order in which they are looked for, and what they are."""
TORQUES = ("motor_torque", "torque", "sensor_torque", "friction_torque")
"""Channels of a torque that methods without an equation of motion read, in the order in which they are looked for."""
REFERENCES = ("position_reference", "reference")
FASTER, WINDOW = 1.5, 0.1
"""Times as fast that the end of an experiment must be to be fitted instead of its start; s over which a speed is
averaged."""
FEWEST = 50
MEAN_OVER = 0.02
"""s over which `Experiment.velocity` averages."""
ROUNDED = 0.02
"""Part of a row by which the times of evenly spaced samples may be off as they are written."""
SPACING = 1e-3
"""Part of the usual distance between two samples by which equally spaced ones may differ from it."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """One motion of an axis.

    Attributes
    ----------
    name : str
    time : array, shape (n,)
        s, strictly ascending; may be irregular. Times that were rounded are made even, as the samples were.
    position : array, shape (n,)
        At the axis's `seen_from`, rad (m).
    drive : array, shape (n,), or None
        The recorded signal of the drive.
    quantity : str
        What it is: one of `stickslip.machines.servo.DRIVE_QUANTITIES`.
    reference : array, shape (n,), or None
        The reference position, at `seen_from`.
    loop : Loop or None
        The controller that makes the drive's signal from reference and position. With reference and loop the
        closed loop is simulated; without, the recorded drive.
    supply : array, shape (n,), or None
        Factor on the drive's signal, such as the supply voltage under a duty cycle.
    used : array of bool, shape (n,), or None
        Rows that the fit looks at; all where None. The whole record is simulated in any case.
    """

    name: str
    time: Array
    position: Array
    drive: Array | None = None
    quantity: str = "torque"
    reference: Array | None = None
    loop: Loop | None = None
    supply: Array | None = None
    used: Mask | None = None

    def __post_init__(self) -> None:
        if self.time.size < FEWEST:
            raise InputError(f"{self.name}: {self.time.size} samples are too few; give at least {FEWEST}")
        for name in ("time", "position", "drive", "reference", "supply"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != self.time.shape:
                raise InputError(f"{self.name}: {name} has shape {values.shape}, time has {self.time.shape}")
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise InputError(
                    f"{self.name}: {name} is not a number in row {bad[0]}; cut or correct the record"
                )
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if back.size:
            raise InputError(
                f"{self.name}: time does not ascend at row {back[0] + 1} (t = {self.time[back[0] + 1]:g} s); sort it"
            )
        object.__setattr__(self, "time", evened(self.time))
        if self.drive is None and not self.closed_loop:
            raise InputError(
                f"{self.name}: neither the drive's signal nor a reference position with its controller is known; map "
                f"the torque or current ({name_columns(torque='COLUMN:UNIT')}), or the reference "
                f"({name_columns(position_reference='COLUMN')}) "
                f"and give its controller ({name_loop('kp=..,kd=..')})"
            )

    @property
    def closed_loop(self) -> bool:
        """Whether the controller is simulated."""
        return self.reference is not None and self.loop is not None

    @property
    def rows(self) -> Mask:
        """Which rows the fit looks at."""
        return np.ones(self.time.size, dtype=np.bool_) if self.used is None else self.used

    @property
    def period(self) -> float:
        """The usual time between samples, s."""
        return float(np.median(np.diff(self.time)))

    def signal(self) -> Array:
        """The drive's signal: the recorded one, or what the controller makes of the recorded position."""
        if self.drive is not None:
            return self.drive
        assert self.reference is not None
        assert self.loop is not None
        return control_signal(self.loop, self.time, self.reference, self.position)

    def velocity(self) -> Array:
        """Velocity over `MEAN_OVER` seconds about every row, rad/s (m/s)."""
        reach = max(1, round(0.5 * MEAN_OVER / self.period))
        low = np.maximum(np.arange(self.time.size) - reach, 0)
        high = np.minimum(np.arange(self.time.size) + reach, self.time.size - 1)
        return (self.position[high] - self.position[low]) / (self.time[high] - self.time[low])

    def torque(self, axis: ServoAxis, velocity: Array) -> Array:
        """Torque on the axis, N·m, with the motor's own constants."""
        gain, loss = axis.drive_gains(self.quantity)
        supply = 1.0 if self.supply is None else self.supply
        return gain * supply * self.signal() - loss * velocity

    def start(self) -> tuple[float, float]:
        """Position and velocity at the begin: a parabola through the first rows, at rest where it does not move."""
        count = min(15, self.time.size)
        t, q = self.time[:count] - self.time[0], self.position[:count]
        distinct = np.unique(q).size
        # At rest, or within one step of the encoder, a slope would be noise.
        if distinct <= 3:
            return float(np.median(q)), 0.0
        powers = np.vander(t, 3 if distinct > 7 else 2, increasing=True)
        line, *_ = np.linalg.lstsq(powers, q, rcond=None)
        return float(line[0]), float(line[1])

    def split(self, share: float) -> tuple[Experiment, Experiment]:
        """Most of this experiment, and the whole of it looked at in the rest: the last `share` of its time.

        Where the end is faster than all before, the first `share` is looked at instead: laws are judged at speeds that
        they were fitted to.
        """
        first, last = self.time[0], self.time[-1]
        late = self.time >= last - share * (last - first)
        if self.can_begin_later and self.top_speed(late) > FASTER * self.top_speed(~late):
            early = self.time < first + share * (last - first)
            return self.since(int(np.sum(early))), replace(self, used=self.rows & early)
        return self.until(int(np.sum(~late))), replace(self, used=self.rows & late)

    @property
    def can_begin_later(self) -> bool:
        """Whether it can be simulated from any row: what a controller has integrated is not recorded."""
        return not self.closed_loop or (self.loop is not None and not self.loop.integrates)

    def top_speed(self, rows: Mask) -> float:
        """The highest mean speed over `WINDOW` seconds in these rows, rad/s (m/s)."""
        step = max(1, round(WINDOW / self.period))
        q, t = self.position[rows], self.time[rows]
        if q.size <= step:
            return 0.0
        return float(np.max(np.abs(q[step:] - q[:-step]) / (t[step:] - t[:-step])))

    def since(self, row: int) -> Experiment:
        """Its rows from this one on, at least as many as an experiment needs."""
        return self._cut(slice(min(row, self.time.size - FEWEST), None))

    def until(self, rows: int) -> Experiment:
        """Its first rows, at least as many as an experiment needs."""
        return self._cut(slice(max(rows, FEWEST)))

    def _cut(self, rows: slice) -> Experiment:
        arrays = ("time", "position", "drive", "reference", "supply", "used")
        return replace(self, **{n: None if (a := getattr(self, n)) is None else a[rows] for n in arrays})


def insist_on_motion(experiments: Sequence[Experiment]) -> None:
    """Refuse records that say nothing of an axis.

    Raises
    ------
    InputError
        If there is none, nothing moves in any of them, or the drive's signal is 0 in those that move.
    """
    if not experiments:
        raise InputError("no record; give at least one")
    moved = [t for t in experiments if np.ptp(t.position) > 0.0]
    names = ", ".join(t.name for t in experiments)
    if not moved:
        place = experiments[0].position[0]
        raise InputError(
            f"{names}: the position is {place:g} throughout, so that the axis never moved; record a motion, or say "
            f"which column it is ({name_columns(position='COLUMN:UNIT')})"
        )
    if not any(t.drive is None or np.any(t.drive != 0.0) for t in moved):
        raise InputError(
            f"{names}: the drive's signal is 0 wherever the axis moves; check that it was logged, or say which column "
            f"it is ({name_columns(torque='COLUMN:UNIT')})"
        )


def evened(time: Array) -> Array:
    """The times; of evenly spaced samples whose times were rounded as they were written, those that were rounded."""
    if evenly_spaced(time):
        return time
    even: Array = np.linspace(float(time[0]), float(time[-1]), time.size, dtype=np.float64)
    return even if float(np.max(np.abs(time - even))) <= ROUNDED * float(even[1] - even[0]) else time


def evenly_spaced(time: Array) -> bool:
    """Whether every two samples are as far apart as the others, to a thousandth."""
    steps = np.diff(time)
    period = float(np.median(steps))
    return bool(np.max(np.abs(steps - period)) <= SPACING * period)


def experiment_of(
    record: Record, axis: ServoAxis, *, loop: Loop | None = None, name: str = "", output: str = "torque"
) -> Experiment:  # fmt: skip
    """Take an experiment from a record.

    Parameters
    ----------
    record : Record
        With ``position`` (rad or m); the drive's signal as ``torque`` or ``motor_torque`` (N·m), ``current`` (A),
        ``torque_percent`` (% of rated) or ``voltage`` (V); perhaps ``position_reference`` and ``supply``.
    axis : ServoAxis
    loop
        As in `Experiment`.
    output : str
        What the loop's output is where no drive signal is recorded: one of `DRIVE_QUANTITIES`. Times the channel
        ``supply`` where the record has one: of a voltage the loop then gives the duty cycle.

    Raises
    ------
    InputError
        If a channel is missing, or the record cannot be used as it is.
    """
    if "position" not in record.channels:
        raise InputError("the record has no channel 'position'; map one to it")
    if axis.gravity == "pendulum" and "position" in record.meta.get("derived", {}):
        raise InputError(
            "the record has no channel 'position', and a velocity does not say at which angle a pendulum hangs; map "
            f"the position ({name_columns(position='COLUMN:UNIT')})"
        )
    found = next((c for c in DRIVES if c in record.channels), None)
    reference = next((c for c in REFERENCES if c in record.channels), None)
    factor = axis.position_factor
    # A time may occur twice where a simulated signal jumps: the later row counts.
    keep = np.concatenate([np.diff(record.time) != 0.0, [True]])

    def column(name: str) -> Array:
        return np.ascontiguousarray(record[name][keep], dtype=np.float64)

    return Experiment(
        name or str(record.meta.get("source", "record")),
        np.ascontiguousarray(record.time[keep], dtype=np.float64),
        factor * column("position"),
        column(found) if found else None,
        DRIVES.get(found, "torque") if found else output,
        factor * column(reference) if reference else None,
        loop,
        column("supply") if "supply" in record.channels else None,
    )
