"""Laws without memory: classical combinations, Stribeck with its jump, Karnopp, viscous friction."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import InputError, ParameterError
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

TABLE = json.loads((Path(__file__).parents[1] / "data" / "karnopp.json").read_text())
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
KARNOPP = Model("karnopp", dv=1e-3, **CURVE)
J = 3.8623e-4


def swing(peak, frequency, **more):
    """A harmonic motion with the given amplitude of the velocity, rad/s."""
    return Reference("harmonic", amplitude=peak / (2.0 * math.pi * frequency), frequency=frequency, **more)


MOTIONS = {
    "eq3.16": swing(0.0251, 0.4, phase=-0.5 * math.pi),
    "eq3.17": swing(0.3142, 0.1, phase=-0.5 * math.pi),
    "eq3.21": Reference("harmonic", amplitude=2.75e-5, frequency=0.2),
    "eq3.22": swing(0.011, 0.2, velocity=0.012),
}


def pushed(model, amplitude, frequency, duration, **how):
    """The axis under the torque amplitude sin(2 pi frequency t): a rate gain of 1 on a reference velocity."""
    push = swing(amplitude, frequency, phase=-0.5 * math.pi)
    return simulate(RigidAxis(J, model), Controller(Gains(0.0, 0.0, 0.0, 1.0)), push, duration, **how)


# ---- Karnopp against the independent program -------------------------------------------------------------------


@pytest.mark.parametrize("motion", MOTIONS)
def test_karnopp_along_a_motion_with_an_applied_torque(motion):
    times = np.array(TABLE[motion]["t"])
    applied = 0.4 * np.sin(2.0 * math.pi * 0.7 * times + 0.3)
    torque = respond(KARNOPP, MOTIONS[motion], times, applied=applied)["friction_torque"]
    assert np.abs(torque - TABLE[motion]["F"]).max() < 1e-9


@pytest.mark.parametrize(
    ("how", "bound"), [({"integrator": "adaptive"}, 1e-8), ({"integrator": "fixed"}, 5e-5)]
)
def test_karnopp_axis_driven_by_a_torque(how, bound):
    wanted = TABLE["karnopp_openloop"]
    record = pushed(KARNOPP, 0.35, 1.0, 2.0, output=wanted["t"], **how)
    rows = record["event"] == 0.0
    assert np.abs(record["position"][rows] - wanted["theta"]).max() < bound
    assert np.abs(record["velocity"][rows] - wanted["omega"]).max() < 50.0 * bound


def test_karnopp_rests_in_its_band():
    record = pushed(KARNOPP, 0.33, 1.0, 1.0)
    assert np.all(record["position"] == 0.0)
    np.testing.assert_allclose(record["friction_torque"], record["motor_torque"], rtol=0, atol=1e-15)


# ---- static friction -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["static", "stribeck_plain", "coulomb"])
@pytest.mark.parametrize("integrator", ["adaptive", "fixed"])
def test_a_contact_breaks_away_at_its_static_torque(law, integrator):
    model = Model(law, **plugins.law(law).example)
    level = model.law.holding(1.0, None, model.parameters, None)
    record = pushed(model, 0.4, 0.25, 1.0, integrator=integrator, output=1e-4)
    moving = np.flatnonzero(record["position"] > 0.0)[0]
    begin = math.asin(level / 0.4) / (2.0 * math.pi * 0.25)
    assert record.time[moving] == pytest.approx(begin, abs=2e-4)
    assert pushed(model, 0.999 * level, 0.25, 2.0, integrator=integrator)["position"].max() == 0.0


@pytest.mark.parametrize("law", ["static", "stribeck_plain", "karnopp"])
@pytest.mark.parametrize("compensated", [False, True])
def test_adaptive_and_fixed_agree_in_the_loop(law, compensated):
    model = Model(law, **plugins.law(law).example)
    helper = Feedback(model, gain=0.7) if compensated else None
    runs = [
        simulate(
            RigidAxis(J, model), Controller(place("PD", J, 10.0, 0.85), helper),
            Reference("sine", amplitude=0.2, frequency=0.4), 2.0, integrator=name, tolerance=1e-8,
        ).meta["metrics"]["position_rms_rad"]
        for name in ("adaptive", "fixed")
    ]  # fmt: skip
    assert runs[0] == pytest.approx(runs[1], rel=2e-3)


def test_torque_at_rest_is_the_applied_one_up_to_the_static_torque():
    still = Reference("table", time=[0.0, 1.0], position=[0.0, 0.0], velocity=[0.0, 0.0])
    applied = [-1.0, -0.2, 0.0, 0.3, 0.335, 0.4]
    times = np.linspace(0.1, 0.9, 6)
    for law in ("static", "stribeck_plain", "karnopp"):
        model = Model(law, **plugins.law(law).example)
        torque = respond(model, still, times, applied=applied)["friction_torque"]
        assert torque == pytest.approx([-0.335, -0.2, 0.0, 0.3, 0.335, 0.335])


def test_figure_2_4_combinations():
    coulomb, both = Model("coulomb", fc=0.285), Model("coulomb", fc=0.285, sigma2=0.018)
    stiction, all_three = (
        Model("static", fs=0.335, fc=0.285),
        Model("static", fs=0.335, fc=0.285, sigma2=0.018),
    )
    viscous = Model("viscous", sigma2=0.018)
    for v in (-3.0, -1e-6, 1e-6, 0.5):
        torque = {m: m.law.steady(v, m.parameters) for m in (coulomb, both, stiction, all_three, viscous)}
        assert torque[stiction] == torque[coulomb] == math.copysign(0.285, v)
        assert torque[both] == torque[all_three] == pytest.approx(torque[coulomb] + torque[viscous])


def test_nonlinear_viscous_friction_doubles_as_its_power_says():
    model = Model("viscous", {"viscous": "power"}, fv2=0.02, delta_v=1.7)
    at = model.law.steady
    assert at(2.0, model.parameters) == pytest.approx(2.0**1.7 * at(1.0, model.parameters))
    assert at(-1.0, model.parameters) == -at(1.0, model.parameters) == -0.02


def test_bad_input_is_refused():
    with pytest.raises(ParameterError, match=r"fs = 0\.2 N·m lies below fc"):
        Model("static", fs=0.2, fc=0.3)
    with pytest.raises(InputError, match=r"applied has shape \(1,\)"):
        respond(KARNOPP, MOTIONS["eq3.16"], [0.1, 0.2], applied=[0.1])
    lugre = Model("lugre", **plugins.law("lugre").example)
    with pytest.raises(InputError, match="needs no applied torque"):
        respond(lugre, MOTIONS["eq3.16"], [0.1], applied=[0.1])
