"""Every control law and velocity estimator, under every option, against its contract; and laws that break it."""

from __future__ import annotations

import math
import re
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from stickslip.contract.control_laws import CHECKS, continuous, examine, integrating, specimen, variants
from stickslip.contract.rest import at_rest
from stickslip.control.linear import Compensation
from stickslip.control.registry import control_law, control_law_names
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par, Surroundings
from stickslip.simulation.compiled_controller import FAULT, compiled, replay

TURN = 2.0 * math.pi

ALL = {
    "-".join([law.name, *law.chosen.values()]): law
    for name in control_law_names()
    for law in variants(control_law(name))
}


@pytest.mark.parametrize("name", ALL)
def test_control_laws_keep_their_contract(name):
    verdicts = list(examine(ALL[name]))
    assert len(verdicts) == len(CHECKS)
    assert [f"{v.name}: {v.text}" for v in verdicts if v.passed is False] == []


# ---- laws that break it --------------------------------------------------------------------------------------------


class Params(NamedTuple):
    """Of the laws below."""

    k: Annotated[float, Par("N·m/rad", "k", "stiffness", positive=True)]


class State(NamedTuple):
    """Of the laws below."""

    sum: Annotated[float, Par("rad", "", "sum of errors")]


def winds_up(y, z, p, u):
    z.sum += y.error
    return p.k * y.error + 1e-3 * p.k * z.sum


def winds_up_late(y, z, p, u):
    if y.rest > 1.8e6:  # half an hour
        z.sum += 1e-9
    return p.k * y.error + z.sum


def hidden_unit(y, z, p, u):
    return p.k * y.error + 0.01 * y.velocity


def squared(y, z, p, u):
    return p.k * y.error * abs(y.error)


def proportional(y, z, p, u):
    return p.k * y.error - 0.05 * y.velocity


def late(y, z, p, u):
    z.sum += 0.5 * (y.moved / y.elapsed - z.sum)
    return z.sum


def half(p, sample_time):
    return 0.5 * sample_time


def broken(sample, **more):
    given = {"place": "loop", "State": State, **more}
    return ControlLaw(
        "broken", Params, sample, title="x", equation="x", source=("own",), example={"k": 5.0}, **given
    )


BROKEN = {
    "rest": broken(winds_up),
    "units": broken(hidden_unit),
    "linear": broken(squared, linear=True),
    "delay": broken(late, place="estimator", delay=half),
    "continuous": broken(squared, continuous=lambda p: control_law("pd").continuous(_Gains())),
}


class _Gains:
    kp, kd = 5.0, 0.0


def twice(p):
    return Compensation("reference", 2.0 * p.gain)


FORMS = {
    "estimator": broken(late, place="estimator", delay=half, continuous=lambda p: 1e3),
    "friction": ControlLaw(**{**control_law("friction_feedforward").written, "continuous": twice}),
}


@pytest.mark.parametrize("name", FORMS)
def test_a_continuous_form_that_is_not_the_laws_is_told(name):
    assert continuous(FORMS[name]).passed is False


def test_the_continuous_forms_of_friction_laws_and_estimators_are_tried():
    for name in ("friction_feedforward", "friction_feedback"):
        assert continuous(control_law(name)).passed
    for name in ("backward_difference", "filtered_difference"):
        assert continuous(control_law(name)).passed
    assert continuous(control_law("dither")).passed is None


def test_what_begins_to_grow_after_half_an_hour_at_rest_is_told():
    """The hour is cut short only where all that remains is the minute that was, bit for bit."""
    told = at_rest(broken(winds_up_late))
    assert told.passed is False
    assert "state loop_sum is " in told.text
    assert at_rest(control_law("pd")).passed


@pytest.mark.parametrize("name", BROKEN)
def test_what_breaks_the_contract_is_told(name):
    assert name in [v.name for v in examine(BROKEN[name]) if v.passed is False]


def test_what_integrates_too_little_is_told_with_what_it_may_leave():
    told = integrating(broken(proportional, integrates=True))
    assert told.passed is False
    left, of, most, share = map(float, re.findall(r"[\d.]+(?:e-\d+)?(?= rad|, of| of it)", told.text))
    assert left > most
    assert most == pytest.approx(share * of, rel=0.1)


class Pendulum(NamedTuple):
    """Of laws whose torque depends on the absolute angle."""

    gravity: Annotated[float, Par("N·m", "G", "gravity torque", positive=True)]
    hangs: Annotated[float, Par("rad", "q_0", "angle at which it hangs")]
    stiffness: Annotated[float, Par("N·m/rad", "k", "stiffness")]


class WrongUnit(NamedTuple):
    """The same, one unit wrong."""

    gravity: Annotated[float, Par("N·m", "G", "gravity torque", positive=True)]
    hangs: Annotated[float, Par("rad", "q_0", "angle at which it hangs")]
    stiffness: Annotated[float, Par("N·m", "k", "stiffness")]


def pulled(y, z, p, u):
    angle = TURN * (y.turns - math.floor(y.turns)) + y.position
    return p.gravity * math.sin(angle + y.error - p.hangs) + p.stiffness * y.error


def pulled_by_a_part(y, z, p, u):
    return p.gravity * math.sin(y.reference - p.hangs) + p.stiffness * y.error


def pendulum(sample, params=Pendulum, stiffness=1.0):
    example = {"gravity": 0.4, "hangs": -0.35, "stiffness": stiffness}
    return ControlLaw(
        "pendulum", params, sample, "feedforward", title="x", equation="x", source=("own",), example=example
    )


def test_a_torque_of_the_absolute_angle_keeps_the_contract():
    assert [v for v in examine(pendulum(pulled)) if v.passed is False] == []


QUARTER = math.pi / 2


class SoftPendulum(NamedTuple):
    gravity: Annotated[float, Par("N·m", "G", "gravity")]
    hangs: Annotated[float, Par("rad", "q_0", "hangs at")]
    stiffness: Annotated[float, Par("N·m/rad", "c", "stiffness")]
    soft: Annotated[float, Par("rad/s", "v_s", "velocity of the sign", positive=True)]


def pulled_beside_a_smooth_sign(y, z, p, u):
    angle = 2.0 * math.pi * (y.turns - math.floor(y.turns)) + y.position
    smooth = p.gravity * math.atan(y.reference_velocity / p.soft)
    return p.gravity * math.cos(angle + y.error - p.hangs - QUARTER) + p.stiffness * y.error + smooth


def test_an_arcus_tangent_beside_a_sine_may_smooth_a_sign():
    """It was told to correct a unit, as was a quarter of a turn written at the head of the file."""
    example = {"gravity": 0.4, "hangs": -0.35, "stiffness": 1.0, "soft": 0.5}
    law = ControlLaw(
        "soft", SoftPendulum, pulled_beside_a_smooth_sign, "feedforward", title="x", equation="x", source=("own",),
        example=example,
    )  # fmt: skip
    assert "units" not in [v.name for v in examine(law) if v.passed is False]


def test_what_is_wrong_with_a_torque_of_the_absolute_angle_is_told():
    said = {v.name: v.text for v in examine(pendulum(pulled, WrongUnit)) if v.passed is False}
    assert list(said) == ["units"]
    assert "other units of angle" in said["units"]
    said = {v.name: v.text for v in examine(pendulum(pulled_by_a_part)) if v.passed is False}
    assert said["turns"].endswith("write 2π y.turns + y.position, and + y.error for the reference's angle")


def divides(y, z, p, u):
    return p.k / y.error


def test_what_a_law_makes_that_is_no_number_is_a_fault_and_does_not_come_out():
    sampled = compiled(specimen(broken(divides)))
    inputs = np.zeros((5, 4))
    inputs[[0, 1, 4], 1] = 10.0
    torque, fault = np.zeros(5), np.zeros(5)
    replay(sampled, inputs, np.array(Surroundings()), FAULT, torque, fault)
    assert torque[:2] == pytest.approx(0.5)
    assert torque[2:4] == pytest.approx(0.5 * np.array([0.99, 0.98]))
    assert list(fault) == [0.0, 0.0, 1.0, 2.0, 0.0]
    assert np.isfinite(torque).all()
