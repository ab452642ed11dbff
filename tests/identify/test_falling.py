"""A fall of friction that certain sliding shows goes into the model, whether or not it is identified."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from stickslip.identify.axis.falling import fall_together, number_of, within_sliding
from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.axis.result import at_level
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.parameter_vector import Parameter
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis
from stickslip.report.answers import doubts, trusted
from stickslip.report.sliding_torque import sliding_of
from stickslip.spec import Par

AXIS = ServoAxis(drive_side="load")
STATIC = Parameter("fs", Par("N·m", "F_S", "static friction", positive=True), 0.4)


def record_of(logs: Any) -> tuple[dict[str, float], Experiment]:
    """The truth of a staircase without imperfections at 250 Hz, which says little of reversals, and its record."""
    log = logs.draw(1070150, "held", 250, "pid", "staircase", "clean")
    return log.truth, Experiment("log", log.time, log.position, log.torque)


@pytest.fixture(name="seen", scope="module")
def _seen(logs: Any) -> Regression:
    """What certain sliding says of it."""
    return regress_axis([record_of(logs)[1]], AXIS)


@pytest.mark.parametrize(("seed", "cell"), [
    (1070150, ("held", 250, "pid", "staircase", "clean")),
    (1070552, ("mean", 1000, "p-pi", "staircase", "backlash")),
])  # fmt: skip
def test_the_model_falls_where_certain_sliding_shows_it(logs: Any, seed: int, cell: tuple[Any, ...]) -> None:
    """The simplest law stood in for it ("no fall shows"), a quarter too low at the speeds of half of the record."""
    log = logs.draw(seed, *cell)
    found = identify_axis([Experiment("log", log.time, log.position, log.torque)], AXIS)
    assert found.model is not None
    friction = found.model.parameters
    assert friction.fs == pytest.approx(log.truth["fs"], rel=0.06)
    assert friction.fc == pytest.approx(log.truth["fc"], rel=0.02)
    assert 0.5 * log.truth["vs"] < friction.vs < 2.0 * log.truth["vs"]


def test_a_law_without_the_fall_that_shows_is_taken_with_care(logs: Any) -> None:
    """A Coulomb law forced on friction that falls over 1 rad/s was "Yes: every number is identified", and the promise
    of its compensator, 78 to 99 %, was kept at 74 %."""
    truth, record = record_of(logs)
    named = {law: identify_axis([record], AXIS, [law]) for law in ("coulomb", "stribeck")}
    fall = named["coulomb"].misfit
    assert fall["fall_missing_Nm"] == pytest.approx(truth["fs"] - truth["fc"], rel=0.25)
    assert 0.5 * truth["vs"] < fall["fall_missing_velocity"] < 2.0 * truth["vs"]
    assert fall["sliding_rms_Nm"] > 1.2 * named["stribeck"].misfit["sliding_rms_Nm"]
    said = trusted(named["coulomb"], doubts(named["coulomb"], sliding_of(named["coulomb"])))
    assert said.startswith("With care: ")
    assert "friction falls by " in said
    assert "law 'coulomb' does not have" in said
    assert "fall" not in "; ".join(doubts(named["stribeck"], sliding_of(named["stribeck"])))


def test_of_several_laws_one_with_the_fall_that_shows_is_taken(logs: Any) -> None:
    """Coulomb's was, beside "friction falls by 12.3 N, which law 'coulomb' does not have"."""
    _, record = record_of(logs)
    found = identify_axis([record], AXIS, ["coulomb", "stribeck"])
    assert found.model is not None
    assert found.model.law.name == "stribeck"
    assert "fall_missing_Nm" not in found.misfit


@pytest.mark.parametrize(("velocity", "told"), [(0.2, False), (0.3, True)])
def test_a_fall_below_all_certain_sliding_is_not_identified(velocity: float, told: bool) -> None:
    """GMS behind a reversal looked like a fall at 5.8 rad/s where certain sliding began at 11.8, and was 1.3."""
    falls = Estimate("vs", "rad/s", "v_S", velocity, 0.01, velocity - 0.02, velocity + 0.02, True)
    level = Estimate("fc", "N·m", "F_C", velocity, 0.01, velocity - 0.02, velocity + 0.02, True)
    judged = within_sliding(falls, 0.25)
    assert judged.identified is told
    assert told or judged.verdict.startswith("extrapolated: gross sliding begins at 0.25 rad/s")
    assert within_sliding(level, 0.25) == level


def test_what_the_prediction_error_does_not_tell_takes_the_value_of_certain_sliding(seen: Regression) -> None:
    value = seen.numbers["fs"].value
    untold = Estimate(
        "fs", "N·m", "F_S", 1e9, 1e8, 1e-20, 1e20, False, "the interval spans a factor of 1e+40"
    )
    found, notes = fall_together(untold, seen, STATIC, 2.0, held=True)
    assert (found.value, found.lower, found.upper) == (value, 1e-20, 1e20)
    assert not found.identified
    assert found.verdict == untold.verdict
    assert not notes


def test_where_both_contradict_the_value_is_certain_slidings_and_the_interval_holds_both(
    seen: Regression,
) -> None:
    value = seen.numbers["fs"].value
    other = Estimate("fs", "N·m", "F_S", 1.3 * value, 0.01 * value, 1.28 * value, 1.32 * value, True, "")
    found, notes = fall_together(other, seen, STATIC, 2.0, held=True)
    assert found.value == value
    assert found.lower < value < 1.32 * value < found.upper
    assert len(notes) == 1


def test_without_a_fall_in_certain_sliding_nothing_is_taken_from_it(seen: Regression) -> None:
    untold = Estimate("fs", "N·m", "F_S", 0.5, 0.1, 0.1, 1.0, False, "untold")
    assert fall_together(untold, replace(seen, falls=0.5), STATIC, 2.0, held=True) == (untold, [])


def test_a_velocity_is_taken_with_the_laws_own_exponent(seen: Regression) -> None:
    assert number_of("vs", seen, 1.0) is seen.falling[1.0][1]
    assert number_of("vs", seen, None) is seen.vs
    assert number_of("vs", seen, 1.5) is None


def test_friction_at_rest_that_nothing_moved_against_is_in_no_model() -> None:
    high = Estimate("fs", "N·m", "F_S", 7.5, 1.0, 3.0, 20.0, False, "above the largest torque recorded")
    flat = at_level(high, 0.06)
    assert (flat.value, flat.lower, flat.upper) == (0.06, 0.06, 20.0)
