"""The adaptive integrator against independent results, invariants and its own convergence."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import pd, place
from stickslip.core.errors import Divergence
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from support.thesis_loops import CASES, INERTIA, METRICS, PARAMETERS, PLANT, misses, thesis_run

LINEAR = [f"{r}/{f}/{c}" for r in CASES for f in ("nominal", "plus10", "minus10") for c in ("PD", "PID")]
# Explicit steps leave ringing of 1e-8 rad/s in a contact that has come to rest; the reference has none.
SETTLED = {"step": {"w2_rms_e", "w2_pp_e"}}


@pytest.mark.parametrize("rule", ["signed", "literal"])
@pytest.mark.parametrize("case", LINEAR)
def test_pd_and_pid_agree_with_the_reference(case, rule, study_reference):
    axis, controller, reference, duration = thesis_run(case)
    record = simulate(axis, controller, reference, duration, integrator="adaptive", slip_rule=rule)
    assert misses(study_reference[rule, case], record.meta["metrics"]) == []


@pytest.mark.parametrize("rule", ["signed", "literal"])
@pytest.mark.parametrize("law", ["stribeck", "lugre"])
@pytest.mark.parametrize("reference", ["low", "step"])
def test_feedback_agrees_with_the_reference(reference, law, rule, study_reference):
    """Feedback that grows near rest; bands where the reference calls it sensitive."""
    for friction in ("nominal", "plus10", "minus10"):
        case = f"{reference}/{friction}/FB-{law}"
        axis, controller, motion, duration = thesis_run(case)
        record = simulate(axis, controller, motion, duration, integrator="adaptive", slip_rule=rule)
        names = [n for n in METRICS if n != "w2_rev_per_s"]
        assert misses(study_reference[rule, case], record.meta["metrics"], names) == [], case


def test_error_falls_with_the_tolerance():
    """Halving digits of the tolerance halves digits of the error, down to 1e-9 rad."""
    axis, controller, reference, _ = thesis_run("low/nominal/PID")
    grid = np.linspace(0.0, 2.0, 401)

    def run(tolerance):
        return simulate(
            axis,
            controller,
            reference,
            2.0,
            integrator="adaptive",
            tolerance=tolerance,
            output=grid,
            metered=False,
        )

    tight = run(1e-11)
    best = np.array([tight["position"][np.searchsorted(tight.time, t)] for t in grid])
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        record = run(tolerance)
        ours = np.array([record["position"][np.searchsorted(record.time, t)] for t in grid])
        errors.append(float(np.abs(ours - best).max()))
    assert errors[2] < 2e-9
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


def test_without_friction_it_is_the_matrix_exponential():
    """J theta'' = -kp theta - kd theta' from 1 rad, in closed form."""
    gains = place("PD", INERTIA, 10.0, 0.5)
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.0, sigma2=0.0))
    record = simulate(
        axis, Controller(gains), Reference("step", amplitude=0.0), 0.5,
        integrator="adaptive", initial=(1.0, 0.0), tolerance=1e-10,
    )  # fmt: skip
    w, zeta = 2 * math.pi * 10.0, 0.5
    wd = w * math.sqrt(1 - zeta**2)
    t = record.time
    exact = np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    assert np.abs(record["position"] - exact).max() < 1e-9


def test_mirror_symmetry():
    for controller in ("PD", "FF-lugre", "FB-gms"):
        axis, control, reference, _ = thesis_run(f"low/nominal/{controller}")
        mirrored = Reference("sine", amplitude=-0.01, frequency=0.4)
        one = simulate(axis, control, reference, 0.5, integrator="adaptive")
        other = simulate(axis, control, mirrored, 0.5, integrator="adaptive")
        assert np.abs(one["position"] + np.interp(one.time, other.time, other["position"])).max() < 1e-9


def test_feedforward_of_an_ideal_step_is_pd():
    """The reference velocity of an ideal step is zero, and so is its feedforward."""
    axis, control, _, _ = thesis_run("step/nominal/PD")
    step = Reference("step", amplitude=0.01)
    plain = simulate(axis, control, step, 0.3, integrator="adaptive")
    for law, parameters in PARAMETERS.items():
        helped = Controller(control.gains, Feedforward(Model(law, **parameters)))
        record = simulate(axis, helped, step, 0.3, integrator="adaptive")
        assert np.abs(record["compensation_torque"]).max() == 0.0
        assert np.abs(np.interp(plain.time, record.time, record["position"]) - plain["position"]).max() < 1e-9


def test_energy_balance_closes():
    for case in ("low/nominal/PD", "low/nominal/PID", "low/plus10/FF-gms", "low/nominal/FB-lugre"):
        axis, controller, reference, _ = thesis_run(case)
        record = simulate(axis, controller, reference, 2.0, integrator="adaptive")
        energy = record.meta["energy"]
        assert abs(energy["residual"]) < 1e-7 * energy["friction_loss"]


def test_a_contact_at_rest_only_loses_energy():
    """Signed rule: what the friction takes never comes back beyond what its springs hold."""
    axis = RigidAxis(INERTIA, Model("gms", **PLANT))
    record = simulate(
        axis, Controller(pd(0.0, 0.0)), Reference("step", amplitude=0.0), 0.2,
        integrator="adaptive", initial=(0.0, 0.5),
    )  # fmt: skip
    kinetic = 0.5 * INERTIA * record["velocity"] ** 2
    assert kinetic.max() <= 0.5 * INERTIA * 0.25 * (1 + 1e-12)
    assert abs(record["velocity"][-1]) < 0.05


def test_coulomb_holds_below_and_slides_above():
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.3))
    gains = pd(10.0, 0.1)
    held = simulate(axis, Controller(gains), Reference("step", amplitude=0.029), 0.5, integrator="adaptive")
    assert np.all(held["position"] == 0.0)
    assert held["friction_torque"][-1] == pytest.approx(0.29)
    slid = simulate(axis, Controller(gains), Reference("step", amplitude=0.2), 1.0, integrator="adaptive")
    assert slid["velocity"][-1] == 0.0
    # It stops where the controller's torque lies within what the contact holds.
    assert abs(slid["motor_torque"][-1]) <= 0.3
    assert slid["position"][-1] > 0.17


def test_feedback_of_the_sign_narrows_what_is_held():
    """Held while kp e stays within F_C less the compensated part: the sliding mode as the exact limit."""
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.3))
    helper = Feedback(Model("coulomb", fc=0.2))
    control = Controller(pd(10.0, 0.1), helper)
    held = simulate(axis, control, Reference("step", amplitude=0.0099), 0.3, integrator="adaptive")
    assert np.all(held["position"] == 0.0)
    slid = simulate(axis, control, Reference("step", amplitude=0.0101), 0.3, integrator="adaptive")
    assert slid["position"][-1] > 0.0


def test_torque_limit_is_kept():
    axis, control, reference, _ = thesis_run("low/nominal/PD")
    limited = Controller(control.gains, torque_limit=0.3)
    record = simulate(axis, limited, reference, 2.0, integrator="adaptive")
    assert np.abs(record["motor_torque"]).max() == 0.3


def test_filtered_feedback_runs_and_calms():
    """The 10 Hz Butterworth of chapter 4 on the compensator's velocity."""
    axis, control, reference, _ = thesis_run("low/nominal/FB-coulomb")
    filtered = Controller(control.gains, Feedback(Model("coulomb", **PARAMETERS["coulomb"]), filter_hz=10.0))
    raw = simulate(axis, control, reference, 2.0, integrator="adaptive")
    calm = simulate(axis, filtered, reference, 2.0, integrator="adaptive")
    assert calm.meta["metrics"]["reversals_per_s"] < raw.meta["metrics"]["reversals_per_s"]


def test_divergence_says_when_and_keeps_the_record():
    """Feedback that overcompensates viscous friction runs away."""
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.01, sigma2=0.01))
    helper = Feedback(Model("coulomb", fc=0.01, sigma2=1.0))
    with pytest.raises(Divergence, match=r"ended at .* s") as caught:
        simulate(
            axis, Controller(pd(0.0, 0.0), helper), Reference("step", amplitude=0.0), 5.0,
            integrator="adaptive", initial=(0.0, 1.0),
        )  # fmt: skip
    assert caught.value.record is not None
    assert 0.0 < caught.value.time < 1.0
    assert len(caught.value.record) > 1
    assert caught.value.record.time[-1] <= caught.value.time


def test_ringing_against_the_torque_limit():
    """A limit just above break-away is met again and again while the contact rings."""
    axis, control, reference, _ = thesis_run("low/nominal/FF-lugre")
    limited = Controller(control.gains, control.compensator, torque_limit=0.32)
    record = simulate(axis, limited, reference, 5.0, integrator="adaptive")
    assert np.abs(record["motor_torque"]).max() == 0.32
    fixed = simulate(axis, limited, reference, 5.0, integrator="fixed", time_step=2e-5)
    grid = np.linspace(0.0, 5.0, 501)
    apart = np.interp(grid, record.time, record["position"]) - np.interp(grid, fixed.time, fixed["position"])
    assert np.abs(apart).max() < 1e-5
