"""A torque over the position whose orders a short way hardly tells apart, and what it does to the inertia."""

from __future__ import annotations

import math
from typing import Any

import pytest

from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis

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
