"""Friction that falls slowly over a record: found, allowed for, said; and none where there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stickslip import Record
from stickslip.identify.axis.drifting import at_the_middle, on_drift
from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.doctor import examine
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.drifting import drift_of, usual_speed
from stickslip.identify.regression.inverse import inverse_dynamics
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
TRUE = {"inertia": 0.02, "fc": 1.0, "sigma2": 0.1, "offset": 0.1}
COUNT = 2.0 * np.pi / 2**18
SECONDS, RATE = 24.0, 250.0


def speed_of(kind: str, t: np.ndarray) -> np.ndarray:
    """rad/s, of moves both ways all along, of a stair that goes up one way and then the other, or of a sweep."""
    if kind == "moves":
        parts = ((3.0, 0.21), (3.0, 0.73), (2.0, 1.9))
        return sum((a * np.sin(2.0 * np.pi * f * t + k) for k, (a, f) in enumerate(parts)), np.zeros(t.size))
    if kind == "sweep":
        return 6.0 * np.sin(2.0 * np.pi * (0.2 * t + 1.6 * t**2 / t[-1]))
    levels = np.array([1.0, 2.0, 3.0, 5.0, 8.0, 6.0, 4.0, 2.5])
    steps = np.concatenate([levels, -levels])[np.minimum((16 * t / t[-1]).astype(int), 15)]
    return np.convolve(steps, np.hanning(101) / np.sum(np.hanning(101)), "same")


def log(kind: str, drift: float, seed: int = 0) -> Experiment:
    """An axis whose level of friction grows by that part, and viscous friction by twice that, from first row to last;
    `TRUE` are the values of the middle."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    v = speed_of(kind, t)
    late = t / SECONDS - 0.5
    level = TRUE["fc"] * (1.0 + drift * late / (1.0 + 0.5 * drift))
    slope = TRUE["sigma2"] * (1.0 + 2.0 * drift * late / (1.0 + drift))
    torque = TRUE["inertia"] * np.gradient(v, t) + level * np.tanh(v / 0.01) + slope * v + TRUE["offset"]
    torque += 0.01 * np.convolve(rng.standard_normal(t.size), np.ones(5), "same")
    position = COUNT * np.round(np.cumsum(v) / RATE / COUNT)
    return Experiment("log", t, position, torque)


def record(e: Experiment) -> Record:
    units = {"position": "rad", "motor_torque": "N·m"}
    return Record(e.time, {"position": e.position, "motor_torque": e.signal()}, units)


@pytest.fixture(scope="module")
def falling() -> Regression:
    return regress_axis([log("moves", -0.12)], AXIS)


def test_a_drift_is_found_and_values_are_those_of_the_middle(falling: Regression) -> None:
    drift = drift_of(falling.numbers, falling.rows)
    assert drift is not None
    speed = usual_speed(falling.rows)
    first, last = (
        TRUE["fc"] * (1.0 + side * 0.06 / 0.94) + TRUE["sigma2"] * speed * (1.0 + side * 0.12 / 0.88)
        for side in (1.0, -1.0)
    )  # the level falls by 12 %, viscous friction by 24 %
    assert drift.low < last / first - 1.0 < drift.high < 0.0
    for name, true in TRUE.items():
        low, high = falling.interval(name)
        assert low <= true <= high, name
        assert high - low < 0.2 * true, name
    assert "drift" not in falling.correlated


def test_what_drifts_is_no_part_of_what_is_left(falling: Regression) -> None:
    plain = {n: falling.numbers[n].value for n in TRUE}
    assert falling.left_by(plain) < 0.02


@pytest.mark.parametrize("kind", ["moves", "stair", "sweep"])
def test_none_is_found_where_there_is_none(kind: str) -> None:
    assert not regress_axis([log(kind, 0.0, 1)], AXIS).drifts


def test_a_stair_up_one_way_and_then_the_other_leaves_the_constant_torque_unsure() -> None:
    """There a drift of friction looks like a constant torque: the interval holds both."""
    found = regress_axis([log("stair", -0.12)], AXIS)
    low, high = found.interval("offset")
    assert low <= TRUE["offset"] <= high
    assert high - low > 0.02 * TRUE["fc"]
    assert not found.drifts
    assert "other values of offset" in on_drift(found)[0]


def test_the_doctor_warns_from_a_few_percent_on() -> None:
    warned = [f for f in examine(record(log("moves", -0.07))).warnings if f.code == "change"]
    assert len(warned) == 1
    assert warned[0].message.startswith("friction falls by ")
    assert "--from" in warned[0].remedy
    assert not [f for f in examine(record(log("moves", 0.0))).findings if f.code == "change"]


def test_other_methods_see_the_record_without_it(falling: Regression) -> None:
    e = log("moves", -0.12)
    (steady,) = at_the_middle([e], AXIS, falling)
    seen: Any = inverse_dynamics([steady], AXIS)
    before: Any = inverse_dynamics([e], AXIS)
    assert seen.relative_error < 0.8 * before.relative_error
    untouched = at_the_middle([e], AXIS, None)
    assert untouched[0] is e


def test_it_is_said_and_numbers_hold() -> None:
    result = identify_axis([log("moves", -0.12)], AXIS, ["coulomb"])
    assert any(n.startswith("Friction falls by ") and "middle of the record" in n for n in result.notes)
    for e in result.estimates:
        assert e.identified, e.name
        assert e.lower <= TRUE[e.name] <= e.upper, e.name
    assert on_drift(None) == []
