"""What a run of the bench is judged by, from the record of every sample."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.core.record import Record
from stickslip.recommendation.swings import back_and_forth

Array = np.ndarray[Any, np.dtype[np.float64]]
Places = np.ndarray[Any, np.dtype[np.bool_]]
STILL = 1e-6
"""rad/s: a reference that moves slower stands still."""
SETTLED = 0.5
"""Share of a hold after which a loop has settled."""
LEFT = 0.1
"""Share of the largest deviation that is left where an error has recovered."""

METRICS = {
    "rms_rad": "error RMS while the reference moves",
    "peak_rad": "largest error",
    "rest_rad": "error left at the end of a hold, mean of its second half",
    "chatter_Nm": "RMS of the torque's change from sample to sample, second half of a hold",
    "chatter_moving_Nm": "the same while the reference moves",
    "hunting_rad": "smaller of the largest rise and fall of the position, second half of a hold: the limit cycle",
    "recovery_s": "time after a change of friction until a tenth of the error's deviation is left",
    "effort_Nm": "torque RMS while the reference moves",
}
"""By name; units in the names. None where a run has no such phase."""


def judged(record: Record, event: float = 0.0) -> dict[str, float | None]:
    """Metrics of a run by name (`METRICS`).

    Parameters
    ----------
    record : Record
        With a row per sample.
    event : float
        When friction changed, s; 0: not.
    """
    time = record.time
    reference, position = record.channels["position_reference"], record.channels["position"]
    torque = record.channels["torque_command"]
    error = reference - position
    speed = np.abs(record.channels["velocity_reference"])
    moving = moves(speed)
    hold = np.flatnonzero(~moving)
    late = hold[int(SETTLED * hold.size) :] if hold.size > 20 else hold[:0]
    change = np.diff(torque, append=torque[-1:])
    return {
        "rms_rad": rms(error[moving]),
        "peak_rad": float(np.abs(error).max()),
        "rest_rad": abs(float(error[late].mean())) if late.size else None,
        "chatter_Nm": rms(change[late]),
        "chatter_moving_Nm": rms(change[moving]),
        "hunting_rad": back_and_forth(position[late]) if late.size else None,
        "recovery_s": recovery(time, error, moving, event) if event > 0.0 else None,
        "effort_Nm": rms(torque[moving]),
    }


def moves(speed: Array) -> Places:
    """Whether the reference moves, or has not yet come to rest for good."""
    last = np.flatnonzero(speed > 1e-3 * max(float(speed.max(initial=0.0)), STILL))
    out = np.zeros(speed.size, dtype=bool)
    if last.size:
        out[: last[-1] + 1] = True
    return out


def rms(values: Array) -> float | None:
    """Root of the mean square; None of nothing."""
    return math.sqrt(float(np.mean(values * values))) if values.size else None


def recovery(time: Array, error: Array, moving: Places, event: float) -> float | None:
    """Time until a tenth of the largest deviation from the error at the end of the motion is left, s."""
    after = np.flatnonzero(np.logical_and(moving, time > event))
    if after.size < 20:
        return None
    final = float(np.median(error[after[int(0.8 * after.size) :]]))
    off = np.abs(error[after] - final)
    beyond = np.flatnonzero(off > LEFT * float(off.max()))
    return float(time[after[beyond[-1]]] - event) if beyond.size else 0.0
