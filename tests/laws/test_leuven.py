"""Leuven: what it comes down to, and the same run by both integrators."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import ParameterError
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}


@pytest.mark.parametrize("method", ["rate", "step"])
def test_one_strong_element_and_shape_one_are_lugre(method):
    """With F_h = sigma0 z and delta_i = 1 eqs. 2.12 and 2.13 are eqs. 2.8 and 2.9."""
    times = np.linspace(0.0, 2.0, 41)
    motion = Reference("harmonic", amplitude=2e-3, frequency=1.0)
    leuven = Model("leuven", k=[3.5e4], w=[1.0], sigma1=0.1, **CURVE)
    lugre = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
    one, other = (respond(m, motion, times, method=method)["friction_torque"] for m in (leuven, lugre))
    np.testing.assert_allclose(one, other, atol=1e-8)


def test_elements_that_cannot_carry_the_static_torque_are_refused():
    with pytest.raises(ParameterError, match="w adds up to"):
        Model("leuven", k=[1e4, 1e4], w=[0.1, 0.1], **CURVE)


@pytest.mark.parametrize("delta_i", [1.0, 2.0])
def test_adaptive_and_fixed_integrators_agree(delta_i):
    model = Model("leuven", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, delta_i=delta_i, sigma1=0.1, **CURVE)
    controller = Controller(place("PD", 3.8623e-4, 10.0, 0.85))
    grid = np.linspace(0.0, 0.5, 51)
    paths = []
    for name in ("adaptive", "fixed"):
        run = simulate(
            RigidAxis(3.8623e-4, model),
            controller,
            Reference("sine", amplitude=0.3, frequency=2.0),
            0.5,
            integrator=name,
            output=grid,
            time_step=5e-5,
            metered=False,
        )
        paths.append(np.interp(grid, run.time, run["position"]))
    assert np.ptp(paths[0]) > 0.2
    assert np.abs(paths[0] - paths[1]).max() < 5e-6


def test_weaker_elements_for_the_other_direction_make_no_jump():
    """An element that comes back above its new limit keeps its torque; steps and rates agree on it."""
    weak = {"w_negative": [0.06] * 4, "fs_negative": 0.24, "fc_negative": 0.2}
    model = Model(
        "leuven",
        {"symmetry": "asymmetric"},
        k=[1e4, 7e3, 5e3, 3e3],
        w=[0.08375] * 4,
        sigma1=0.1,
        **CURVE,
        **weak,
    )
    motion = Reference("harmonic", amplitude=2e-3, frequency=0.5)
    times = np.linspace(0.0, 4.0, 8001)
    by_rate, by_step = (respond(model, motion, times, method=m) for m in ("rate", "step"))
    rates = by_rate["friction_torque"]
    np.testing.assert_allclose(rates, by_step["friction_torque"], atol=1e-6)
    # The bristle moves by at most 1 + 0.335 / 0.2 of the travel; damping gives less than a millinewton metre.
    assert np.all(np.abs(np.diff(rates)) < 2.7 * 25e3 * np.abs(np.diff(by_rate["position"])) + 1e-3)
    assert rates[-1] > 0.285
    fastest = rates[5000:7000].min()
    assert -0.2402 < fastest < -0.2
