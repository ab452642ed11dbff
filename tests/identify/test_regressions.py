"""A regression is made once for the doctor and the identification of one record, and again where anything differs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression import regressions
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.identify.regression.regressions import Regressions
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")


def record(fc: float = 0.1) -> Experiment:
    """An axis with Coulomb and viscous friction on two sines."""
    t = 1e-3 * np.arange(8000, dtype=np.float64)
    q = 0.5 * np.sin(4.0 * t) + 0.3 * np.sin(1.5 * t)
    v, a = 2.0 * np.cos(4.0 * t) + 0.45 * np.cos(1.5 * t), -8.0 * np.sin(4.0 * t) - 0.675 * np.sin(1.5 * t)
    noise = np.random.default_rng(1).normal(0.0, 1.0, (2, t.size))
    return Experiment(
        "sines", t, q + 1e-6 * noise[0], 0.01 * a + 0.02 * v + fc * np.sign(v) + 0.002 * noise[1]
    )


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the first experiments of regressions that were really made."""
    names: list[str] = []

    def counted(experiments: Sequence[Experiment], axis: ServoAxis, **options: Any) -> Regression:
        names.append(experiments[0].name)
        return regress_axis(experiments, axis, **options)

    monkeypatch.setattr(regressions, "regress_axis", counted)
    return names


def test_the_same_question_is_answered_once(made: list[str]) -> None:
    regress = Regressions()
    first = regress([record()], AXIS)
    other = ServoAxis(drive_side="load", backlash=0.01)  # which takes no part
    assert regress([replace(record(), name="again")], other, skew=None) is first
    assert made == ["sines"]


def test_whatever_the_numbers_depend_on_asks_anew(made: list[str]) -> None:
    regress, experiment = Regressions(), record()
    first = regress([experiment], AXIS)
    half = np.arange(experiment.time.size) < 4000
    assert regress([record(0.2)], AXIS).numbers["fc"].value > 1.9 * first.numbers["fc"].value
    regress([replace(experiment, used=half)], AXIS)
    regress([replace(experiment, supply=np.full(experiment.time.size, 2.0))], AXIS)
    regress([experiment], replace(AXIS, drive_gain=2.0))
    regress([experiment], replace(AXIS, gravity="pendulum"))
    regress([experiment], replace(AXIS, motion="linear"))
    assert regress([experiment], AXIS, skew=1e-3).numbers["skew"].value == 1e-3
    regress([experiment, experiment], AXIS)
    assert len(made) == 9
    assert experiment.drive is not None
    experiment.drive[:] *= 3.0  # the very same object, with other numbers in it
    assert regress([experiment], AXIS).numbers["fc"].value > 2.9 * first.numbers["fc"].value


@pytest.mark.parametrize("how", [["--inverse"], ["--law", "coulomb"]])
def test_doctor_and_identification_of_the_command_line_share_theirs(
    how: list[str], made: list[str], tmp_path: Path
) -> None:
    experiment = record()
    assert experiment.drive is not None
    table = np.column_stack([experiment.time, experiment.position, experiment.drive])
    log = tmp_path / "log.csv"
    head = "time [s],position [rad],torque [N·m]"
    np.savetxt(log, table, delimiter=",", header=head, comments="", encoding="utf-8")
    assert main(["identify", str(log), *how, "--no-report", "--out", str(tmp_path / "out")]) == 0
    assert made == ["record"]
