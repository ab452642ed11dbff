"""Armstrong's seven parameters: what each does, and a delay that does not depend on the steps."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.spec import Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

U = Surroundings()
MODEL = Model("armstrong", kt=2.5e4, fc=0.285, fs_inf=0.05, vs=0.01, tau=1e-3, gamma=0.1)
LAW, P = MODEL.law, MODEL.parameters


def breakaway_after(dwell):
    """Torque at which the contact breaks away when it is loaded at once after a time at rest."""
    z = LAW.state(P)
    for _ in range(100):
        LAW.step(0.0, 0.0, dwell / 100, z, P, U)
    torques = [LAW.step(1e-3, 1e-3, 1e-5, z, P, U) for _ in range(3000)]
    return max(torques)


def test_breakaway_rises_with_the_dwell_time():
    for dwell in (0.1, 1.0, 10.0):
        loading = 0.3 / 2.5e4 / 1e-3
        rest = dwell + loading
        assert breakaway_after(dwell) == pytest.approx(0.285 + 0.05 * rest / (rest + 0.1), abs=4e-4)


def test_sliding_friction_lags_by_the_delay():
    """After a jump of the velocity the torque stays for tau_L, then changes; whatever the steps are."""
    for dt in (1e-5, 1e-4, 2.5e-4):
        z = LAW.state(P)
        LAW.step(0.0, 0.0, 10.0, z, P, U)
        for _ in range(400):
            LAW.step(0.02, 0.02, 1e-3, z, P, U)
        torque = [LAW.step(0.02, 0.02, 0.0, z, P, U)]
        LAW.step(0.02, 0.005, 1e-9, z, P, U)
        n = round(2e-3 / dt)
        torque += [LAW.step(0.005, 0.005, dt, z, P, U) for _ in range(n)]
        early, late = torque[round(0.5e-3 / dt)], torque[-1]
        assert early == pytest.approx(torque[0], rel=1e-12)
        assert late > torque[0] + 1e-3


def test_no_step_is_too_long_for_the_delay():
    """One step of a second equals a thousand at constant velocity."""
    one, many = LAW.state(P), LAW.state(P)
    for z in (one, many):
        LAW.step(0.02, 0.02, 1.0, z, P, U)
    whole = LAW.step(0.02, 0.02, 1.0, one, P, U)
    for _ in range(1000):
        parts = LAW.step(0.02, 0.02, 1e-3, many, P, U)
    assert whole == pytest.approx(parts, rel=1e-12)


def test_runs_in_the_fixed_integrator_by_itself():
    axis = RigidAxis(3.8623e-4, Model("armstrong", **LAW.example))
    controller = Controller(place("PD", 3.8623e-4, 10.0, 0.85))
    grid = np.linspace(0.0, 1.0, 101)
    paths = []
    for step in (1e-4, 2.5e-5):
        run = simulate(
            axis,
            controller,
            Reference("sine", amplitude=0.3, frequency=1.0),
            1.0,
            output=grid,
            time_step=step,
            metered=False,
        )
        assert run.meta["integrator"] == "fixed"
        paths.append(np.interp(grid, run.time, run["position"]))
    assert np.ptp(paths[0]) > 0.2
    assert np.abs(paths[0] - paths[1]).max() < 1e-4
