"""The loop's response, its modes and the PD it bears, on virtual machines whose modes are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stickslip.analyse.tracking import tracking_metrics
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError
from stickslip.identification.response.drivetrain import fit_drivetrain, identified_drivetrain, loop_response
from stickslip.identification.response.nyquist import fastest_pd
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.files import machine
from stickslip.machines.machine import Machine
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.models.model import Model
from stickslip.rigs.loop import Loop
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.resonance import Resonance
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig

DRY = machine("thesis-dry")


def responses(plant, **options):
    done = perform(
        Resonance(inertia=plant.inertia, stuck=0.01, duration=12.0, **options), VirtualRig(plant)
    ).insist()
    return [loop_response(done.part(label), label) for label in ("sliding", "sticking")]


@pytest.fixture(scope="module")
def dry():
    return responses(DRY)


def test_modes_spring_and_masses_are_those_of_the_machine(dry):
    drivetrain, flexible = fit_drivetrain(*dry, DRY.inertia), DRY.flexible
    assert drivetrain.sliding == pytest.approx(flexible.modes[1], rel=0.02)
    assert drivetrain.axis.stiffness == pytest.approx(flexible.elasticity, rel=0.03)
    assert drivetrain.axis.load == pytest.approx(flexible.disk, rel=0.03)
    assert drivetrain.axis.inertia == pytest.approx(DRY.inertia)
    found = identified_drivetrain(dry, drivetrain, fastest_pd(dry, DRY.inertia).sentence)
    assert found["mode_sticking"].value < found["mode_sliding"].value
    assert found["spring"].lower < flexible.elasticity < found["spring"].upper


@pytest.mark.parametrize("late", [0.0, 0.5, 2.0, 3.4])
@pytest.mark.parametrize("flexible", [True, False])
def test_the_delay_is_found_whole_samples_of_it_too(late, flexible):
    """A phase tells parts of a turn alone: with two samples the search ended at -0.7."""
    friction = Model("lugre", sigma0=8e3, sigma1=0.1, sigma2=0.01, fs=0.4, fc=0.3, vs=0.02)
    train = TwoMassAxis(5e-4, 3e-4, 900.0, 0.03) if flexible else None
    plant = Machine(
        "belt", 8e-4, Contact(friction), flexible=train, delay=late, limits={"torque": 3.0},
        encoder=Encoder(65536.0 if flexible else 0.0),
    )  # fmt: skip
    drivetrain = fit_drivetrain(*responses(plant), plant.inertia)
    assert drivetrain.delay == pytest.approx(late, abs=0.15)
    if train and drivetrain.axis:
        assert drivetrain.axis.stiffness == pytest.approx(train.stiffness, rel=0.1)
        assert drivetrain.axis.load == pytest.approx(train.load, rel=0.1)
    assert bool(drivetrain.axis) == flexible


def standing(plant, bandwidth):
    """Motion above 5 Hz under a PD that holds a position, at the end, rad RMS."""
    wanted = setpoints(2000, position=0.02, closed=1.0)
    with Loop(VirtualRig(plant)) as loop:
        loop.run(wanted, Controller(place("PD", plant.inertia, bandwidth, 1.0), None, 1.0, 1e-3))
        record = loop.record()
    return tracking_metrics(record)["late_oscillation_rad"]


def test_a_pd_is_calm_below_the_bandwidth_that_rings_and_rings_above(dry):
    fastest = fastest_pd(dry[1:], DRY.inertia)
    assert fastest.name == "sticking"
    at, frequency = fastest.bandwidth, fastest.frequency
    assert standing(DRY, 0.85 * at) < 3e-5
    assert standing(DRY, 1.3 * at) > 1e-4
    assert 200.0 < frequency < 260.0


def test_a_rigid_axis_has_no_mode_while_it_slides():
    rigid = replace(DRY.without("flexibility", "encoder-mode", "bandwidth"), delay=0.5)
    found = fit_drivetrain(*responses(rigid), rigid.inertia)
    assert found.axis is None
    assert found.delay == pytest.approx(0.5, abs=0.1)


def test_a_record_without_excitation_is_refused(dry):
    rig = VirtualRig(DRY)
    with Loop(rig) as loop:
        loop.run(setpoints(5000, torque=1e-6 * np.sin(np.arange(5000.0))))
        record = loop.record()
    with pytest.raises(InputError, match="does not answer"):
        loop_response(record, "quiet")
