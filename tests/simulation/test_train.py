"""The located flow of a train: its tables, its flows, and its motion against independent results."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import stickslip as ss
from stickslip.jit import WIDTH, kernel, pointer
from stickslip.machines.contact import Bearings, Contact, Drift
from stickslip.machines.drivetrain import INPUTS
from stickslip.machines.encoder import Encoder
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier, Harmonics
from stickslip.simulation.machine import loop as machine_loop
from stickslip.simulation.machine.layout import lay_out_machine
from stickslip.simulation.machine.layout import run as run_samples
from stickslip.simulation.train import shapes
from stickslip.simulation.train.blocks import doubled, kept, series
from stickslip.simulation.train.layout import cannot_locate, sliding
from stickslip.simulation.train.records import BLOCKS, GIVEN, STICKING, TRAIN, train_of

GIVEN_TABLE = json.loads((Path(__file__).parent.parent / "data" / "three_inertias.json").read_text())
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
GMS = ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
TABLE10 = ss.Model(
    "gms", {"curve": "double_stribeck"}, k=[1e4, 5e3], alpha=[0.5, 0.5], c=24.0, sigma2=0.01,
    beta0=80.7454, beta1=-80.4742, beta2=-80.5930, beta3=0.7884, beta4=0.7871, v1=0.1755, v2=0.1758,
)  # fmt: skip
LAWS = {
    "gms": GMS,
    "gms, literal": GMS.having(slip_rule="literal"),
    "gms, Table 10": TABLE10,
    "maxwell_slip": ss.Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.05, 0.08, 0.09, 0.1], sigma2=0.018),
}
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
TIME = 1e-3


def train(friction: ss.Model = GMS, **more: object) -> Machine:
    """The three inertias of the table."""
    rotor, shaft, disk = GIVEN_TABLE["inertias"]
    coupling, elasticity = GIVEN_TABLE["stiffness"]
    axis = FlexibleAxis(rotor, shaft, disk, coupling, elasticity, GIVEN_TABLE["damping_ratio"])
    return Machine("train", rotor + shaft + disk, Contact(friction), flexible=axis, sample_time=TIME, **more)


def rigid(friction: ss.Model = GMS, **more: object) -> Machine:
    return Machine("rigid", 3.8623e-4, Contact(friction), sample_time=TIME, **more)


def loop(m: Machine, helper: ss.Model | None = LUGRE) -> ss.Controller:
    """PD of 20 Hz."""
    return ss.Controller(
        ss.place("PD", m.inertia, 20.0, 1.0), helper and ss.Feedforward(helper), 1.0, sample_time=TIME
    )


def run(m: Machine, reference: ss.Reference, duration: float, tolerance: float = 1e-7) -> ss.Record:
    """The tolerance is that of a sub-step."""
    whole = tolerance / machine_loop.sub_step_tolerance(m, 1.0)
    return machine_loop.simulate_machine(m, loop(m), reference, duration, metered=False, tolerance=whole)


# ---- tables and flows ---------------------------------------------------------------------------------------------


def table(first: int, count: int) -> np.ndarray:
    return shapes.tables().reshape(-1, WIDTH)[first : first + count]


@pytest.mark.parametrize("rate", [-1.3, 0.4, 2.0])
def test_the_tables_are_those_of_an_exponential(rate: float) -> None:
    """Rates exp(a tau): their integrals, halves and values between the nodes in closed form."""
    tau = np.arange(shapes.NODES) / shapes.PARTS
    g = np.exp(rate * tau)
    near = 4e-9 * abs(rate) ** 9 + 1e-11
    grown = table(shapes.INTEGRAL, shapes.NODES)[:, : shapes.PARTS].T @ g
    assert grown == pytest.approx((g[1:] - 1.0) / rate, abs=near)
    twice = table(shapes.DRIVEN, 2 * shapes.NODES * shapes.TERMS)[:: 2 * shapes.TERMS, : shapes.PARTS].T @ g
    assert twice == pytest.approx((g[1:] - 1.0 - rate * tau[1:]) / rate**2, abs=near)
    for half, first in ((shapes.LEFT, 0.0), (shapes.RIGHT, 0.5)):
        there = table(half, shapes.NODES)[:, : shapes.NODES].T @ g
        assert there == pytest.approx(np.exp(rate * (first + 0.5 * tau)), abs=near)
    powers = table(shapes.POWERS, shapes.NODES)[:, : shapes.NODES].T @ g
    assert np.polyval(powers[::-1], 2 * 0.29 - 1.0) == pytest.approx(math.exp(0.29 * rate), abs=near)


@kernel()
def make(out: np.ndarray, kind: int, h: float, level: int) -> int:
    """A flow over h by its series; where one of a part of a sample is kept."""
    t = train_of(pointer(out, 0))
    series(t, kind, h, BLOCKS)
    return kept(t, kind, level)


@kernel()
def make_double(out: np.ndarray, h: float, block: int) -> None:
    doubled(train_of(pointer(out, 0)), BLOCKS, h, block)


def wanted(m: Machine, h: float, stiffness: float, given: np.ndarray) -> np.ndarray:
    """The states behind a step of h by one exponential of the system and the powers of time that drive it."""
    system = sliding(m, m.clutch.law.modes(m.clutch.parameters).viscous)
    size = len(system.states)
    a, load = system.a, system.b[:, INPUTS.index("load")]
    a[:, 4] -= stiffness * load
    torque, start, rates = given[size], given[size + 1], given[size + 2 :]
    tau = np.arange(shapes.NODES) / shapes.PARTS
    coefficients = np.linalg.solve(np.vander(tau, increasing=True), rates)
    count = size + 1 + shapes.NODES + 1
    big = np.zeros((count, count))
    # Behind the states 1, tau, ..., tau^9, of which each drives the next.
    big[:size, :size] = h * a
    big[:size, size] = h * (torque * system.b[:, INPUTS.index("command")] - start * load)
    for k in range(shapes.NODES):
        big[size + k + 1, size + k] = k + 1.0
        big[:size, size + k + 1] = -h * load * h * coefficients[k] / (k + 1)
    x = np.concatenate([given[:size], [1.0], np.zeros(shapes.NODES + 1)])
    return (expm(big) @ x)[:size]


@pytest.mark.parametrize("kind", [0, STICKING])
def test_flows_are_those_of_the_matrix_exponential(kind: int) -> None:
    m = train(amplifier=Amplifier(1.0, bandwidth=500.0), encoder=Encoder(0.0, mode=400.0, mode_share=0.3))
    laid = lay_out_machine(m)
    n = laid.train[: TRAIN.itemsize // 8].view(TRAIN)[0]
    size = int(n["size"])
    count = size + GIVEN
    rng = np.random.default_rng(1)
    given = rng.normal(size=count) * np.array([1e-4, 0.1] * 3 + [0.1] + [1e-4, 0.1] + [0.1, 0.1] + [20.0] * 9)
    stiffness = 0.0 if kind == 0 else sum(m.clutch.parameters.k)
    for level in range(int(n["deepest"]) + 1):
        h = TIME / 2**level
        places = [make(laid.train, kind, 0.5 * h, level)]
        if level >= n["resolved"]:
            make(laid.train, kind, h, level)
            places.append(BLOCKS)
        for block in places:
            columns = laid.train[block : block + count * WIDTH].reshape(count, WIDTH)
            end = given @ columns
            truth = wanted(m, h, stiffness, given)
            scale = np.abs(given) @ np.abs(columns) + 1e-12
            assert np.all(np.abs(end[:size] - truth) < 1e-9 * scale[:size]), (level, block)


# ---- motion -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", ["low", "high"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-7, 1e-8])
def test_three_inertias_move_as_an_independent_integrator_has_it(motion: str, tolerance: float) -> None:
    given = GIVEN_TABLE["motions"][motion]
    reference = ss.Reference("sine", amplitude=given["amplitude"], frequency=given["frequency"])
    m = train()
    record = run(m, reference, given["samples"][-1] * TIME, tolerance)
    assert "general_step" not in record.meta
    error = np.abs(record["position"][given["samples"]] - given["position"])
    assert error.max() < tolerance


def test_the_estimate_of_the_error_holds() -> None:
    given = GIVEN_TABLE["motions"]["low"]
    m = train()
    reference = ss.Reference("sine", amplitude=given["amplitude"], frequency=given["frequency"])
    record = ss.simulate(m, loop(m), reference, 5.0, check=True)
    error = np.abs(record["position"][given["samples"]] - given["position"]).max()
    assert 0.0 < error < 2.0 * record.meta["accuracy"]["error_rad"] < 2e-7


@pytest.mark.parametrize("name", LAWS)
@given(
    amplitude=st.floats(1e-3, 0.2), frequency=st.floats(0.3, 3.0), start=st.floats(-0.01, 0.01),
)  # fmt: skip
@example(amplitude=1.953125e-3, frequency=0.5, start=1.5e-3)
@settings(max_examples=6, deadline=None)
def test_a_rigid_machine_moves_as_a_rigid_axis_on_its_own_located_flow(
    name: str, amplitude: float, frequency: float, start: float
) -> None:
    """That engine follows one velocity and one force in steps of order 8."""
    m = rigid(LAWS[name])
    reference = ss.Reference("sine", amplitude=amplitude, frequency=frequency)
    axis = ss.RigidAxis(m.inertia, m.friction)
    more = {"metered": False, "tolerance": 1e-11}
    one = ss.simulate(m, loop(m), reference, 0.5, initial=(start, 0.0), **more)
    other, beside = (
        ss.simulate(axis, loop(m), reference, 0.5, initial=(begin, 0.0), output=one.time, **more)
        for begin in (start, start + 1e-9)
    )
    other, beside = (r["position"][r["event"] == 0.0] for r in (other, beside))
    # A loop that swings itself up, or a tie that rounding decides, says nothing of either engine.
    assume(np.max(np.abs(other - beside)) < 1e-7)
    assert np.max(np.abs(one["position"] - other)) < 1e-6


@pytest.mark.parametrize("name", LAWS)
def test_sub_steps_tend_to_the_located_flow(name: str) -> None:
    """Behind a current loop and a delay, under given torques: a loop would make much of what is left."""
    m = train(LAWS[name], amplifier=Amplifier(1.0, bandwidth=800.0), delay=0.3)
    torques = 0.5 * np.sin(0.02 * np.arange(1000))

    def angles(tolerance: float, located: bool) -> np.ndarray:
        rows = np.zeros((torques.size, 6))
        run_samples(lay_out_machine(m, tolerance, located=located), torques, rows)
        return rows[:, 1]

    truth = angles(1e-11, True)
    for tolerance in (1e-6, 1e-8):
        assert np.max(np.abs(angles(tolerance, True) - truth)) < 10.0 * tolerance
    coarse, fine = (float(np.max(np.abs(angles(t, False) - truth))) for t in (1e-5, 1e-10))
    assert fine < 0.1 * coarse
    assert fine < 2e-5


@pytest.mark.parametrize("name", LAWS)
def test_nothing_creeps_in_a_minute_at_rest(name: str) -> None:
    m = train(LAWS[name])
    laid = lay_out_machine(m)
    rows = np.zeros((60000, 6))
    torques = np.where(np.arange(len(rows)) < 200, 0.4, 0.02)
    run_samples(laid, torques, rows)
    late = rows[30000:, 1]
    assert np.ptp(late) < 1e-12
    assert abs(laid.axis[5]) < 1e-9


def test_one_sample_at_a_time_is_a_block() -> None:
    m = train(delay=0.3, amplifier=Amplifier(1.0, bandwidth=500.0))
    torques = 0.5 * np.sin(0.02 * np.arange(500))
    whole, parts = lay_out_machine(m), lay_out_machine(m)
    rows, single = np.zeros((500, 6)), np.zeros((500, 6))
    run_samples(whole, torques, rows)
    for k in range(500):
        run_samples(parts, torques[k : k + 1], single[k : k + 1])
    assert np.array_equal(rows, single)


@pytest.mark.parametrize(
    ("machine", "why"),
    [
        (train(LUGRE), "not made of springs"),
        (rigid(ss.Model("dahl", fc=0.3, sigma0=3e4, delta_d=0.5)), "gives no `modes`"),
        (rigid(ss.Model("coulomb", fc=0.3)), "not made of springs"),
        (rigid(cogging=Harmonics((2.0,), (0.01,), (0.0,))), "cogging"),
        (replace(rigid(), contact=Contact(GMS, ripple=Harmonics((2.0,), (0.1,), (0.0,)))), "ripple"),
        (replace(rigid(), contact=Contact(GMS, bearings=Bearings(0.02))), "bearings"),
        (replace(rigid(), contact=Contact(GMS, drift=Drift(0.1))), "drift"),
    ],
)
def test_what_has_no_located_flow_takes_sub_steps_and_the_record_says_why(machine: Machine, why: str) -> None:
    assert why in cannot_locate(machine)
    record = run(machine, ss.Reference("sine", amplitude=0.01, frequency=1.0), 0.05)
    assert why in record.meta["general_step"]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("made", [train, rigid])
def test_a_loop_that_comes_to_rest_on_sticking_elements_has_an_end(made, name: str) -> None:
    """An element at its limit: what rounding leaves of the balance let it go and stopped the axis at once."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        gains = ss.Gains(kp=rng.uniform(2.0, 12.0), kd=rng.uniform(0.07, 0.14))
        controller = ss.Controller(gains, torque_limit=1.0, sample_time=TIME)
        reference = ss.Reference("step", amplitude=rng.uniform(0.005, 0.12), tau=0.02)
        record = ss.simulate(made(LAWS[name]), controller, reference, 2.0, metered=False, tolerance=1e-7)
        assert record.meta["ended"] == 2.0
        assert abs(record.channels["velocity"][-1]) < 1e-9
