"""Dahl's curve for every shape factor: closed solutions, the finite reach of brittle contacts, all integrators."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.spec import Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

U = Surroundings()
SIGMA0, FC = 3.5e4, 0.285


def model(delta_d: float) -> Model:
    return Model("dahl", sigma0=SIGMA0, fc=FC, delta_d=delta_d)


@pytest.mark.parametrize("method", ["rate", "step"])
@pytest.mark.parametrize("delta_d", [0.0, 0.5, 1.0, 1.5, 2.0])
def test_stress_strain_curve(delta_d, method):
    """From the unloaded contact: F/F_C = sx, 2sx - s²x², 1 - exp(-sx), ... with s = sigma0 / F_C."""
    times = np.linspace(0.0, 1.9, 39)
    travel = 2e-5 * times * SIGMA0 / FC
    closed = {
        0.0: np.minimum(travel, 1.0),
        0.5: 1.0 - np.maximum(1.0 - 0.5 * travel, 0.0) ** 2,
        1.0: 1.0 - np.exp(-travel),
        1.5: 1.0 - (1.0 + 0.5 * travel) ** -2,
        2.0: 1.0 - 1.0 / (1.0 + travel),
    }
    ramp = Reference("ramp", velocity=2e-5, end=2.0)
    torque = respond(model(delta_d), ramp, times, method=method)["friction_torque"]
    np.testing.assert_allclose(torque, FC * closed[delta_d], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("delta_d", [0.0, 0.3, 0.7])
def test_a_brittle_contact_reaches_its_level_after_a_finite_distance(delta_d):
    m = model(delta_d)
    law, p = m.law, m.parameters
    reach = FC / SIGMA0 / (1.0 - delta_d)
    z = law.state(p)
    assert law.step(0.999 * reach, 0.999 * reach, 1.0, z, p, U) < FC
    assert law.step(0.002 * reach, 0.002 * reach, 1.0, z, p, U) == FC


@pytest.mark.parametrize("delta_d", [0.0, 0.5, 1.0, 3.0])
def test_one_step_is_many(delta_d):
    """The step is exact: a distance in one step is the same distance in a thousand."""
    m = model(delta_d)
    law, p = m.law, m.parameters
    one, many = law.state(p), law.state(p)
    for v in (3e-6, -7e-6, 2e-6):
        whole = law.step(v, v, 1.0, one, p, U)
        for _ in range(1000):
            parts = law.step(v, v, 1e-3, many, p, U)
        assert parts == pytest.approx(whole, abs=1e-11)


def test_larger_shape_factors_bend_more_sharply_from_the_first_slope_on():
    """Thesis, after eq. 2.7."""
    shapes = [model(d) for d in (0.5, 1.0, 1.5, 3.0)]
    torques = [m.law.step(1e-5, 1e-5, 1.0, m.law.state(m.parameters), m.parameters, U) for m in shapes]
    assert torques == sorted(torques, reverse=True)
    for m in shapes:
        z = m.law.state(m.parameters)
        assert m.law.step(1e-12, 1e-12, 1.0, z, m.parameters, U) == pytest.approx(SIGMA0 * 1e-12, rel=1e-6)


@pytest.mark.parametrize("delta_d", [0.5, 1.0, 2.0])
def test_adaptive_and_fixed_integrators_agree(delta_d):
    axis = RigidAxis(3.8623e-4, model(delta_d))
    controller = Controller(place("PD", 3.8623e-4, 10.0, 0.85))
    grid = np.linspace(0.0, 1.0, 101)
    paths = [
        simulate(
            axis,
            controller,
            Reference("sine", amplitude=0.3, frequency=1.0),
            1.0,
            integrator=name,
            output=grid,
            time_step=5e-5,
            metered=False,
        )
        for name in ("adaptive", "fixed")
    ]
    one, other = (np.interp(grid, r.time, r["position"]) for r in paths)
    assert np.ptp(one) > 0.2
    assert np.abs(one - other).max() < 2e-6  # of the fixed steps


def test_a_step_across_a_reversal_is_cut_there():
    """From v0 to -v0: out and back the same distance, on the two branches of the hysteresis."""
    m = model(1.0)
    z = m.law.state(m.parameters)
    torque = m.law.step(4e-5, -4e-5, 1.0, z, m.parameters, U)
    out = FC * (1.0 - math.exp(-SIGMA0 * 1e-5 / FC))
    assert torque == pytest.approx(-FC + (out + FC) * math.exp(-SIGMA0 * 1e-5 / FC), rel=1e-12)
