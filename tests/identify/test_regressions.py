"""A regression is made once for the doctor and the identification of one record, and again where anything differs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identify.regression import regressions
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.identify.regression.regressions import Regressions
from stickslip.identify.trial import Trial
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")


def record(fc: float = 0.1) -> Trial:
    """An axis with Coulomb and viscous friction on two sines."""
    t = 1e-3 * np.arange(8000, dtype=np.float64)
    q = 0.5 * np.sin(4.0 * t) + 0.3 * np.sin(1.5 * t)
    v, a = 2.0 * np.cos(4.0 * t) + 0.45 * np.cos(1.5 * t), -8.0 * np.sin(4.0 * t) - 0.675 * np.sin(1.5 * t)
    noise = np.random.default_rng(1).normal(0.0, 1.0, (2, t.size))
    return Trial("sines", t, q + 1e-6 * noise[0], 0.01 * a + 0.02 * v + fc * np.sign(v) + 0.002 * noise[1])


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the first trials of regressions that were really made."""
    names: list[str] = []

    def counted(trials: Sequence[Trial], axis: ServoAxis, **options: Any) -> Regression:
        names.append(trials[0].name)
        return regress_axis(trials, axis, **options)

    monkeypatch.setattr(regressions, "regress_axis", counted)
    return names


def test_the_same_question_is_answered_once(made: list[str]) -> None:
    regress = Regressions()
    first = regress([record()], AXIS)
    other = ServoAxis(drive_side="load", backlash=0.01)  # which takes no part
    assert regress([replace(record(), name="again")], other, skew=None) is first
    assert made == ["sines"]


def test_whatever_the_numbers_depend_on_asks_anew(made: list[str]) -> None:
    regress, trial = Regressions(), record()
    first = regress([trial], AXIS)
    half = np.arange(trial.time.size) < 4000
    assert regress([record(0.2)], AXIS).numbers["fc"].value > 1.9 * first.numbers["fc"].value
    regress([replace(trial, used=half)], AXIS)
    regress([replace(trial, supply=np.full(trial.time.size, 2.0))], AXIS)
    regress([trial], replace(AXIS, drive_gain=2.0))
    regress([trial], replace(AXIS, gravity="pendulum"))
    regress([trial], replace(AXIS, motion="linear"))
    assert regress([trial], AXIS, skew=1e-3).numbers["skew"].value == 1e-3
    regress([trial, trial], AXIS)
    assert len(made) == 9
    assert trial.drive is not None
    trial.drive[:] *= 3.0  # the very same object, with other numbers in it
    assert regress([trial], AXIS).numbers["fc"].value > 2.9 * first.numbers["fc"].value


@pytest.mark.parametrize("how", [["--inverse"], ["--law", "coulomb"]])
def test_doctor_and_identification_of_the_command_line_share_theirs(
    how: list[str], made: list[str], tmp_path: Path
) -> None:
    trial = record()
    assert trial.drive is not None
    table = np.column_stack([trial.time, trial.position, trial.drive])
    log = tmp_path / "log.csv"
    head = "time [s],position [rad],torque [N·m]"
    np.savetxt(log, table, delimiter=",", header=head, comments="", encoding="utf-8")
    assert main(["identify", str(log), *how, "--no-report", "--out", str(tmp_path / "out")]) == 0
    assert made == ["record"]
