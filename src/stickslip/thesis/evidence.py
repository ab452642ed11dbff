"""What a statement about runs is judged on: metrics, and quantities taken from the records."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from stickslip.core.record import Record

STANDSTILL_SPEED, REFERENCE_MOVES, SHORTEST_STANDSTILL = 1e-3, 2e-3, 10e-3  # rad/s, rad/s, s; as the metrics'
NEAR_ZERO, AWAY = 0.3, 0.5  # shares of the reference's peak velocity


class View(Protocol):
    """Runs of a study by slip rule and case, `reference/friction/controller`."""

    def metric(self, rule: str, case: str, name: str) -> float:
        """One metric of a run; KeyError where the run is missing or failed."""
        ...

    def record(self, rule: str, case: str) -> Record:
        """The record of a run; KeyError where it is missing or failed."""
        ...


@dataclass(frozen=True)
class Evidence:
    """The runs of one slip rule, asked by quantity and case.

    Attributes
    ----------
    view : View
    rule : str
        Slip rule of the runs.
    """

    view: View
    rule: str
    _motions: dict[str, Motion] = field(default_factory=dict[str, "Motion"])

    def __call__(self, name: str, case: str) -> float:
        """The quantity of that name (a key of `QUANTITIES`, or a metric) of a run, SI units."""
        known = QUANTITIES.get(name)
        return known.take(self, case) if known else self.view.metric(self.rule, case, name)

    def motion(self, case: str) -> Motion:
        """What the record of a run shows, read once."""
        if case not in self._motions:
            self._motions[case] = Motion.of(self.view.record(self.rule, case))
        return self._motions[case]


@dataclass(frozen=True)
class Motion:
    """Quantities of a record that are no metrics.

    Attributes
    ----------
    standstills : int
        How many there are (|v| < 1e-3 rad/s for 10 ms while |v_d| > 2e-3 rad/s).
    away : int
        Those that begin where |v_d| is above half its peak.
    off_zero : int
        Those that begin where |v_d| is above 30 % of its peak.
    longest : float
        Longest that begins below 30 % of the peak, s.
    lag : float
        Mean of the position error in the direction of the reference's motion, rad.
    midway : float
        RMS of the velocity error where |v_d| is above half its peak, rad/s.
    low, high : float
        Extremes of the position error in the second half, rad.
    """

    standstills: int
    away: int
    off_zero: int
    longest: float
    lag: float
    midway: float
    low: float
    high: float

    @classmethod
    def of(cls, record: Record) -> Motion:
        """Read a record of a closed loop."""
        t, vd, v = record.time, record["velocity_reference"], record["velocity"]
        error = record["position_reference"] - record["position"]
        peak = float(np.max(np.abs(vd))) or 1.0
        starts, lengths = standstills(t, v, vd)
        speed = np.abs(vd[starts])
        near = lengths[speed < NEAR_ZERO * peak]
        late = error[t >= 0.5 * t[-1]]
        return cls(
            standstills=len(starts),
            away=int(np.sum(speed > AWAY * peak)),
            off_zero=int(np.sum(speed >= NEAR_ZERO * peak)),
            longest=float(near.max()) if near.size else 0.0,
            lag=_mean(error * np.sign(vd), t),
            midway=math.sqrt(_mean(np.where(np.abs(vd) > AWAY * peak, (vd - v) ** 2, np.nan), t)),
            low=float(late.min()),
            high=float(late.max()),
        )


def _mean(values: Any, time: Any) -> float:
    """Mean over the time where the values are numbers."""
    width = np.diff(time)
    middle = 0.5 * (values[1:] + values[:-1])
    there = np.isfinite(middle)
    total = float(width[there].sum())
    return float(np.sum(middle[there] * width[there])) / total if total else 0.0


def standstills(time: Any, velocity: Any, desired: Any) -> tuple[Any, Any]:
    """First rows and lengths (s) of the standstills while the reference moves."""
    still = (np.abs(velocity) < STANDSTILL_SPEED) & (np.abs(desired) > REFERENCE_MOVES)
    edges = np.diff(np.concatenate(([0], still.astype(np.int8), [0])))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    lengths = time[last] - time[first]
    long_enough = lengths >= SHORTEST_STANDSTILL
    return first[long_enough], lengths[long_enough]


@dataclass(frozen=True)
class Quantity:
    """How a statement names a quantity, its unit, and where it comes from."""

    label: str
    unit: str
    take: Callable[[Evidence, str], float]


def _metric(name: str, label: str, unit: str, magnitude: bool = False) -> Quantity:
    def take(evidence: Evidence, case: str) -> float:
        value = evidence.view.metric(evidence.rule, case, name)
        return abs(value) if magnitude else value

    return Quantity(label, unit, take)


QUANTITIES: dict[str, Quantity] = {
    "rms": _metric("position_rms_rad", "RMS error", "rad"),
    "peak": _metric("position_peak_rad", "peak error", "rad"),
    "steady": _metric("steady_state_error_rad", "|steady-state error|", "rad", magnitude=True),
    "oscillation": _metric("velocity_above_50Hz_rms_rad_s", "velocity above 50 Hz", "rad/s"),
    "reversals": _metric("reversals_per_s", "reversals", "/s"),
    "late reversals": _metric("second_half_reversals_per_s", "reversals at steady state", "/s"),
    "late span": _metric("second_half_position_span_rad", "peak-to-peak error", "rad"),
    "standstills": Quantity("standstills", "", lambda e, c: e.motion(c).standstills),
    "standstills away": Quantity("standstills above half speed", "", lambda e, c: e.motion(c).away),
    "standstills off zero": Quantity("standstills above 30 % speed", "", lambda e, c: e.motion(c).off_zero),
    "longest": Quantity("longest standstill near zero velocity", "s", lambda e, c: e.motion(c).longest),
    "lag": Quantity("mean lag", "rad", lambda e, c: e.motion(c).lag),
    "midway": Quantity("velocity error above half speed", "rad/s", lambda e, c: e.motion(c).midway),
    "late low": Quantity("least error at steady state", "rad", lambda e, c: e.motion(c).low),
    "late high": Quantity("greatest error at steady state", "rad", lambda e, c: e.motion(c).high),
    "offset": _metric("steady_state_error_rad", "steady-state error", "rad"),
    "shake": _metric("position_above_5Hz_rms_rad", "oscillation above 5 Hz", "rad"),
    "late shake": _metric("late_oscillation_rad", "oscillation at the end", "rad"),
    "near": _metric("near_zero_rms_rad", "error near zero velocity", "rad"),
    "away": _metric("away_rms_rad", "error away from it", "rad"),
    "smooth": _metric("smooth_error_rms_rad", "error below 5 Hz", "rad"),
    "sticking": _metric("sticking_share", "time stuck", ""),
    "response": _metric("response_time_s", "response time", "s"),
    "strongest": _metric("strongest_Hz", "strongest oscillation at", "Hz"),
}
