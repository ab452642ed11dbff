"""A recommendation on the machine at hand: its resonances, delay, amplifier, encoder and noise are in it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_recommend_axes import INERTIA, PD, identified
from test_recommend_composed import MODEL

import stickslip as ss
from stickslip.cli import main
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError
from stickslip.machines.contact import Contact, Drift
from stickslip.machines.encoder import Encoder
from stickslip.machines.files import machine
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier
from stickslip.models.model import Model
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.candidate_run import rings, run
from stickslip.recommendation.candidates import Setting
from stickslip.recommendation.following import simulated
from stickslip.recommendation.plant import Plant, WholeMachine
from stickslip.recommendation.recommend import Drive, recommend, recommend_on

LUGRE = Model("lugre", sigma0=3.5e4, sigma1=3.0, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
DRY = machine("thesis-dry")
COUNTS = DRY.encoder.counts
OWN = Path(__file__).parents[1] / "support" / "sliding_mode.py"


def test_a_machine_without_imperfections_is_the_rigid_axis_bit_for_bit():
    drive = Drive(20.0, amplitude=0.1, encoder_counts=65536.0)
    known = Machine(
        "plain", 2.0 * INERTIA, Contact(LUGRE), amplifier=Amplifier(1.0, bandwidth=800.0), delay=0.4,
        encoder=Encoder(65536.0),
    )  # fmt: skip
    beside = {"offset": 0.02, "waves": ((3.0, 0.01, 0.5),)}
    rigid = Plant(INERTIA, LUGRE, **beside, delay=0.4, bandwidth=800.0)
    other = Plant(INERTIA, LUGRE, **beside, machine=known)
    one, two = (simulated(p, drive.loop(INERTIA), drive.reference, 1e-3) for p in (rigid, other))
    assert np.ptp(one) > 0.1
    assert np.array_equal(one, two)


def test_its_resonances_are_in_it():
    """A PD of 36 Hz holds the rigid axis, and rings on the elastic drivetrain."""
    gains = ss.place("PD", DRY.inertia, 36.0, 1.0)
    drive = Drive(gains=gains, amplitude=0.2, encoder_counts=COUNTS)
    found = {}
    for name, plant in (
        ("rigid", Plant(DRY.inertia, DRY.contact.friction)),
        ("machine", Plant(DRY.inertia, DRY.contact.friction, machine=DRY)),
    ):
        linear = drive.loop(DRY.inertia)
        found[name] = rings(plant, linear, drive, run(plant, linear, drive))
    assert found == {"rigid": "", "machine": "at rest"}


def test_a_train_keeps_its_springs_and_gets_the_drawn_inertia_and_friction():
    own = Plant(1.5 * DRY.inertia, LUGRE, machine=DRY).built(1e-3, COUNTS)
    assert own.inertia == pytest.approx(own.flexible.inertia, rel=1e-12)
    assert own.inertia == pytest.approx(1.5 * DRY.inertia)
    assert (own.flexible.coupling, own.flexible.elasticity) == (
        DRY.flexible.coupling,
        DRY.flexible.elasticity,
    )
    assert own.clutch.parameters == LUGRE.parameters  # neither bearings nor direction a second time
    assert (own.delay, own.cogging, own.encoder.noise) == (DRY.delay, DRY.cogging, DRY.encoder.noise)


def test_drawn_axes_stand_at_other_angles_of_the_machine():
    found = replace(identified(), misfit={"sliding_rms_Nm": 0.01})
    drawn = list(plants_of(found, INERTIA, 4, 1, machine=DRY))
    assert drawn[0].machine is DRY
    assert len({p.machine.start_angle for p in drawn}) == len({p.machine.seed for p in drawn}) == 5
    assert all(p.waves == () for p in drawn)  # its cogging is known
    assert all(p.delay == 0.0 and math.isinf(p.bandwidth) for p in drawn)
    smooth = replace(DRY, cogging=type(DRY.cogging)(), contact=Contact(LUGRE))
    assert any(p.waves for p in plants_of(found, INERTIA, 4, 1, machine=smooth))


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(recommending, "GAINS", (0.8,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def test_the_recommendation_says_on_which_machine(few):
    soft = DRY.without("flexibility", "encoder-mode")
    drive = Drive(gains=PD, amplitude=0.2, encoder_counts=COUNTS, torque_limit=2.0, machine=soft)
    found = recommend(identified(), drive, axes=1, confirm=2)
    assert found.chosen is not None
    assert any("on the machine thesis-dry, with its resonances" in note for note in found.notes)
    assert found.drive.as_dict()["machine"] == "thesis-dry"
    plain = recommend(identified(), replace(drive, machine=None), axes=1, confirm=2)
    assert any("Simulated with a rigid axis" in note for note in plain.notes)
    assert found.linear_error != plain.linear_error


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"sample_time": 2e-3, "encoder_counts": COUNTS},
            r"sample_time = 0\.002, that of the machine thesis-dry",
        ),
        ({"encoder_counts": 4096.0}, r"encoder_counts = 4096, that of the machine thesis-dry is 1e\+06"),
    ],
)
def test_a_drive_that_is_not_the_machines_is_refused(given, words):
    with pytest.raises(ParameterError, match=words):
        Drive(amplitude=0.2, machine=DRY, **given)


def test_the_command_takes_sample_time_and_counts_from_the_machine(tmp_path, monkeypatch, capsys, few):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(MODEL)
    line = ["recommend", "model.toml", "--machine", "thesis-dry", "--bandwidth", "10", "--amplitude", "0.2"]
    line += ["--axes", "1", "--confirm", "0"]
    assert main([*line, "--json"]) == 0
    drive = json.loads(capsys.readouterr().out)["drive"]
    assert (drive["machine"], drive["encoder_counts"], drive["sample_time"]) == ("thesis-dry", COUNTS, 1e-3)
    assert drive["torque_limit"] == DRY.limits["torque"]
    assert main([*line, "--sample-time", "0.002"]) == 2
    assert "that of the machine thesis-dry is 0.001" in capsys.readouterr().err
    assert main(["recommend", "model.toml", "--machine", "thesis-wet", "--amplitude", "0.2"]) == 2
    assert "thesis-wet" in capsys.readouterr().err


def test_a_loop_feeds_the_inertia_where_its_torque_answers_to_the_acceleration():
    pd = ControlBlock("pd", kp=PD.kp, kd=PD.kd)
    for more, feeds in (
        ({}, False),
        ({"feedforward": ControlBlock("inertia_feedforward", inertia=2e-4)}, True),
        ({"feedforward": ControlBlock("inertia_feedforward", inertia=0.0, offset=0.1)}, False),
        ({"observer": ControlBlock("disturbance_observer", inertia=INERTIA, corner=400.0)}, False),
    ):
        assert Controller(loop=pd, sample_time=1e-3, **more).answers_to_acceleration is feeds
    own = ControlBlock(
        str(OWN), inertia=INERTIA, slope=62.8, torque=0.45, layer=0.5
    )  # a loop that feeds it itself
    assert Controller(loop=own, sample_time=1e-3).answers_to_acceleration is True


def measured(level: float) -> WholeMachine:
    """`DRY` with so many times its friction."""
    contact = replace(DRY.contact, drift=Drift(level - 1.0, 1e-3) if level != 1.0 else Drift())
    return WholeMachine.of(replace(DRY.without("encoder-mode"), contact=contact))


def test_a_machine_that_was_measured_is_run_as_it_is():
    """Its law's springs are what the encoder sees, and bearings and direction are its own."""
    plant = measured(1.0)
    assert plant.built(1e-3, COUNTS) is plant.machine
    assert plant.built(1e-3, COUNTS).spring_factor > 1.0


def test_what_is_safe_on_every_measured_machine_is_chosen():
    """Full gain leaves the least error on the friction found, and pushes where there is a seventh less."""
    drive = Drive(8.0, amplitude=0.01, frequency=0.4, encoder_counts=COUNTS, torque_limit=2.0, machine=DRY)
    laws = {"gms": DRY.clutch}
    sure = recommend_on([measured(1.0)], drive, laws, DRY.inertia, (0.9, 1.0))
    unsure = recommend_on([measured(x) for x in (1.0, 0.85)], drive, laws, DRY.inertia, (0.9, 1.0))
    assert sure.chosen.setting.gain == 1.0
    assert (sure.margin, sure.unsafe_gain) == (pytest.approx(1.1), 1.25)
    assert unsure.chosen.setting.gain == 0.9
    assert unsure.unsafe_gain == 1.0
    assert sure.linear_error == unsure.linear_error
    assert (sure.axes, unsure.axes) == (1, 2)


def test_gains_up_to_the_first_that_is_not_safe_are_the_margin():
    one = Setting("gms", "feedforward", 0.8)
    others = [replace(one, gain=g) for g in (0.9, 1.0, 1.25)]
    assert recommending.margin_of(one, [others[2]], others[:2]) == (1.25, 1.25)
    assert recommending.margin_of(one, [others[1]], others) == (pytest.approx(1.125), 1.0)
    assert recommending.margin_of(one, [replace(others[1], law="coulomb")], []) == (1.0, math.inf)
