"""Position feedforward: the law gives its map, ahead by its lead, and takes cogging from a machine's motion."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.position import position_feedforward
from stickslip.core.errors import ParameterError
from stickslip.machines.files import machine
from stickslip.machines.position_map import PositionMap, Waves

TURN = 2.0 * np.pi
MAP = PositionMap(Waves((12.0, 72.0), (0.02, 0.1), (-0.01, 0.05)), unit="N·m", lower=0.0, upper=TURN)
MOTOR = Path(__file__).parents[1] / "data" / "direct_drive_24.toml"


def given(block, angles, *, turns=0.0, velocity=0.0, error=0.0, reference_velocity=0.0):
    """The law's torque at measured angles."""
    law, p = block.law, block.parameters
    return np.array([
        law.sample(
            SimpleNamespace(position=float(x), turns=turns, velocity=velocity, error=error,
                            reference_velocity=reference_velocity), None, p, None,
        )
        for x in angles
    ])  # fmt: skip


def test_harmonics_and_table_give_the_map():
    angles = np.linspace(-7.0, 13.0, 501)
    assert given(position_feedforward(MAP), angles) == pytest.approx(MAP.beside(angles), abs=1e-12)
    table = position_feedforward(MAP, points=4096)
    assert given(table, angles) == pytest.approx(MAP.beside(angles), abs=2e-4)
    at = TURN * np.arange(4096) / 4096.0
    assert given(table, at + 1e-12) == pytest.approx(MAP.beside(at), abs=1e-9)
    half = position_feedforward(MAP, gain=0.5)
    assert given(half, angles) == pytest.approx(0.5 * MAP.beside(angles), abs=1e-12)


def test_turns_that_were_split_off_count_in_parts_only():
    block, angles = position_feedforward(MAP), np.linspace(0.0, 0.01, 20)
    parts = given(block, angles, turns=1000.0 + 3.0 / 1024.0)
    assert parts == pytest.approx(MAP.beside(angles + TURN * 3.0 / 1024.0), abs=1e-9)


def test_the_lead_looks_ahead_of_either_angle():
    angles = np.linspace(0.0, 1.0, 50)
    ahead = given(
        position_feedforward(MAP, lead=1e-3), angles, velocity=5.0, error=0.1, reference_velocity=9.0
    )
    assert ahead == pytest.approx(MAP.beside(angles + 5e-3), abs=1e-12)
    block = position_feedforward(MAP, lead=1e-3, angle="reference")
    wanted = given(block, angles, velocity=5.0, error=0.1, reference_velocity=9.0)
    assert wanted == pytest.approx(MAP.beside(angles + 0.1 + 9e-3), abs=1e-12)


def test_maps_that_do_not_suit_are_refused():
    for wrong, said in (
        (PositionMap(MAP.even, unit="A"), "torque constant"),
        (PositionMap(), "holds no order"),
        (PositionMap(MAP.even, lower=0.0, upper=3.0), "whole turn"),
        (PositionMap(Waves((0.5,), (1.0,), (0.0,))), "no whole number"),
    ):
        with pytest.raises(ParameterError, match=said):
            position_feedforward(wrong)


def cogging_of(plant):
    """What the drive must give against a machine's cogging."""
    waves = plant.cogging
    cosine = tuple(-a * np.cos(p) for a, p in zip(waves.amplitude, waves.phase, strict=True))
    sine = tuple(a * np.sin(p) for a, p in zip(waves.amplitude, waves.phase, strict=True))
    return PositionMap(Waves(waves.order, cosine, sine), unit="N·m", lower=0.0, upper=TURN)


@pytest.mark.slow
@pytest.mark.parametrize("angle", ["measured", "reference"])
def test_a_machines_motion_is_smoother_by_four(angle):
    plant = machine(MOTOR)
    friction = ss.ControlBlock("friction_feedforward", plant.friction)
    gains = ss.place("PD", inertia=plant.inertia, bandwidth=12.0, damping=1.0)
    loop = ss.ControlBlock("pd", kp=gains.kp, kd=gains.kd)
    found = []
    for more in ([], [position_feedforward(cogging_of(plant), angle=angle, lead=1.0e-3)]):
        drive = ss.Controller(loop=loop, sample_time=1e-3, feedforward=[friction, *more], torque_limit=2.0)
        record = ss.simulate(plant, drive, ss.Reference("ramp", velocity=1.0), duration=4.0)
        late = record.time > 1.0
        error = record["position_reference"] - record["position"]
        found.append((float(np.std(record["velocity"][late])), float(np.std(error[late]))))
    assert found[0][0] > 4.0 * found[1][0]
    assert found[0][1] > 4.0 * found[1][1]
