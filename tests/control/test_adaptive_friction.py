"""Functions of adaptive friction that the golden rows do not hold: a polynomial, and Gaussians over the angle too."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.registry import control_law
from support.golden_rows import INERTIA, controller, learnt, pd

TIME, RATE, SLOPE, LEAK = 1e-3, 12.0, 62.83, 0.05
LOW = ss.Reference("sine", amplitude=0.01, frequency=0.4)


def polynomial(v, angle):
    return np.array([min(max(v / 1e-3, -1.0), 1.0) * min(abs(v) / 0.35, 1.0) ** i for i in range(4)])


def over_angle(v, angle):
    places, centres = [-0.8, -0.4, 0.0, 0.4, 0.8] * 4, 0.25 * (np.arange(20) // 5)
    place = math.asinh(v / 1e-3) / math.asinh(0.35 / 1e-3)
    return np.exp(-(((place - np.array(places)) / 0.4) ** 2) - ((angle - centres) / 0.25) ** 2)


@pytest.mark.parametrize(
    ("functions", "values"), [("polynomial", polynomial), ("gaussians_over_angle", over_angle)]
)
def test_the_torque_is_the_sum_of_functions_whose_weights_follow_the_gradient(functions, values):
    law = control_law("adaptive_friction").having(functions=functions)
    p = law.parameters({**law.example, "slope": SLOPE, "leak": LEAK, "largest": 10.0})
    z, weights = law.state(p), np.zeros(len(p.rate))
    rng = np.random.default_rng(2)
    for _ in range(200):
        v, error, behind, position = rng.normal(size=4) * np.array([0.1, 0.01, 0.05, 0.5])
        y = SimpleNamespace(
            reference_velocity=v, velocity=v - behind, error=error, position=position, turns=0.0, elapsed=TIME
        )
        phi = values(v, position + error)
        weights += TIME * RATE * (phi * (behind + SLOPE * error) - LEAK * weights)
        assert law.sample(y, z, p, None) == pytest.approx(float(phi @ weights), abs=1e-12)
    assert z.weight == pytest.approx(weights.tolist(), abs=1e-12)
    assert np.abs(weights).max() > 0.01


def test_gaussians_over_the_angle_count_turns():
    law = control_law("adaptive_friction").having(functions="gaussians_over_angle")
    p = law.parameters({**law.example, "largest": 10.0})
    torques = []
    for turns, position in ((0.0, 0.3), (1.0, 0.3 - 2.0 * math.pi), (1.0, 0.3)):
        y = SimpleNamespace(
            reference_velocity=0.1, velocity=0.0, error=0.01, position=position, turns=turns, elapsed=TIME
        )
        torques.append(law.sample(y, law.state(p), p, None))
    assert torques[1] == pytest.approx(torques[0], rel=1e-12)
    assert torques[2] < 1e-12 * torques[0]


@pytest.mark.slow
@pytest.mark.parametrize(("functions", "most"), [("polynomial", 0.9e-3), ("gaussians_over_angle", 0.8e-3)])
def test_an_axis_that_a_pd_leaves_stuck_follows(functions, most):
    friction = ss.Model(
        "gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018
    )
    drive = controller(pd(), None, learnt(functions), alone=True)
    record = ss.simulate(
        ss.RigidAxis(INERTIA, friction), drive, LOW, 5.0, integrator="sampled", metered=False
    )
    error = (record["position_reference"] - record["position"])[record["event"] == 0.0]
    assert math.sqrt(float(np.mean(error**2))) < most  # the PD alone: 12.24 mrad
