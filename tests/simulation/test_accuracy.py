"""A run's own estimate of its error, against finer runs."""

from __future__ import annotations

import numpy as np
import pytest

from conftest import CASES, INERTIA, PLANT, thesis_run
from stickslip.control.compensators.feedback import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model
from stickslip.simulation import accuracy, exact
from stickslip.simulation.closed_loop import prepare, simulate

AXIS = RigidAxis(INERTIA, Model("gms", **PLANT))
PD = Controller(place("PD", INERTIA, 36.0, 1.0))
SINE = CASES["low"][0]


@pytest.mark.parametrize(
    "run", ["low/nominal/PD", "low/nominal/PID", "high/nominal/FF-lugre", "low/plus10/FB-gms", "low/minus10/FB-lugre",
            "step/nominal/FB-coulomb", "high/nominal/FB-stribeck"],
)  # fmt: skip
def test_errors_lie_within_the_estimate(run):
    axis, controller, reference, duration = thesis_run(run)
    duration = min(duration, 1.0)
    case = prepare(axis, controller, reference, duration, tolerance=1e-7)
    fine = prepare(axis, controller, reference, duration, tolerance=1e-10)
    found = accuracy.estimate(case)
    error = np.max(np.abs(exact.prepare(case).run()[0][:, 0] - exact.prepare(fine).run()[0][:, 0]))
    assert error <= max(found.error, 1e-7)
    assert found.well_conditioned == (found.error <= 1e-6)


def test_a_linear_run_is_well_conditioned():
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.0, sigma2=0.018))
    assert accuracy.estimate(prepare(axis, PD, SINE, 1.0, tolerance=1e-9)).error < 1e-10


def test_a_run_in_which_errors_grow_is_not():
    """Feedback of more viscous friction than there is: an oscillation, and any error, grows by exp(20 t)."""
    axis = RigidAxis(1.0, Model("coulomb", fc=0.0))
    controller = Controller(Gains(kp=1000.0), Feedback(Model("coulomb", fc=0.0, sigma2=40.0)))
    found = accuracy.estimate(prepare(axis, controller, SINE, 1.0, tolerance=1e-7))
    assert not found.well_conditioned
    assert found.error > 1e-6


def test_simulate_tells_when_asked():
    record = simulate(AXIS, PD, SINE, 0.5, tolerance=1e-7, check=True)
    assert record.meta["accuracy"]["well_conditioned"] is True
    assert 0.0 < record.meta["accuracy"]["error_rad"] < 1e-6
    assert "accuracy" not in simulate(AXIS, PD, SINE, 0.1).meta


def test_the_adaptive_integrator_is_held_to_ten_times_the_tolerance():
    record = simulate(AXIS, PD, SINE, 0.2, integrator="adaptive", tolerance=1e-8, check=True)
    assert 0.0 < record.meta["accuracy"]["error_rad"] < 1e-7


def test_the_fixed_integrator_has_no_tolerance():
    case = prepare(AXIS, PD, SINE, 0.1)
    with pytest.raises(ValueError, match="no tolerance"):
        accuracy.estimate(case, "fixed")


def test_a_finer_tolerance_finds_what_a_sensitive_run_does():
    """PID creeps along an unstable slide, where an error grows ten thousandfold."""
    friction = Model("gms", **{**PLANT, "fs": 0.32143, "fc": 0.2923, "sigma2": 0.01741})
    axis, pid = RigidAxis(3.7e-4, friction), Controller(place("PID", INERTIA, 36.0, 1.0))

    def run(tolerance):
        case = prepare(axis, pid, SINE, 2.5, tolerance=tolerance, metered=False)
        return case, exact.prepare(case).run()[0][:, 0]

    truth = run(3.3e-11)[1]
    errors, estimates = [], []
    for tolerance in (1e-8, 1e-9, 1e-10):
        case, found = run(tolerance)
        errors.append(np.max(np.abs(found - truth)))
        estimates.append(accuracy.estimate(case).error)
    assert errors[2] < 0.01 * errors[0]
    assert estimates[2] < 0.01 * estimates[0]
    assert all(error <= found for error, found in zip(errors, estimates))
