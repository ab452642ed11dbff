"""Gains that a record shows, against those that somebody gives."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identification.axis import identify_axis
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.loop_check import GAINS, doubted_loops, shown_gains
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis
from support import axis_cases as cases

WRONG: dict[str, dict[str, Any]] = {
    "kp": {"kp": 1.41 * cases.LOOP.kp},
    "kd": {"kd": 2.0 * cases.LOOP.kd},
    "kr": {"kr": 0.0},
    "ki": {"ki": 40.0},
}


def recorded(counts: float, seen: float, seed: int = 0, late: int = 0) -> Experiment:
    """A record of so many counts a turn, made by a controller that saw the position in `seen` of them."""
    time = 1e-3 * np.arange(6000)
    rng = np.random.default_rng(seed)
    reference = cases.wanted(time, seed)
    loop = replace(cases.LOOP, count=2.0 * math.pi / seen if seen else 0.0)
    push = 0.01 * np.repeat(rng.standard_normal(time.size // 10), 10)
    drive = Drive(time, reference, "feedback", loop, disturbance=push, max_step=2e-4)
    out = drive_axis(Mechanics(cases.INERTIA, offset=0.03), cases.model("stribeck"), drive)
    count = 2.0 * math.pi / counts
    signal = np.roll(out[:, 2] + 2e-3 * rng.standard_normal(time.size), late)
    return Experiment(
        "log.csv", time, count * np.round(out[:, 0] / count), signal, "torque", reference, cases.LOOP
    )


@pytest.mark.parametrize("counts", [2000, 16384, 1_000_000])
@pytest.mark.parametrize("seen", ["the same", "the exact position", "two rows before"])
def test_right_gains_are_not_doubted(counts: int, seen: str) -> None:
    for seed in range(3):
        made = recorded(
            counts, 0 if seen == "the exact position" else counts, seed, 2 * (seen == "two rows before")
        )
        assert doubted_loops([made]) == []


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("counts", [16384, 1_000_000])
def test_wrong_gains_are_told_with_those_that_the_record_shows(name: str, counts: int) -> None:
    made = recorded(counts, counts)
    claimed = replace(made, loop=replace(cases.LOOP, **WRONG[name]))
    shown = shown_gains(claimed)
    assert shown is not None
    truth = np.array([getattr(cases.LOOP, g) for g in GAINS])
    assert np.all(np.abs(shown.values - truth) < np.maximum(2.0 * shown.half_widths, 0.03 * truth))
    (said,) = doubted_loops([claimed])
    assert said.startswith("log.csv")
    assert f"{name} {WRONG[name][name]:.4g} given" in said
    assert not any(f"{g} " in said for g in GAINS if g != name)


@pytest.mark.parametrize("late", [1, 2, -1])
def test_a_reference_that_is_recorded_late_is_no_other_controller(late: int) -> None:
    for seed in range(2):
        made = recorded(16384, 16384, seed)
        assert made.reference is not None
        rows = np.clip(np.arange(made.time.size) - late, 0, made.time.size - 1)
        made = replace(made, reference=made.reference[rows])
        for name, gains in ({"as it was": {}} | WRONG).items():
            shown = shown_gains(replace(made, loop=replace(cases.LOOP, **gains)))
            assert shown is not None
            assert bool(shown.differing()) == bool(gains), name


@pytest.mark.parametrize("kr", [0.0, 0.3])
def test_a_reference_that_is_recorded_late_is_told(kr: float) -> None:
    # Stiffer: rows of the reference are worth more of the signal.
    loop = Loop(kp=30.0, kd=0.3, kr=kr)
    time = 1e-3 * np.arange(6000)
    reference = cases.wanted(time, 0)
    drive = Drive(time, reference, "feedback", loop, max_step=2e-4)
    out = drive_axis(Mechanics(cases.INERTIA), cases.model("stribeck"), drive)
    made = Experiment("log.csv", time, out[:, 0], out[:, 2], "torque", reference, loop)
    assert doubted_loops([made]) == []
    for late, said in ((2, "2 rows late"), (1, "1 row late"), (-1, "1 row early")):
        moved = reference[np.clip(np.arange(time.size) - late, 0, time.size - 1)]
        (note,) = doubted_loops([replace(made, reference=moved)])
        assert f"log.csv: the reference seems recorded {said}; so shifted, the loop given" in note
        for wrong, told in (({"kd": 0.6}, "kd 0.6 given, 0.3 "), ({"kp": 42.0}, "kp 42 given, 30 ")):
            (note,) = doubted_loops([replace(made, reference=moved, loop=replace(loop, **wrong))])
            assert told in note
            assert note.count(" given, ") == 1


def test_a_signal_with_its_sign_turned_is_told_with_the_gains_as_shown() -> None:
    made = recorded(16384, 16384)
    assert made.drive is not None
    (said,) = doubted_loops([replace(made, drive=-made.drive)])
    assert f"kp {cases.LOOP.kp:.4g} given, -{cases.LOOP.kp:.2g}"[:-1] in said
    assert said.endswith("the recorded signal's sign may be turned.")


def test_a_factor_on_the_output_belongs_to_the_gains() -> None:
    made = recorded(16384, 16384)
    halved = replace(made, loop=replace(cases.LOOP, kp=4.0, kd=0.04, kr=0.04))
    assert doubted_loops([halved])
    assert doubted_loops([halved], 2.0) == []


def test_rows_at_the_limit_say_nothing_of_the_gains() -> None:
    made = recorded(16384, 16384)
    assert made.drive is not None
    limit = 0.3
    assert np.mean(np.abs(made.drive) > limit) > 0.1
    cut = replace(made, drive=np.clip(made.drive, -limit, limit))
    assert doubted_loops([cut]) == []
    assert doubted_loops([replace(cut, loop=replace(cases.LOOP, limit=limit))]) == []


def test_a_gain_that_a_record_does_not_excite_is_not_doubted() -> None:
    made = recorded(16384, 16384)
    rng = np.random.default_rng(3)
    push = 0.4 * np.repeat(rng.standard_normal(made.time.size // 50), 50)
    held = np.zeros(made.time.size)
    drive = Drive(made.time, held, "feedback", cases.LOOP, disturbance=push, max_step=2e-4)
    out = drive_axis(Mechanics(cases.INERTIA), cases.model("coulomb"), drive)
    still = replace(made, reference=held, position=out[:, 0], drive=out[:, 2])
    assert doubted_loops([replace(still, loop=replace(cases.LOOP, kr=0.0))]) == []
    (said,) = doubted_loops([replace(still, loop=replace(cases.LOOP, kd=0.16))])
    assert "kd 0.16 given, 0.08" in said
    # So short that one stretch is all there is.
    assert shown_gains(still.until(200)) is not None


def test_nothing_is_said_without_signal_or_rows() -> None:
    made = recorded(16384, 16384)
    assert shown_gains(replace(made, drive=None)) is None
    assert shown_gains(replace(made, loop=None)) is None
    assert shown_gains(made.until(90)) is None
    idle = replace(made, drive=0.0 * made.time, reference=0.0 * made.time, position=0.0 * made.time)
    assert doubted_loops([idle]) == []


def test_identification_doubts_a_loop_that_did_not_make_the_record() -> None:
    axis = ServoAxis(drive_side="load")
    made = recorded(16384, 16384).until(3000)
    wrong = replace(made, loop=Loop(kp=8.0, kd=0.16, kr=0.08, limit=3.0))
    found = identify_axis([wrong], axis, ["coulomb"], intervals="covariance")
    assert any("kd 0.16 given, 0.0799" in note for note in found.notes)
