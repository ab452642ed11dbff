"""Laws under prescribed motion against an independent table and closed solutions."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from stickslip.core.errors import InputError, StepFailure, UnknownName
from stickslip.core.spec import Law, Par
from stickslip.models.model import Model, Reference
from stickslip.simulation.prescribed.open_loop import respond

TABLE = json.loads((Path(__file__).parents[1] / "data" / "open_loop.json").read_text())
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
GMS = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
COULOMB = Model("coulomb", fc=0.285, sigma2=0.018)
MODELS = {
    "gms4_nominal": GMS,
    "gms4_plus10": GMS.scaled(fs=1.1, fc=1.1),
    "gms4_minus10": GMS.scaled(fs=0.9, fc=0.9),
    "gms3_comp": Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE),
    "lugre": LUGRE,
    "coulomb": COULOMB,
    "stribeck": Model("stribeck", k=3.5e4, **CURVE),
    "leuven_1.0": Model("leuven", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, sigma1=0.1, **CURVE),
    "leuven_2.0": Model("leuven", k=[1e4, 7e3, 5e3, 3e3], w=[0.08375] * 4, sigma1=0.1, delta_i=2.0, **CURVE),
    "armstrong": Model(
        "armstrong", kt=2.5e4, fc=0.285, fs_inf=0.05, vs=0.01, tau=1e-3, gamma=0.1, sigma2=0.018
    ),
    "dahl_1.0": Model("dahl", sigma0=3.5e4, fc=0.285),
    "dahl_1.5": Model("dahl", sigma0=3.5e4, fc=0.285, delta_d=1.5),
}

BY_STEPS = ("leuven_1.0", "leuven_2.0", "armstrong")
"""Laws whose steps have no closed form: 1e-8 N·m, the table's own bound; all else 1e-9."""


def swing(peak, frequency, **more):
    """A harmonic motion with the given amplitude of the velocity, rad/s."""
    return Reference("harmonic", amplitude=peak / (2.0 * math.pi * frequency), frequency=frequency, **more)


MOTIONS = {
    "eq3.16": swing(0.0251, 0.4, phase=-0.5 * math.pi),
    "eq3.17": swing(0.3142, 0.1, phase=-0.5 * math.pi),
    "eq3.21": Reference("harmonic", amplitude=2.75e-5, frequency=0.2),
    "eq3.22": swing(0.011, 0.2, velocity=0.012),
}


BY_RATE_AND_STEP = [
    (name, method)
    for name in MODELS
    for method in ("rate", "step")
    if method == "step" or MODELS[name].law.rate
]


@pytest.mark.parametrize(("name", "method"), BY_RATE_AND_STEP)
@pytest.mark.parametrize("motion", MOTIONS)
def test_agrees_with_the_independent_table(motion, name, method):
    record = respond(MODELS[name], MOTIONS[motion], TABLE[motion]["t"], method=method)
    room = 1e-8 if method == "step" and name in BY_STEPS else 1e-9
    assert np.abs(record["friction_torque"] - TABLE[motion][name]).max() < room


@pytest.mark.parametrize("method", ["rate", "step"])
def test_lugre_at_constant_velocity_relaxes_exponentially(method):
    # sigma0 z = s (1 - exp(-sigma0 v t / s)); the velocity stops at once at the ramp's end.
    v, times = 2e-4, np.linspace(0.0, 0.2, 81)
    ramp = Reference("ramp", velocity=v, end=0.1)
    torque = respond(LUGRE, ramp, times, method=method)["friction_torque"]
    s = 0.285 + 0.05 * math.exp(-((v / 0.01) ** 2))
    moving = (times > 0.0) & (times < 0.1)
    decay = np.exp(-3.5e4 * v * times[moving] / s)
    expected = s * (1.0 - decay) + 0.1 * v * decay + 0.018 * v
    np.testing.assert_allclose(torque[moving], expected, rtol=0.0, atol=1e-10)
    bristle = s * (1.0 - math.exp(-3.5e4 * v * 0.1 / s))
    np.testing.assert_allclose(torque[times > 0.1], bristle, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("method", ["rate", "step"])
def test_elements_stick_as_springs_and_the_weaker_slip_first(method):
    # Element i breaks away at alpha_i s / k_i: 8.4, 12, 17 and 28 µrad.
    v = 1e-6
    times = np.linspace(0.0, 11.8, 60)
    torque = respond(GMS, Reference("ramp", velocity=v, end=20.0), times, method=method)["friction_torque"]
    position = v * times
    rigid = position < 0.25 * 0.335 / 1e4
    np.testing.assert_allclose(torque[rigid], 2.5e4 * position[rigid] + 0.018 * v, rtol=0.0, atol=1e-10)
    first_slips = position > 0.25 * 0.335 / 1e4
    expected = 0.25 * 0.335 + 1.5e4 * position[first_slips] + 0.018 * v
    np.testing.assert_allclose(torque[first_slips], expected, rtol=0.0, atol=1e-8)


def test_both_slip_rules_agree_where_the_motion_is_slow():
    times = np.linspace(0.0, 5.0, 200)
    signed, literal = (
        respond(GMS, MOTIONS["eq3.16"], times, slip_rule=rule)["friction_torque"]
        for rule in ("signed", "literal")
    )
    np.testing.assert_allclose(signed, literal, rtol=0.0, atol=1e-9)


def test_rate_and_step_agree_on_motion_that_stops_and_reverses():
    motion = Reference.table([0.0, 0.1, 0.2, 0.3, 0.4], [0.0, 1e-3, 1e-3, 4e-4, 4e-4], [0.0] * 5)
    times = np.linspace(0.0, 0.4, 57)
    for model in (GMS, LUGRE):
        one, other = (respond(model, motion, times, method=m)["friction_torque"] for m in ("rate", "step"))
        np.testing.assert_allclose(one, other, rtol=0.0, atol=2e-9)


def test_output_times_do_not_change_the_answer():
    many = respond(GMS, MOTIONS["eq3.16"], np.linspace(0.0, 2.0, 4001))
    few = respond(GMS, MOTIONS["eq3.16"], np.linspace(0.0, 2.0, 11))
    np.testing.assert_allclose(many["friction_torque"][::400], few["friction_torque"], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(many["velocity"][::400], few["velocity"], rtol=0.0, atol=1e-15)


def test_nothing_asked_gives_nothing():
    assert len(respond(GMS, MOTIONS["eq3.16"], [])) == 0
    assert respond(GMS, MOTIONS["eq3.16"], [0.0])["friction_torque"] == pytest.approx([0.0], abs=1e-9)


@pytest.mark.parametrize("times", [[0.0, 2.0, 1.0], [-1.0, 0.0], [0.0, math.nan], [[0.0, 1.0]]])
def test_times_that_do_not_ascend_from_zero_are_refused(times):
    with pytest.raises(InputError, match=r"ascending|times\[0\] = \[0.0, 1.0\] must be a number"):
        respond(GMS, MOTIONS["eq3.16"], times)


def test_unknown_methods_and_tolerances_are_refused():
    with pytest.raises(UnknownName, match="did you mean 'rate'"):
        respond(GMS, MOTIONS["eq3.16"], [1.0], method="rates")
    with pytest.raises(InputError, match="tolerance = 0 must"):
        respond(GMS, MOTIONS["eq3.16"], [1.0], tolerance=0.0)


class Growth(NamedTuple):
    """Parameters of a state that grows without bound."""

    pace: Annotated[float, Par("1/s", "a", "pace", positive=True)]


class Grown(NamedTuple):
    """Its state."""

    z: Annotated[float, Par("-", "z", "grows as tan(a t)")]


def growing_rate(v, z, p, u, dz):
    dz.z = p.pace * (1.0 + z.z * z.z)
    return z.z


def growing_step(v0, v1, dt, z, p, u):
    z.z = math.tan(math.atan(z.z) + p.pace * dt)
    return z.z


def growth(**more):
    """A law of the test's own."""
    return Law(
        "growth", Growth, growing_step, title="grows", equation="z = tan(a t)", source=(),
        example={"pace": 1.0}, State=Grown, **more,
    )  # fmt: skip


def test_a_state_without_bound_ends_the_run_and_keeps_what_was_computed():
    law = growth(rate=growing_rate)
    with pytest.raises(StepFailure, match="no step meets the tolerance") as caught:
        respond(Model(law, pace=1.0), MOTIONS["eq3.22"], [0.5, 1.0, 2.0, 3.0])
    assert caught.value.time == 2.0
    np.testing.assert_allclose(caught.value.record["friction_torque"], np.tan([0.5, 1.0]), rtol=1e-8)


def test_a_law_without_rates_goes_by_its_steps():
    law = growth()
    torque = respond(Model(law, pace=1.0), MOTIONS["eq3.22"], [0.5, 1.0])["friction_torque"]
    np.testing.assert_allclose(torque, np.tan([0.5, 1.0]), rtol=1e-8)
    with pytest.raises(InputError, match="use method 'step'"):
        respond(Model(law, pace=1.0), MOTIONS["eq3.22"], [0.5], method="rate")
