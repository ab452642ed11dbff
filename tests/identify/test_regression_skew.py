"""When the torque acted, as certain sliding tells it: parts of a row, many rows, and what only looks like them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identify.axis.agreed import aligned
from stickslip.identify.axis.in_sentences import on_timing
from stickslip.identify.doctor import examine
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.flexible import Train
from stickslip.identify.regression.number import Number
from stickslip.identify.regression.regression import regress_axis
from stickslip.identify.regression.together import as_told
from stickslip.machines.servo import ServoAxis
from stickslip.record import Record

AXIS = ServoAxis(drive_side="load")


def experiment(log: Any) -> Experiment:
    return Experiment("log", log.time, log.position, log.torque)


def record(log: Any) -> Record:
    return Record(
        log.time,
        {"position": log.position, "motor_torque": log.torque},
        {"position": "rad", "motor_torque": "N·m"},
    )


@pytest.mark.parametrize("column", ["held", "commanded", "actual", "mean"])
def test_the_skew_is_found_to_a_tenth_of_a_row(logs: Any, column: str) -> None:
    log = logs.draw(4242, column, 1000, "p-pi", "production", "clean")
    found = regress_axis([experiment(log)], AXIS)
    assert found.numbers["skew"].value == pytest.approx(log.truth["skew"], abs=1e-4)
    low, high = found.interval("skew")
    assert low <= log.truth["skew"] <= high
    (sentence,) = on_timing(found)
    assert ("after" if log.truth["skew"] < 0.0 else "before") in sentence


def test_a_skew_of_many_rows_is_found_and_taken_out(logs: Any) -> None:
    log = logs.draw(4242, "held", 1000, "p-pi", "production", "clean")
    late = Experiment("late", log.time, log.position, np.interp(log.time - 8e-3, log.time, log.torque))
    found = regress_axis([late], AXIS)
    assert found.numbers["skew"].value == pytest.approx(log.truth["skew"] + 8e-3, abs=1e-4)
    (moved,) = aligned([late], found)
    assert moved.drive is not None
    assert np.max(np.abs(moved.drive - log.torque)[20:-20]) < 0.05 * np.max(np.abs(log.torque))


@pytest.mark.parametrize("late", [0.06, 0.1])
@pytest.mark.parametrize("kind", ["clean", "backlash"])
def test_a_torque_that_comes_a_tenth_of_a_second_late_is_told_and_taken_out(
    logs: Any, kind: str, late: float
) -> None:
    """As robots log it, whose effort comes by another message; strokes are much longer."""
    log = logs.draw(1500005, "actual", 500, "feedforward", "staircase", kind)
    k = round(500 * late)
    moved = Experiment("late", log.time[k:] - log.time[k], log.position[k:], log.torque[:-k])
    found = regress_axis([moved], AXIS)
    assert found.numbers["skew"].value == pytest.approx(log.truth["skew"] + late, abs=5e-4)
    low, high = found.interval("inertia")
    assert low <= log.truth["inertia"] <= high
    table = Record(
        moved.time,
        {"position": moved.position, "motor_torque": log.torque[:-k]},
        {"position": "rad", "motor_torque": "N·m"},
    )
    (said,) = (f for f in examine(table).findings if f.code == "time-skew")
    assert f"{1e3 * late:.0f}" in said.message or f"{1e3 * late + 2:.0f}" in said.message


def test_an_axis_that_dwells_at_every_reversal_has_no_late_torque(logs: Any) -> None:
    """A slow sine whose acceleration does not show: its torque turns as late as friction lets the axis go."""
    log = logs.draw(1500003, "mean", 250, "feedforward", "sine", "backlash")
    assert "time-skew" not in {f.code for f in examine(record(log)).findings}


@pytest.mark.parametrize("rows", [-5, 5])
@pytest.mark.parametrize("motion", ["production", "staircase"])
def test_a_delay_of_many_rows_is_one_beside_play_and_noise(logs: Any, motion: str, rows: int) -> None:
    for seed, kind in ((996180, "clean"), (996204, "asymmetry"), (996012, "backlash")):
        log = logs.draw(seed, "held", 1000, "pid", motion, kind)
        inside = slice(abs(rows), -abs(rows))
        late = Experiment("late", log.time[inside], log.position[inside], np.roll(log.torque, rows)[inside])
        found = regress_axis([late], AXIS)
        low, high = found.interval("skew")
        wrong = abs(found.numbers["skew"].value - log.truth["skew"] - rows * 1e-3)
        assert wrong <= max(0.75 * (high - low), 0.1e-3)  # one lies 1.003 half-widths off
        low, high = found.interval("inertia")
        assert low <= log.truth["inertia"] <= high


def test_a_skew_that_is_given_is_kept(logs: Any) -> None:
    log = logs.draw(4242, "actual", 1000, "p-pi", "production", "clean")
    found = regress_axis([experiment(log)], AXIS, skew=0.0)
    assert found.numbers["skew"].value == 0.0
    free = regress_axis([experiment(log)], AXIS)
    assert found.numbers["inertia"].value != free.numbers["inertia"].value


@pytest.mark.parametrize(
    ("loop", "imperfection"), [("feedforward", "clean"), ("p-pi", "backlash"), ("p-pi", "flexible")]
)
def test_feedforward_backlash_and_flexibility_are_no_time_skew(
    logs: Any, loop: str, imperfection: str
) -> None:
    log = logs.draw(321, "commanded", 1000, loop, "production", imperfection)
    assert "time-skew" not in {f.code for f in examine(record(log)).findings}


def test_the_doctor_says_when_the_torque_acted(logs: Any) -> None:
    log = logs.draw(4242, "commanded", 1000, "p-pi", "production", "clean")
    (said,) = (f for f in examine(record(log)).findings if f.code == "torque-timing")
    assert said.level == "note"
    assert f"{abs(log.truth['skew']) * 1e3:.1f}" in said.message


def test_ringing_is_not_explained_half_a_cycle_late_by_an_inertia_below_0(logs: Any) -> None:
    """Tuning steps with cogging: a skew of 5 rows made J -0.3 of the truth, Fc half as high again."""
    log = logs.draw(140636, "mean", 500, "pid", "steps", "cogging")
    found = regress_axis([experiment(log)], AXIS)
    assert abs(found.numbers["skew"].value - log.truth["skew"]) < 0.5 * found.period
    assert found.numbers["inertia"].value == pytest.approx(log.truth["inertia"], rel=0.2)


@pytest.mark.parametrize(
    "cell",
    [(993426, "actual", 500, "p-pi", "sine", "cogging"), (993436, "actual", 500, "p-pi", "steps", "cogging"),
     (990286, "commanded", 500, "feedforward", "sine", "cogging")],
    ids=lambda cell: str(cell[0]),
)  # fmt: skip
def test_cogging_is_no_skew_of_many_rows(logs: Any, cell: Any) -> None:
    """It was: 3.6, 17 and 5 rows, J 41 % above and 96 % below the truth, both identified."""
    log = logs.draw(*cell)
    found = regress_axis([experiment(log)], AXIS)
    low, high = found.interval("inertia")
    assert low <= log.truth["inertia"] <= high


def test_one_band_fitted_with_two_skews_confirms_nothing(logs: Any) -> None:
    found = regress_axis([experiment(logs.draw(4242, "held", 1000, "p-pi", "production", "clean"))], AXIS)
    assert found.confirmed("inertia")
    assert not replace(found, bands=(found.bands[0], found.bands[0])).confirmed("inertia")


def test_a_skew_beside_a_train_that_gives_is_as_sure_as_the_inertia() -> None:
    """Of 23 that tuning steps seemed to tell to a quarter of a row 8 held."""
    sure, unsure = Number(1.0, 0.009), Number(1.0, 0.02)
    for train in (Train.GIVES, Train.SWINGS):
        told, blurred = (
            as_told({"skew": Number(0.0, 1e-5), "inertia": i}, 1.0, 1e-3, train) for i in (sure, unsure)
        )
        assert told.interval[1] < 0.25e-3 < 0.5e-3 < blurred.interval[1]
    assert (
        as_told({"skew": Number(0.0, 1e-5), "inertia": unsure}, 1.0, 1e-3, Train.RIGID).interval[1] < 0.1e-3
    )


def test_a_skew_beside_an_inertia_that_is_not_told_is_not_stated() -> None:
    """A slow sine: J has the interval [-158 %, +158 %], its skew had one of 0.06 ms that was 0.85 ms off."""
    t = np.arange(0.0, 12.0, 1e-3)
    v = 2.0 * np.cos(2.0 * np.pi * 0.25 * t)
    rng = np.random.default_rng(3)
    torque = (
        1e-6 * np.gradient(v, t) + 0.2 * np.tanh(v / 0.01) + 0.02 * v + 2e-3 * rng.standard_normal(t.size)
    )
    found = regress_axis(
        [Experiment("slow", t, 2.0 / (2.0 * np.pi * 0.25) * np.sin(2.0 * np.pi * 0.25 * t), torque)], AXIS
    )
    assert not found.shows_inertia
    assert on_timing(replace(found, numbers=found.numbers | {"skew": Number(0.0, 1e-5)})) == []
