"""Closed loops under controllers made of control laws: as the controllers that they replace, and as the reference's."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ParameterError

INERTIA, TIME = 3.8623e-4, 1e-3
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
AXIS = ss.RigidAxis(INERTIA, ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE))
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.0, **CURVE)
LOW = ss.Reference("sine", amplitude=0.01, frequency=0.4)
FAST = ss.Reference("sine", amplitude=0.5, frequency=2.0)
W = 2.0 * math.pi * 20.0
PD = ss.ControlBlock("pd", kp=INERTIA * W**2, kd=2.0 * INERTIA * W)
PID = ss.ControlBlock("pid", kp=3.0 * INERTIA * W**2, kd=3.0 * INERTIA * W, ki=INERTIA * W**3)


def feedforward(**choices):
    return ss.ControlBlock("friction_feedforward", LUGRE, choices, gain=0.9)


PAIRS = {
    "PID": (
        ss.Controller(loop=PID, sample_time=TIME),
        ss.Controller(ss.place("PID", INERTIA, 20.0, 1.0), sample_time=TIME),
    ),
    "PID with feedforward and a coarse encoder": (
        ss.Controller(
            loop=PID, sample_time=TIME, feedforward=feedforward(), torque_limit=0.6, encoder_counts=4096.0
        ),
        ss.Controller(ss.place("PID", INERTIA, 20.0, 1.0), ss.Feedforward(LUGRE, 0.9), 0.6, TIME, 4096.0),
    ),
}


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_the_loop_is_that_of_the_controller_it_replaces(pair):
    one, two = (ss.simulate(AXIS, c, LOW, 1.5, time_step=1e-4) for c in pair)
    for channel in ("position", "motor_torque", "compensation_torque"):
        assert one[channel] == pytest.approx(two[channel], abs=1e-10)
    assert np.ptp(one["position"]) > 1e-3
    assert one.meta["metrics"] == pytest.approx(two.meta["metrics"], rel=1e-6, abs=1e-12, nan_ok=True)


def test_a_record_says_which_laws_controlled():
    observer = ss.ControlBlock("disturbance_observer", inertia=INERTIA, corner=400.0)
    controller = ss.Controller(loop=PD, sample_time=TIME, feedforward=feedforward(), observer=observer)
    record = ss.simulate(AXIS, controller, LOW, 0.05)
    said = record.meta["controller"]
    assert [said[part]["law"] for part in ("loop", "feedforward", "observer", "estimator")] == [
        "pd",
        "friction_feedforward",
        "disturbance_observer",
        "backward_difference",
    ]
    assert said["feedforward"]["friction"]["sigma0"] == 3.5e4
    assert "gains" not in record.meta
    assert np.abs(record["compensation_torque"]).max() > 0.0


@pytest.mark.parametrize("integrator", ["exact", "adaptive"])
def test_an_integrator_in_continuous_time_refuses_it_in_a_line(integrator):
    with pytest.raises(ss.InputError, match="sample") as refused:
        ss.simulate(AXIS, ss.Controller(loop=PD, sample_time=TIME), LOW, 0.1, integrator=integrator)
    assert "\n" not in str(refused.value)


PLACED_PD, PLACED_PID = (ss.place(kind, INERTIA, 20.0, 1.0) for kind in ("PD", "PID"))
BACK = ss.ControlBlock("friction_feedback", LUGRE, gain=0.7)
CONTINUOUS = {
    "PR": (
        ss.Controller(loop=ss.ControlBlock("pr", kp=6.0, kd=0.1), sample_time=0.0),
        ss.Controller(ss.pr(6.0, 0.1)),
    ),
    "PD": (
        ss.Controller(loop=ss.ControlBlock("pd", **PD.law.placed(INERTIA, 20.0, 1.0)), sample_time=0.0),
        ss.Controller(PLACED_PD),
    ),
    "PID, feedforward": (
        ss.Controller(
            loop=ss.ControlBlock("pid", **PID.law.placed(INERTIA, 20.0, 1.0)),
            sample_time=0.0,
            feedforward=feedforward(),
        ),
        ss.Controller(PLACED_PID, ss.Feedforward(LUGRE, 0.9)),
    ),
    "PD, feedback": (
        ss.Controller(
            loop=ss.ControlBlock("pd", **PD.law.placed(INERTIA, 20.0, 1.0)), sample_time=0.0, observer=BACK
        ),
        ss.Controller(PLACED_PD, ss.Feedback(LUGRE, 0.7)),
    ),
}


@pytest.mark.parametrize("integrator", ["exact", "adaptive", "fixed"])
@pytest.mark.parametrize("name", CONTINUOUS)
def test_in_continuous_time_it_is_bit_for_bit_the_one_with_gains(name, integrator):
    if (name, integrator) == ("PD, feedback", "exact"):
        integrator = "auto"  # a bristle in the feedback's place takes the adaptive one
    one, two = (
        ss.simulate(AXIS, c, FAST, 0.4, integrator=integrator, slip_rule="literal") for c in CONTINUOUS[name]
    )
    assert one.meta["integrator"] == two.meta["integrator"]
    for channel in ("position", "motor_torque", "compensation_torque"):
        assert np.array_equal(one[channel], two[channel])
    assert np.ptp(one["position"]) > 0.1
    assert one.meta["metrics"] == pytest.approx(two.meta["metrics"], rel=0, abs=0, nan_ok=True)
    assert one.meta["controller"]["sample_time"] == 0.0


SAMPLED_ONLY = {
    "acts on samples only": {
        "observer": ss.ControlBlock("disturbance_observer", inertia=INERTIA, corner=400.0)
    },
    "lead acts on samples": {
        "feedforward": ss.ControlBlock("friction_feedforward", LUGRE, gain=0.9, lead=1e-3)
    },
    "deadband acts on samples": {
        "observer": ss.ControlBlock("friction_feedback", LUGRE, gain=0.9, deadband=1e-3)
    },
    "one law compensates": {"feedforward": feedforward(), "observer": BACK},
    "low-pass of 'filtered_difference'": {"estimator": ss.ControlBlock("filtered_difference", corner=600.0)},
    "what its integral does": {"loop": PID, "torque_limit": 1.0},
    "control law 'pid'": {
        "loop": ss.ControlBlock("pid", choices={"at_rest": "reset"}, kp=1.0, ki=1.0, kd=0.1)
    },
    "encoder": {"encoder_counts": 4096.0},
}


@pytest.mark.parametrize("why", SAMPLED_ONLY)
def test_what_acts_on_samples_is_refused_in_continuous_time(why):
    with pytest.raises(ParameterError, match=why) as refused:
        ss.Controller(**{"loop": PD, "sample_time": 0.0, **SAMPLED_ONLY[why]})
    assert "give a sample_time" in str(refused.value)
    assert "\n" not in str(refused.value)
    # With one it is taken.
    ss.Controller(**{"loop": PD, "sample_time": TIME, **SAMPLED_ONLY[why]})


def test_the_slip_rule_of_a_run_is_that_of_the_laws_in_the_controller():
    gms = AXIS.friction
    control = ss.Controller(
        loop=PD, sample_time=TIME, feedforward=ss.ControlBlock("friction_feedforward", gms, gain=0.9)
    )
    own, literal = (ss.simulate(AXIS, control, LOW, 0.3, slip_rule=rule) for rule in (None, "literal"))
    assert own.meta["slip_rules"] == {"friction": "signed", "feedforward": "signed"}
    assert literal.meta["slip_rules"] == {"friction": "literal", "feedforward": "literal"}
    given = ss.Controller(
        loop=PD,
        sample_time=TIME,
        feedforward=ss.ControlBlock("friction_feedforward", gms.having(slip_rule="literal"), gain=0.9),
    )
    again = ss.simulate(AXIS, given, LOW, 0.3, slip_rule="literal")
    assert np.array_equal(literal["compensation_torque"], again["compensation_torque"])


REFERENCE = {
    # RMS error in mrad along LOW, of the reference computation (engine B, rtol 1e-9; class W: 1e-3)
    "PID": (PID, None, None, 1.266),
    "PD + DOB 400": (PD, None, 400.0, 0.6540),
    "PD + FF LuGre 0.9": (PD, feedforward(velocity="held"), None, 5.904),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REFERENCE)
def test_errors_are_those_of_the_reference(name):
    loop, ahead, corner, rms = REFERENCE[name]
    observer = ss.ControlBlock("disturbance_observer", inertia=INERTIA, corner=corner) if corner else None
    controller = ss.Controller(
        loop=loop, sample_time=TIME, feedforward=ahead, observer=observer, torque_limit=1.0
    )
    record = ss.simulate(AXIS, controller, LOW, 5.0, time_step=2e-5)
    t = TIME * np.arange(5000)
    error = np.interp(t, record.time, record["position_reference"] - record["position"])
    assert 1e3 * math.sqrt(np.mean(error**2)) == pytest.approx(rms, rel=1e-3)
