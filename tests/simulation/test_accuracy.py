"""A run's own estimate of its error, against finer runs."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.simulation import accuracy
from stickslip.simulation.closed_loop import prepare, simulate
from stickslip.simulation.exact import engine as exact
from support.thesis_loops import CASES, INERTIA, PARAMETERS, PLANT, thesis_run

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
    assert found.well_conditioned == (found.error <= 1e-6 and not found.depends_on_start)


@pytest.mark.parametrize("rule", ["signed", "literal"])
@pytest.mark.parametrize("law", ["coulomb", "stribeck"])
def test_compensation_that_pushes_away_from_rest_depends_on_its_start(law, rule):
    """Such runs called themselves well conditioned: steps are exact, but 1e-9 rad decides which way it goes first."""
    axis, controller, reference, _ = thesis_run(f"low/nominal/FB-{law}")
    record = simulate(axis, controller, reference, 1.0, slip_rule=rule, check=True)
    found = record.meta["accuracy"]
    assert found["depends_on_start"] is True
    assert found["well_conditioned"] is False
    runs = [
        simulate(axis, controller, reference, 1.0, slip_rule=rule, initial=(start, 0.0), output=1e-3)
        for start in (0.0, 1e-9, -1e-9)
    ]
    times = np.arange(0.0, 1.0, 1e-3)
    there = [np.interp(times, r.time, r["position"]) for r in runs]
    apart = max(np.abs(other - there[0]).max() for other in there[1:])
    assert found["start_rad"] == pytest.approx(apart, rel=0.2)
    assert apart > 1e-4


@pytest.mark.parametrize(
    "run", ["low/nominal/PD", "low/nominal/PID", "low/nominal/FB-lugre", "step/nominal/FB-gms"]
)
def test_other_runs_do_not(run):
    axis, controller, reference, _ = thesis_run(run)
    found = accuracy.estimate(prepare(axis, controller, reference, 1.0, slip_rule="literal"))
    assert not found.depends_on_start
    assert found.start < 3e-6


def test_either_integrator_says_the_same():
    loop = Controller(
        PD.gains, Feedback(Model("lugre", **{**PARAMETERS["lugre"], "sigma0": 3.5e6, "sigma1": 0.0}))
    )
    case = prepare(AXIS, loop, SINE, 0.3)
    exactly, adaptively = (accuracy.start_apart(case, name) for name in ("exact", "adaptive"))
    assert exactly > 1e-7
    assert adaptively == pytest.approx(exactly, rel=0.05)


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
