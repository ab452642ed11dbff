"""The linear machine: its response against the dynamic stiffness, its flow against a fine integration, its names."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import INPUTS, Chain, Drivetrain, LinearContact
from stickslip.machines.files import machine
from stickslip.simulation.machine import plant
from stickslip.simulation.machine.layout import contact_spring, lay_out_machine

FREQUENCY = np.array([0.5, 20.0, 290.0, 310.0, 800.0, 2750.0, 6000.0])


def dynamic(m, contact, bearings, f, place):
    """Measured angle per torque on an inertia, from M, D and K in the frequency domain: no state at all."""
    x, s = m.flexible, 2j * math.pi * f
    k, d = np.zeros((3, 3)), np.zeros((3, 3))
    for i, (spring, damper) in enumerate(zip((x.coupling, x.elasticity), x.dampers, strict=True)):
        joins = np.zeros(3)
        joins[i], joins[i + 1] = 1.0, -1.0
        k, d = k + spring * np.outer(joins, joins), d + damper * np.outer(joins, joins)
    k[1, 1], d[1, 1] = k[1, 1] + bearings.stiffness, d[1, 1] + bearings.damping
    k[2, 2], d[2, 2] = k[2, 2] + contact.stiffness, d[2, 2] + contact.damping
    angle = np.linalg.solve(s * s * np.diag((x.rotor, x.shaft, x.disk)) + s * d + k, np.eye(3)[:, place])[1]
    e = m.encoder
    w, share = 2.0 * math.pi * e.mode, e.mode_share if e.mode > 0.0 else 0.0
    follows = (w * w + 2.0 * e.mode_damping * w * s) / (s * s + 2.0 * e.mode_damping * w * s + w * w)
    return angle * (1.0 - share + share * follows)


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease"])
@pytest.mark.parametrize("stiffness", [0.0, 25_000.0])
def test_the_response_is_that_of_the_dynamic_stiffness(name, stiffness):
    m, contact = machine(name), LinearContact(stiffness, 0.02)
    bearings = m.stuck_bearings
    found = m.linear(contact, bearings).state_space()
    lag = 1.0 / (1.0 + 1j * FREQUENCY / m.amplifier.bandwidth)
    for source, place in zip(INPUTS, (0, 0, 1, 2), strict=True):
        told = np.array([dynamic(m, contact, bearings, f, place) for f in FREQUENCY])
        told *= lag if source == "command" else 1.0
        assert found.response(FREQUENCY, source) == pytest.approx(told, rel=1e-7)


def test_a_rigid_machine_is_one_inertia():
    m = machine("thesis-dry").without("flexibility", "encoder-mode", "bearings", "bandwidth")
    found = m.linear().state_space()
    assert found.states == ("angle[0]", "velocity[0]")
    assert found.a.tolist() == [[0.0, 1.0], [0.0, 0.0]]
    assert found.b.tolist() == [[0.0] * 4, [1.0 / m.inertia] * 4]
    assert m.linear(bearings=m.stuck_bearings).visible == 0.0


def test_states_are_named():
    states = machine("thesis-dry").linear().state_space().states
    assert states[:2] == ("angle[0]", "velocity[0]")
    assert states[4:7] == ("angle[2]", "velocity[2]", "torque")
    assert states[7:] == ("mode", "mode_velocity")


def test_the_flow_is_that_of_many_short_steps():
    """Midpoint steps of 10^-8 s, whose error is far below what is asked; the rising input too."""
    system, step, parts = machine("thesis-dry").linear().state_space(), 1e-4, 10_000
    n, m, h = *system.b.shape, step / parts
    half = np.eye(n) - 0.5 * h * system.a
    moves = np.linalg.solve(half, np.eye(n) + 0.5 * h * system.a)
    takes = np.linalg.solve(half, h * system.b)
    moved, held, rising = np.eye(n), np.zeros((n, m)), np.zeros((n, m))
    for i in range(parts):
        moved, held, rising = moves @ moved, moves @ held + takes, moves @ rising + takes * (i + 0.5) / parts
    flow = system.over(step)
    for found, told in ((flow.moved, moved), (flow.held, held), (flow.rising, rising)):
        assert found == pytest.approx(told, rel=1e-5, abs=1e-6 * np.abs(told).max())


@pytest.mark.parametrize("without", [(), ("flexibility",), ("encoder-mode", "bandwidth")])
def test_the_virtual_machine_moves_by_this_flow(without):
    """Its compiled sample multiplies by the very numbers: none is built a second time."""
    m = machine("thesis-grease").without(*without)
    laid, system = lay_out_machine(m), m.linear().state_space()
    n = len(system.states)
    blocks = laid.matrix.reshape(-1, plant.LEVELS, plant.COLUMNS, plant.SLOTS)
    assert n + plant.GIVEN <= plant.SLOTS
    assert not np.any(blocks[..., n:])
    for level in (0, 3, plant.FINEST):
        rows, flow = blocks[0, level].T[:n], system.over(m.sample_time / 2**level)
        assert rows[:, :n] == pytest.approx(flow.moved, rel=1e-9, abs=1e-12)
        assert rows[:, n : n + 3] == pytest.approx(flow.held[:, :3], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("without", [(), ("flexibility",)])
def test_a_sticking_contact_is_a_spring_of_the_flow(without):
    """All of its stiffness, about where it sticks: as a drivetrain with that contact moves from there."""
    m = machine("thesis-dry").without(*without)
    laid = lay_out_machine(m)
    stiff = contact_spring(m)
    system = m.linear(LinearContact(stiff)).state_space()
    n = len(system.states)
    rows = laid.matrix.reshape(-1, plant.LEVELS, plant.COLUMNS, plant.SLOTS)[plant.SPRINGS, 3].T[:n]
    assert rows[:, :n] == pytest.approx(system.over(m.sample_time / 8).moved, rel=1e-8, abs=1e-9)
    angles = np.array([name.startswith("angle") or name == "mode" for name in system.states], dtype=float)
    # At rest about any angle it stays: what the spring pulls is taken back.
    assert rows[:, :n] @ (3.0 * angles) + 3.0 * rows[:, n + plant.IN_ANGLE] == pytest.approx(
        3.0 * angles, abs=1e-9
    )


def test_modes_of_the_chain_are_those_of_the_undamped_matrices():
    drivetrain = Drivetrain((1.2e-4, 1.2e-4, 1.9e-4), (17_800.0, 396.0))
    found = np.sort(np.abs(np.linalg.eigvals(drivetrain.state_space().a).imag))[::2] / (2.0 * math.pi)
    assert found[1:] == pytest.approx(drivetrain.chain.modes().frequencies[1:], rel=1e-9)


def test_what_no_drivetrain_has_is_refused():
    with pytest.raises(ParameterError, match=r"drivetrain: inertias = 0 kg·m² must be greater than 0"):
        Chain((0.0,), ())
    with pytest.raises(ParameterError, match="drivetrain: encoder = 1 is not the number of an inertia"):
        Drivetrain((1.0,), encoder=1)
    with pytest.raises(ParameterError, match="drivetrain: 2 dampers for 1 springs"):
        Drivetrain((1.0, 1.0), (1.0,), dampers=(0.1, 0.1))
