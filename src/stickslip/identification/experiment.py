"""One record prepared for identification: a motion, the signal that drove it, and the control loop around it."""

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
"""Channels that may contain the drive's signal, in order of preference, with the quantity of each."""
TORQUES = ("motor_torque", "torque", "sensor_torque", "friction_torque")
"""Torque channels read by methods without an equation of motion, in order of preference."""
REFERENCES = ("position_reference", "reference")
FASTER, WINDOW = 1.5, 0.1
"""Ratio of top speeds from which the end of an experiment is fitted instead of its start; averaging time of a speed,
s."""
FEWEST = 50
MEAN_OVER = 0.02
"""Averaging time of `Experiment.velocity`, s."""
ROUNDED = 0.02
"""Rounding of evenly spaced times, as a part of the sample period."""
SPACING = 1e-3
"""Relative tolerance of the distance between equally spaced samples."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """One motion of an axis.

    Attributes
    ----------
    name : str
    time : array, shape (n,)
        s, strictly increasing; may be irregular. Rounded times of evenly spaced samples are made even.
    position : array, shape (n,)
        Position at the axis's `seen_from`, rad (m).
    drive : array, shape (n,), or None
        The recorded signal of the drive.
    quantity : str
        Quantity of `drive`: one of `stickslip.machines.servo.DRIVE_QUANTITIES`.
    reference : array, shape (n,), or None
        The reference position at `seen_from`, rad (m).
    loop : Loop or None
        The controller that computes the drive's signal from reference and position. With reference and loop the closed
        loop is simulated; otherwise the recorded drive signal is applied.
    supply : array, shape (n,), or None
        Factor on the drive's signal, such as the supply voltage under a duty cycle.
    used : array of bool, shape (n,), or None
        Rows that are fitted; None for all. The whole record is simulated in any case.
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
        """Mask of the rows that are fitted."""
        return np.ones(self.time.size, dtype=np.bool_) if self.used is None else self.used

    @property
    def period(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    def signal(self) -> Array:
        """Return the drive's signal: the recorded one, or the controller's output for the recorded position."""
        if self.drive is not None:
            return self.drive
        assert self.reference is not None
        assert self.loop is not None
        return control_signal(self.loop, self.time, self.reference, self.position)

    def velocity(self) -> Array:
        """Return the velocity averaged over `MEAN_OVER` seconds about every row, rad/s (m/s)."""
        reach = max(1, round(0.5 * MEAN_OVER / self.period))
        low = np.maximum(np.arange(self.time.size) - reach, 0)
        high = np.minimum(np.arange(self.time.size) + reach, self.time.size - 1)
        return (self.position[high] - self.position[low]) / (self.time[high] - self.time[low])

    def torque(self, axis: ServoAxis, velocity: Array) -> Array:
        """Return the torque on the axis with the motor's own constants, N·m (N)."""
        gain, loss = axis.drive_gains(self.quantity)
        supply = 1.0 if self.supply is None else self.supply
        return gain * supply * self.signal() - loss * velocity

    def start(self) -> tuple[float, float]:
        """Return position and velocity at the start, from a parabola through the first rows; velocity 0 at rest."""
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
        """Return most of this experiment to fit, and the last `share` of its time to hold out.

        If the end is faster than everything before it, the first `share` is held out instead: laws are judged at speeds
        to which they were fitted.
        """
        first, last = self.time[0], self.time[-1]
        late = self.time >= last - share * (last - first)
        if self.can_begin_later and self.top_speed(late) > FASTER * self.top_speed(~late):
            early = self.time < first + share * (last - first)
            return self.since(int(np.sum(early))), replace(self, used=self.rows & early)
        return self.until(int(np.sum(~late))), replace(self, used=self.rows & late)

    @property
    def can_begin_later(self) -> bool:
        """Whether it can be simulated from any row: the state of an integrating controller is not recorded."""
        return not self.closed_loop or (self.loop is not None and not self.loop.integrates)

    def top_speed(self, rows: Mask) -> float:
        """Return the highest mean speed over `WINDOW` seconds in these rows, rad/s (m/s)."""
        step = max(1, round(WINDOW / self.period))
        q, t = self.position[rows], self.time[rows]
        if q.size <= step:
            return 0.0
        return float(np.max(np.abs(q[step:] - q[:-step]) / (t[step:] - t[:-step])))

    def since(self, row: int) -> Experiment:
        """Return the rows from this one on, at least as many as an experiment needs."""
        return self._cut(slice(min(row, self.time.size - FEWEST), None))

    def until(self, rows: int) -> Experiment:
        """Return the first rows, at least as many as an experiment needs."""
        return self._cut(slice(max(rows, FEWEST)))

    def _cut(self, rows: slice) -> Experiment:
        arrays = ("time", "position", "drive", "reference", "supply", "used")
        return replace(self, **{n: None if (a := getattr(self, n)) is None else a[rows] for n in arrays})


def insist_on_motion(experiments: Sequence[Experiment]) -> None:
    """Refuse records without motion or drive signal.

    Raises
    ------
    InputError
        If there is no record, no record moves, or the drive's signal is 0 in those that move.
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
    """Return the times; rounded times of evenly spaced samples are made even."""
    if evenly_spaced(time):
        return time
    even: Array = np.linspace(float(time[0]), float(time[-1]), time.size, dtype=np.float64)
    return even if float(np.max(np.abs(time - even))) <= ROUNDED * float(even[1] - even[0]) else time


def evenly_spaced(time: Array) -> bool:
    """Return whether all samples are equally far apart, to a thousandth."""
    steps = np.diff(time)
    period = float(np.median(steps))
    return bool(np.max(np.abs(steps - period)) <= SPACING * period)


def experiment_of(
    record: Record, axis: ServoAxis, *, loop: Loop | None = None, name: str = "", output: str = "torque"
) -> Experiment:  # fmt: skip
    """Build an experiment from a record.

    Parameters
    ----------
    record : Record
        With ``position`` (rad or m); the drive's signal as ``torque`` or ``motor_torque`` (N·m), ``current`` (A),
        ``torque_percent`` (% of rated) or ``voltage`` (V); perhaps ``position_reference`` and ``supply``.
    axis : ServoAxis
    loop
        As in `Experiment`.
    output : str
        Quantity of the loop's output if no drive signal is recorded: one of `DRIVE_QUANTITIES`. It is multiplied by the
        channel ``supply`` if the record has one: for a voltage, the loop's output is then the duty cycle.

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
