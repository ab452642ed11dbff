"""A recorded run as a rig: it returns the recorded measurements, whatever torque it is given.

This tests the loop, its limits or a controller with the record alone. Nothing moves.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.config import Table
from stickslip.core.errors import InputError, RigError
from stickslip.core.record import Record
from stickslip.core.resources import number_of
from stickslip.readers import read
from stickslip.rigs.declared import FASTEST, SLOWEST
from stickslip.rigs.files import limits_in
from stickslip.rigs.rig import Capabilities, Limits, Measurement, RigKind, Watchdog

Array = np.ndarray[Any, np.dtype[np.float64]]

UNLIMITED = Limits(torque=1e9, speed=1e9)
"""Nothing moves: there is nothing to protect"""
UNEVEN = 0.01  # of the sample time: deviation of a recorded time at which the record is resampled
ROW = 150
"""Bytes of a resampled sample, with its sources"""
CHANNELS = ("position", "motor_torque", "sensor_torque", "temperature", "status")


class Replay:
    """A rig that plays a record back.

    Parameters
    ----------
    record : Record
        With ``position`` (rad), and optionally ``motor_torque``, ``sensor_torque`` (N·m), ``temperature`` (°C) and
        ``status``.
    sample_time : float or None
        s; None: the one in its meta, else the median of its time steps. A record with other times is interpolated
        linearly.
    limits : Limits or None

    Raises
    ------
    InputError
        If the record has no position, fewer than two samples or times that are not increasing, or the sample time is
        invalid.
    """

    name = "replay"

    def __init__(
        self, record: Record, *, sample_time: float | None = None, limits: Limits | None = None
    ) -> None:
        if len(record) < 2:
            raise InputError("replay: the record has fewer than two samples; give a longer one")
        record["position"]  # raises where there is none
        insist_on_order(record.time)
        self.sample_time = usable(sample_time_of(record) if sample_time is None else sample_time)
        # It depends neither on the torque nor on the clock of the caller.
        self.limits = replace(limits or UNLIMITED, answer_time=math.inf, standstill_torque=math.inf)
        self.capabilities = Capabilities(
            Watchdog(0.0, "nothing moves"),
            real_clock=False,
            torque_sensor="sensor_torque" in record.channels,
            temperature="temperature" in record.channels,
        )
        self._rows = self._laid_out(record)
        self._next = 0

    def _laid_out(self, record: Record) -> Array:
        """Return rows of `Measurement`, one sample time apart except for pauses."""
        time: Array = record.time
        steps = np.diff(time)
        uneven = np.abs(steps - self.sample_time) > UNEVEN * self.sample_time
        at = time
        # A gap is a pause of the run; uneven times are resampled.
        if np.any(uneven & (steps < 2.0 * self.sample_time)):
            span = float(time[-1] - time[0])
            count = (
                number_of(span, self.sample_time, ROW, f"replay: {span:.4g} s", "give a longer sample_time")
                + 1
            )
            at = float(time[0]) + self.sample_time * np.arange(count, dtype=np.float64)
        rows = np.zeros((at.size, 1 + len(CHANNELS)))
        rows[:, 0] = at
        for i, name in enumerate(CHANNELS, 1):
            if name in record.channels:
                rows[:, i] = np.interp(at, time, record[name])
            elif name != "status":
                rows[:, i] = math.nan
        return rows

    def open(self) -> Measurement:
        """Return the first sample."""
        self._next = 0
        return self._answer()

    def exchange(self, torque: float) -> Measurement:
        """Return the next sample.

        Raises
        ------
        RigError
            At the end of the record.
        """
        return self._answer()

    def pause(self, seconds: float) -> Measurement:
        """Return the first sample after the recorded pause, or after `seconds` of the record."""
        times = self._rows[: self._next, 0]
        # No torque follows the last sample before a pause, so the record continues with the first one after it.
        if times.size > 1 and times[-1] - times[-2] > 1.5 * self.sample_time:
            return self._row(self._next - 1)
        end: float = self._rows[max(self._next - 1, 0), 0] + seconds - 0.5 * self.sample_time
        after: Any = np.searchsorted(self._rows[:, 0], end)
        self._next = max(self._next, int(after))
        return self._answer()

    def close(self) -> None:
        """Nothing to do."""

    def _row(self, index: int) -> Measurement:
        values: list[float] = self._rows[index].tolist()
        return Measurement(*values)

    def _answer(self) -> Measurement:
        if self._next >= len(self._rows):
            raise RigError("replay: the record has ended", float(self._rows[-1, 0]))
        self._next += 1
        return self._row(self._next - 1)


def sample_time_of(record: Record) -> float:
    """Return the sample time of the record's meta, or the median of its time steps, to the nanosecond; s."""
    told = record.meta.get("sample_time")
    if isinstance(told, float):
        return told
    median: Any = np.median(np.diff(record.time))
    return round(float(median), 9) or float(median)


def insist_on_order(time: Array) -> None:
    """Refuse times that are not finite or not increasing.

    Raises
    ------
    InputError
        Names the first.
    """
    wrong = np.flatnonzero(~np.isfinite(time))
    if wrong.size:
        raise InputError(f"replay: time of row {wrong[0]} is {time[wrong[0]]}; leave such rows out")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        row = int(back[0])
        raise InputError(
            f"replay: time goes from {time[row]:.9g} to {time[row + 1]:.9g} s after row {row} and is not increasing; "
            "check the log with `stickslip doctor`"
        )


def usable(sample_time: float) -> float:
    """Return the sample time if a loop can run with it, s.

    Raises
    ------
    InputError
    """
    if not FASTEST <= sample_time <= SLOWEST:
        raise InputError(
            f"replay: sample_time = {sample_time:g} s must be from {FASTEST:g} to {SLOWEST:g}; "
            "give one, or fix the log's times"
        )
    return sample_time


def build(settings: Table) -> Replay:
    """Build from ``file`` (any log that `stickslip.readers` reads), ``sample_time`` and ``limits``."""
    path = settings.document.locate(settings.text("file"))
    sample_time = settings.positive("sample_time", "s") if settings.has("sample_time") else None
    return Replay(read(path), sample_time=sample_time, limits=limits_in(settings, UNLIMITED))


RIG = RigKind("replay", build, "a recorded run, played back")
