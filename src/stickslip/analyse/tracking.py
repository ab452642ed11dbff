"""Tracking metrics of a rig: errors, oscillation and sticking, from encoder and motor torque."""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np

from stickslip.core.record import Record

Array = np.ndarray[Any, np.dtype[np.float64]]

SHAKING = 5.0
"""Hz above which motion is oscillation: ten times the fastest reference, and below the cycles of the 10 Hz loops
(decision 0014)."""
NEAR = 0.3
"""Share of the reference's peak velocity that counts as near zero velocity."""
STILL = 0.1
"""Share of the reference's peak velocity below which the axis sticks while the reference moves with over `NEAR`."""
SMOOTH = 15.0
"""Corner of the low-pass for detecting sticking, Hz: one count per sample is faster than the slow reference."""
LATE = 0.2
"""Last share of the run that counts as steady state."""
METRICS = (
    "position_rms_rad", "position_peak_rad", "position_above_5Hz_rms_rad", "near_zero_rms_rad", "away_rms_rad",
    "smooth_error_rms_rad", "sticking_share", "steady_state_error_rad", "late_oscillation_rad", "response_time_s",
    "torque_rms_Nm", "saturated_share", "strongest_Hz", "ended_s",
)  # fmt: skip


def tracking_metrics(record: Record, torque_limit: float = math.inf) -> dict[str, float]:
    """Return the metrics of a run along a reference.

    Parameters
    ----------
    record : Record
        Channels ``position``, ``position_reference``, ``velocity_reference`` (rad, rad/s), ``torque_command`` (N·m),
        evenly sampled.
    torque_limit : float
        N·m; commands within 1 % of it are saturated.

    Returns
    -------
    dict
        `METRICS`: errors in rad; ``position_above_5Hz_rms_rad`` and ``late_oscillation_rad`` (the same at steady state)
        measure the oscillation; ``smooth_error_rms_rad`` is the error without it; ``sticking_share`` the share of the
        time in which the axis rests while the reference moves fast; ``response_time_s`` the time to 90 % of the
        reference's end; ``strongest_Hz`` the frequency of the oscillation.
    """
    time = record.time - record.time[0]
    step = float(np.median(np.diff(time)))
    error = record["position_reference"] - record["position"]
    desired = record["velocity_reference"]
    peak = float(np.max(np.abs(desired))) or 1.0
    near = np.abs(desired) < NEAR * peak
    slow, fast = _parted(error, step)
    velocity = np.gradient(_low_passed(record["position"], SMOOTH, step), step)
    moving = np.abs(desired) > NEAR * peak
    stuck = moving & (np.abs(velocity) < STILL * peak)
    late = time >= (1.0 - LATE) * time[-1]
    torque = record["torque_command"]
    final = float(record["position_reference"][-1])
    reached = np.flatnonzero(record["position"] * math.copysign(1.0, final) >= 0.9 * abs(final))
    values = (
        _rms(error), float(np.max(np.abs(error))), _rms(fast), _rms(slow[near]), _rms(slow[~near]), _rms(slow),
        float(np.sum(stuck)) / max(1, int(np.sum(moving))), float(np.mean(error[late])), _rms(fast[late]),
        float(time[reached[0]]) if reached.size else math.inf, _rms(torque),
        float(np.mean(np.abs(torque) >= 0.99 * torque_limit)), _strongest(fast, step), float(time[-1]),
    )  # fmt: skip
    return dict(zip(METRICS, values, strict=True))


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2))) if values.size else 0.0


def _low_passed(values: Array, corner: float, step: float) -> Array:
    """Apply a zero-phase fourth-order Butterworth low-pass."""
    signal: Any = importlib.import_module("scipy.signal")
    if values.size < 64:
        return values
    sections = signal.butter(4, corner, fs=1.0 / step, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, values), dtype=np.float64)


def _parted(error: Array, step: float) -> tuple[Array, Array]:
    """Split the error into the parts below and above `SHAKING`."""
    slow = _low_passed(error, SHAKING, step)
    return slow, error - slow


def _strongest(fast: Array, step: float) -> float:
    """Return the frequency at which the oscillation is strongest, Hz."""
    if fast.size < 64 or not np.any(fast):
        return 0.0
    signal: Any = importlib.import_module("scipy.signal")
    frequency, density = signal.welch(fast, 1.0 / step, nperseg=min(512, fast.size))
    return float(frequency[int(np.argmax(density))])
