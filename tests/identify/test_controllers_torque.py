"""A torque that a controller makes of the velocity tells the controller, not friction: nothing is identified then."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from stickslip.identify.axis.agreed import sliding_values
from stickslip.identify.axis.identify import identify_axis
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis

INERTIA, WEIGHT, LEVEL = 0.185, 3.6, 0.19  # kg·m², N·m, N·m; of a pendulum of 0.5 kg on a geared motor
PERIOD, STEPS = 5e-3, 20
PENDULUM = ServoAxis(gravity="pendulum", drive_side="load")


def swung(command: Callable[[float, float, float], float], seconds: float = 3.9) -> Experiment:
    """A pendulum with Coulomb friction under a torque that `command` makes of time, angle and velocity.

    The angle comes in steps of 2.9 mrad, the torque with 8 mN·m of noise.
    """
    rows = round(seconds / PERIOD)
    time, angle, torque = np.linspace(0.0, PERIOD * (rows - 1), rows), np.zeros(rows), np.zeros(rows)
    q, v, step = 0.05, 0.0, PERIOD / STEPS
    for k in range(rows):
        torque[k] = command(time[k], q, v)
        angle[k] = q
        for _ in range(STEPS):
            v += step * (torque[k] - WEIGHT * math.sin(q) - LEVEL * math.tanh(v / 1e-2)) / INERTIA
            q += step * v
    noise = 8e-3 * np.random.default_rng(2).standard_normal(rows)
    return Experiment("swung", time, 2.9e-3 * np.round(angle / 2.9e-3), torque + noise)


def pumped(_t: float, _q: float, v: float) -> float:
    """Bang-bang, always with the velocity."""
    return 0.9 * math.copysign(1.0, v)


def followed(t: float, q: float, v: float) -> float:
    """Stiff position control along two sines."""
    reference = 1.2 * math.sin(1.2 * t) + 0.3 * math.sin(3.1 * t)
    rate = 1.44 * math.cos(1.2 * t) + 0.93 * math.cos(3.1 * t)
    return 80.0 * (reference - q) + 6.0 * (rate - v)


def looked_at(experiment: Experiment) -> Regression:
    return regress_axis([experiment], PENDULUM)


def test_a_bang_bang_torque_does_not_tell_the_friction_of_the_pendulum_that_it_swings() -> None:
    """Its level came out as Coulomb friction, four times too high and sure to 2 %."""
    record = swung(pumped)
    found = looked_at(record)
    value, low, high = sliding_values(found, None)["fc"]
    assert value > 3.0 * LEVEL
    assert high - low < 0.5 * value
    assert "neither the inertia nor the weight of the pendulum" in found.doubt
    result = identify_axis([record], PENDULUM, ["coulomb"])
    assert not any(e.identified for e in result.estimates)
    assert "map the motor's own torque or current" in " ".join(result.notes)


def test_a_pendulum_under_position_control_is_believed() -> None:
    found = looked_at(swung(followed, 12.0))
    assert found.doubt == ""
    low, high = found.interval("fc")
    assert low < LEVEL < high
    assert found.numbers["inertia"].value == pytest.approx(INERTIA, rel=0.05)


def test_a_torque_that_falls_with_the_velocity_is_said_to_be_a_controllers() -> None:
    """Proportional speed control of a motor whose cogging is larger than its friction."""
    inertia, cogging, gain, level, step = 6e-6, 1.8e-2, 2.9e-3, 1e-3, 1e-4
    rows, q, v, ordered = 6000, 0.0, 0.0, 2.0 * math.pi
    angle, torque = np.zeros(rows), np.zeros(rows)
    for k in range(rows):
        torque[k], angle[k] = gain * (ordered - v), q
        for _ in range(10):
            friction = level * math.tanh(v / 1e-2)
            v += step * (gain * (ordered - v) - friction - cogging * math.sin(36.0 * q)) / inertia
            q += step * v
    record = Experiment(
        "speed", np.linspace(0.0, 1e-3 * (rows - 1), rows), 3.14e-4 * np.round(angle / 3.14e-4), torque
    )
    result = identify_axis([record], ServoAxis(drive_side="load"), ["coulomb"])
    assert not any(e.identified for e in result.estimates if e.name in ("fc", "sigma2"))
    assert "made from the velocity by a controller" in " ".join(result.notes)
