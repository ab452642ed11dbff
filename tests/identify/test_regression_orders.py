"""A torque over the position: which orders it has, what the record does not tell apart, and what it does to the
inertia."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression import rivals
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis
from stickslip.report.answers import around

AXIS = ServoAxis(drive_side="load")


def told(log: Any) -> Regression:
    return regress_axis([Experiment("log", log.time, log.position, log.torque)], AXIS)


def test_whole_orders_are_taken_from_half_a_turn_on(logs: Any) -> None:
    """In halves of a way of 0.7 turns, order 38 was beside the grid and order 50 beyond it: the slow sine's inertia
    came out 114 % too high, with an interval of 37 %, and what was recommended made moves worse than nothing."""
    log = logs.draw(90063, "commanded", 1000, "feedforward", "sine", "cogging")
    found = told(log)
    assert {38, 22, 50} <= {round(2.0 * math.pi * order, 6) for order in found.orders}
    low, high = found.interval("inertia")
    assert low < log.truth["inertia"] < high < 1.3 * log.truth["inertia"]


@pytest.mark.parametrize(
    "cell",
    [
        (820386, "actual", 1000, "pid", "sine", "cogging"),  # 0.45 turns, 60 % off beside an interval of 22 %
        (820506, "actual", 250, "pid", "sine", "cogging"),  # 0.34 turns, 51 % beside 41 %
    ],
)
def test_inertia_is_as_unsure_as_a_torque_over_a_short_way_can_make_it(logs: Any, cell: Any) -> None:
    """A slow sine accelerates with less than the cogging: what went to a wrong order passed for inertia."""
    log = logs.draw(*cell)
    low, high = told(log).interval("inertia")
    assert low < log.truth["inertia"] < high
    assert high > 2.0 * low  # not identified


def test_moves_tell_inertia_beside_cogging_on_a_short_way_too(logs: Any) -> None:
    """Tuning steps accelerate with many times the cogging: hardly less sure than before."""
    log = logs.draw(820016, "held", 1000, "p-pi", "steps", "cogging")
    low, high = told(log).interval("inertia")
    assert low < log.truth["inertia"] < high < 1.2 * low


def test_an_identification_says_how_much_torque_it_leaves_cogging_among_it(logs: Any) -> None:
    log = logs.draw(97, "held", 1000, "p-pi", "staircase", "cogging", orders=(4, 12, 24))
    found = identify_axis([Experiment("log", log.time, log.position, log.torque)], AXIS, ["coulomb"])
    cogging = math.sqrt(0.5 * float((log.machine.sizes[:, 0] ** 2).sum()))
    assert found.misfit["sliding_rms_Nm"] == pytest.approx(cogging, rel=0.3)
    assert found.misfit_unit("sliding_rms_Nm") == "N·m"
    (sentence,) = around(regression := found.details["regression"], found)
    assert all(f"at {n} a revolution" in sentence for n in (4, 12, 24))
    assert "does not tell" not in sentence
    unsure = replace(regression, alike=tuple((order + 0.5 / math.pi,) for order in regression.orders))
    assert (
        "at 4 a revolution (the record does not tell it from 5; record slow turns" in around(unsure, found)[0]
    )
    # What a law's form leaves repeats over the position: 0.3 % of Fc was cogging of axes that have none.
    (band, *others), size = regression.bands, 0.01 * regression.friction / np.max(regression.harmonics)
    small = replace(regression, bands=(replace(band, harmonics=size * band.harmonics), *others))
    assert around(small, found) == []


def slow_sine(amplitude: float, *, seconds: float, frequency: float, every: float = 0.008) -> Experiment:
    """A direct drive with order 42, from rows that a computer polls unevenly; high orders die away at speed."""
    rng = np.random.default_rng(8)
    spacing = every * np.clip(1.0 + 0.25 * rng.standard_normal(round(seconds / every)), 0.625, 1.75)
    t, w = np.cumsum(spacing), 2.0 * math.pi * frequency
    q, v, a = 12.0 * (1.0 - np.cos(w * t)), 12.0 * w * np.sin(w * t), 12.0 * w * w * np.cos(w * t)
    friction = np.sign(v) * (0.022 + 0.008 * np.exp(-np.abs(v))) + 9e-5 * v
    cogging = amplitude * np.cos(42.0 * q + 0.4) / np.sqrt(1.0 + (42.0 * v / 250.0) ** 2)
    count = 2.0 * math.pi / 16384
    torque = 9e-5 * a + friction + cogging + 5e-4 * rng.standard_normal(t.size)
    return Experiment("sine", t, np.floor(q / count) * count, torque)


def test_rows_as_logged_tell_an_order_that_windows_hide(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows of 19 ms show order 42 beside the reversals alone, where 37 explains it as well: 37 was said."""
    found = regress_axis([slow_sine(0.016, seconds=30.0, frequency=0.2)], AXIS)
    assert [round(2.0 * math.pi * order, 6) for order in found.orders] == [42.0]
    assert found.harmonics == pytest.approx([0.016], rel=0.1)
    assert found.alike == ((),)
    # Where these rows are too few, what is not told apart is said.
    monkeypatch.setattr(rivals, "FEWEST", 10_000)
    unsure = regress_axis([slow_sine(0.016, seconds=30.0, frequency=0.2)], AXIS)
    assert 42 in {round(2.0 * math.pi * order) for order in (unsure.orders[0], *unsure.alike[0])}
    assert unsure.alike[0]
