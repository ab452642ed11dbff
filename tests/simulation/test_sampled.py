"""The sampled engine against independent results, its two ways against each other, and in its corners."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import Divergence, InputError, LawError
from stickslip.core.spec import Bristle
from stickslip.models import plugins
from stickslip.simulation.case_arrays import DONE
from stickslip.simulation.sampled import engine as sampled
from support.places import REFERENCE, needs_reference
from support.sampled_loops import (
    CONTROLLERS,
    CURVE,
    FAST,
    GMS,
    HIGH,
    LAWS,
    LOW,
    LUGRE,
    PD,
    PID,
    ROWS,
    TIME,
    J,
    apart,
    case_of,
    moved_by,
    on_grid,
)

# ---- equal to the general step, which knows a law by its ``step`` alone ----------------------------------------------


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_the_general_step_tends_to_the_located_flow(law, controller, monkeypatch):
    case = {t: case_of(law, controller, duration=0.15, tolerance=t) for t in (1e-7, 1e-10)}
    located = sampled.run(case[1e-10])
    assert located.code == DONE
    assert np.ptp(on_grid(located)[:, 3]) > 1e-3
    monkeypatch.setattr(sampled, "cannot_locate", lambda case: "asked for")
    coarse, fine = (apart(located, sampled.run(case[t])) for t in (1e-7, 1e-10))
    # Of an encoder, a position near the edge of a count may fall into the next one.
    assert fine < 1e-8 or fine < 0.2 * coarse or controller.encoder_counts > 0.0, (coarse, fine)
    assert fine < 2e-5


# ---- against independent results -----------------------------------------------------------------------------------


def reference_table():
    path = REFERENCE / "compensators" / "reference.json"
    return json.loads(path.read_text())["table"] if path.exists() else {}


TABLE = reference_table()
CASES = [
    (row, case, found["rms"])
    for row in ROWS
    for case, found in TABLE.get(row, {}).items()
    if case.endswith("exact") and found["rms"]["err"] < 1e-5 * found["rms"]["value"]
]


@needs_reference("compensators/reference.json")
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


def lugre(v, z, side):
    s = 0.285 + 0.05 * math.exp(-((v / 0.01) ** 2))
    dz = v - 3.5e4 * side * v / s * z
    return 3.5e4 * z + 0.1 * dz + 0.018 * v, dz


def dahl(shape, v, z, side):
    r = 1.0 - side * z / 0.285
    return z + 0.018 * v, 3.5e3 * v * math.copysign(abs(r) ** shape, r)


def test_lugre_is_that_of_a_general_solver_with_events():
    case = case_of(LUGRE, CONTROLLERS["PD"], duration=0.12, tolerance=1e-11)
    rows = on_grid(sampled.run(case))
    expected = moved_by(rows[:-1, 5], lugre)
    assert np.abs(rows[:, 3] - expected).max() < 1e-9
    assert np.ptp(expected) > 1e-3


@pytest.mark.parametrize(("name", "shape"), [("dahl", 1.0), ("dahl, ductile", 2.0)])
def test_dahl_is_that_of_a_general_solver_with_events(name, shape):
    rows = on_grid(sampled.run(case_of(LAWS[name], CONTROLLERS["PD"], duration=0.06, tolerance=1e-11)))
    expected = moved_by(rows[:-1, 5], partial(dahl, shape))
    assert np.abs(rows[:, 3] - expected).max() < 1e-9
    assert np.ptp(expected) > 1e-3


def test_elasto_plastic_is_that_of_a_general_solver_with_events():
    model = LAWS["elasto_plastic"]
    law, p, now, slope = model.law, model.parameters, SimpleNamespace(z=0.0), SimpleNamespace(z=0.0)

    def contact(v, z, side):
        now.z = z
        return law.rate(v, now, p, None, slope), slope.z

    rows = on_grid(sampled.run(case_of(model, CONTROLLERS["PD"], duration=0.06, tolerance=1e-11)))
    expected = moved_by(rows[:-1, 5], contact)
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
def test_metrics_are_those_of_the_general_step(law, monkeypatch):
    axis, controller = ss.RigidAxis(J, law), CONTROLLERS["PD"]
    one = ss.simulate(axis, controller, FAST, 0.3)
    monkeypatch.setattr(sampled, "cannot_locate", lambda case: "asked for")
    other = ss.simulate(axis, controller, FAST, 0.3)
    assert other.meta["general_step"] == "asked for"
    for name in (
        "position_rms_rad", "velocity_rms_rad_s", "torque_rms_Nm", "motor_work_J", "friction_loss_J",
        "position_peak_rad", "velocity_peak_rad_s", "second_half_position_rms_rad",
    ):  # fmt: skip
        assert one.meta["metrics"][name] == pytest.approx(other.meta["metrics"][name], rel=2e-3), name
    for record in (one, other):
        assert abs(record.meta["energy"]["residual"]) < 1e-3 * record.meta["energy"]["motor_work"]


@pytest.mark.parametrize("name", ["gms", "elasto_plastic", "dahl"])
def test_work_is_counted_where_the_contact_hardly_moves(name):
    """Torque times the way, sample by sample: a contact that rings while it sticks does little work, not more."""
    slow = ss.Reference("sine", amplitude=0.01, frequency=0.4)
    loop = ss.Controller(ss.place("PD", J, 20.0, 1.0), sample_time=TIME)
    record = ss.simulate(ss.RigidAxis(J, LAWS[name]), loop, slow, 2.0)
    at = record["event"] == 0.0
    work = np.sum(record["motor_torque"][at][:-1] * np.diff(record["position"][at]))
    assert record.meta["metrics"]["motor_work_J"] == pytest.approx(work, rel=2e-3)


def test_modes_that_speak_of_a_growth_need_it():
    law = plugins.law("dahl")
    without = ss.Model(replace(law, growth=None, variants={}, name="without"), sigma0=3.5e3, fc=0.285)
    record = ss.simulate(ss.RigidAxis(J, without), CONTROLLERS["PD"], FAST, 0.05)
    assert "gives no `growth`" in record.meta["general_step"]
    with pytest.raises(LawError, match="own_growth=True"):
        Bristle(1e4, 0.0, 0.0, 0.3, 0.01, elastic=0.1)


def test_a_loop_that_diverges_says_so():
    wild = ss.Controller(ss.Gains(1e3, 0.0, 1e3, 0.0), None, math.inf, 0.02)
    with pytest.raises(
        Divergence, match=r"ended at .* left every reasonable bound; lower the bandwidth or .* give a"
    ):
        ss.simulate(ss.RigidAxis(J, LAWS["coulomb"]), wild, FAST, 5.0)


@pytest.mark.parametrize("law", ["lugre", "dahl"])
def test_a_loop_on_a_stiff_bristle_that_diverges_says_so_soon(law: str):
    """Steps as short as the bristle settles fast were 4e7 of them in 36 ms."""
    control = ss.Controller(ss.place("PD", J, 400.0), sample_time=1e-3)
    with pytest.raises(Divergence, match="left every reasonable bound") as error:
        ss.simulate(ss.RigidAxis(J, LAWS[law]), control, FAST, 1.0)
    assert error.value.record is not None
    assert error.value.record.meta["counts"]["steps"] < 1e6


def test_a_bristle_that_slides_faster_than_any_axis_does_what_its_equation_says():
    """v(0) = 3e4 rad/s, without a torque: its level and viscous friction alone slow it down."""
    friction = ss.Model("lugre", sigma0=100.0, sigma1=0.0, sigma2=1e-4, fs=0.3, fc=0.3, vs=0.01)
    free = ss.Controller(ss.Gains(1e-12, 0.0, 0.0, 0.0), sample_time=1e-3)
    record = ss.simulate(ss.RigidAxis(J, friction), free, FAST, 0.05, initial=(0.0, 3e4))
    at = record["event"] == 0.0
    rate, goal = 1e-4 / J, -0.3 / 1e-4
    exact = goal + (3e4 - goal) * np.exp(-rate * record.time[at])
    # The bristle bends first, over some microradians.
    assert np.abs(record["velocity"][at] - exact).max() < 1e-4
    assert record.meta["counts"]["steps"] < 2000


def test_it_says_what_it_cannot_run():
    with pytest.raises(InputError, match="acts in continuous time"):
        ss.simulate(ss.RigidAxis(J, GMS), ss.Controller(PD), FAST, 0.05, integrator="sampled")
