"""The exponent with which friction falls: found from the record, or named; what it leaves open is in the intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip import plugins
from stickslip.identify.axis import exponent
from stickslip.identify.axis.exponent import is_open, named_for_both, shown, with_other
from stickslip.identify.axis.falling import fall_each_way
from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.axis.prediction import Rival, axis_prediction
from stickslip.identify.axis.search import Asked
from stickslip.identify.estimate import Estimate
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.axis_start import each_way
from stickslip.identify.fit.parameter_vector import Parameter
from stickslip.identify.observer.prediction_error import PredictionError
from stickslip.identify.regression.band_system import USUAL_EXPONENTS
from stickslip.identify.regression.inverse import inverse_dynamics
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.identify.regression.sliding_rows import Fall
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
MOVES = ("held", 1000, "p-pi", "production", "clean")
LAW = plugins.law("stribeck")


def drawn(logs: Any, seed: int, power: float) -> tuple[Experiment, dict[str, float]]:
    """An ordinary log whose friction falls with this exponent, and the truth."""
    log = logs.draw(seed, *MOVES, exponent=power)
    return Experiment("log", log.time, log.position, log.torque), log.truth


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_certain_sliding_tells_the_exponent_and_the_levels_of_both_forms(logs: Any, power: float) -> None:
    record, truth = drawn(logs, 970000, power)
    found = regress_axis([record], AXIS)
    assert found.exponent == power
    assert found.falling[power][0] > 0.99
    assert math.fsum(chance for chance, _ in found.falling.values()) == pytest.approx(1.0)
    for name in ("fc", "sigma2", "inertia"):
        low, high = found.interval(name)
        assert low <= truth[name] <= high
    assert found.vs.value == pytest.approx(truth["vs"], rel=0.3)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_law_is_fitted_with_the_exponent_that_the_record_shows(logs: Any, power: float) -> None:
    record, truth = drawn(logs, 970060, power)
    found = identify_axis([record], AXIS, ["stribeck"])
    assert found.model is not None
    assert found.model.as_dict()["delta_s"] == power
    for name in ("fs", "fc", "vs"):
        assert found[name].lower <= truth[name] <= found[name].upper
    assert any("delta_s = 1" in note for note in found.notes) == (power == 1.0)


def test_an_exponent_that_is_named_is_taken(logs: Any) -> None:
    record, _ = drawn(logs, 970000, 1.0)
    found = identify_axis([record], AXIS, ["stribeck"], values={"delta_s": 2.0})
    assert found.model is not None
    assert found.model.as_dict()["delta_s"] == 2.0
    assert not any("delta_s" in note for note in found.notes)
    assert not is_open(Asked(values={"delta_s": 2.0}), [LAW])
    assert not is_open(Asked(free=["delta_s"]), [LAW])
    assert is_open(Asked(), [LAW])
    assert not is_open(Asked(), [plugins.law("coulomb")])


def test_certain_sliding_says_nothing_without_a_fall() -> None:
    asked = Asked()
    assert shown(asked, None, [LAW]) == (asked, [])


def test_an_exponent_is_that_of_both_directions(logs: Any) -> None:
    """Of friction per direction one had kept the usual exponent, beside which the other's was found."""
    record, truth = drawn(logs, 970060, 1.0)
    law, sliding = each_way(LAW), regress_axis([record], AXIS, each_way=True)
    assert shown(Asked(), sliding, [law])[0].values == {"delta_s": 1.0, "delta_s_negative": 1.0}
    assert shown(Asked(), sliding, [LAW])[0].values == {"delta_s": 1.0}
    named = Asked(values={"delta_s": 1.0})
    assert named_for_both(named, [law]).values == {"delta_s": 1.0, "delta_s_negative": 1.0}
    assert named_for_both(named, [LAW]).values == named.values
    apart = Asked(values={"delta_s": 1.0, "delta_s_negative": 2.0})
    assert named_for_both(apart, [law]).values == apart.values
    assert not is_open(Asked(values={"delta_s_negative": 2.0}), [law])
    # The fall that sliding shows for both stands where the prediction error does not tell a direction's.
    par = next(f.par for f in law.fields if f.name == "vs")
    for way, level in (("", "fc_positive"), ("_negative", "fc_negative")):
        for name, true in (("fs", truth["fs"]), ("vs", truth["vs"])):
            lost = Estimate(
                f"{name}{way}", "", "", 9.0 * true, math.nan, 0.1 * true, 90.0 * true, False, "untold"
            )
            taken = fall_each_way(lost, sliding, Parameter(lost.name, par, true), 1.0, held=True)
            assert taken.value == pytest.approx(true, rel=0.3)
            assert not taken.identified
        excess = sliding.numbers["fs"].value - sliding.numbers["fc"].value
        rest = fall_each_way(
            replace(lost, name=f"fs{way}"), sliding, Parameter(f"fs{way}", par, 1.0), 1.0, held=True
        )
        assert rest.value == pytest.approx(sliding.numbers[level].value + excess)


def preferring(sliding: Regression, chances: Mapping[float, float]) -> Regression:
    """The regression with other probabilities of friction's forms."""
    return replace(sliding, falling={d: (chances[d], vs) for d, (_, vs) in sliding.falling.items()})


def deciding(
    logs: Any, monkeypatch: pytest.MonkeyPatch
) -> tuple[
    Callable[[Rival, Regression, Sequence[Estimate]], tuple[Any, Any, Any]], PredictionError, Regression
]:
    """What decides, given the other form's result, certain sliding and estimates; and what an ordinary log says.

    Where the other form is taken, the values that it is fitted with stand for the result.
    """
    record, _ = drawn(logs, 970000, 2.0)
    first, asked = inverse_dynamics([record], AXIS), Asked()
    found = axis_prediction([record], AXIS, LAW, first=first)
    monkeypatch.setattr(exponent, "axis_prediction", lambda *_, values, **__: values)

    def decide(other: Rival, sliding: Regression, judged: Sequence[Estimate]) -> tuple[Any, Any, Any]:
        monkeypatch.setattr(exponent, "rival", lambda *_: other)
        return exponent.predicted_with([record], AXIS, LAW, first, asked, found, sliding, judged)

    return decide, found, regress_axis([record], AXIS)


@pytest.mark.parametrize(("better", "form"), [(-1.0, 1.0), (1.0, 2.0)])
def test_where_record_and_certain_sliding_contradict_each_other_both_forms_are_held(
    logs: Any, monkeypatch: pytest.MonkeyPatch, better: float, form: float
) -> None:
    decide, found, told = deciding(logs, monkeypatch)
    beside = {e.name: 1.1 * e.value for e in found.estimates}
    chances = {form: 0.98, 3.0 - form: 0.02}
    result, other, said = decide(
        Rival(better * found.cost, beside), preferring(told, chances), found.estimates
    )
    assert result is found
    assert other.keys() == {"fs", "vs"}
    assert "does not decide" in said[0]


@pytest.mark.parametrize(("better", "taken"), [(-1.0, "own"), (0.0, "both"), (1.0, "other")])
def test_the_record_decides_by_a_tenth_or_both_are_held(
    logs: Any, monkeypatch: pytest.MonkeyPatch, better: float, taken: str
) -> None:
    decide, found, told = deciding(logs, monkeypatch)
    levels = {e.name: 1.2 * e.upper for e in found.estimates if e.name in ("fs", "vs")}
    beside = {e.name: e.value for e in found.estimates} | levels
    other_one, open_ = Rival(better * found.cost, beside), preferring(told, USUAL_EXPONENTS)
    result, other, said = decide(other_one, open_, found.estimates)
    if taken == "other":
        assert result["delta_s"] == 1.0
        assert "delta_s = 1" in said[0]
        return
    assert result is found
    assert bool(other) == bool(said) == (taken == "both")
    for before, after in zip(found.estimates, with_other(found.estimates, found, other), strict=True):
        assert after.value == before.value
        # As wide about the other as about its own.
        wide = after.name in other and before.identified
        assert after.upper == pytest.approx(1.2 * before.upper**2 / before.value if wide else before.upper)
    # Where certain sliding is sure the record is not asked.
    assert decide(other_one, told, found.estimates) == (found, {}, [])
    # Nor where nothing is left that depends on it.
    doubted = [replace(e, identified=False) for e in found.estimates]
    assert decide(other_one, open_, doubted) == (found, {}, [])


def test_a_fall_of_either_form_has_a_tenth_left_at_the_same_speed() -> None:
    gaussian, tustin = Fall.like(2.0, 2.0), Fall.like(2.0, 1.0)
    speed = np.array([2.0 * math.sqrt(math.log(10.0))])
    assert gaussian.vs == pytest.approx(2.0)
    assert gaussian.at(speed) == pytest.approx(0.1)
    assert tustin.at(speed) == pytest.approx(0.1)
    assert tustin.at(-speed) == pytest.approx(0.1)
    assert Fall(1.0, 2.0).at(np.array([1e9])) == pytest.approx(0.0)
