"""What a recommendation says of itself: its sample time, the true reason for none, whose an oscillation is."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip.control.linear import Cascade, Gains
from stickslip.core.errors import InputError
from stickslip.core.messages import render
from stickslip.identification.estimate import Estimate
from stickslip.identification.identified_file import Identified
from stickslip.identification.motion import sinusoid
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import Drive, run
from stickslip.recommendation.candidates import Bench, rings_alone
from stickslip.recommendation.notes import lag_of, sampled_as
from stickslip.recommendation.refusals import held
from stickslip.recommendation.ringing import within_counts
from stickslip.recommendation.sample_time import refuse_filter, sample_time_for

INERTIA = 4e-4
COULOMB = Model("coulomb", fc=0.05, sigma2=1e-3)


def identified(*estimates: Estimate, period: float = 0.0) -> Identified:
    """A model of a record with that time between its rows, s."""
    data = ({"file": "log.csv", "rows": 9, **({"sample_time": period} if period else {})},)
    return Identified(
        Path("m.toml"), COULOMB, estimates, np.eye(len(estimates)), {"inertia": INERTIA}, data=data
    )


def drive_of(period: float, told_by: str = "") -> Drive:
    """A drive whose loop is critically damped at 15 Hz."""
    return Drive(15.0, sample_time=period, sample_time_from=told_by, amplitude=1.0)


def test_the_sample_time_is_the_records_where_nothing_else_is_given_and_it_is_said() -> None:
    assert sample_time_for(identified(period=5e-4), 2e-3, None, drive_of) == (2e-3, "as given")
    drive = drive_of(*sample_time_for(identified(period=5e-4), None, None, drive_of, INERTIA))
    (said,) = sampled_as(drive, None)
    assert said.startswith(
        "Simulated with a sample time of 0.0005 s, the time between the rows of the record log.csv;"
    )
    assert "give sample_time." in render(said)
    assert drive.as_dict()["sample_time_from"].endswith("give sample_time")
    period, source = sample_time_for(identified(), None, None, drive_of)
    assert period == pytest.approx(1e-3)
    assert source.startswith("assumed, as the model does not contain")


@pytest.mark.parametrize(("period", "kept"), [(2e-3, True), (3e-3, True), (5e-3, False), (0.03, False)])
def test_a_loop_hardly_damped_at_its_records_rows_runs_faster_than_they_were_kept(
    period: float, kept: bool
) -> None:
    drive = drive_of(*sample_time_for(identified(period=period), None, None, drive_of, INERTIA))
    assert drive.sample_time == pytest.approx(period if kept else 1e-3)
    assert drive.sample_time_from.startswith(
        "the time between" if kept else f"assumed: sampled every {period:.3g} s"
    )
    asked = [note for note in sampled_as(drive, None) if note.startswith("A loop that is sampled more often")]
    assert len(asked) == kept


def test_a_filter_that_its_records_rows_could_not_hold_runs_faster_than_they_were_kept() -> None:
    def filtered(period: float, told_by: str = "") -> Drive:
        return replace(drive_of(period, told_by), velocity_filter=300.0)

    period, source = sample_time_for(identified(period=2e-3), None, None, filtered, INERTIA)
    assert period == pytest.approx(1e-3)
    assert "could not have its filter of 300 Hz" in source
    refuse_filter(filtered(period))
    with pytest.raises(InputError, match=r"filter = 300 Hz must lie below half the sample rate, 250 Hz"):
        refuse_filter(filtered(2e-3))


def test_a_loop_unstable_on_an_inertia_that_is_not_identified_asks_for_the_inertia() -> None:
    unsure = Estimate("inertia", "kg·m²", "inertia", INERTIA, math.inf, 1e-6, 1e-2, False)
    drive = replace(Drive(), motion=sinusoid(0.1, 0.5))
    with pytest.raises(InputError, match=r"unstable.*give that with inertia in kg·m², check its gains"):
        held(identified(unsure), "it left", drive)
    for found, given in ((identified(unsure), INERTIA), (identified(), None)):
        with pytest.raises(InputError, match="unstable: it left; check its gains"):
            held(found, "it left", drive, given)


@pytest.mark.parametrize(
    ("slow", "said"),
    [(Gains(1.6, 0.0, 0.05, 0.0), "kr = 0 below kd = 0.05"), (Cascade(30.0, 0.05, 1.0, 0.0), "feed = 0")],
)
def test_a_lag_that_is_most_of_the_error_is_told_with_what_is_left_without_it(
    slow: Gains | Cascade, said: str
) -> None:
    plant, drive = RigidAxis(INERTIA, COULOMB), Drive(gains=slow, amplitude=1.0, frequency=0.5)
    trial = run(plant, drive.loop(INERTIA), drive)
    assert not isinstance(trial, str)
    (note,) = lag_of(plant, trial, drive.loop(INERTIA), drive)
    assert said in note
    assert "% of the error without any compensator" in note
    fed = slow._replace(feed=1.0) if isinstance(slow, Cascade) else slow._replace(kr=slow.kd)
    assert not list(lag_of(plant, trial, replace(drive, gains=fed).loop(INERTIA), drive))


@pytest.mark.parametrize(("swing", "own"), [(1e-3, True), (1e-5, False)])
def test_a_swing_wider_than_counts_is_the_integrals_and_no_finer_encoder_is_asked_for(
    swing: float, own: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = RigidAxis(INERTIA, COULOMB)
    monkeypatch.setattr("stickslip.recommendation.candidates.rings", lambda *_: "at rest")
    monkeypatch.setattr("stickslip.recommendation.candidates.swing_at_rest", lambda *_: swing)
    drive = Drive(gains=Gains(1.0, 8.0, 0.15, 0.15), amplitude=0.1, encoder_counts=65536.0)
    said = rings_alone(Bench([plant], drive.loop(INERTIA), drive, {}), INERTIA, "N·m")
    assert f"by up to {swing:.2g} rad peak to peak" in said
    assert ("the integral part hunts" in said) is own
    assert ("lower ki (8)" in said) is own
    assert ("use a finer encoder" in said) is not own


def test_what_stays_within_the_counts_by_a_small_torque_is_no_oscillation() -> None:
    drive = Drive(encoder_counts=4096.0)
    count = 2.0 * math.pi / 4096.0
    assert within_counts(2.0 * count, 0.01, 0.1, drive)
    assert not within_counts(4.0 * count, 0.01, 0.1, drive)
    assert not within_counts(2.0 * count, 0.05, 0.1, drive)
