"""Maxwell-slip: closed loops, non-local memory, and the same run by all integrators."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.spec import Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

U = Surroundings()
MODEL = Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4)
DAMPED = Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, sigma2=0.018)


def follow(model, turns):
    """Torques at the turning points of a motion from rest, rad."""
    z, here, out = model.law.state(model.parameters), 0.0, []
    for there in turns:
        out.append(model.law.step(there - here, there - here, 1.0, z, model.parameters, U))
        here = there
    return out


def test_masing_rule():
    """After a reversal the branch is the virgin curve, twice as large (Masing)."""
    virgin = [follow(MODEL, [x])[0] for x in np.linspace(0.0, 4e-5, 9)]
    branch = [follow(MODEL, [4e-5, 4e-5 - 2.0 * x])[1] for x in np.linspace(0.0, 4e-5, 9)]
    np.testing.assert_allclose(branch, virgin[-1] - 2.0 * np.array(virgin), atol=1e-12)


def test_torque_is_the_sum_of_saturated_springs():
    for x in (5e-6, 1e-5, 1.5e-5, 5e-5):
        expected = sum(min(k * x, 0.08375) for k in (1e4, 7e3, 5e3, 3e3))
        assert follow(MODEL, [x])[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("helper", [None, Feedforward, Feedback])
def test_exact_adaptive_and_fixed_integrators_agree(helper):
    axis = RigidAxis(3.8623e-4, DAMPED)
    compensator = helper(DAMPED, gain=0.6) if helper else None
    controller = Controller(place("PD", 3.8623e-4, 10.0, 0.85), compensator)
    grid = np.linspace(0.0, 1.0, 101)
    paths = {}
    for name in ("exact", "adaptive", "fixed"):
        run = simulate(
            axis,
            controller,
            Reference("sine", amplitude=0.3, frequency=1.0),
            1.0,
            integrator=name,
            output=grid,
            time_step=2e-5,
            metered=False,
        )
        paths[name] = np.interp(grid, run.time, run["position"])
    assert np.ptp(paths["exact"]) > 0.2
    assert np.abs(paths["exact"] - paths["adaptive"]).max() < 1e-8
    assert np.abs(paths["fixed"] - paths["adaptive"]).max() < 1e-6


@pytest.mark.parametrize("method", ["rate", "step"])
def test_open_loop_follows_the_closed_hysteresis(method):
    times = np.linspace(0.0, 2.0, 81)
    motion = Reference("harmonic", amplitude=3e-5, frequency=1.0)
    torque = respond(MODEL, motion, times, method=method)["friction_torque"]
    position = motion.sample(times)[:, 0]
    expected, springs, before = [], np.zeros(4), 0.0
    for x in position:
        springs = np.clip(springs + np.array([1e4, 7e3, 5e3, 3e3]) * (x - before), -0.08375, 0.08375)
        expected.append(springs.sum())
        before = x
    np.testing.assert_allclose(torque, expected, atol=2e-9)
