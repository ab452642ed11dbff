"""Makkar's smooth curve: its levels, its slope at rest, and that it stays near the Stribeck curve that it smooths."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ParameterError

EXAMPLE = dict(ss.law("makkar").example)
MODEL = ss.Model("makkar", **EXAMPLE)


def torque(v, **more):
    model = ss.Model("makkar", **{**EXAMPLE, **more})
    return np.array([model.law.steady(float(x), model.parameters) for x in np.atleast_1d(v)])


def test_its_levels_are_the_coulomb_and_nearly_the_static_torque():
    assert torque(10.0) == pytest.approx(0.285 + 0.018 * 10.0, rel=1e-12)
    v = np.geomspace(1e-5, 1.0, 4000)
    peak = torque(v, sigma2=0.0).max()
    assert 0.92 * 0.335 < peak < 0.335
    assert 1e-3 < v[int(np.argmax(torque(v, sigma2=0.0)))] < 1e-2  # between 1 / gamma2 and 1 / gamma3


def test_it_is_smooth_at_rest():
    slope = 0.05 * (1000.0 - 100.0) + 0.285 * 1000.0 + 0.018
    assert torque(1e-7) / 1e-7 == pytest.approx(slope, rel=1e-6)
    assert torque(-0.003) == pytest.approx(-torque(0.003), abs=0.0)


def test_a_stribeck_effect_that_would_drive_is_refused():
    with pytest.raises(ParameterError, match="gamma2 = 50 s/rad must be at least gamma3 = 100"):
        ss.Model("makkar", **{**EXAMPLE, "gamma2": 50.0})


def test_an_axis_follows_as_with_the_law_that_it_smooths():
    pid = ss.ControlBlock("pid", kp=18.3, kd=0.1456, ki=766.4)
    drive = ss.Controller(loop=pid, sample_time=1e-3, torque_limit=1.0)
    fast = ss.Reference("sine", amplitude=0.5, frequency=0.5)
    errors = []
    for friction in (MODEL, ss.Model("coulomb", fc=0.285, sigma2=0.018)):
        record = ss.simulate(ss.RigidAxis(3.8623e-4, friction), drive, fast, 2.0)
        assert record.meta["energy"]["friction_loss"] > 0.0
        errors.append(record.meta["metrics"]["position_rms_rad"])
    assert errors[0] == pytest.approx(errors[1], rel=0.1)
