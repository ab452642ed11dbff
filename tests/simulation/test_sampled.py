"""The sampled engine against independent results, against the fixed integrator refined, and in its corners."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.errors import Divergence, InputError
from stickslip.simulation import fixed, sampled
from stickslip.simulation._case import DONE
from stickslip.simulation.closed_loop import prepare

J, TIME = 3.8623e-4, 1e-3
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
GMS = ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
LAWS = {
    "gms": GMS,
    "gms, literal": GMS.having(slip_rule="literal"),
    "gms, Table 10": ss.Model(
        "gms", {"curve": "double_stribeck"}, k=[1e4, 5e3], alpha=[0.5, 0.5], c=24.0, sigma2=0.01,
        beta0=80.7454, beta1=-80.4742, beta2=-80.5930, beta3=0.7884, beta4=0.7871, v1=0.1755, v2=0.1758,
    ),
    "lugre": LUGRE,
    "maxwell_slip": ss.Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.05, 0.08, 0.09, 0.1], sigma2=0.018),
    "coulomb": ss.Model("coulomb", fc=0.285, sigma2=0.018),
    "stribeck": ss.Model("stribeck", k=3.5e4, **CURVE),
}  # fmt: skip
W = 2.0 * math.pi * 20.0
LINEAR = {
    "PD": ss.ControlBlock("pd", kp=J * W**2, kd=2.0 * J * W),
    "PID": ss.ControlBlock("pid", kp=3.0 * J * W**2, kd=3.0 * J * W, ki=J * W**3),
}
HELP = ss.ControlBlock(
    "friction_feedforward",
    ss.Model("lugre", sigma0=3.5e4, sigma1=0.0, **CURVE),
    {"velocity": "held"},
    gain=0.9,
)


def observer(corner):
    return ss.ControlBlock("disturbance_observer", inertia=J, corner=corner)


ROWS = {
    name: ss.SampledController(LINEAR[loop], TIME, helper, watcher, torque_limit=1.0)
    for name, (loop, helper, watcher) in {
        "PD": ("PD", None, None),
        "PID": ("PID", None, None),
        "PD + FF LuGre .9": ("PD", HELP, None),
        "PID + FF LuGre .9": ("PID", HELP, None),
        "PD + DOB 200": ("PD", None, observer(200.0)),
        "PD + DOB 400": ("PD", None, observer(400.0)),
        "PD + DOB 800": ("PD", None, observer(800.0)),
        "PD + FF LuGre .9 + DOB 400 residual": ("PD", HELP, observer(400.0)),
    }.items()
}
"""Controllers by the names of the rows of the reference."""
LOW = ss.Reference("sine", amplitude=0.01, frequency=0.4)
HIGH = ss.Reference("sine", amplitude=0.5, frequency=0.1)
FAST = ss.Reference("sine", amplitude=0.05, frequency=4.0)
PD, PID = (ss.place(kind, J, 36.0, 1.0) for kind in ("PD", "PID"))
CONTROLLERS = {
    "PD": ss.Controller(PD, None, 1.0, TIME),
    "PID with an encoder": ss.Controller(PID, None, 1.0, TIME, 1e6),
    "feedforward": ss.Controller(PD, ss.Feedforward(LUGRE, 0.9), 1.0, TIME),
    "feedback at its limit": ss.Controller(PD, ss.Feedback(GMS, 0.8), 0.4, TIME),
    "cascade": ss.Controller(ss.Cascade(60.0, 0.05, 1.0), None, 1.0, TIME),
    "control laws": ROWS["PD + FF LuGre .9 + DOB 400 residual"],
}


def case_of(law, controller, reference=FAST, duration=0.3, **more):
    return prepare(ss.RigidAxis(J, law), controller, reference, duration, **{"metered": False, **more})


def on_grid(outcome):
    return outcome.rows[outcome.rows[:, 8] == 0.0]


def apart(one, other):
    return np.abs(on_grid(one)[:, 3] - on_grid(other)[:, 3]).max()


# ---- equal to the fixed integrator ---------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_the_fixed_integrator_tends_to_it(law, controller):
    case = case_of(law, controller, duration=0.15)
    outcome = sampled.run(case)
    assert outcome.code == DONE
    assert np.ptp(on_grid(outcome)[:, 3]) > 1e-3
    coarse, fine = (apart(outcome, fixed.run(case, dt)) for dt in (2e-5, 2.5e-6))
    # Of an encoder, a position near the edge of a count may fall into the next one.
    assert fine < 1e-7 or fine < 0.3 * coarse or controller.encoder_counts > 0.0, (coarse, fine)
    assert fine < 2e-5


# ---- against independent results -----------------------------------------------------------------------------------


def reference_table():
    folder = os.environ.get("STICKSLIP_REFERENCE")
    path = Path(folder or "none") / "compensators" / "reference.json"
    return json.loads(path.read_text())["table"] if path.exists() else {}


TABLE = reference_table()
CASES = [
    (row, case, found["rms"])
    for row in ROWS
    for case, found in TABLE.get(row, {}).items()
    if case.endswith("exact") and found["rms"]["err"] < 1e-5 * found["rms"]["value"]
]


@pytest.mark.skipif(not TABLE, reason="the reference is not there")
@pytest.mark.parametrize(("row", "name", "rms"), CASES, ids=[f"{row}, {case}" for row, case, _ in CASES])
def test_loops_are_those_of_the_independent_reference(row, name, rms):
    speed, scale, _ = name.split("_")
    x = float(scale[1:])
    friction = {**CURVE, "fs": x * CURVE["fs"], "fc": x * CURVE["fc"]}
    law = ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **friction)
    reference, duration = (LOW, 5.0) if speed == "low" else (HIGH, 20.0)
    rows = on_grid(sampled.run(case_of(law, ROWS[row], reference, duration, output=TIME)))
    found = math.sqrt(np.mean((rows[:, 1] - rows[:, 3]) ** 2))
    assert found == pytest.approx(rms["value"], rel=1e-5)


INDEPENDENT = {
    ("PD", "low"): 0.012243237191408842,
    ("PID", "low"): 0.0012659900790444787,
    ("PD + FF LuGre .9", "low"): 0.0059042446643199084,
    ("PD + DOB 400", "low"): 0.000653989622614563,
    ("PID + FF LuGre .9", "high"): 0.00022094839983306504,
}
"""RMS of the error, rad, from two other engines and another text of the controllers (GMS of thesis Table 1)."""


@pytest.mark.parametrize(("row", "speed"), INDEPENDENT)
def test_errors_of_the_loop_are_those_of_other_engines(row, speed):
    reference, duration = (LOW, 5.0) if speed == "low" else (HIGH, 20.0)
    rows = on_grid(sampled.run(case_of(GMS, ROWS[row], reference, duration, output=TIME)))
    found = math.sqrt(np.mean((rows[:, 1] - rows[:, 3]) ** 2))
    assert found == pytest.approx(INDEPENDENT[row, speed], rel=1e-5)


def lugre_sliding(torques, position, velocity):
    """LuGre under held torques, by DOP853 stopped at every reversal; position at every sample."""
    out, z = [position], 0.0
    for u in torques:
        t, y = 0.0, [out[-1], velocity, z]
        while t < TIME:
            side = math.copysign(1.0, y[1]) if y[1] != 0.0 else math.copysign(1.0, u - 3.5e4 * y[2])

            def rate(_, y, u=u, side=side):
                s = 0.285 + 0.05 * math.exp(-((y[1] / 0.01) ** 2))
                dz = y[1] - 3.5e4 * side * y[1] / s * y[2]
                return [y[1], (u - 3.5e4 * y[2] - 0.1 * dz - 0.018 * y[1]) / J, dz]

            def turned(_, y, side=side):
                return side * y[1] if abs(y[1]) > 1e-13 else 1e-13

            turned.terminal, turned.direction = True, -1
            run = solve_ivp(
                rate, (t, TIME), y, "DOP853", rtol=1e-12, atol=1e-14, events=turned, max_step=1e-4
            )
            t, y = run.t[-1], run.y[:, -1]
            if run.status == 1:
                y[1] = 0.0
        _, velocity, z = y
        out.append(y[0])
    return np.array(out)


def test_lugre_is_that_of_a_general_solver_with_events():
    case = case_of(LUGRE, CONTROLLERS["PD"], duration=0.12, tolerance=1e-11)
    rows = on_grid(sampled.run(case))
    expected = lugre_sliding(rows[:-1, 5], 0.0, 0.0)
    assert np.abs(rows[:, 3] - expected).max() < 1e-9
    assert np.ptp(expected) > 1e-3


# ---- tolerance, rest, ends -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gms", "maxwell_slip", "coulomb", "stribeck"])
def test_the_tolerance_is_that_of_the_run(name):
    truth = sampled.run(case_of(LAWS[name], CONTROLLERS["PD"], tolerance=1e-12))
    for tolerance in (1e-7, 1e-9):
        run = sampled.run(case_of(LAWS[name], CONTROLLERS["PD"], tolerance=tolerance))
        assert apart(truth, run) < tolerance


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_estimate_of_the_error_holds(law):
    record = ss.simulate(ss.RigidAxis(J, law), CONTROLLERS["feedforward"], FAST, 0.3, check=True)
    assert record.meta["integrator"] == "sampled"
    truth = sampled.run(case_of(law, CONTROLLERS["feedforward"], tolerance=1e-12))
    error = np.abs(record["position"][record["event"] == 0.0] - on_grid(truth)[:, 3]).max()
    assert error <= record.meta["accuracy"]["error_rad"] + 1e-14


@pytest.mark.parametrize("name", ["gms", "maxwell_slip", "coulomb"])
def test_nothing_creeps_at_rest(name):
    step = ss.Reference("step", amplitude=0.01)
    rows = on_grid(sampled.run(case_of(LAWS[name], CONTROLLERS["PD"], step, 120.0, output=0.1)))
    assert np.ptp(rows[300:, 3]) < 1e-15
    assert abs(rows[-1, 5]) > 1e-3
    assert rows[-1, 6] == pytest.approx(rows[-1, 5], abs=1e-12)


def test_the_torque_is_held_and_keeps_its_limit():
    controller = ss.Controller(PID, None, 0.3, TIME, 20000.0)
    rows = on_grid(sampled.run(case_of(GMS, controller, output=1e-4, duration=0.5)))
    blocks = rows[:-1, 5].reshape(-1, 10)
    assert np.all(blocks == blocks[:, :1])
    assert np.abs(rows[:, 5]).max() == 0.3


@pytest.mark.parametrize("name", ["gms", "lugre", "coulomb"])
def test_where_rows_are_wanted_does_not_change_the_motion(name):
    one = sampled.run(case_of(LAWS[name], CONTROLLERS["PD"]))
    other = sampled.run(case_of(LAWS[name], CONTROLLERS["PD"], output=1.5e-4))
    ends = [on_grid(o)[-1, 3] for o in (one, other)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_metrics_are_those_of_the_fixed_integrator(law):
    axis, controller = ss.RigidAxis(J, law), CONTROLLERS["PD"]
    one = ss.simulate(axis, controller, FAST, 0.3)
    other = ss.simulate(axis, controller, FAST, 0.3, integrator="fixed", time_step=5e-6)
    for name in (
        "position_rms_rad", "velocity_rms_rad_s", "torque_rms_Nm", "motor_work_J", "friction_loss_J",
        "position_peak_rad", "velocity_peak_rad_s", "second_half_position_rms_rad",
    ):  # fmt: skip
        assert one.meta["metrics"][name] == pytest.approx(other.meta["metrics"][name], rel=2e-3), name
    energy = one.meta["energy"]
    assert abs(energy["residual"]) < 1e-3 * energy["motor_work"]


def test_a_loop_that_diverges_says_so():
    wild = ss.Controller(ss.Gains(1e3, 0.0, 1e3, 0.0), None, math.inf, 0.02)
    with pytest.raises(Divergence, match="left every reasonable bound"):
        ss.simulate(ss.RigidAxis(J, LAWS["coulomb"]), wild, FAST, 5.0)


def test_it_says_what_it_cannot_run():
    dahl = ss.Model("dahl", sigma0=3.5e4, fc=0.285)
    record = ss.simulate(ss.RigidAxis(J, dahl), CONTROLLERS["PD"], FAST, 0.05)
    assert record.meta["integrator"] == "fixed"
    assert "gives no `modes`" in record.meta["refused"]["sampled"]
    with pytest.raises(InputError, match="acts in continuous time"):
        ss.simulate(ss.RigidAxis(J, GMS), ss.Controller(PD), FAST, 0.05, integrator="sampled")
