"""Sliding is estimated once for the doctor and the identification of a record, and again where anything differs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identification import memo
from stickslip.identification.experiment import Experiment
from stickslip.identification.memo import SlidingMemo
from stickslip.identification.search import Asked
from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.machines.servo import ServoAxis
from support.analytic_records import TRUTH
from support.analytic_records import record as analytic_record

AXIS = ServoAxis(drive_side="load")


def record(**truth: float) -> Experiment:
    return analytic_record(seconds=6.0, **truth)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the first experiments of estimates that were really made."""
    names: list[str] = []

    def counted(experiments: Sequence[Experiment], *options: Any, **named: Any) -> SlidingPosterior:
        names.append(experiments[0].name)
        return estimate_sliding(experiments, *options, **named)

    monkeypatch.setattr(memo, "estimate_sliding", counted)
    return names


def test_the_same_question_is_answered_once(made: list[str]) -> None:
    estimate = SlidingMemo()
    first = estimate([record()], AXIS)
    other = ServoAxis(drive_side="load", backlash=0.01)  # has no part in sliding
    assert estimate([replace(record(), name="again")], other) is first
    assert made == ["record"]


def test_whatever_the_numbers_depend_on_is_estimated_anew(made: list[str]) -> None:
    estimate, experiment = SlidingMemo(), record()
    first = estimate([experiment], AXIS)
    assert (
        estimate([record(fc=2.0 * TRUTH["fc"])], AXIS).numbers["fc"].value > 1.9 * first.numbers["fc"].value
    )
    estimate([replace(experiment, used=np.arange(experiment.time.size) < 4000)], AXIS)
    estimate([replace(experiment, supply=np.full(experiment.time.size, 2.0))], AXIS)
    estimate([experiment], replace(AXIS, drive_gain=2.0))
    estimate([experiment], replace(AXIS, motion="linear"))
    estimate([experiment], AXIS, Asked(skew=1e-3))
    assert len(made) == 7
    assert experiment.drive is not None
    experiment.drive[:] *= 3.0  # the same object, with other values in it
    assert estimate([experiment], AXIS).numbers["fc"].value > 2.9 * first.numbers["fc"].value


def test_doctor_and_identification_of_the_command_line_share_theirs(made: list[str], tmp_path: Path) -> None:
    experiment = record()
    table = np.column_stack([experiment.time, experiment.position, experiment.signal()])
    log = tmp_path / "log.csv"
    head = "time [s],position [rad],torque [N·m]"
    np.savetxt(log, table, delimiter=",", header=head, comments="", encoding="utf-8")
    command = ["identify", str(log), "--law", "coulomb", "--no-report", "--out", str(tmp_path / "out")]
    assert main(command) == 0
    assert made == ["record"]
