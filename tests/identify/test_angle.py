"""What depends on the angle, found from sliding runs on virtual machines whose ripple and cogging are known."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.identification.steady_friction.position_dependence import identify_angle
from stickslip.machines.angle import AngleMap
from stickslip.machines.files import machine
from stickslip.machines.motor import Harmonics
from stickslip.models.model import Model
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.sliding import Sliding
from stickslip.rigs.virtual import VirtualRig

GREASE = machine("thesis-grease")
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 200)


def slid(plant, velocities=(1.0, 0.6)):
    return perform(Sliding(velocities=velocities), VirtualRig(plant)).record


def test_ripple_cogging_and_the_difference_of_directions_come_apart():
    found = identify_angle(slid(GREASE))
    angle = found.details["angle"]
    ripple, cogging = GREASE.contact.ripple, GREASE.cogging
    assert angle.ripple.order == ripple.order
    assert angle.beside.order == cogging.order
    # The bearings' part of friction does not ripple: some 8 % of it.
    assert angle.ripple.amplitude == pytest.approx(ripple.amplitude, rel=0.12)
    true = -np.array([cogging.at(x) for x in CIRCLE])
    assert angle.torque(CIRCLE) - angle.offset == pytest.approx(true, abs=6e-4)
    assert 0.002 < angle.offset < 0.006  # friction of 0.26 N·m, 1.5 % more one way and less the other
    assert found.misfit["rms_Nm"] < 0.004


def test_no_harmonics_are_made_up():
    plain = identify_angle(slid(GREASE.without("position", "cogging", "direction")))
    angle = plain.details["angle"]
    assert angle.ripple.order == ()
    assert angle.beside.order == ()
    assert abs(angle.offset) < 3e-4


def test_a_law_gets_the_ripple_and_a_file_keeps_it():
    angle = AngleMap(
        Harmonics((1.0, 3.0), (0.2, 0.1), (0.3, -1.0)), Harmonics((12.0,), (0.01,), (0.5,)), 0.002
    )
    law = angle.on(Model("coulomb", fc=0.3))
    assert law.parameters.ripple == (0.2, 0.1)
    assert law.law.chosen["position_dependence"] == "spectrum"
    assert AngleMap.of(angle.as_dict()) == angle
    assert angle.torque(CIRCLE).max() <= angle.largest
    with pytest.raises(InputError, match="angle"):
        AngleMap.of({"ripple": [0.1]})


def test_runs_in_one_direction_are_refused():
    record = slid(GREASE, (2.0,))
    forth = record["velocity_reference"] > 0.0
    one = type(record)(
        record.time[forth], {k: v[forth] for k, v in record.channels.items()}, record.units, record.meta
    )
    with pytest.raises(InputError, match="both directions"):
        identify_angle(one)
