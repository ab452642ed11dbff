"""LuGre near rest against tight-tolerance solutions of SciPy: a dragged mass, and a load that is held."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

TIMES = np.linspace(0.0, 20.0, 2001)
CANUDAS = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "fc": 1.0, "fs": 1.5, "vs": 1e-3}
HELD = {"sigma0": 1e5, "sigma1": 10.0, "sigma2": 0.4, "fc": 1.0, "fs": 1.5, "vs": 1e-3}


def tight(p, mass, drive, times):
    """Position over time of a mass under ``drive(t, x)`` and LuGre friction, by SciPy's Radau."""

    def slopes(t, y):
        x, v, z = y
        s = p["fc"] + (p["fs"] - p["fc"]) * math.exp(-((v / p["vs"]) ** 2))
        dz = v - p["sigma0"] * abs(v) / s * z
        friction = p["sigma0"] * z + p["sigma1"] * dz + p["sigma2"] * v
        return [v, (drive(t, x) - friction) / mass, dz]

    solution = solve_ivp(
        slopes,
        (0.0, times[-1]),
        [0.0, 0.0, 0.0],
        method="Radau",
        rtol=1e-11,
        atol=1e-14,
        t_eval=times,
        first_step=1e-7,
    )
    assert solution.success
    return solution.y[0]


@functools.cache
def dragged():
    """1 kg behind a spring of 2 N/m whose other end moves at 0.1 m/s (Canudas de Wit et al. 1995)."""
    return tight(CANUDAS, 1.0, lambda t, x: 2.0 * (0.1 * t - x), TIMES)


@functools.cache
def held():
    """0.01 kg·m² under half the Coulomb torque, applied at once."""
    return tight(HELD, 0.01, lambda t, x: 0.5, np.array([0.0, 1.0, 2.0]))


@pytest.mark.parametrize(
    ("integrator", "step", "room"), [("adaptive", 1.0, 1e-6), ("fixed", 1e-3, 3e-3), ("fixed", 1e-4, 1e-5)]
)
def test_stick_slip_of_a_dragged_mass(integrator, step, room):
    """The spring is a controller with kp = 2 on a ramp."""
    run = simulate(
        RigidAxis(1.0, Model("lugre", **CANUDAS)),
        Controller(Gains(kp=2.0)),
        Reference("ramp", velocity=0.1),
        20.0,
        integrator=integrator,
        time_step=step,
        output=TIMES,
        metered=False,
    )
    position = np.interp(TIMES, run.time, run["position"])
    assert np.abs(position - dragged()).max() < room
    # It sticks and slips: a third of the time and more at rest, and at times far faster than it is dragged.
    assert np.mean(np.abs(run["velocity"]) < 1e-3) > 0.3
    assert run["velocity"].max() > 0.2


@pytest.mark.parametrize(("integrator", "room"), [("adaptive", 1e-4), ("fixed", 0.05)])
def test_a_load_at_half_of_coulomb_is_held_with_the_true_drift(integrator, room):
    """At 1 ms the ringing of the contact (500 Hz) is far from resolved, yet the bristles remember it."""
    compliance = 1e-6  # the load is a spring too soft to notice the motion
    run = simulate(
        RigidAxis(0.01, Model("lugre", **HELD)),
        Controller(Gains(kp=compliance)),
        Reference.table([0.0, 2.0], [0.5 / compliance] * 2, [0.0, 0.0]),
        2.0,
        integrator=integrator,
        time_step=1e-3,
        output=[0.0, 1.0, 2.0],
        metered=False,
    )
    position = np.array([run["position"][run.time == t][0] for t in (1.0, 2.0)])
    elastic = 0.5 / HELD["sigma0"]
    drift, truth = position - elastic, held()[1:] - elastic
    assert truth[0] > elastic
    np.testing.assert_allclose(drift, truth, rtol=room)
    assert abs(position[1] - position[0]) < 1e-3 * drift[0]
