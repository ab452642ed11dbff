"""Compute signals from others, on request; they are listed in the record's ``meta["derived"]``."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option
from stickslip.core.record import Record

METHODS = ("butterworth", "savitzky-golay")
INTEGRAL = "integral of the velocity, from 0, by trapezoids"

Array = np.ndarray[Any, np.dtype[np.float64]]


def with_velocity(record: Record, method: str = "butterworth", *, cutoff: float | None = None) -> Record:
    """Return the record with the velocity as zero-phase derivative of its position.

    Parameters
    ----------
    record : Record
        Evenly sampled.
    method : {"butterworth", "savitzky-golay"}
        Central differences of the position, filtered forward and backward; or the slope of a polynomial fitted to a
        sliding window (Savitzky and Golay 1964).
    cutoff : float
        Hz; -3 dB of both passes together. Default: a tenth of the sampling frequency.

    Returns
    -------
    Record
        Channel ``velocity`` in rad/s (or m/s) replaced or added.

    Raises
    ------
    InputError
        Without position, with uneven or missing samples, or with a cutoff that is not below half the sampling
        frequency.
    UnknownName
        If the method is unknown.
    """
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    rate = _rate(record)
    cutoff = 0.1 * rate if cutoff is None else cutoff
    if not 0.0 < cutoff < 0.5 * rate:
        raise InputError(
            f"cutoff = {cutoff:g} Hz must lie above 0 and below half the sampling frequency, {0.5 * rate:g}"
        )
    position = record["position"]
    signal: Any = importlib.import_module("scipy.signal")
    if method == "butterworth":
        order = 4
        # Two passes damp twice: each has -1.5 dB at the requested cutoff.
        single = cutoff / (np.sqrt(2.0) - 1.0) ** (0.5 / order)
        sections = signal.butter(order, min(single, 0.499 * rate), fs=rate, output="sos")
        smooth = signal.sosfiltfilt(
            sections, position - position[0], padlen=min(len(record) - 1, int(3 * rate / cutoff))
        )
        velocity = np.gradient(np.asarray(smooth), 1.0 / rate)
        how = (
            f"zero-phase Butterworth of the position, order {order}, {cutoff:g} Hz (-3 dB), central"
            " differences"
        )
    else:
        order = 3
        points = _window(signal, order, 2.0 * np.pi * cutoff / rate, len(record))
        velocity = np.asarray(signal.savgol_filter(position, points, order, deriv=1, delta=1.0 / rate))
        how = f"Savitzky-Golay slope of the position, order {order}, {points} points ({cutoff:g} Hz)"
    return _with(
        record, {"velocity": velocity}, {"velocity": f"{record.units['position']}/s"}, {"velocity": how}
    )


def with_position(record: Record) -> Record:
    """Return the record with the position as integral of its velocity, from 0, by trapezoids.

    Returns
    -------
    Record
        Channel ``position`` in rad (or m) replaced or added. An integral shows neither friction within an encoder count
        nor the angle within a turn.

    Raises
    ------
    InputError
        Without velocity, or with gaps in it.
    """
    if "velocity" not in record.channels:
        raise InputError("the record has neither a position nor a velocity to integrate; map one of them")
    velocity = record["velocity"]
    if not np.isfinite(velocity).all():
        raise InputError(
            "the record has no position, and its velocity has missing values, over which it cannot be integrated; "
            f"leave those rows out ({name_option('leave_out', 'A:B')}), or map the position"
        )
    ways = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(record.time)
    position: Array = np.concatenate([[0.0], np.cumsum(ways)])
    unit = record.units["velocity"].removesuffix("/s")
    return _with(record, {"position": position}, {"position": unit}, {"position": INTEGRAL})


def positioned(record: Record) -> Record:
    """Return the record of an axis; without a position it is the integral of the velocity. A tribometer's friction
    torque needs none."""
    lacks = "velocity" in record.channels and not {"position", "friction_torque"} & record.channels.keys()
    return with_position(record) if lacks else record


def with_resampled_time(record: Record, period: float | None = None) -> Record:
    """Return the record, linearly interpolated on an even grid.

    Parameters
    ----------
    record : Record
        With increasing times.
    period : float
        s; default: the median sample interval.

    Raises
    ------
    InputError
        If times are not increasing, or the period is not positive.
    """
    steps = np.diff(record.time)
    if len(record) < 2 or not np.all(steps > 0.0):
        raise InputError("times do not ascend; `stickslip doctor` says where")
    period = float(np.median(steps)) if period is None else period
    if not 0.0 < period < np.inf:
        raise InputError(f"period = {period:g} s must be greater than 0")
    count = int((record.time[-1] - record.time[0]) / period * (1.0 + 1e-12)) + 1
    time = record.time[0] + period * np.arange(count)
    channels: dict[str, Array] = {k: np.interp(time, record.time, v) for k, v in record.channels.items()}
    derived = {
        **record.meta.get("derived", {}),
        "time": f"every channel interpolated linearly every {period:g} s",
    }
    return Record(time, channels, record.units, {**record.meta, "derived": derived})


def _window(signal: Any, order: int, frequency: float, limit: int) -> int:
    """Return the shortest window whose slope has -3 dB at a frequency, rad per sample."""
    points = (order + 2) | 1
    while points <= limit:
        weights = np.asarray(signal.savgol_coeffs(points, order, deriv=1, use="dot"))
        response = np.abs(np.sum(weights * np.exp(1j * frequency * np.arange(points)))) / frequency
        if response <= np.sqrt(0.5):
            return points
        points += 2
    raise InputError(f"the cutoff takes a window of more than the record's {limit} points; raise it")


def _rate(record: Record) -> float:
    """Return the sampling frequency, Hz, of a record that can be filtered."""
    steps = np.diff(record.time)
    if "position" not in record.channels:
        raise InputError("the record has no position to derive a velocity from")
    if len(record) < 16:
        raise InputError(f"the record has {len(record)} rows; give at least 16")
    period = float(np.median(steps))
    if not (
        np.isfinite(record.time).all()
        and np.all(np.abs(steps - period) <= 0.2 * abs(period))
        and period > 0.0
    ):
        raise InputError("the record is not evenly sampled; call `with_resampled_time` first")
    if not np.isfinite(record["position"]).all():
        raise InputError(
            "the position has missing values; `stickslip.identification.doctor.examine` leaves them out"
        )
    return 1.0 / period


def _with(record: Record, channels: dict[str, Array], units: dict[str, str], how: dict[str, str]) -> Record:
    meta = {**record.meta, "derived": {**record.meta.get("derived", {}), **how}}
    return Record(record.time, {**record.channels, **channels}, {**record.units, **units}, meta)
