"""Dependence on position, load, temperature and time, for any law, in the integrators that can carry it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.spec import Surroundings
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

LAWS = [plugins.law(name) for name in ("coulomb", "stribeck_plain", "lugre", "gms")]
some_laws = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
J = 3.8623e-4
RIPPLE = {"ripple": [0.2], "order": [1.0], "ripple_phase": [0.5]}
MOTION = Reference("harmonic", amplitude=0.3, frequency=0.5)
TIMES = np.linspace(0.0, 2.0, 41)


def with_choice(law, values, **choices):
    return Model(law, choices, **{**law.example, **values})


@some_laws
def test_laws_follow_position_load_temperature_and_time(law):
    around = Surroundings(load=1.5, temperature=35.0)
    plain = respond(Model(law, **law.example), MOTION, TIMES)
    modulated = with_choice(
        law, {**RIPPLE, "load_exponent": 2.0, "temperature_coefficient": -0.02, "drift": 0.3, "drift_time": 2.0},
        position_dependence="spectrum", load_dependence="load_power", temperature_dependence="exponential",
        time_dependence="settling",
    )  # fmt: skip
    torque = respond(modulated, MOTION, TIMES, surroundings=around)["friction_torque"]
    factor = (
        (1.0 + 0.2 * np.cos(plain["position"] + 0.5)) * 1.5**2 * math.exp(-0.02 * 15.0)
        * (1.0 + 0.3 * (1.0 - np.exp(-TIMES / 2.0)))
    )  # fmt: skip
    np.testing.assert_allclose(torque, factor * plain["friction_torque"], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("law", ["coulomb", "lugre"])
def test_adaptive_and_fixed_carry_a_ripple_and_exact_refuses_it(law):
    found = plugins.law(law)
    model = with_choice(found, RIPPLE, position_dependence="spectrum")
    axis, loop = RigidAxis(J, model), Controller(place("PD", J, 10.0, 0.85))
    move = Reference("sine", amplitude=2.0, frequency=0.25)
    runs = [simulate(axis, loop, move, 2.0, integrator=name, tolerance=1e-8) for name in ("auto", "fixed")]
    errors = [run.meta["metrics"]["position_rms_rad"] for run in runs]
    assert runs[0].meta["integrator"] == "adaptive"
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
    plain = simulate(RigidAxis(J, Model(found, **found.example)), loop, move, 2.0, tolerance=1e-8)
    assert abs(errors[0] / plain.meta["metrics"]["position_rms_rad"] - 1.0) > 0.01
    with pytest.raises(InputError, match=r"depends on its surroundings .*position_dependence = spectrum"):
        simulate(axis, loop, move, 2.0, integrator="exact")


def test_the_axis_knows_its_load_and_temperature():
    model = with_choice(plugins.law("coulomb"), {"sigma2": 0.0}, load_dependence="load_power")
    loop = Controller(place("PD", J, 10.0, 0.85))
    move = Reference("ramp", velocity=0.5, end=2.0)
    for name in ("adaptive", "fixed"):
        record = simulate(RigidAxis(J, model, load=2.0), loop, move, 1.0, integrator=name)
        assert record["friction_torque"][-1] == pytest.approx(2.0 * 0.285, rel=1e-6)


def test_a_sampled_loop_carries_a_ripple():
    model = with_choice(plugins.law("coulomb"), {"sigma2": 0.0, **RIPPLE}, position_dependence="spectrum")
    loop = Controller(place("PD", J, 10.0, 0.85), sample_time=1e-3)
    move = Reference("ramp", velocity=2.0, end=4.0)
    runs = [
        simulate(RigidAxis(J, model), loop, move, 1.0, tolerance=tolerance)
        for tolerance in (1e-7, 1e-9, 1e-11)
    ]
    assert "depends on its surroundings" in runs[0].meta["general_step"]
    q, sliding = runs[2]["position"], (runs[2].time > 0.5) & (runs[2]["event"] == 0.0)
    assert np.all(runs[2]["velocity"][sliding] > 0.1)
    expected = 0.285 * (1.0 + 0.2 * np.cos(q + 0.5))
    np.testing.assert_allclose(runs[2]["friction_torque"][sliding], expected[sliding], rtol=1e-6)
    coarse, fine = (abs(run["position"][-1] - q[-1]) for run in runs[:2])
    assert fine < 0.3 * coarse
    assert fine < 1e-7


def test_a_ripple_that_would_turn_friction_round_is_refused():
    with pytest.raises(ParameterError, match=r"ripple adds up to 1\.2"):
        with_choice(
            plugins.law("coulomb"), {"ripple": [0.7, 0.5], "order": [1, 2], "ripple_phase": [0, 0]},
            position_dependence="spectrum",
        )  # fmt: skip
