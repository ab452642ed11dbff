"""The condition of learning against closed forms, and against learning on a linear loop sample by sample."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.learning import over_angle, over_time, response, widest
from stickslip.analyse.presliding_loop import Axis
from stickslip.control.learning import low_pass, low_pass_response, relearned, smoothed
from stickslip.core.errors import InputError
from stickslip.machines.drivetrain import Drivetrain
from support.golden_rows import INERTIA, PD, ROWS

TIME = 1e-3
AXIS = Axis(Drivetrain((INERTIA,)), ss.Model("coulomb", fc=0.285, sigma2=0.0))


@pytest.mark.parametrize("delay", [0, 1])
def test_what_the_loop_takes_of_a_torque_is_that_of_the_closed_form(delay):
    frequency = np.array([0.5, 5.0, 20.0, 60.0, 150.0, 400.0])
    z = np.exp(2j * math.pi * frequency * TIME)
    plant = TIME**2 / (2.0 * INERTIA) * (z + 1.0) / (z - 1.0) ** 2 * z**-delay
    opened = (PD["kp"] + PD["kd"] * (1.0 - 1.0 / z) / TIME) * plant
    found = response(AXIS.drivetrain, linearised(ROWS["PD"], math.inf, 1.0), delay, frequency)
    assert found == pytest.approx(opened / (1.0 + opened), rel=1e-6)


def test_an_observer_takes_the_whole_of_a_constant_torque():
    slow = np.array([1e-3])
    drive = linearised(ROWS["PD + DOB 200"], math.inf, 1.0)
    assert abs(response(AXIS.drivetrain, drive, 0.0, slow)[0] - 1.0) < 1e-4


def test_the_low_pass_lets_through_what_it_says():
    weights = low_pass(40.0, TIME)
    assert weights.sum() == pytest.approx(1.0)
    assert low_pass_response(weights, np.array([0.0, 0.04])) == pytest.approx([1.0, math.sqrt(0.5)], rel=1e-4)
    wave = np.sin(2.0 * math.pi * 40.0 * TIME * np.arange(1000))
    assert smoothed(wave, weights)[100:-100] == pytest.approx(math.sqrt(0.5) * wave[100:-100], abs=1e-4)
    assert smoothed(np.full(50, 3.0), weights) == pytest.approx(3.0)


def learning(corner, advance, rate, repetitions, delay=0):
    """RMS of the loop's torque, and tables, repetition by repetition: PD on an inertia with a torque that repeats."""
    n = 1200
    t = TIME * np.arange(n)
    rough = np.random.default_rng(1).standard_normal(n)
    load = (0.2 * np.sin(30.0 * t) + 0.02 * smoothed(rough, low_pass(250.0, TIME))) * np.sin(
        np.pi * t / t[-1]
    ) ** 2
    table, out, tables = np.zeros(n), [], []
    for _ in range(repetitions):
        position = velocity = last = 0.0
        torque, waiting = np.zeros(n), [0.0] * delay
        for k in range(n):
            torque[k] = -PD["kp"] * position - PD["kd"] * (position - last) / TIME
            last = position
            waiting.append(torque[k] + table[k])
            acceleration = (waiting.pop(0) - load[k]) / INERTIA
            position += TIME * velocity + 0.5 * TIME**2 * acceleration
            velocity += TIME * acceleration
        out.append(math.sqrt(float(np.mean(torque**2))))
        tables.append(table)
        table = relearned(table, torque, rate, advance, low_pass(corner, TIME), 10.0)
    return np.array(out), np.array(tables)


@pytest.mark.parametrize("delay", [0, 1])
def test_where_the_condition_holds_every_repetition_comes_nearer(delay):
    found = widest(AXIS, ROWS["PD"], 0.8, float(delay))
    assert found.worst <= 0.95
    assert found.corner == pytest.approx(100.0)
    errors, tables = learning(found.corner, found.advance, 0.8, 6, delay)
    steps = np.linalg.norm(np.diff(tables, axis=0), axis=1)
    assert np.all(steps[1:] <= found.worst * steps[:-1])
    assert errors[-1] < 0.25 * errors[0]  # what Q leaves out stays


def test_where_it_does_not_hold_the_error_grows():
    found = over_time(AXIS, ROWS["PD"], 1.5, 400.0, 0)
    assert not found.holds
    assert 40.0 < found.frequency < 400.0
    errors, _ = learning(400.0, 0, 1.5, 16)
    assert errors[-1] > 5.0 * errors.min()


def test_over_the_angle_faster_motion_and_finer_bins_ask_for_more():
    calm = over_angle(AXIS, ROWS["PD + DOB 200"], 0.8, 0.2 / 64, 0.3)
    fast = over_angle(AXIS, ROWS["PD + DOB 200"], 0.8, 0.2 / 512, 3.0)
    assert calm.holds
    assert calm.worst == pytest.approx(0.2, abs=0.01)
    assert not fast.holds


def test_what_cannot_be_judged_is_refused():
    with pytest.raises(InputError, match=r"rate = 2 converges with no filter"):
        widest(AXIS, ROWS["PD"], 2.0)
    with pytest.raises(InputError, match="unstable while the axis slides"):
        widest(Axis(Drivetrain((0.02 * INERTIA,)), AXIS.friction), ROWS["PD"], 0.8)
