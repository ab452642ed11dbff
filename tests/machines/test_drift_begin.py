"""A drift of friction that begins later: until then as without, from then on towards its level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ParameterError
from stickslip.machines.contact import Drift
from stickslip.machines.files import machine


def test_friction_drops_when_its_drift_begins():
    ideal = machine("ideal")
    later, drop = (
        replace(ideal, contact=replace(ideal.contact, drift=Drift(-0.3, 1e-3, begin))) for begin in (0.9, 0.4)
    )
    loop = ss.ControlBlock("pd", kp=20.0, kd=0.2)
    control = ss.Controller(loop=loop, sample_time=1e-3, torque_limit=1.0)
    runs = [
        ss.simulate(one, control, ss.Reference("ramp", velocity=2.0), 0.8, metered=False)
        for one in (later, drop)
    ]
    torque = [r.channels["friction_torque"] for r in runs]
    before, after = runs[0].time < 0.4, runs[0].time > 0.5
    assert np.array_equal(torque[0][before], torque[1][before])
    assert torque[1][after] == pytest.approx(0.7 * torque[0][after], rel=0.01)


def test_a_drift_begins_at_a_time():
    with pytest.raises(ParameterError, match="drift: begin = -1 s must be a finite number of at least 0"):
        Drift(-0.3, 1.0, -1.0)
