"""A torque column of few counts: at constant velocity its rounding does not average out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.smooth import Window
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.identify.regression.rounding import rounded_sums
from stickslip.identify.regression.sliding_rows import narrowest_width, signals_of, sliding_rows
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
COUNT = 0.15
"""Of Fc: a small motor's torque in whole percent."""


def staircase(logs: Any, seed: int, count: float) -> tuple[dict[str, float], Experiment]:
    """The truth of a staircase, and its record with the torque rounded."""
    log = logs.draw(seed, "commanded", 1000, "p-pi", "staircase", "clean")
    step = count * log.truth["fc"]
    return log.truth, Experiment("log", log.time, log.position, np.round(log.torque / step) * step)


def half(found: Regression, name: str) -> float:
    """Half-width of an interval."""
    low, high = found.interval(name)
    return 0.5 * (high - low)


def test_intervals_hold_although_a_level_is_rounded_as_a_whole(logs: Any) -> None:
    """Without the rounding 12 of 16 levels and 13 of 16 slopes held (seeds 1090000 to 1090015)."""
    for seed in (1090003, 1090006, 1090007, 1090012):
        truth, record = staircase(logs, seed, COUNT)
        found = regress_axis([record], AXIS)
        for name in ("fc", "sigma2", "offset", "inertia"):
            low, high = found.interval(name)
            assert low <= truth[name] <= high, (seed, name)


def test_a_coarser_column_tells_less_and_a_fine_one_loses_nothing(logs: Any) -> None:
    fine, rounded, coarse = (
        half(regress_axis([staircase(logs, 1090000, count)[1]], AXIS), "fc") for count in (1e-6, 0.05, COUNT)
    )
    assert fine < rounded < coarse


def test_rows_whose_window_sees_several_counts_are_not_rounded_together() -> None:
    """A torque that rises all the time averages the rounding out; one that stands does not."""
    time = np.arange(4000) * 1e-3
    speed = np.where(time < 2.0, 1.0, -1.0)
    position = np.cumsum(speed) * 1e-3
    standing = Experiment("log", time, position, np.round(3.3 * speed))
    rising = replace(standing, drive=np.round(100.0 * speed * time % 40.0))
    sums: list[float] = []
    for record in (standing, rising):
        signals = signals_of(record, AXIS)
        assert signals.count == 1.0 or record is standing
        rows = sliding_rows(replace(signals, count=1.0), Window(narrowest_width(signals), signals.period))
        sums.append(float(np.max(np.abs(rounded_sums([rows], rows.fixed)), initial=0.0)))
    assert sums[1] < 0.05 * sums[0]
