"""Elasto-plastic friction: no drift below break-away, where LuGre drifts, and what else sets it apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

U = Surroundings()
CONTACT = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
LUGRE = Model("lugre", **CONTACT)


def elasto_plastic(z_ba: float, **changed: float) -> Model:
    return Model("elasto_plastic", **{**CONTACT, **changed}, z_ba=z_ba)


def creep(model: Model) -> float:
    """Displacement a period of an axis under 0.15 + 0.10 sin N·m at 1 Hz, below break-away, rad."""
    w = 2.0 * math.pi
    # A controller without gain but on the reference's velocity passes a torque on.
    torque = Reference("harmonic", amplitude=0.10 / w, frequency=1.0, phase=-0.5 * math.pi, velocity=0.15)
    run = simulate(
        RigidAxis(3.8623e-4, model),
        Controller(Gains(kp=0.0, kr=1.0)),
        torque,
        10.0,
        integrator="adaptive",
        output=0.01,
    )
    fifth, tenth = np.interp([5.0, 10.0], run.time, run["position"])
    return float(tenth - fifth) / 5.0


def test_no_drift_under_a_load_below_break_away_where_lugre_drifts():
    """Dupont et al. 2002. The load stays below sigma0 z_ba = 0.2625 N·m; with less z_ba a little drift is left."""
    lugre, elastic, partly = creep(LUGRE), creep(elasto_plastic(7.5e-6)), creep(elasto_plastic(6e-6))
    assert lugre > 1e-6
    assert abs(elastic) < 1e-6 * lugre
    assert abs(elastic) < partly < 0.1 * lugre


def pulled(model: Model, path: list[float], parts: int = 400) -> tuple[float, float]:
    """Torque at the end of slow straight moves along `path` (rad), and their work, J."""
    law, p = model.law, model.parameters
    z, here, work, last = law.state(p), 0.0, 0.0, 0.0
    for there in path:
        v = math.copysign(1e-6, there - here)
        for _ in range(parts):
            torque = law.step(v, v, abs(there - here) / 1e-6 / parts, z, p, U)
            work += 0.5 * (last + torque) * (there - here) / parts
            last = torque
        here = there
    return last, work


def test_a_loop_below_break_away_is_elastic_and_a_larger_one_costs_energy():
    """sigma1 = sigma2 = 0, so that the bristle alone is left."""
    model = elasto_plastic(6e-6, sigma1=0.0, sigma2=0.0)
    torque, _ = pulled(model, [5e-6])
    assert torque == pytest.approx(3.5e4 * 5e-6, rel=1e-12)
    torque, work = pulled(model, [5e-6, -5e-6, 0.0])
    assert torque == pytest.approx(0.0, abs=1e-12)
    assert work == pytest.approx(0.0, abs=1e-16)
    _, work = pulled(model, [9e-6, -9e-6, 9e-6, -9e-6, 0.0])
    assert work > 0.1 * 3.5e4 * 9e-6**2
    bristle = Model("lugre", **{**CONTACT, "sigma1": 0.0, "sigma2": 0.0})
    assert pulled(bristle, [5e-6, -5e-6, 0.0])[1] > 1e-8  # LuGre loses energy in the small loop too


@pytest.mark.parametrize("z_ba", [1e-7, 4e-6, 8e-6])
@pytest.mark.parametrize("v", [1e-4, -0.01, 1.0])
def test_slid_long_enough_it_carries_the_steady_curve_of_lugre(z_ba, v):
    model = elasto_plastic(z_ba)
    law, p = model.law, model.parameters
    z = law.state(p)
    torque = law.step(v, v, 1e-3 / abs(v), z, p, U)
    assert torque == pytest.approx(law.steady(v, p), rel=1e-9)
    assert torque == pytest.approx(LUGRE.law.steady(v, LUGRE.parameters), rel=1e-9)


@pytest.mark.parametrize("z_ba", [1e-6, 4e-6, 7.5e-6, 8.1e-6])
@pytest.mark.parametrize("displacement", [2e-6, 8.3e-6, 1e-5, 1.5e-5, 3e-5])
def test_one_step_at_constant_velocity_solves_the_equation(z_ba, displacement):
    """Against SciPy over the published equation, typed anew: alpha = sin(pi (z - middle) / (z_ss - z_ba)) / 2 + 1/2."""
    v, limit = 1.0, 0.285 / 3.5e4  # far beyond the Stribeck velocity: z_ss = F_C / sigma0

    def equation(x, z):
        alpha = 0.0
        if z[0] > z_ba:
            alpha = 0.5 * math.sin(math.pi * (z[0] - 0.5 * (limit + z_ba)) / (limit - z_ba)) + 0.5
        return [1.0 - alpha * z[0] / limit]

    solution = solve_ivp(
        equation, (0.0, displacement), [0.0], method="LSODA", rtol=1e-11, atol=1e-18, max_step=2e-8
    )
    model = elasto_plastic(z_ba)
    law, p = model.law, model.parameters
    z = law.state(p)
    law.step(v, v, displacement / v, z, p, U)
    assert z.z == pytest.approx(solution.y[0, -1], rel=1e-6)


def test_a_break_away_beyond_the_sliding_torque_is_refused():
    with pytest.raises(ParameterError, match=r"z_ba = 9e-06 rad must lie below .* 8\.143e-06 rad"):
        elasto_plastic(9e-6)
