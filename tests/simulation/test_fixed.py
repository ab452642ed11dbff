"""The fixed-step integrator against closed solutions, an independent reference and its own convergence."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import ParameterError
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation._meter import gathered
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import DIVERGED, DONE, NOT_FINITE, lay_out
from stickslip.simulation.compiled_controller import measured_position
from stickslip.simulation.fixed import engine as fixed
from stickslip.simulation.sampled import engine as sampled
from support.sampled_text import Memory, design_filter, low_passed

J = 3.8623e-4
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
GMS = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
GMS_3 = Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
STRIBECK = Model("stribeck", k=3.5e4, **CURVE)
COULOMB = Model("coulomb", fc=0.285, sigma2=0.018)
LOW = Reference("sine", amplitude=0.01, frequency=0.4)
STILL = Reference("step", amplitude=0.0)
PD = place("PD", J, 36.0, 1.0)
REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "fixed_reference.json").read_text())


def simulate(
    plant, dt, *, gains=PD, helper=None, reference=LOW, duration=1.0, grid=None, rule="signed", **more
):
    """Run a closed loop; keywords of `Controller` and of `lay_out` in `more`."""
    named = ("torque_limit", "sample_time", "encoder_counts")
    controller = Controller(gains, helper, **{k: more.pop(k) for k in named if k in more})
    grid = np.linspace(0.0, duration, 501) if grid is None else np.asarray(grid)
    case = lay_out(
        RigidAxis(J, plant),
        controller,
        reference,
        duration,
        tolerance=1e-9,
        grid=grid,
        slip_rule=rule,
        **more,
    )
    if controller.sample_time > 0.0:
        assert fixed.can_run(case) == "the controller is sampled; use the sampled integrator"
        return sampled.run(case)
    assert fixed.can_run(case) == ""
    return fixed.run(case, dt)


def on_grid(outcome):
    """The rows at output times, without those of events."""
    return outcome.rows[outcome.rows[:, 8] == 0.0]


def order(errors, factor=2.0):
    """Mean order of convergence of errors at steps that shrink by `factor`."""
    return math.log(errors[0] / errors[-1], factor) / (len(errors) - 1)


# ---- convergence ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "helper"), [("low/nominal/PD", None), ("low/nominal/FF-lugre", Feedforward(LUGRE))]
)
def test_agrees_with_the_independent_reference_at_second_order(name, helper):
    exact = REFERENCE[name]
    errors = []
    for dt in (1e-4, 5e-5):
        rows = on_grid(simulate(GMS, dt, helper=helper, duration=5.0, grid=exact["t"], rule=exact["rule"]))
        errors.append(np.abs(rows[:, 3] - exact["theta"]).max())
    assert errors[0] < 2e-7
    assert order(errors) >= 1.8


@pytest.mark.parametrize(
    ("plant", "helper", "steps", "duration"),
    [
        (GMS, None, (2e-4, 1e-4, 5e-5), 1.0),
        (GMS, None, (2e-3, 1e-3, 5e-4), 1.0),  # the contact's ringing is not resolved: the damped method
        (LUGRE, Feedforward(GMS_3), (2.5e-5, 1.25e-5, 6.25e-6), 0.5),
        (GMS, Feedback(COULOMB), (5e-5, 2.5e-5, 1.25e-5), 0.3),  # 54 reversals against a jump of the torque
        (COULOMB, Feedforward(LUGRE), (4e-4, 2e-4, 1e-4), 1.0),
    ],
)
def test_order_of_convergence(plant, helper, steps, duration):
    case = {"helper": helper, "duration": duration, "grid": np.linspace(0.0, duration, 41)}
    fine = on_grid(simulate(plant, steps[-1] / 16.0, **case))[:, 3]
    errors = [np.abs(on_grid(simulate(plant, dt, **case))[:, 3] - fine).max() for dt in steps]
    assert order(errors) >= 1.8, errors


@pytest.mark.parametrize(
    ("plant", "gains", "helper"),
    [
        (GMS, place("PID", J, 12.0, 1.0), None),
        (COULOMB, PD, Feedback(Model("coulomb", fc=0.2))),
        (GMS, PD, Feedback(LUGRE, filter_hz=10.0)),
        (GMS, PD, Feedforward(GMS_3, filter_hz=10.0)),
    ],
)
def test_tends_to_the_adaptive_integrator(plant, gains, helper):
    grid = np.linspace(0.0, 0.5, 51)
    controller = Controller(gains, helper)
    case = lay_out(RigidAxis(J, plant), controller, LOW, 0.5, tolerance=1e-10, grid=grid, metered=False)
    located = on_grid(adaptive.run(case))
    # A kink may lie anywhere inside a step, so that single halvings scatter: the order over a factor of 16.
    steps = (1e-4, 2.5e-5, 6.25e-6)
    errors = [np.abs(on_grid(fixed.run(case, dt))[:, 3] - located[:, 3]).max() for dt in steps]
    assert errors[0] < 1e-5
    assert order(errors, factor=4.0) >= 1.8, errors


def test_a_steep_law_keeps_second_order_while_it_slides():
    sliding = Reference("harmonic", amplitude=0.01, frequency=1.0, velocity=0.2)
    # It starts where the controller already carries the friction, so that it never stops.
    start = {"initial": (-0.29 / PD.kp, 0.2 + 0.02 * math.pi), "reference": sliding, "duration": 0.5}
    grid = np.linspace(0.0, 0.5, 21)
    fine = on_grid(simulate(STRIBECK, 1e-5, grid=grid, **start))
    assert fine[:, 4].min() > 0.1
    errors = [
        np.abs(on_grid(simulate(STRIBECK, dt, grid=grid, **start))[:, 3] - fine[:, 3]).max()
        for dt in (1e-3, 5e-4)
    ]
    assert errors[0] < 1e-6
    assert order(errors) >= 1.8, errors


# ---- a stuck contact --------------------------------------------------------------------------------------


def perturbed(dt, steps, velocity=0.01):
    """Energy of a frictionless spring contact after a perturbation that breaks no element away, J, at every step."""
    contact = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **{**CURVE, "sigma2": 0.0})
    outcome = simulate(
        contact, dt, gains=Gains(0.0), reference=STILL, duration=dt * steps, grid=dt * np.arange(steps + 1),
        initial=(0.0, velocity),
    )  # fmt: skip
    assert outcome.code == DONE
    rows = on_grid(outcome)
    return 0.5 * J * rows[:, 4] ** 2 + 0.5 * 2.5e4 * rows[:, 3] ** 2


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_a_stuck_contact_dissipates_where_its_ringing_is_not_resolved(dt):
    # The perturbation moves the contact by 0.1 % of its travel up to break-away.
    energy = perturbed(dt, 20, velocity=1e-4)
    assert np.all(np.diff(energy) <= 1e-12 * energy[0])
    assert energy[-1] < 1e-9 * energy[0]


def test_a_ringing_that_bristles_remember_is_resolved_and_still_loses_energy():
    energy = perturbed(1e-3, 20, velocity=0.01)
    assert np.all(np.diff(energy) <= 1e-12 * energy[0])
    assert energy[1] > 0.5 * energy[0]


def test_a_resolved_contact_keeps_its_energy():
    energy = perturbed(5e-5, 400)
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9


# ---- holding ----------------------------------------------------------------------------------------------


def test_a_coulomb_block_sticks_until_the_torque_exceeds_what_it_holds_then_slides():
    # kp (r t - x) reaches F_C at t_b; from there J x'' = kp (r s - x): x = r (s - sin(w s) / w).
    kp, r, fc = 20.0, 0.1, 0.285
    breakaway, w = fc / (kp * r), math.sqrt(kp / J)
    errors = []
    for dt in (4e-4, 2e-4):
        outcome = simulate(
            Model("coulomb", fc=fc), dt, gains=Gains(kp), reference=Reference("ramp", velocity=r, end=1.0),
            duration=breakaway + 5.0 / w,
        )  # fmt: skip
        rows = on_grid(outcome)
        before = rows[:, 0] < breakaway
        assert before.sum() > 100
        assert np.all(rows[before][:, 3:5] == 0.0)
        np.testing.assert_allclose(rows[before][:, 6], kp * r * rows[before][:, 0], atol=1e-12)
        events = outcome.rows[outcome.rows[:, 8] == 1.0]
        assert outcome.counts["events"] == 1
        assert events[0, 0] == pytest.approx(breakaway, abs=1e-10)
        s = rows[~before][:, 0] - breakaway
        errors.append(np.abs(rows[~before][:, 3] - r * (s - np.sin(w * s) / w)).max())
    assert errors[0] < 1e-5
    assert order(errors) >= 1.8


def test_a_block_held_below_its_limit_never_moves():
    rows = simulate(COULOMB, 1e-3, gains=Gains(1.0), reference=Reference("step", amplitude=0.28)).rows
    assert np.all(rows[:, 3:5] == 0.0)
    assert np.all(rows[:, 6] == 0.28)


def test_feedback_that_jumps_at_rest_reduces_what_the_contact_holds():
    kp, r = 20.0, 0.1
    outcome = simulate(
        Model("coulomb", fc=0.285), 1e-4, gains=Gains(kp), helper=Feedback(Model("coulomb", fc=0.2)),
        reference=Reference("ramp", velocity=r, end=1.0), duration=0.06,
    )  # fmt: skip
    first = outcome.rows[outcome.rows[:, 8] == 1.0][0]
    assert first[0] == pytest.approx(0.085 / (kp * r), abs=1e-10)
    assert np.all(outcome.rows[outcome.rows[:, 0] < first[0]][:, 4] == 0.0)
    assert outcome.rows[-1, 4] > 0.0
    assert outcome.rows[-1, 7] == pytest.approx(0.2)


def test_a_jump_of_the_torque_has_a_row_before_and_a_row_after_it():
    # The reference turns at 1.25 s: Coulomb feedforward changes its sign.
    rows = simulate(GMS, 1e-4, helper=Feedforward(COULOMB), duration=1.5).rows
    before, after = rows[(rows[:, 0] == 1.25) & (rows[:, 8] == 1.0)]
    assert before[7] == pytest.approx(0.285)
    assert after[7] == pytest.approx(-0.285)
    assert after[5] - before[5] == pytest.approx(-0.57)
    assert np.all(np.diff(rows[:, 0]) >= 0.0)


def test_a_reversal_is_met_at_zero_velocity():
    outcome = simulate(GMS, 1e-4)
    events = outcome.rows[outcome.rows[:, 8] == 1.0]
    assert outcome.counts["events"] == events.shape[0] > 0
    assert np.all(events[:, 4] == 0.0)
    assert np.all(np.diff(outcome.rows[:, 0]) >= 0.0)


# ---- compensators, limit, filter --------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [1e-4, 1e-3])
@pytest.mark.parametrize("source", [None, Feedforward, Feedback])
@pytest.mark.parametrize("plant", [COULOMB, STRIBECK, LUGRE, GMS], ids=lambda m: m.law.name)
def test_every_law_in_every_place_runs_and_balances_its_energy(plant, source, dt):
    for law in (COULOMB, STRIBECK, LUGRE, GMS_3) if source else (None,):
        outcome = simulate(plant, dt, helper=source(law) if source else None)
        assert outcome.code == DONE
        assert np.all(np.isfinite(outcome.rows))
        assert on_grid(outcome).shape[0] == 501
        acc = gathered(outcome.meter)
        kinetic = 0.5 * J * outcome.rows[-1, 4] ** 2
        room = 3e-2 if dt == 1e-3 else 3e-3
        assert abs(acc["work"] - acc["loss"] - kinetic) <= room * acc["work"]
        assert acc["e_max"] < 0.018


def test_exact_feedback_cancels_friction():
    for law in (COULOMB, STRIBECK, LUGRE):
        assert gathered(simulate(law, 1e-4, helper=Feedback(law)).meter)["e_max"] < 2e-6


def test_torque_stays_within_its_limit():
    free, tight = simulate(GMS, 1e-4), simulate(GMS, 1e-4, torque_limit=0.3)
    assert np.abs(free.rows[:, 5]).max() > 0.3
    assert np.abs(tight.rows[:, 5]).max() == 0.3
    # Below the static torque of 0.335 N·m only the pre-sliding springs give way.
    assert np.abs(tight.rows[:, 3]).max() < 1e-4


@pytest.mark.parametrize(("frequency", "gain"), [(10.0, math.sqrt(0.5)), (100.0, 1e-2)])
def test_the_filter_of_a_compensator_is_a_butterworth_low_pass(frequency, gain):
    # A law that is only viscous, 1 N·m·s/rad, shows the filtered reference velocity as torque.
    helper = Feedforward(Model("coulomb", fc=0.0, sigma2=1.0), filter_hz=10.0)
    motion = Reference("harmonic", amplitude=1e-4, frequency=frequency)
    rows = on_grid(simulate(COULOMB, 1e-5, helper=helper, reference=motion))
    late = rows[:, 0] > 0.5
    amplitude = 1e-4 * 2.0 * math.pi * frequency
    assert np.abs(rows[late][:, 7]).max() / amplitude == pytest.approx(gain, rel=2e-2)


# ---- sampled control --------------------------------------------------------------------------------------


def test_a_sampled_controller_holds_what_it_computed_from_whole_counts():
    period, counts = 2e-3, 20000.0
    sampled = {"sample_time": period, "encoder_counts": counts}
    rows = on_grid(simulate(GMS, 1e-4, gains=PD, grid=1e-4 * np.arange(10000) + 2e-5, **sampled))
    blocks = rows[:, 5].reshape(-1, 20)
    assert np.all(blocks == blocks[:, :1])
    assert np.unique(blocks[:, 0]).size > 50
    # Torque = kp (theta_d - n q) + kr v_d - kd m q / T with whole n and m (kd alone shows m).
    q = 2.0 * math.pi / counts
    loose, kd = Model("coulomb", fc=1e-3, sigma2=0.0), 0.05
    gains = Gains(0.0, kd=kd, kr=kd)
    r = on_grid(simulate(loose, 1e-4, gains=gains, grid=period * np.arange(500), **sampled))
    m = (r[:, 2] - r[:, 5] / kd) * period / q
    assert np.abs(m - np.round(m)).max() < 1e-6
    assert np.unique(np.round(m)).size > 2


def test_sampling_tends_to_continuous_control():
    reference = on_grid(simulate(COULOMB, 1e-4))[:, 3]
    errors = [
        np.abs(on_grid(simulate(COULOMB, 1e-4, sample_time=period))[:, 3] - reference).max()
        for period in (1e-3, 5e-4, 2.5e-4)
    ]
    assert 0.8 < order(errors) < 1.3, errors


@pytest.mark.parametrize("law", [COULOMB, STRIBECK, LUGRE, GMS_3], ids=lambda m: m.law.name)
@pytest.mark.parametrize("source", [Feedforward, Feedback])
def test_sampled_compensators_run(law, source):
    helper = source(law, filter_hz=100.0)
    outcome = simulate(GMS, 2e-4, helper=helper, sample_time=5e-4, encoder_counts=20000.0)
    assert outcome.code == DONE
    assert np.abs(outcome.rows[:, 7]).max() > 0.1


def test_the_drive_counts_positions():
    count = 2.0 * math.pi / 4096.0
    assert measured_position(10.4 * count, 4096.0) == pytest.approx(10.0 * count)
    assert measured_position(-0.6 * count, 4096.0) == pytest.approx(-count)
    assert measured_position(0.1234567, 0.0) == 0.1234567


def test_the_drives_filter_halves_the_power_at_its_corner():
    corner = 2.0 * math.pi * 50.0
    n = SimpleNamespace(filter=corner, sample_time=1e-3)
    memory, constant = at_start(), at_start()
    design_filter(n, memory)
    design_filter(n, constant)
    out = [low_passed(memory, math.sin(corner * 1e-3 * i)) for i in range(4000)]
    assert np.sqrt(2.0) * np.std(out[2000:]) == pytest.approx(math.sqrt(0.5), rel=1e-6)
    assert [low_passed(constant, 1.0) for _ in range(400)][-1] == pytest.approx(1.0, abs=1e-12)


def at_start():
    return SimpleNamespace(**dict.fromkeys(Memory._fields, 0.0))


# ---- ends of runs -----------------------------------------------------------------------------------------


def test_a_run_that_leaves_its_limits_ends_and_keeps_its_rows():
    outcome = simulate(COULOMB, 1e-3, limits=(1e-3, 1e6))
    assert outcome.code == DIVERGED
    assert 0.0 < outcome.time < 1.0
    assert np.abs(outcome.rows[:, 3]).max() <= 1e-3
    assert outcome.rows[-1, 0] == pytest.approx(outcome.time, abs=2.1e-3)


def test_an_infinite_torque_is_reported():
    start = {"initial": (1e300, 1e300), "limits": (math.inf, math.inf)}
    assert simulate(COULOMB, 1e-3, gains=Gains(1e10), **start).code == NOT_FINITE


@pytest.mark.parametrize("dt", [0.0, -1e-3, math.nan, math.inf])
def test_a_step_that_is_no_positive_number_is_refused(dt):
    with pytest.raises(ParameterError, match=r"dt = .* must be greater than 0"):
        simulate(COULOMB, dt)
