"""What the report of an axis sets beside its fit: measured friction, slow motion, and the size of a misfit."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from stickslip import Model
from stickslip.identification.axis import identify_axis
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.report.axis_evidence import beside, judgements, measured_friction, slow_rows
from stickslip.report.axis_pictures import pictures_of
from stickslip.report.identified import rendered
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

AXIS = ServoAxis(drive_side="load")
TRUTH = {"fs": 0.3, "fc": 0.2, "vs": 0.3, "sigma2": 0.01}
LOOP = Loop(kp=12.0, kd=0.12, kr=0.12)
COUNT = 2.0 * math.pi / 65536


def steady(v: Any) -> Any:
    return TRUTH["fc"] + (TRUTH["fs"] - TRUTH["fc"]) * np.exp(-((v / TRUTH["vs"]) ** 2)) + TRUTH["sigma2"] * v


@cache
def record(law: str = "stribeck") -> Experiment:
    """Levels of velocity in both directions, counted, with white noise of the torque."""
    friction = (
        Model("stribeck", k=100.0, **TRUTH) if law == "stribeck" else Model("coulomb", fc=0.2, sigma2=0.01)
    )
    levels = [s * v for v in (0.2, 0.5, 1.0, 2.0, 5.0) for s in (1.0, -1.0)]
    velocity = np.concatenate([np.zeros(200), *(np.full(600, v) for v in levels), np.zeros(200)])
    velocity = np.convolve(np.pad(velocity, 40, mode="edge"), np.ones(81) / 81.0, mode="valid")
    time, reference = 1e-3 * np.arange(velocity.size), 1e-3 * np.cumsum(velocity)
    drive = Drive(time, reference, "feedback", LOOP, max_step=1e-4)
    out = drive_axis(Mechanics(8e-4, offset=0.02), friction, drive)
    noise = 2e-3 * np.random.default_rng(0).standard_normal(time.size)
    return Experiment(
        "log.csv", time, COUNT * np.round(out[:, 0] / COUNT), out[:, 2] + noise, "torque", reference, LOOP
    )


@cache
def identified() -> Identification:
    return identify_axis([record("coulomb")], AXIS, ["coulomb"], intervals="covariance")


def test_measured_friction_lies_on_the_true_curve() -> None:
    inverse = inverse_dynamics([record()], AXIS)
    sides = measured_friction(inverse, Mechanics(8e-4, offset=0.02))
    assert all(speed.size >= 4 for speed, _ in sides)
    for speed, torque in sides:
        assert torque == pytest.approx(steady(speed), rel=0.04)
        assert np.all(speed > 0.0)
    # With an offset that is wrong, the directions part.
    forwards, backwards = measured_friction(inverse, Mechanics(8e-4, offset=-0.02))
    assert np.median(forwards[1] - steady(forwards[0])) > 0.03
    assert np.median(backwards[1] - steady(backwards[0])) < -0.03


def test_the_slow_motion_is_where_the_axis_moves_least_but_moves() -> None:
    rows = slow_rows(record())
    assert rows is not None
    shown = record().position[rows]
    assert 12 * COUNT < np.ptp(shown) < 0.2
    assert slow_rows(record().until(1000)) is None
    time = 1e-3 * np.arange(4000)
    assert slow_rows(Experiment("even", time, 3.0 * time, 0.0 * time)) is None


def test_misfits_are_judged_beside_the_noise() -> None:
    found = identified()
    told = judgements(found)
    assert set(told) == {"position_relative", "drive_relative", "inverse_dynamics_relative"}
    # Without any other disturbance the simulation is as near as noise and rounding let it.
    assert told["drive_relative"] == "good: at the noise of the signal"
    assert told["position_relative"] == "good: at the encoder's rounding"
    assert beside(1.0, 0.5, "the noise") == "good: at the noise"
    assert beside(1.0, 0.04, "the noise") == "25 times the noise"
    assert beside(1.0, 0.000321, "the noise") == "3100 times the noise"
    assert beside(1.0, 0.0, "the noise") == beside(math.nan, 1.0, "the noise") == ""


def test_the_report_shows_them() -> None:
    found = identified()
    pictures = {p.name: p for p in pictures_of(found)}
    assert {"slow-position", "slow-drive"} <= pictures.keys()
    curve = pictures["sliding-curve"]
    assert [t.label for t in curve.traces if "points" in t.kind] == ["measured, v > 0", "measured, v < 0"]
    page = rendered(found, [], "t", {})
    assert '<span class="yes">good: at the noise of the signal</span>' in page
