"""A load behind a spring: the inertia is that of both, and frequency and share of the motor are determined."""

from __future__ import annotations

import math

import pytest

from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.identification.train import two_inertias
from stickslip.machines.servo import ServoAxis
from support.analytic_records import record
from support.belt import LOAD, MOTOR, driven

AXIS = ServoAxis(drive_side="load")


@pytest.fixture(scope="module", params=[30.0, 60.0])
def belt(request: pytest.FixtureRequest) -> tuple[float, SlidingPosterior]:
    def friction(v: float) -> float:
        return 0.05 * math.tanh(v / 1e-2) + 5e-4 * v

    return request.param, estimate_sliding([driven(request.param, friction)], AXIS)


def test_a_load_behind_a_belt_does_not_count_as_more_inertia(belt: tuple[float, SlidingPosterior]) -> None:
    found = belt[1]
    assert max(found.presence("elasticity"), found.presence("elasticity of higher order")) > 0.5
    low, high = found.interval("inertia")
    assert low <= MOTOR + LOAD <= high


def test_motor_and_load_are_right_or_not_determined(belt: tuple[float, SlidingPosterior]) -> None:
    frequency, found = belt
    both = two_inertias(found)
    if both is not None:
        assert both.antiresonance == pytest.approx(frequency, rel=0.25)


def test_a_rigid_axis_has_no_load_behind_a_spring() -> None:
    assert two_inertias(estimate_sliding([record()], AXIS)) is None
