"""The metrics that the meter's accumulator holds at the end of a run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulation._meter import LATE, SIZE, gathered


def settle_band_of(reference: Any, duration: float) -> float:
    """2 % of the way the reference goes, where it comes to rest before the end of the run; else 0. rad."""
    start, late, end = reference.sample([0.0, 0.9 * duration, duration])
    first = 0.0 if reference.kind.name == "step" else start[0]
    travel = abs(end[0] - first)
    at_rest = abs(end[0] - late[0]) <= 1e-3 * travel and abs(end[1]) * duration <= 1e-3 * travel
    return 0.02 * travel if travel > 0.0 and at_rest else 0.0


@kernel()
def mean_and_deviation(turns: Any, first: int, apart: int, kind: int) -> tuple[float, float]:
    """Of the distances in time (kind 0) or place (1) of turns that stand `apart`, from `first` on.

    Without NumPy's functions: whoever reads a kernel that calls them loads numba's, with SciPy, in 0.35 s.
    """
    count = turns.shape[0] - apart - first
    mean = 0.0
    for i in range(first, first + count):
        mean += abs(turns[i + apart, kind] - turns[i, kind])
    mean /= count
    squares = 0.0
    for i in range(first, first + count):
        off = abs(turns[i + apart, kind] - turns[i, kind]) - mean
        squares += off * off
    return mean, (squares / count) ** 0.5


@kernel()
def even_cycle(turns: Any, first: int) -> tuple[float, float]:
    """Amplitude (rad) and period (s) of turns from `first` on that are those of at least 5 even periods, or two NaN."""
    count = turns.shape[0] - first
    if count < 11:
        return math.nan, math.nan
    found = (0.0, 0.0)
    for kind in range(2):
        # Periods from every second turn to the next, swings from one turn to the next.
        apart = 2 if kind == 0 else 1
        mean, spread = mean_and_deviation(turns, first, apart, kind)
        if not mean > 0.0 or spread >= 0.05 * mean:
            return math.nan, math.nan
        found = (mean, found[0])
    return 0.5 * found[0], found[1]


@kernel()
def side_of(position: float, middle: float, swing: float) -> float:
    """Above (1) or below (-1) the middle quarters of the whole swing, or in them (0)."""
    if abs(position - middle) < 0.25 * swing:
        return 0.0
    return 1.0 if position > middle else -1.0


@kernel()
def ends_of_swings(turns: Any, first: int) -> int:
    """Put, from `first` on, the ends of whole swings in the place of all turns; returns where they end.

    Where an axis stops its bristles spring back and ring: many small turns about the end of one swing. That end is
    the farthest of them, and its time that of the first which is about as far.
    """
    low, high = math.inf, -math.inf
    for i in range(first, turns.shape[0]):
        low = min(low, turns[i, 1])
        high = max(high, turns[i, 1])
    middle, swing = 0.5 * (low + high), high - low
    kept, begin = first, first
    while begin < turns.shape[0]:
        side = side_of(turns[begin, 1], middle, swing)
        end, farthest = begin, turns[begin, 1]
        while end < turns.shape[0] and side * side_of(turns[end, 1], middle, swing) >= 0.0:
            if side * (turns[end, 1] - farthest) > 0.0:
                farthest = turns[end, 1]
            end += 1
            if side == 0.0:
                break
        if side != 0.0:
            while side * (farthest - turns[begin, 1]) > 0.1 * swing:
                begin += 1
            turns[kept, 0] = turns[begin, 0]
            turns[kept, 1] = farthest
            kept += 1
        begin = end
    return kept


@kernel()
def limit_cycle(turns: Any, duration: float) -> tuple[float, float]:
    """Amplitude (rad) and period (s) of a limit cycle in the last 40 % of a run, or two NaN.

    There is one where at least 5 periods have amplitudes and periods that spread (standard deviation over
    mean) by less than 5 %. ``turns`` has time and position of the velocity's reversals, shape (n, 2), ascending; it is
    written over where these are not themselves the ends of even swings.
    """
    first = 0
    while first < turns.shape[0] and turns[first, 0] < LATE * duration:
        first += 1
    found = even_cycle(turns, first)
    if math.isnan(found[0]):
        found = even_cycle(turns[: ends_of_swings(turns, first)], first)
    return found


SETTLED_FOR = 0.1
"""Of the run, without leaving the band again."""
COARSE = (
    "position_rms_rad", "position_peak_rad", "steady_state_error_rad", "end_error_rad", "velocity_rms_rad_s",
    "velocity_peak_rad_s", "torque_rms_Nm", "torque_peak_Nm", "friction_residual_rms_Nm",
    "second_half_position_rms_rad", "second_half_position_peak_rad", "second_half_position_span_rad",
    "second_half_velocity_rms_rad_s", "second_half_torque_rms_Nm", "motor_work_J", "friction_loss_J",
)  # fmt: skip
"""Metrics that windows longer than `_meter.MAX_WINDOW` give as well."""


def metrics(acc: Any, turns: Any) -> dict[str, float]:
    """Read a finished accumulator: one number a metric, its unit in the name; NaN where there is none.

    The definitions are in docs/metrics.md.
    """
    late = np.ascontiguousarray(turns[turns[:, 0] > 0.0])
    amplitude, period = limit_cycle(late, float(gathered(acc)["duration"]))
    return {name: float(value) for name, value in columns(acc, amplitude, period).items()}


def columns(acc: Any, amplitude: Any, period: Any) -> dict[str, Any]:
    """The metrics of many finished accumulators, shape (..., SIZE), and of their limit cycles, shape (...)."""
    found = gathered(acc)
    duration = found["duration"]
    half = 0.5 * duration
    # For good: a limit cycle that happens to end inside the band has not settled.
    settled = (found["settle_band"] > 0.0) & (found["outside_last"] <= (1.0 - SETTLED_FOR) * duration)
    return {
        "position_rms_rad": np.sqrt(found["e2"] / duration),
        "position_peak_rad": found["e_max"],
        "steady_state_error_rad": found["ss_e"] / (0.2 * duration),
        "end_error_rad": found["e_end"],
        "settling_s": np.where(settled, found["outside_last"], math.nan),
        "velocity_rms_rad_s": np.sqrt(found["ev2"] / duration),
        "velocity_peak_rad_s": found["v_max"],
        "torque_rms_Nm": np.sqrt(found["tm2"] / duration),
        "torque_peak_Nm": found["tm_max"],
        "friction_residual_rms_Nm": np.sqrt(found["df2"] / duration),
        "standstills": found["still_count"],
        "longest_standstill_s": found["still_longest"],
        "reversals_per_s": found["reversals"] / duration,
        "reversals_beyond_reference_per_s": (found["reversals"] - found["reference_reversals"]) / duration,
        "velocity_above_50Hz_rms_rad_s": np.sqrt(found["hp2"] / duration),
        "limit_cycle_amplitude_rad": amplitude,
        "limit_cycle_period_s": period,
        "second_half_position_rms_rad": np.sqrt(found["w2_e2"] / half),
        "second_half_position_peak_rad": found["w2_e_max"],
        "second_half_position_span_rad": found["w2_e_high"] - found["w2_e_low"],
        "second_half_velocity_rms_rad_s": np.sqrt(found["w2_ev2"] / half),
        "second_half_torque_rms_Nm": np.sqrt(found["w2_tm2"] / half),
        "second_half_velocity_above_50Hz_rms_rad_s": np.sqrt(found["w2_hp2"] / half),
        "second_half_reversals_per_s": found["w2_reversals"] / half,
        "motor_work_J": found["work"],
        "friction_loss_J": found["loss"],
    }


METRICS = tuple(columns(np.ones(SIZE), 0.0, 0.0))
"""Names of the metrics."""
