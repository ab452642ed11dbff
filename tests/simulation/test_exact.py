"""The exact integrator against the independent reference, closed solutions and its own convergence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, pid, place
from stickslip.core.errors import InputError
from stickslip.core.spec import Bristle, Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation import _forcing as forcing
from stickslip.simulation._meter import gathered
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import DIVERGED, DONE, Case, Outcome, lay_out
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.exact import engine as exact
from support.thesis_loops import CASES, INERTIA, METRICS, PARAMETERS, PLANT, misses, thesis_run

NAMES = ["rms_e", "max_e", "ss_e", "rms_ev", "rms_Tm", "rms_hp", "rev_per_s"]
COULOMB = Model("coulomb", fc=0.285, sigma2=0.018)
OTHER = Model("lugre", **PARAMETERS["lugre"])
OTHER.law = replace(OTHER.law, modes=None, variants={})
FREE = Model("coulomb", fc=0.0, sigma2=0.018)
GMS = Model("gms", **PLANT)
SINE = CASES["low"][0]
PD = place("PD", INERTIA, 36.0, 1.0)


def metrics(acc: np.ndarray, duration: float) -> dict[str, float]:
    """The metrics of the study that the reference rooms are given for."""
    acc = gathered(acc)
    found = {
        "rms_e": math.sqrt(acc["e2"] / duration),
        "max_e": acc["e_max"],
        "ss_e": acc["ss_e"] / (0.2 * duration),
        "rms_ev": math.sqrt(acc["ev2"] / duration),
        "rms_Tm": math.sqrt(acc["tm2"] / duration),
        "rms_hp": math.sqrt(acc["hp2"] / duration),
        "rev_per_s": acc["reversals"] / duration,
    }
    return {METRICS[name]: value for name, value in found.items()}


def loop(friction, controller, reference, duration, tolerance=1e-9, step=1e-3, **more) -> Case:
    grid = np.arange(round(duration / step) + 1) * step
    axis = RigidAxis(INERTIA, friction)
    return lay_out(axis, controller, reference, duration, tolerance=tolerance, grid=grid, **more)


def column(outcome: Outcome, index: int) -> np.ndarray:
    """One column of the rows on the grid."""
    return outcome.rows[outcome.rows[:, 8] == 0.0, index]


@pytest.mark.parametrize("rule", ["signed", "literal"])
@pytest.mark.parametrize(
    "controller",
    ["PD", "PID"]
    + [f"{how}-{law}" for how in ("FF", "FB") for law in ("coulomb", "stribeck", "lugre", "gms")],
)
@pytest.mark.parametrize("motion", ["low", "high", "step"])
def test_study_against_the_reference(motion, controller, rule, study_reference):
    for friction in ("nominal", "plus10", "minus10"):
        case = f"{motion}/{friction}/{controller}"
        assert study_misses(case, rule, study_reference, NAMES) == [], case


def study_misses(case, rule, study_reference, names):
    axis, controller, reference, duration = thesis_run(case)
    laid = loop(axis.friction, controller, reference, duration, slip_rule=rule)
    assert exact.can_run(laid) == ""
    outcome = exact.run(laid)
    assert outcome.code == DONE
    return misses(study_reference[rule, case], metrics(outcome.meter, duration), names)


def test_without_friction_the_run_is_the_matrix_exponential():
    """A step with PID: the loop is linear, of third order, and its solution an exponential."""
    gains = place("PID", INERTIA, 20.0, 0.7)
    case = loop(FREE, Controller(gains), Reference("step", amplitude=0.01), 0.5)
    outcome = exact.run(case)
    a = np.array(
        [
            [0.0, 1.0, 0.0],
            [-gains.kp / INERTIA, -(gains.kd + 0.018) / INERTIA, gains.ki / INERTIA],
            [-1.0, 0.0, 0.0],
        ]
    )
    b = np.array([0.0, gains.kp * 0.01 / INERTIA, 0.01])
    values, vectors = np.linalg.eig(a)
    rest = -np.linalg.solve(a, b)
    parts = np.linalg.solve(vectors, -rest.astype(complex))
    t = column(outcome, 0)
    want = rest[0] + ((vectors[0] * parts)[None, :] * np.exp(np.outer(t, values))).sum(axis=1).real
    assert np.max(np.abs(column(outcome, 3) - want)) < 1e-9


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_stiction_holds_up_to_the_break_away_torque(sign):
    """A rigid axis on a ramp: at rest until kp theta_d reaches F_C, then the linear motion under constant torque."""
    gains = Gains(kp=20.0)
    case = loop(COULOMB, Controller(gains), Reference("ramp", velocity=sign * 0.1), 0.4)
    outcome = exact.run(case)
    t_break = 0.285 / (20.0 * 0.1)
    events = outcome.rows[outcome.rows[:, 8] == 1.0, 0]
    assert events[0] == pytest.approx(t_break, abs=1e-9)
    t, position = column(outcome, 0), column(outcome, 3)
    assert np.all(position[t < t_break] == 0.0)
    assert np.all(sign * position[t > t_break + 1e-3] > 0.0)
    at_rest = (t > 0.0) & (t < t_break)
    np.testing.assert_allclose(column(outcome, 6)[at_rest], sign * 2.0 * t[at_rest], atol=1e-12)


def test_coulomb_against_the_adaptive_integrator():
    case = loop(COULOMB, Controller(PD), SINE, 2.0)
    a, b = exact.run(case), adaptive.run(case)
    assert np.max(np.abs(column(a, 3) - column(b, 3))) < 1e-7


def test_feedback_of_the_very_friction_leaves_the_linear_loop():
    """Equal Coulomb friction in plant and feedback cancels: no stiction, no sliding mode, no event but reversals."""
    controller = Controller(PD, Feedback(COULOMB))
    outcome = exact.run(loop(COULOMB, controller, SINE, 2.0))
    free = exact.run(loop(Model("coulomb", fc=0.0), Controller(PD), SINE, 2.0))
    assert np.max(np.abs(column(outcome, 3) - column(free, 3))) < 1e-8


def test_feedforward_on_an_ideal_step_does_nothing():
    reference = Reference("step", amplitude=0.01)
    for law, values in PARAMETERS.items():
        helped = exact.run(loop(GMS, Controller(PD, Feedforward(Model(law, **values))), reference, 0.2))
        alone = exact.run(loop(GMS, Controller(PD), reference, 0.2))
        np.testing.assert_array_equal(column(helped, 3), column(alone, 3))


def test_mirror_symmetry():
    up = exact.run(loop(GMS, Controller(PD), SINE, 2.0))
    down = exact.run(loop(GMS, Controller(PD), Reference("sine", amplitude=-0.01, frequency=0.4), 2.0))
    np.testing.assert_allclose(column(up, 3), -column(down, 3), atol=1e-12)


@pytest.mark.parametrize(
    "controller", ["PD", "PID", "FF-lugre", "FB-gms", "FB-coulomb", "FB-lugre", "FB-stribeck"]
)
def test_error_follows_the_tolerance(controller):
    axis, control, reference, duration = thesis_run(f"low/nominal/{controller}")
    duration = min(duration, 1.3)
    truth = exact.prepare(loop(axis.friction, control, reference, duration, 1e-11)).run()[0]
    for tolerance in (1e-6, 1e-8):
        motion = exact.prepare(loop(axis.friction, control, reference, duration, tolerance)).run()[0]
        assert np.max(np.abs(motion[:, 0] - truth[:, 0])) < 30.0 * tolerance


def test_prepared_run_and_rows_agree():
    case = loop(GMS, Controller(PD), SINE, 1.0, 1e-8)
    prepared = exact.prepare(case)
    motion, code, time = prepared.run()
    outcome = prepared.record()
    assert (code, time, outcome.code, outcome.time) == (DONE, 1.0, DONE, 1.0)
    np.testing.assert_allclose(motion[:, 0], column(outcome, 3), atol=1e-9)
    np.testing.assert_array_equal(exact.prepare(case).run()[0], motion)


def test_torques_of_the_rows_balance():
    """J dv/dt = T_m - T_f, by differences of a fine grid between events."""
    axis, controller, reference, _ = thesis_run("low/nominal/FB-gms")
    outcome = exact.run(loop(axis.friction, controller, reference, 0.3, step=1e-5))
    t, v = column(outcome, 0), column(outcome, 4)
    net = column(outcome, 5) - column(outcome, 6)
    slope = INERTIA * (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    worst = np.abs(slope - net[1:-1])
    assert np.median(worst) < 1e-6
    assert np.quantile(worst, 0.98) < 1e-3


def test_torque_jumps_have_two_rows():
    outcome = exact.run(loop(GMS, Controller(PD, Feedforward(COULOMB)), SINE, 1.5))
    at = np.flatnonzero(np.diff(outcome.rows[:, 0]) == 0.0)
    assert at.size
    assert np.max(np.abs(np.diff(outcome.rows[:, 7])[at])) == pytest.approx(0.57, abs=1e-3)


def test_divergence_keeps_the_rows():
    controller = Controller(Gains(kp=0.0, kd=0.0), Feedback(Model("coulomb", fc=0.3, sigma2=1.0)))
    case = loop(Model("coulomb", fc=0.1), controller, SINE, 5.0, initial=(0.0, 0.1), limits=(10.0, 1e6))
    outcome = exact.run(case)
    assert outcome.code == DIVERGED
    assert 0.0 < outcome.time < 5.0
    assert outcome.rows[-1, 0] <= outcome.time


@pytest.mark.parametrize("kp", [0.0, 1e-6, 1e-3])
def test_vanishing_stiffness(kp):
    """A free axis on constant Coulomb friction: deceleration by F_C and the damping, in closed form."""
    case = loop(COULOMB, Controller(Gains(kp=kp)), Reference("ramp", velocity=0.0), 0.01, initial=(0.0, 20.0))
    v = column(exact.run(case), 4)
    t = np.arange(11) * 1e-3
    rate = 0.018 / INERTIA
    want = (20.0 + 0.285 / 0.018) * np.exp(-rate * t) - 0.285 / 0.018
    assert np.max(np.abs(v - want)) < 1e-9 + 2.0 * kp


def test_maxwell_slip_law_with_infinite_attraction():
    """GMS with a fast attraction tends to elements that slide at their limit at once."""
    quick = Model("gms", k=[1e4, 5e3], alpha=[0.5, 0.5], c=1e5, fs=0.3, fc=0.3, vs=0.01, sigma2=0.018)
    case = loop(quick, Controller(PD), SINE, 1.0)
    law = replace(quick.law, modes=lambda p: replace(quick.law.modes(p), attraction=math.inf), variants={})
    model = Model("gms", k=[1e4, 5e3], alpha=[0.5, 0.5], c=1e5, fs=0.3, fc=0.3, vs=0.01, sigma2=0.018)
    model.law = law
    side = replace(case.plant, model=model)
    a, b = exact.run(case), exact.run(replace(case, plant=side))
    assert np.max(np.abs(column(a, 3) - column(b, 3))) < 1e-5


def test_feedforward_table_follows_the_law():
    axis, controller, reference, duration = thesis_run("low/nominal/FF-stribeck")
    case = loop(axis.friction, controller, reference, duration)
    cells, kinks = forcing.feedforward(case)
    assert forcing.feedforward(case)[0] is cells
    assert kinks
    t = np.sort(np.random.default_rng(0).uniform(0.0, duration, 2000))
    i = np.maximum(np.searchsorted(cells[:, 0], t, side="right") - 1, 0)
    x = (t - cells[i, 0]) * cells[i, 1]
    table = cells[i, 2] + x * (cells[i, 3] + x * (cells[i, 4] + x * (cells[i, 5] + x * cells[i, 6])))
    model = controller.compensator.model
    want = [model.law.steady(v, model.parameters) for v in reference.sample(t)[:, 1]]
    assert np.max(np.abs(table - want)) < 1e-9


def test_the_table_of_a_feedforward_gives_its_law_all_that_a_law_may_read(monkeypatch):
    """Karnopp in its band gives back the applied torque, the last of them: read past the end, it was what lay there."""
    handed = []
    tabulate = forcing.tabulate

    def watched(law, *more):
        handed.append(law.surroundings.copy())
        return tabulate(law, *more)

    monkeypatch.setattr(forcing, "tabulate", watched)
    karnopp = Model("karnopp", dv=1e-3, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
    case = loop(GMS, Controller(PD, Feedforward(karnopp, gain=0.8031)), SINE, 0.1)
    cells, _ = forcing.feedforward(case)
    assert [u.tolist() for u in handed] == [list(Surroundings())]
    assert cells[0, 2] == 0.0


@pytest.mark.parametrize(
    ("controller", "words"),
    [
        (Controller(PD, sample_time=1e-3), "sample time"),
        (Controller(PD, torque_limit=1.0), "torque limit"),
        (Controller(PD, Feedforward(COULOMB, filter_hz=10.0)), "filter"),
        (Controller(PD, Feedback(OTHER)), "compensator"),
    ],
)
def test_refusals_are_one_sentence(controller, words):
    case = loop(GMS, controller, SINE, 0.1)
    assert words in exact.can_run(case)
    with pytest.raises(ValueError, match=words):
        exact.run(case)


def test_plants_without_modes_are_refused():
    assert "plant" in exact.can_run(loop(OTHER, Controller(PD), SINE, 0.1))
    creeping = loop(Model("stribeck", **PARAMETERS["stribeck"]), Controller(PD), SINE, 0.1)
    assert "steep slope" in exact.can_run(creeping)


@pytest.mark.parametrize("sigma1", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("compensated", [False, True])
def test_a_bristle_in_the_plant_against_the_adaptive_integrator(sigma1, compensated):
    friction = Model("lugre", **{**PARAMETERS["lugre"], "sigma1": sigma1})
    helper = Feedback(Model("lugre", **PARAMETERS["lugre"]), gain=0.8) if compensated else None
    case = loop(friction, Controller(PD, helper), SINE, 1.5)
    a, b = exact.run(case), adaptive.run(case)
    assert np.max(np.abs(column(a, 3) - column(b, 3))) < 2e-8
    assert np.max(np.abs(column(a, 6) - column(b, 6))) < 1e-4


def test_a_users_bristle_needs_no_more_than_its_description():
    """Dahl friction (shape factor 1) on a free axis: F = F_C (1 - exp(-k x / F_C)), so the energy is closed."""
    law = replace(
        Model("lugre", **PARAMETERS["lugre"]).law,
        modes=lambda p: Bristle(p.sigma0, p.sigma1, p.sigma2, p.fc, 0.0, constant_curve=True),
        variants={},
    )
    friction = Model("lugre", sigma0=50.0, sigma1=0.0, sigma2=0.0, fs=0.3, fc=0.3, vs=0.01)
    friction.law = law
    start = 20.0
    case = loop(friction, Controller(Gains(kp=1e-9)), SINE, 0.012, initial=(0.0, start))
    outcome = exact.run(case)
    x, v, friction_torque = column(outcome, 3), column(outcome, 4), column(outcome, 6)
    np.testing.assert_allclose(friction_torque, 0.3 * (1.0 - np.exp(-50.0 * x / 0.3)), atol=1e-9)
    spent = 0.3 * x - 0.3 * 0.3 / 50.0 * (1.0 - np.exp(-50.0 * x / 0.3))
    np.testing.assert_allclose(v, np.sqrt(start**2 - 2.0 * spent / INERTIA), rtol=1e-9)


def test_a_less_steep_slope_against_the_adaptive_integrator():
    """A layer of 1 mrad/s instead of 10 urad/s: it takes many steps to cross."""
    helper = Feedback(Model("stribeck", **{**PARAMETERS["stribeck"], "k": 300.0}))
    case = loop(GMS, Controller(PD, helper), SINE, 0.6)
    a, b = exact.run(case), adaptive.run(case)
    assert np.max(np.abs(column(a, 3) - column(b, 3))) < 1e-7


def test_integral_action_leaves_no_error():
    gains = pid(20.0, 400.0, 0.2)
    outcome = exact.run(loop(FREE, Controller(gains), Reference("step", amplitude=0.01, tau=0.02), 3.0))
    assert abs(column(outcome, 3)[-1] - 0.01) < 1e-9


def test_a_bristle_slides_freely_under_an_open_loop_torque():
    """Stick-slip without a controller: 0.39 rad of free slide, against the adaptive integrator."""
    w = 2.0 * math.pi
    torque = Reference("harmonic", amplitude=0.35 / w, frequency=1.0, phase=-0.5 * math.pi)
    case = loop(Model("lugre", **PARAMETERS["lugre"]), Controller(Gains(kp=0.0, kr=1.0)), torque, 0.5)
    found, sure = exact.run(case), adaptive.run(case)
    assert column(sure, 3).max() > 0.3
    assert np.max(np.abs(column(found, 3) - column(sure, 3))) < 1e-8
    assert found.counts["steps"] < 10_000


def test_elements_under_an_open_loop_torque_are_left_to_the_adaptive_integrator():
    """Where all of them slip and nothing else holds the axis, digits are lost; "auto" takes the next integrator."""
    w = 2.0 * math.pi
    torque = Reference("harmonic", amplitude=0.35 / w, frequency=1.0, phase=-0.5 * math.pi)
    axis = RigidAxis(INERTIA, Model("gms", **PLANT))
    record = simulate(axis, Controller(Gains(kp=0.0, kr=1.0)), torque, 1.0)
    assert record.meta["integrator"] == "adaptive"
    # identification.json of the reference: the largest position of this record.
    assert record["position"].max() == pytest.approx(0.3368436348, abs=1e-6)


def test_a_feedforward_over_too_long_a_run_is_refused(monkeypatch):
    monkeypatch.setattr(forcing, "MOST_CELLS", 3000)
    controller = Controller(PD, Feedforward(GMS))
    with pytest.raises(InputError, match=r"duration = 400 s: .*more than 3000 pieces.*shorter run"):
        exact.run(loop(GMS, controller, SINE, 400.0))


def test_a_law_with_parameters_for_each_direction_is_refused_for_that_reason():
    """It was said that GMS gives no elements."""
    both = {"fs_negative": 0.3, "fc_negative": 0.25, "vs_negative": 0.01}
    asymmetric = Model("gms", {"symmetry": "asymmetric"}, **PLANT, **both)
    with pytest.raises(
        InputError, match="law 'gms' has symmetry = asymmetric, for which its flow has no closed form"
    ):
        simulate(RigidAxis(INERTIA, asymmetric), Controller(PD), SINE, 0.1, integrator="exact")
    record = simulate(RigidAxis(INERTIA, asymmetric), Controller(PD), SINE, 0.1)
    assert record.meta["integrator"] == "adaptive"
