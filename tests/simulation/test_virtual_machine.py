"""The virtual machine's samples: convergence, equilibrium, energy, seeds, and laws that hold at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.machines.contact import Contact
from stickslip.machines.files import machine
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.machine.layout import TOLERANCE, lay_out_machine, look, run, wait

J = 4.2757e-4
STIFF = Model("lugre", sigma0=2e4, sigma1=0.1, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)


def moved(m, torques, tolerance=TOLERANCE, laid=None):
    """Measured rows, one per torque."""
    laid = laid or lay_out_machine(m, tolerance)
    rows = np.zeros((len(torques), 6))
    run(laid, np.asarray(torques, dtype=np.float64), rows)
    return rows


@pytest.mark.parametrize("friction", ["thesis", "stiff"])
def test_converges_to_the_adaptive_integrator_with_its_tolerance(friction):
    """A torque by constants that breaks away, slides, reverses and sticks."""
    m = machine("ideal") if friction == "thesis" else Machine("stiff", J, Contact(STIFF))
    model = m.clutch
    scale = 1e9  # torque = kp (reference - position): held as long as the reference is, the position's part is 1e-9
    levels = [0.2, 0.45, 0.1, -0.45, 0.0]
    times = np.concatenate([[0.0], *[[0.1 * i, 0.1 * i + 1e-9] for i in range(1, 5)], [0.5]])
    values = np.repeat(levels, 2)
    reference = Reference(
        "table", time=times.tolist(), position=(scale * values).tolist(), velocity=[0.0] * 10
    )
    truth = simulate(
        RigidAxis(J, model), Controller(Gains(1.0 / scale)), reference, 0.5, integrator="adaptive",
        tolerance=1e-11, output=np.arange(0.0, 0.5001, 0.01), metered=False,
    )  # fmt: skip
    grid = truth["event"] == 0.0
    wanted = np.interp(np.arange(0.01, 0.5, 0.01), truth.time[grid], truth["position"][grid])
    torques = np.repeat(levels, 100)
    errors = []
    for tolerance in (1e-5, 1e-6, 1e-7, 1e-10):
        rows = moved(m, torques, tolerance)
        errors.append(float(np.max(np.abs(rows[9:-1:10, 1] - wanted))))
    assert errors[-1] < 2e-6
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[2] < 0.1 * errors[0]


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease"])
def test_rests_where_the_springs_balance_the_torque(name):
    m = machine(name).without(
        "encoder-counts", "encoder-noise", "current-noise", "sensor-noise", "converters", "cogging", "position",
        "drift", "temperature", "direction",
    )  # fmt: skip
    rows = moved(m, np.concatenate([np.linspace(0.0, 0.02, 500), np.full(2000, 0.02)]))
    seen = 0.02 / rows[-200:, 1].mean()
    assert seen == pytest.approx(m.visible_stiffness, rel=0.01)
    assert rows[-1, 3] == pytest.approx(0.02, rel=0.05)  # what the bearings do not carry


def test_noise_depends_on_seed_and_sample_alone():
    m = machine("thesis-dry")
    torques = 0.4 * np.sin(0.01 * np.arange(400))
    whole = moved(m, torques)
    laid = lay_out_machine(m)
    single = np.concatenate([moved(m, torques[i : i + 1], laid=laid) for i in range(400)])
    assert np.array_equal(whole, single)
    assert not np.array_equal(whole, moved(replace(m, seed=7), torques))
    # Switching the sensor's noise off leaves the current's.
    quiet = moved(m.without("sensor-noise"), torques)
    assert np.array_equal(quiet[:, :3], whole[:, :3])
    assert not np.array_equal(quiet[:, 3], whole[:, 3])


def test_amplifier_saturates_and_the_drive_trips_on_overspeed():
    m = machine("thesis-grease").without("current-noise", "converters", "bandwidth")
    rows = moved(m, np.full(20, 5.0))
    assert rows[:, 2].max() == pytest.approx(0.22 * 6.0)
    rows = moved(m, np.full(800, 1.0))
    tripped = np.flatnonzero(rows[:, 5])
    assert tripped.size
    speed = np.diff(rows[:, 1]) / 1e-3
    assert speed[tripped[0] - 1] == pytest.approx(37.7, rel=0.05)
    assert np.abs(rows[tripped[0] + 1 :, 2]).max() == 0.0
    assert speed[-1] < speed[tripped[0]]


def test_delay_moves_the_torque_by_its_part_of_a_sample():
    m = machine("ideal")
    late = moved(replace(m, delay=1.0), [0.5, 0.0, 0.0])
    now = moved(m, [0.5, 0.0, 0.0])
    assert late[0, 1] == 0.0
    assert late[1, 1] == pytest.approx(now[0, 1], rel=1e-12)


@pytest.mark.parametrize("whole", [1, 4, 99])
@pytest.mark.parametrize("part", [0.0, 0.25, 1.0])
def test_a_longer_delay_moves_the_same_motion_by_whole_samples(whole: int, part: float) -> None:
    m = replace(machine("ideal"), delay=part)
    torques = np.random.default_rng(3).uniform(-0.6, 0.6, 50)
    now = moved(m, torques)[:, 1]
    late = moved(replace(m, delay=whole + part), np.append(torques, np.zeros(whole)))[:, 1]
    assert np.ptp(now) > 1e-3
    assert not late[:whole].any()
    np.testing.assert_allclose(late[whole:], now, rtol=0.0, atol=1e-12)


def test_pause_advances_drift_and_cools():
    m = machine("thesis-dry")
    laid = lay_out_machine(m)
    moved(m, np.full(3000, 0.45), laid=laid)
    warm = float(laid.now["warmth"])
    wait(laid, 600.0)
    row = np.zeros(6)
    look(laid, row)
    assert row[0] == pytest.approx(603.0)
    assert row[4] - 20.0 == pytest.approx((warm - 20.0) * np.exp(-1.0), rel=1e-9)


@pytest.mark.parametrize("law", ["coulomb", "karnopp", "stribeck", "lugre", "dahl", "maxwell_slip", "static"])
def test_any_law_of_the_package_moves_and_stops(law):
    from stickslip.models import plugins

    found = plugins.law(law)
    m = Machine("any", J, Contact(Model(found, {}, **found.example)))
    torques = np.concatenate([np.full(300, 0.1), np.full(100, 0.6), np.zeros(1500)])
    rows = moved(m, torques)
    assert abs(rows[299, 1]) < 2e-3
    assert rows[399, 1] > 0.1
    rest = rows[-200:, 1]
    assert np.ptp(rest) < 1e-5


def test_singular_viscous_term_settles():
    """|v|^0.38 of Table 10 has an infinite slope at rest; the contact still comes to rest under any load."""
    m = machine("thesis-grease").without("current-noise", "encoder-counts", "encoder-noise", "converters")
    rows = moved(m, np.concatenate([np.full(200, 0.5), np.zeros(3000)]))
    assert np.ptp(rows[-500:, 1]) < 1e-6


@pytest.mark.parametrize("law", ["coulomb", "static"])
def test_a_contact_that_holds_lets_go_within_a_sample_when_the_torque_has_grown(law):
    """Behind a current loop: the torque passes the level in the middle of a sample; at rest before, closed form."""
    level, torque, corner = 0.2, 0.3, 150.0
    values = {"fc": level, "sigma2": 0.0} | ({"fs": level} if law == "static" else {})
    m = Machine("late", J, Contact(Model(law, **values)), amplifier=Amplifier(1.0, bandwidth=corner))
    rate = 2.0 * np.pi * corner
    leaves = -np.log(1.0 - level / torque) / rate
    assert 1e-3 < leaves < 2e-3
    rows = moved(m, np.full(20, torque))
    t = 1e-3 * np.arange(1, 21) - leaves
    gap = torque - level  # what is left to grow when it lets go: J dv/dt = gap (1 - exp(-rate t))
    way = gap / J * (0.5 * t**2 - t / rate + (1.0 - np.exp(-rate * t)) / rate**2)
    assert rows[:, 1] == pytest.approx(np.where(t > 0.0, way, 0.0), abs=1e-6)
