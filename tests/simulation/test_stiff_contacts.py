"""Contacts that are stiff for their inertia: the step does not shrink without end."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

WELL_DAMPED = {"sigma0": 5e3, "fs": 0.9, "fc": 0.62, "vs": 0.06, "delta_s": 1.6, "sigma2": 0.035}
DAHL = [
    (
        0.010268077,
        221.5389,
        3.0164741,
        0.03593289,
        0.552,
        {"sigma0": 3441738.2, "fc": 6.2566473, "sigma2": 0.114},
    ),
    (
        0.44752284,
        1759.4008,
        56.120302,
        0.03266116,
        1.396,
        {"sigma0": 242.08185, "fc": 0.026644426, "sigma2": 4.9e-5},
    ),
]
"""Inertia, stiffness and damping of a PD, amplitude and frequency, and a brittle contact."""


@pytest.mark.parametrize("sigma1", [0.05, 1.5, 15.0])
def test_a_bristle_with_damping_is_followed_through_a_reversal(sigma1):
    """Its spring nearly cancels the loop's there: made stiffer for the digits' sake, it brought damping along that no
    step was short enough for."""
    axis = ss.RigidAxis(1.7e-3, ss.Model("lugre", sigma1=sigma1, **WELL_DAMPED))
    loop = (
        axis,
        ss.Controller(ss.Gains(60.0, 0.0, 0.65, 0.65)),
        ss.Reference("sine", amplitude=0.15, frequency=1.7),
    )
    ran = ss.simulate(*loop, 0.6)
    assert ran.meta["integrator"] == "exact"
    assert ran.meta["counts"]["steps"] < 40_000
    other = ss.simulate(*loop, 0.6, integrator="adaptive", output=ran.time)
    assert np.max(np.abs(ran["position"] - np.interp(ran.time, other.time, other["position"]))) < 3e-8


@pytest.mark.parametrize(("inertia", "kp", "kd", "amplitude", "frequency", "contact"), DAHL)
def test_a_brittle_contact_reaches_its_level(inertia, kp, kd, amplitude, frequency, contact):
    """Dahl's curve meets it as a tangent, with a slope without bound: 1e6 steps went by beside it."""
    axis = ss.RigidAxis(inertia, ss.Model("dahl", delta_d=0.5, **contact))
    loop = (
        axis,
        ss.Controller(ss.Gains(kp, 0.0, kd, kd)),
        ss.Reference("sine", amplitude=amplitude, frequency=frequency),
    )
    ran = ss.simulate(*loop, 0.5)
    assert ran.meta["integrator"] == "adaptive"
    assert ran.meta["counts"]["steps"] < 40_000
    fixed = ss.simulate(*loop, 0.5, integrator="fixed", time_step=1e-5)
    error = ran.meta["metrics"]["position_rms_rad"] / fixed.meta["metrics"]["position_rms_rad"] - 1.0
    assert abs(error) < 1e-5
