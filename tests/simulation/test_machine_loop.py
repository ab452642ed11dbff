"""A machine with its imperfections under `simulate`: against the ideal axis, the rig, finer steps and a solver."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.core.errors import Divergence, InputError, ParameterError
from stickslip.machines.contact import Bearings, Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.files import machine
from stickslip.machines.machine import IMPERFECTIONS, Machine
from stickslip.machines.motor import Amplifier
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig
from support.thesis_loops import INERTIA, PARAMETERS, PLANT

SINE = ss.Reference("sine", amplitude=0.05, frequency=1.0)
GAINS = ss.place("PD", INERTIA, 10.0, 0.85)
DRY = machine("thesis-dry")


def helped(kind: Any, law: str) -> ss.Controller:
    return ss.Controller(GAINS, kind(ss.Model(law, **PARAMETERS[law])))


def ideal(friction: ss.Model, **more: Any) -> Machine:
    return Machine("ideal", INERTIA, Contact(friction), **more)


@pytest.mark.parametrize("kind", [None, ss.Feedforward, ss.Feedback])
def test_without_imperfections_a_machine_is_the_ideal_axis(kind: Any) -> None:
    friction = DRY.contact.friction
    controller = ss.Controller(GAINS, kind and kind(DRY.models["lugre"], 0.7), sample_time=1e-3)
    axis = ss.simulate(ss.RigidAxis(INERTIA, friction), controller, SINE, 2.0, time_step=1e-5)
    run = ss.simulate(ideal(friction), controller, SINE, 2.0, check=True)
    there = np.interp(run.time, axis.time, axis["position"])
    apart = float(np.max(np.abs(run["position"] - there)))
    assert apart < 2e-5
    assert apart < 2.0 * run.meta["accuracy"]["error_rad"]
    for name in ("position_rms_rad", "velocity_rms_rad_s", "torque_rms_Nm", "friction_residual_rms_Nm"):
        assert run.meta["metrics"][name] == pytest.approx(axis.meta["metrics"][name], rel=2e-3)


@pytest.mark.parametrize("kind", [None, ss.Feedback])  # a rig fades a feedforward in when it takes over
def test_it_does_what_the_rig_of_the_machine_does(kind: Any) -> None:
    """Both worlds of one machine: the same positions from its encoder, bit for bit, by the same controller."""
    controller = ss.Controller(GAINS, kind and kind(DRY.models["lugre"]), torque_limit=1.0, sample_time=1e-3)
    run = ss.simulate(DRY, controller, SINE, 1.0)
    rig = VirtualRig(DRY)
    count = 1000
    wanted = SINE.sample(1e-3 * np.arange(count))
    path = setpoints(
        count, position=wanted[:, 0], velocity=wanted[:, 1], acceleration=wanted[:, 2], closed=1.0
    )
    with Loop(rig) as loop:
        rows = loop.run(path, controller)
    assert np.array_equal(rows[:, 1], run["position_measured"][:count])
    assert np.allclose(rows[:, 4], run["torque_command"][:count], rtol=0.0, atol=1e-12)


def test_every_imperfection_changes_what_the_loop_does() -> None:
    """Each alone, on the machine without any."""
    bare = DRY.without(*IMPERFECTIONS)
    controller = helped(ss.Feedforward, "lugre")
    first = ss.simulate(bare, controller, SINE, 0.6)["position"]
    same = []
    for name in IMPERFECTIONS:
        alone = DRY.without(*(n for n in IMPERFECTIONS if n != name))
        if np.array_equal(ss.simulate(alone, controller, SINE, 0.6)["position"], first):
            same.append(name)
    # The sensors beside the loop do not act on it; the dry machine has neither filter nor delay, and no limit is met.
    assert set(same) <= {"sensor-noise", "velocity-filter", "delay", "current-limit", "encoder-mode"}


def test_the_error_of_a_run_is_told_by_finer_steps() -> None:
    controller = helped(ss.Feedforward, "gms")
    smooth = DRY.without("encoder-counts", "encoder-noise", "current-noise", "converters")
    run = ss.simulate(smooth, controller, SINE, 1.0, check=True)
    finest = ss.simulate(smooth, controller, SINE, 1.0, check=False)
    assert finest.meta["counts"]["substeps"] == run.meta["counts"]["substeps"]
    assert run.meta["tolerance"] == 1e-9
    fine = ss.simulate(smooth, controller, SINE, 1.0, tolerance=1e-11)
    assert fine.meta["sub_step_tolerance"] == pytest.approx(1e-12)
    error = float(np.max(np.abs(run["position"] - fine["position"])))
    told = run.meta["accuracy"]["error_rad"]
    assert 0.0 < told < 1e-4
    assert 0.5 * error < told < 4.0 * error


def test_a_control_law_of_ones_own_runs_on_it() -> None:
    observer = ss.Controller(
        loop=ss.ControlBlock("pd", kp=GAINS.kp, kd=GAINS.kd), sample_time=1e-3,
        observer=ss.ControlBlock("disturbance_observer", inertia=DRY.inertia, corner=200.0),
    )  # fmt: skip
    plain = ss.simulate(DRY, ss.Controller(GAINS), SINE, 2.0)
    run = ss.simulate(DRY, observer, SINE, 2.0)
    assert run.meta["controller"]["observer"]
    assert run.meta["metrics"]["position_rms_rad"] < 0.2 * plain.meta["metrics"]["position_rms_rad"]


def test_rows_are_those_of_the_samples_asked_for() -> None:
    controller = ss.Controller(GAINS)
    every = ss.simulate(DRY, controller, SINE, 0.1)
    tenth = ss.simulate(DRY, controller, SINE, 0.1, output=0.01)
    some = ss.simulate(DRY, controller, SINE, 0.1, output=[0.0, 0.03, 0.07])
    assert every.time.size == 101
    assert np.array_equal(tenth["position"], every["position"][::10])
    assert np.array_equal(some["position"], every["position"][[0, 30, 70]])
    np.testing.assert_equal(tenth.meta["metrics"], every.meta["metrics"])


def test_it_starts_where_it_is_told_with_every_inertia() -> None:
    run = ss.simulate(DRY, ss.Controller(GAINS), SINE, 0.01, initial=(0.3, 0.5))
    assert run["position"][0] == 0.3
    assert run["velocity"][0] == 0.5
    assert run["position"][1] == pytest.approx(
        0.3 + 0.5e-3 - 0.5 * GAINS.kp * 0.3 / DRY.inertia * 1e-6, abs=1e-3
    )


def test_the_slip_rule_is_the_laws_own_unless_one_is_given() -> None:
    literal = ideal(ss.Model("gms", {"slip_rule": "literal"}, **PLANT))
    runs = [
        ss.simulate(literal, ss.Controller(GAINS), SINE, 0.1, slip_rule=rule) for rule in (None, "signed")
    ]
    assert [run.meta["slip_rules"]["friction"] for run in runs] == ["literal", "signed"]


@pytest.mark.parametrize(
    ("more", "controller", "said"),
    [
        (
            {},
            ss.Controller(GAINS, sample_time=5e-4),
            "sample_time = 0.0005 s, that of the machine ideal is 0.001 s",
        ),
        ({}, ss.Controller(GAINS, sample_time=1e-3, encoder_counts=4096.0), "has an encoder of its own"),
        ({"integrator": "exact"}, ss.Controller(GAINS), "the exact integrator cannot run a machine"),
        ({"output": 1.5e-3}, ss.Controller(GAINS), "no whole number of the machine's samples"),
        ({"output": [0.0, 1.5e-3]}, ss.Controller(GAINS), "must be those of the machine's samples"),
    ],
)
def test_what_does_not_fit_a_machine_is_said(more: Any, controller: ss.Controller, said: str) -> None:
    with pytest.raises(InputError, match=said):
        ss.simulate(ideal(ss.Model("gms", **PLANT)), controller, SINE, 0.1, **more)


def test_the_tolerance_of_a_run_is_that_of_its_sub_steps() -> None:
    smooth = DRY.without("encoder-counts", "encoder-noise", "current-noise", "converters")
    coarse, fine = (
        ss.simulate(smooth, helped(ss.Feedforward, "gms"), SINE, 0.3, tolerance=tolerance).meta["counts"]
        for tolerance in (1e-8, 1e-12)
    )
    assert fine["substeps"] > 2 * coarse["substeps"]
    with pytest.raises(ParameterError, match="tolerance = 0 rad must be greater than 0"):
        ss.simulate(smooth, ss.Controller(GAINS), SINE, 0.3, tolerance=0.0)


def test_a_duration_of_nothing_is_refused() -> None:
    with pytest.raises(ParameterError, match="duration"):
        ss.simulate(DRY, ss.Controller(GAINS), SINE, math.nan)


def test_a_drive_that_switches_off_ends_the_run_and_keeps_its_record() -> None:
    """The encoder of this one loses counts at 20 rad/s."""
    friction = ss.Model("coulomb", fc=1e-3, sigma2=0.0)
    fast = ideal(friction, encoder=Encoder(counts=4096.0, max_speed=20.0))
    with pytest.raises(Divergence, match="faster than its encoder follows") as error:
        ss.simulate(fast, ss.Controller(GAINS), ss.Reference("sine", amplitude=10.0, frequency=2.0), 1.0)
    assert error.value.record is not None
    assert 5 < error.value.record.time.size < 1000


def test_a_current_loop_delays_what_the_solver_says_it_does() -> None:
    """Motor torque against scipy's, of an axis without friction worth the name."""
    from scipy.integrate import solve_ivp

    corner, friction = 100.0, ss.Model("coulomb", fc=1e-12, sigma2=0.01)
    contact = Contact(friction, bearings=Bearings(viscous=0.01))
    slow = Machine("slow", INERTIA, contact, amplifier=Amplifier(1.0, bandwidth=corner))
    run = ss.simulate(slow, ss.Controller(GAINS), SINE, 0.2)
    torque, x, path = run["torque_command"], np.zeros(3), [0.0]
    for k in range(200):

        def rate(_t: float, y: Any, held: float = float(torque[k])) -> list[float]:
            return [y[1], (y[2] - 0.01 * y[1]) / INERTIA, 2.0 * math.pi * corner * (held - y[2])]

        x = solve_ivp(rate, (0.0, 1e-3), x, rtol=1e-10, atol=1e-14).y[:, -1]
        path.append(float(x[0]))
    assert np.max(np.abs(run["position"] - np.array(path))) < 1e-7


def test_a_machine_without_one_of_its_parts_says_so_in_the_record() -> None:
    run = ss.simulate(replace(DRY, seed=7).without("cogging"), ss.Controller(GAINS), SINE, 0.05)
    assert run.meta["machine"]["without"] == ["cogging"]
    assert run.meta["machine"]["seed"] == 7


@pytest.mark.slow
def test_a_contact_that_creeps_before_it_breaks_away_is_resolved_by_default():
    """What it is wrong by while it creeps grows ten thousandfold until it slides: 1.2 mrad it was, at sub-steps
    wrong by a hundred tolerances."""
    lugre = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
    axis = ss.Machine("exact", 3.8623e-4, ss.Contact(lugre))
    control = ss.Controller(ss.place("PD", 3.8623e-4, 20.0))
    motion = ss.Reference("sine", amplitude=0.05, frequency=1.0)
    usual, fine = (
        ss.simulate(axis, control, motion, 0.3, tolerance=tolerance) for tolerance in (1e-9, 1e-14)
    )
    apart = np.abs(usual["position"] - fine["position"])
    assert np.ptp(fine["position"]) > 0.01  # it has broken away
    assert apart.max() < 2e-5


@pytest.mark.parametrize("tolerance", [1e-7, 1e-9])
@pytest.mark.parametrize("law", ["lugre", "dahl"])
def test_an_axis_that_moves_at_the_start_is_damped_from_there_on(law: str, tolerance: float) -> None:
    """The torque of the first sub-step ran on from 0: 3e-6 rad, whatever the tolerance."""
    curve = {"fs": 0.335, "vs": 0.05, "sigma1": 0.1} if law == "lugre" else {}
    friction = ss.Model(law, sigma0=1e3, fc=0.285, sigma2=0.018, **curve)
    controller, start = ss.Controller(GAINS, sample_time=1e-3), (0.0, 2.0)
    still = ss.Reference.table([0.0, 1.0], [0.0, 0.0])
    axis = ss.simulate(
        ss.RigidAxis(INERTIA, friction), controller, still, 0.05, initial=start, tolerance=1e-12
    )
    run = ss.simulate(
        ideal(friction), controller, still, 0.05, initial=start, tolerance=tolerance, check=True
    )
    there = axis["position"][axis["event"] == 0.0]
    apart = np.abs(run["position"] - there)
    assert apart[1] < max(tolerance, 1e-8)
    assert apart.max() < 2.0 * run.meta["accuracy"]["error_rad"]
    assert run["friction_torque"][0] == pytest.approx(axis["friction_torque"][0], rel=1e-9)


def test_the_first_sample_of_a_moving_axis_is_that_of_its_differential_equations() -> None:
    s0, s1, s2, fc, fs, vs = 1e3, 0.1, 0.018, 0.285, 0.335, 0.05
    friction = ss.Model("lugre", sigma0=s0, sigma1=s1, sigma2=s2, fc=fc, fs=fs, vs=vs)

    def rates(_: float, y: Any) -> list[float]:
        _, v, z = y
        dz = v - s0 * abs(v) / (fc + (fs - fc) * math.exp(-((v / vs) ** 2))) * z
        return [v, -(s0 * z + s1 * dz + s2 * v) / INERTIA, dz]

    exact = solve_ivp(rates, (0.0, 1e-3), [0.0, 2.0, 0.0], "DOP853", rtol=1e-12, atol=1e-15).y[0, -1]
    still = ss.Reference.table([0.0, 1.0], [0.0, 0.0])
    for tolerance in (1e-7, 1e-10):
        run = ss.simulate(
            ideal(friction), ss.Controller(GAINS), still, 1e-3, initial=(0.0, 2.0), tolerance=tolerance
        )
        assert abs(run["position"][1] - exact) < max(tolerance, 1e-8)


def test_what_the_shortest_sub_steps_are_wrong_by_is_told() -> None:
    """Two runs that both end at the shortest sub-steps agreed to 1e-11 rad, and were wrong by 6e-10."""
    friction = ss.Model("dahl", sigma0=1e3, fc=0.285, sigma2=0.018)
    controller = ss.Controller(ss.place("PD", 4e-4, 12.0), sample_time=1e-3)
    still = ss.Reference.table([0.0, 1.0], [0.0, 0.0])
    more = {"initial": (0.02, 0.0), "tolerance": 1e-12}
    axis = ss.simulate(ss.RigidAxis(4e-4, friction), controller, still, 0.05, **more)
    run = ss.simulate(Machine("m", 4e-4, Contact(friction)), controller, still, 0.05, check=True, **more)
    error = np.abs(run["position"] - axis["position"][axis["event"] == 0.0]).max()
    assert error > 1e-10
    assert error < run.meta["accuracy"]["error_rad"] < 30.0 * error


@pytest.mark.parametrize("law", ["gms", "coulomb"])
def test_a_machine_whose_loop_diverges_says_so_when_it_leaves_every_bound(law: str) -> None:
    """It ran on until its controller was handed 1e9 rad, or was no longer a number, and told no cure."""
    friction = ss.Model("gms", **PLANT) if law == "gms" else ss.Model("coulomb", fc=0.285)
    stiff = ss.Controller(ss.place("PD", INERTIA, 400.0))
    for limit, cure in ((math.inf, "sample time, or give a torque limit$"), (1e9, "sample time$")):
        with pytest.raises(
            Divergence, match=rf"ended at .* every reasonable bound; lower the .* {cure}"
        ) as error:
            ss.simulate(ideal(friction), replace(stiff, torque_limit=limit), SINE, 1.0)
        assert error.value.record is not None
        assert np.abs(error.value.record["position"]).max() < 1e6
