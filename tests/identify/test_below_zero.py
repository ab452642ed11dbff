"""An interval that lies below 0 says that the model is wrong, not that a number is the least that it can be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from stickslip import law
from stickslip.identify.axis.falling import told
from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.axis.result import advice, explaining
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.parameter_vector import Parameter
from stickslip.identify.regression.reasons import APART, DRIVES
from stickslip.identify.regression.regression import regress_axis
from stickslip.machines.servo import ServoAxis
from stickslip.spec import Par

START = Estimate("inertia", "kg·m²", "J", 1.0, math.inf, -math.inf, math.inf, False)


def parameter(*, positive: bool) -> Parameter:
    return Parameter("inertia", Par("kg·m²", "J", "inertia", lower=0.0, positive=positive), 1.0)


@pytest.mark.parametrize("positive", [True, False])
def test_an_interval_below_zero_identifies_nothing(positive: bool) -> None:
    said = told(START, parameter(positive=positive), -0.0125, -0.0214, -0.0036, math.nan)
    assert not said.identified
    assert "asks for -0.0125 kg·m² (-0.0036 at most), which cannot be below 0" in said.verdict
    assert 0.0 <= said.lower <= said.value < said.upper == pytest.approx(0.0214)


def test_one_that_reaches_zero_is_not_told_from_it() -> None:
    said = told(START, parameter(positive=True), 0.1, -0.1, 0.3, math.nan)
    assert (said.identified, said.verdict) == (False, "the data do not distinguish it from 0")


def test_a_level_that_would_drive_the_axis_takes_all_verdicts_down(logs: Any) -> None:
    """At one speed, where the loop answers cogging alone, another program's log gave a mass eight times too high,
    identified, beside friction of -158 N."""
    log = logs.draw(4, "held", 1000, "p-pi", "production", "clean")
    axis = ServoAxis(drive_side="load")
    right = Experiment("log", log.time, log.position, log.torque)
    friction = log.truth["fc"] * np.sign(np.gradient(log.position, log.time))
    wrong = Experiment("log", log.time, log.position, log.torque - 3.0 * friction)
    assert regress_axis([right], axis).doubt == ""
    assert regress_axis([wrong], axis).doubt == DRIVES
    found = identify_axis([wrong], axis, ["coulomb"])
    assert not any(e.identified for e in found.estimates)
    assert found["inertia"].verdict == DRIVES


def test_a_model_that_leaves_more_torque_than_there_is_tells_nothing() -> None:
    known = Estimate("inertia", "kg·m²", "J", 1.0, 0.01, 0.98, 1.02, True)
    (bad,) = explaining([known], {"force_relative": 1.43, "inverse_dynamics_relative": 0.143}, confirmed=True)
    assert (bad.identified, bad.verdict[:50]) == (False, "the model leaves 143% of the torque over the whole")
    for misfit in ({"force_relative": 1.43, "inverse_dynamics_relative": 0.9}, {"force_relative": 0.9}, {},
                   {"force_relative": 1.2, "inverse_dynamics_relative": math.nan}):  # fmt: skip
        assert explaining([known], misfit, confirmed=True) == (known,)


def test_what_nothing_confirms_is_not_identified_where_half_of_the_torque_is_left():
    known = Estimate("inertia", "kg·m²", "J", 2e-3, 1e-4, 1.8e-3, 2.2e-3, True)
    misfit = {"force_relative": 0.72, "inverse_dynamics_relative": 0.69}
    assert explaining([known], misfit, confirmed=True) == (known,)
    (left,) = explaining([known], misfit, confirmed=False)
    assert not left.identified
    assert "leaves 72% of the torque" in left.verdict
    assert explaining([known], {**misfit, "force_relative": 0.4}, confirmed=False) == (known,)


def test_what_to_measure_next_does_not_contradict_the_verdict() -> None:
    coulomb = law("coulomb")
    below = told(START, parameter(positive=True), -0.0125, -0.0214, -0.0036, math.nan)
    assert advice([below], coulomb) == ("Log torque and motion by one clock, without filters of their own.",)
    assert advice([START], coulomb, APART.format(share=6.0)) == (
        "Record longer moves with gentler accelerations: motor and load then move as one.",
    )
    assert advice([START], coulomb) == ("Record stronger accelerations.",)
