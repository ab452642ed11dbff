"""What looks like one mistake and may be another: a gear for degrees, a magnitude for a badly moved axis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip import Record
from stickslip.identify.doctor import examine

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
    told = float(found.remedy.split("--gear-ratio ")[1].split()[0])
    assert told == pytest.approx(ratio, rel=0.05)


def test_degrees_may_be_a_gear_too():
    (found,) = [f for f in examine(swinging(360.0, 1.4)).findings if "comes back" in f.message]
    assert found.code == "position-unit"
    assert "or the motor's angle before a gear of about 5" in found.message
    assert "if it is in degrees, or identify with --gear-ratio 5" in found.remedy


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
