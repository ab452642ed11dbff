"""What looks like one mistake and may be another: a gear for degrees, a magnitude for a badly moved axis."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import Record
from stickslip.identification.doctor import examine

UNITS = {"position": "rad", "motor_torque": "N·m"}


def swinging(turn: float, swing: float) -> Record:
    """A pendulum that swings by so many rad to either side, its position counted so that `turn` is a turn."""
    t = np.arange(0.0, 8.0, 1e-3)
    q = swing * np.sin(2.0 * np.pi * 0.5 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    random = np.random.default_rng(1).standard_normal((2, t.size))
    torque = 1e-3 * a + 0.1 * np.sign(v) + 0.4 * np.sin(q) + 1e-3 * random[1]
    position = turn / math.tau * (q + 1e-3 * random[0])
    return Record(t, {"position": position, "motor_torque": torque}, UNITS)


@pytest.mark.parametrize(("ratio", "swing"), [(30.0, 2.0), (35.0, 1.8)])
def test_a_gear_is_not_taken_for_degrees(ratio, swing):
    """A pendulum behind a gear of 20 was called degrees, with the option to read it so."""
    (found,) = [f for f in examine(swinging(ratio * math.tau, swing)).findings if "comes back" in f.message]
    assert found.code == "gravity"
    said = f"{found.message}; {found.remedy}"
    assert ":deg" not in said
    told = float(found.remedy.split("gear_ratio=")[1].split()[0].rstrip(","))
    assert told == pytest.approx(ratio, rel=0.05)


def test_degrees_may_be_a_gear_too():
    (found,) = [f for f in examine(swinging(360.0, 1.4)).findings if "comes back" in f.message]
    assert found.code == "position-unit"
    assert "or the motor's angle before a gear of about 5" in found.message
    assert "if it is in degrees, or identify with gear_ratio=5" in found.remedy


@pytest.mark.parametrize(("swing", "weighs"), [(0.27, True), (1.0, True), (0.27, False)])
def test_a_bend_over_a_twelfth_of_a_turn_is_no_gravity(swing, weighs):
    """Cogging of 0.12 N·m over 30 degrees was "7.01 N·m once a turn, as gravity does"; a pendulum shows a fifth of its
    weight there."""
    found = swinging(math.tau, swing)
    if not weighs:
        q = found["position"]
        v = np.gradient(q, found.time)
        bent = found["motor_torque"] - 0.4 * np.sin(q) + 0.3 * np.sign(v) + 0.12 * np.cos(8.0 * q)
        found = Record(found.time, {**{c: found[c] for c in found.channels}, "motor_torque": bent}, UNITS)
    said = [f.message for f in examine(found).findings if f.code == "gravity"]
    assert len(said) == int(weighs)
    if said:
        assert float(said[0].split("angle: ")[1].split()[0]) == pytest.approx(0.4, rel=0.1)


@pytest.mark.parametrize("weight", [0.0, 0.4])
@pytest.mark.parametrize("way", [0.02, 0.05])
def test_friction_that_builds_up_behind_a_reversal_is_no_gravity(way: float, weight: float) -> None:
    """A slow sine of another program over 57 degrees, LuGre friction of 1.5 N·m: "0.547 N·m once a turn, as gravity
    does"; play and a spring at the load made it as well."""
    t = np.arange(0.0, 20.0, 4e-3)
    sine = np.sin(2.0 * np.pi * 0.2 * t)
    q = np.cumsum(np.sign(sine) * np.maximum(np.abs(sine) - 0.3, 0.0))
    q = q / np.ptp(q) + weight * np.sin(2.0 * np.pi * 0.7 * t)
    friction, bristle = np.zeros(t.size), 0.0
    for k, step in enumerate(np.diff(q, prepend=q[0]).tolist()):
        bristle += step - abs(step) * bristle / way
        friction[k] = 0.3 * bristle / way
    torque = 1e-3 * np.gradient(np.gradient(q, t), t) + friction + weight * np.sin(q)
    torque += 1e-3 * np.random.default_rng(3).standard_normal(t.size)
    record = Record(t, {"position": q, "motor_torque": torque}, UNITS)
    told = [f.message for f in examine(record).findings if f.code == "gravity"]
    assert len(told) == int(weight > 0.0)
    if told:
        assert float(told[0].split("angle: ")[1].split()[0]) == pytest.approx(weight, rel=0.25)


def moved(weight: float, *, magnitude: bool) -> Record:
    t = np.arange(0.0, 4.0, 1e-3)
    q = 8.0 * np.sin(2.0 * np.pi * 0.5 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    torque = 1e-3 * a + 0.2 * np.sign(v) + 0.01 * v + weight
    torque += 2e-3 * np.random.default_rng(2).standard_normal(t.size)
    return Record(t, {"position": q, "motor_torque": np.abs(torque) if magnitude else torque}, UNITS)


@pytest.mark.parametrize("weight", [0.0, 0.1])
def test_a_torque_without_its_sign_is_an_error(weight):
    """No error and no warning; `identify` then asked for longer and gentler motion."""
    found = examine(moved(weight, magnitude=True))
    assert [f.code for f in found.errors] == ["torque-magnitude"]
    assert "magnitude" in found.errors[0].message
    assert "log the signed torque" in found.errors[0].remedy
    accepted = examine(moved(weight, magnitude=True), accept=["torque-magnitude"])
    assert not accepted.errors


@pytest.mark.parametrize("weight", [0.0, 2.0])
def test_a_weight_that_is_always_held_is_no_magnitude(weight):
    found = examine(moved(weight, magnitude=False))
    assert "torque-magnitude" not in {f.code for f in found.findings}


def test_a_counter_of_many_turns_is_not_counted_within_one():
    """A wrap of 512 turns was said to be "counted within one turn"."""
    t = np.arange(0.0, 4.0, 1e-3)
    far = 512.0 * math.tau
    q = 50.0 * np.sin(2.0 * np.pi * 0.5 * t) + 0.5 * far
    for turns, said in (
        (512.0, "its counter starts anew, after 512 turns"),
        (1.0, "it is counted within one turn"),
    ):
        position = np.mod(q, turns * math.tau) if turns == 1.0 else np.mod(q + 0.5 * far, far)
        record = Record(t, {"position": position, "motor_torque": np.cos(np.pi * t)}, UNITS)
        (found,) = [f for f in examine(record).findings if f.code == "position-wrap"]
        assert found.message.endswith(said)


@pytest.mark.parametrize(("column", "level"), [("Torque command [Nm]", "note"), ("Torque [Nm]", "warning")])
def test_a_commanded_torque_at_its_limit_is_what_acts(column, level):
    """That what was cut off is lost was said of a command, and the result doubted for it."""
    t = np.arange(0.0, 4.0, 1e-3)
    torque = np.clip(3.0 * np.sin(2.0 * np.pi * t), -2.2, 2.2)
    position = np.cumsum(np.cumsum(torque - np.mean(torque))) * 1e-6 / 1e-3
    found = ss.doctor({"time [s]": t, "position [rad]": position, column: torque}).findings
    (at_limit,) = [f for f in found if f.code == "saturation"]
    assert at_limit.level == level
    assert ("what was cut off is lost" in at_limit.line()) == (level == "warning")
    assert "2.2" in at_limit.message
