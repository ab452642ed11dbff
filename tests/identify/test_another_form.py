"""Friction of another form than a level and a slope: what certain sliding fits of it is not identified."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.identify.axis.in_sentences import on_creep
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.creeping import NOWHERE
from stickslip.identify.regression.number import Number
from stickslip.identify.regression.regression import regress_axis
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
RATE, INERTIA = 1000.0, 1.35e-3
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0, 150.0)


def staircase(root: float) -> dict[str, Any]:
    """Steps of 0.8 s in both directions, twice; level, viscous part, and one with the root of the speed."""
    up = np.concatenate([np.full(800, v) for v in SPEEDS])
    way = np.concatenate([np.zeros(300), up, np.zeros(300), -up])
    wanted = np.concatenate([way, way, np.zeros(300)])
    box = np.ones(61) / 61.0
    speed = np.convolve(np.convolve(wanted, box, "same"), box, "same")
    position = np.cumsum(speed) / RATE
    position = 0.5 * (position + np.concatenate([[0.0], position[:-1]]))
    friction = np.sign(np.round(speed, 9)) * (0.35 + root * np.sqrt(np.abs(speed))) + 0.002 * speed
    noise = np.random.default_rng(2).standard_normal(speed.size)
    torque = INERTIA * np.gradient(speed) * RATE + friction + 2e-3 * noise
    return {"t": np.arange(speed.size) / RATE, "position": np.round(position / 6e-6) * 6e-6, "torque": torque}


@pytest.mark.parametrize("root", [0.0, 0.05])
def test_a_grease_that_thins_has_no_level_and_slope(root: float) -> None:
    """Its slow speeds were left out as friction that is rebuilt after a reversal, and the rest called identified: at
    0.5 rad/s the curve was 46 % too high."""
    found = ss.identify(**staircase(root), law=["coulomb"])
    fc, sigma2, inertia = (found.parameters[n] for n in ("fc", "sigma2", "inertia"))
    assert inertia.identified
    assert inertia.value == pytest.approx(INERTIA, rel=0.02)
    assert fc.identified is (root == 0.0)
    assert sigma2.identified is (root == 0.0)
    said = " ".join(found.notes)
    assert ("friction rises with velocity in another form" in said) is (root > 0.0)
    if root == 0.0:
        assert fc.value == pytest.approx(0.35, rel=0.01)
    else:
        assert "slower steady motion" in fc.verdict


@pytest.mark.parametrize("seed", [0, 2])
def test_friction_is_not_missing_where_a_chattering_torque_makes_speeds_lack_and_exceed_it_by_turns(
    seed: int,
) -> None:
    """Another program's axis of plain friction whose loop chatters: "68% of friction's level is missing although the
    axis slides steadily"."""
    log = staircase(0.0)
    white = np.random.default_rng(seed).standard_normal(log["t"].size + 199)
    chatter = 0.35 * np.convolve(white, np.ones(200) / np.sqrt(200.0), "valid")
    found = regress_axis([Experiment("log", log["t"], log["position"], log["torque"] + chatter)], AXIS)
    assert found.creep == NOWHERE


def test_of_a_record_whose_numbers_are_not_believed_no_friction_is_missing() -> None:
    log = staircase(0.05)
    found = regress_axis([Experiment("log", log["t"], log["position"], log["torque"])], AXIS)
    (said,) = on_creep(found, AXIS)
    assert "is missing although the axis slides steadily" in said
    unsure = {**found.numbers, "inertia": Number(INERTIA, 10.0 * INERTIA)}
    assert replace(found, numbers=unsure).doubt
    assert on_creep(replace(found, numbers=unsure), AXIS) == []
