"""Velocity estimators: the stated delay is the one measured, and rest is rest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.estimators import ESTIMATORS
from stickslip.control.registry import control_law
from stickslip.core.spec import Surroundings

TIME = 1e-3


def velocities(block, position):
    """The estimate along measured positions, rad/s."""
    controller = Controller(loop=ControlBlock("pd", kp=0.0, kd=1.0), sample_time=TIME, estimator=block)
    n, m, z, p = controller.settings, controller.memory(), controller.state(), controller.parameters
    u, sample = SimpleNamespace(**Surroundings()._asdict()), controller.functions["sample"]
    return np.array([-sample(x, x, 0.0, 0.0, n, m, z, p, u) for x in position.tolist()])


@pytest.mark.parametrize("time", [1e-3, 2.5e-4])
@pytest.mark.parametrize("name", ESTIMATORS)
def test_the_stated_delay_is_the_lag_behind_a_constant_acceleration(name, time, monkeypatch):
    monkeypatch.setattr(f"{__name__}.TIME", time)
    law = control_law(name)
    block = ControlBlock(law, **dict(law.example))
    t = np.arange(2000) * time
    lag = (t - velocities(block, 0.5 * t**2))[-1]
    assert law.delay(block.parameters, time) == pytest.approx(lag, rel=1e-9)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_constant_velocity_is_found_and_rest_is_rest(name):
    block = ControlBlock(name, **dict(control_law(name).example))
    found = velocities(block, 0.3 * TIME * np.arange(400) + 7.0)
    assert found[0] == 0.0
    assert found[-1] == pytest.approx(0.3, rel=1e-9)
    assert not velocities(block, np.full(50, 7.0)).any()


def test_more_filter_is_more_delay_and_less_noise():
    noise = 1e-5 * np.random.default_rng(1).standard_normal(4000)
    blocks = [ControlBlock("backward_difference")]
    blocks += [
        ControlBlock(name, corner=corner)
        for name in ("filtered_difference", "butterworth_difference", "luenberger")
        for corner in (800.0, 200.0)
    ]
    spread = [float(np.std(velocities(block, noise))) for block in blocks]
    delay = [block.law.delay(block.parameters, TIME) for block in blocks]
    for wide in (1, 3, 5):
        assert spread[0] > spread[wide] > spread[wide + 1]
        assert delay[0] < delay[wide] < delay[wide + 1]


def test_the_kalman_filters_gains_are_those_of_the_riccati_equation():
    """Of a random acceleration that is constant over a sample, and a position measured with noise."""
    for acceleration, noise in ((2000.0, 1e-5), (20.0, 1e-4)):
        block = ControlBlock("kalman", acceleration=acceleration, noise=noise)
        a, c = np.array([[1.0, TIME], [0.0, 1.0]]), np.array([[1.0, 0.0]])
        g = acceleration * np.array([[0.5 * TIME**2], [TIME]])
        p = solve_discrete_are(a.T, c.T, g @ g.T, np.array([[noise**2]]))
        gains = (p @ c.T / (c @ p @ c.T + noise**2)).ravel()
        # A jump of the measured position, from rest: the first velocity is the second gain times it.
        found = velocities(block, np.array([0.0, 1e-3]))
        assert found[1] == pytest.approx(1e-3 * gains[1], rel=1e-6)


def test_the_tracking_differentiator_follows_a_jump_with_its_acceleration_and_stops_there():
    block = ControlBlock("tracking_differentiator", acceleration=100.0, window=0.004)
    jump = np.concatenate([np.zeros(5), np.full(600, 0.1)])
    speed = velocities(block, jump)
    assert np.abs(np.diff(speed)).max() <= 100.0 * TIME * (1.0 + 1e-12)
    moved = np.cumsum(speed) * TIME
    assert moved[-1] == pytest.approx(0.1, rel=1e-3)
    assert moved.max() < 0.1 * 1.01
    # The shortest time with that acceleration is 2 sqrt(0.1 / 100) s.
    late = np.flatnonzero(moved > 0.098)[0] * TIME
    assert late < 1.3 * 2.0 * np.sqrt(0.1 / 100.0)
