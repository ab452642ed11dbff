"""Controllers made of control laws on a rig: as those that they replace, with an observer, and through faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import pd, pid
from stickslip.core.errors import InputError
from stickslip.rigs.loop import Loop
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.rig import setpoints
from support.axis_rig import FRICTION, AxisRig

T = 1e-3
AT = {name: COLUMNS.index(name) for name in COLUMNS}
AHEAD = ControlBlock("friction_feedforward", FRICTION)
PD = ControlBlock("pd", kp=19.7612, kd=0.1747)
PID = ControlBlock("pid", kp=59.28, ki=4469.9, kd=0.2621)
OBSERVER = ControlBlock("disturbance_observer", inertia=3.8623e-4, corner=300.0)
PAIRS = {
    "PD + FF": (
        Controller(loop=PD, sample_time=T, feedforward=AHEAD, torque_limit=1.0),
        Controller(pd(19.7612, 0.1747), Feedforward(FRICTION), torque_limit=1.0),
    ),
    "PID": (
        Controller(loop=PID, sample_time=T, torque_limit=1.0),
        Controller(pid(59.28, 4469.9, 0.2621), torque_limit=1.0),
    ),
}
OBSERVED = Controller(loop=PD, sample_time=T, feedforward=AHEAD, observer=OBSERVER, torque_limit=1.0)


def sine(count, offset=0.0, hz=1.0):
    t, w = T * np.arange(count), 2.0 * math.pi * hz
    return setpoints(
        count, position=offset + 0.2 * np.sin(w * t), velocity=0.2 * w * np.cos(w * t), closed=1.0
    )


def tracked(controller, blocks=True):
    """Open loop, then the controller along a sine, a pause, and it again."""
    with Loop(AxisRig(blocks=blocks)) as loop:
        rows = [loop.run(setpoints(100, torque=0.1), controller)]
        rows.append(loop.run(sine(700, rows[-1][-1, AT["position"]]), controller))
        loop.pause(0.2)
        rows.append(loop.run(sine(300, rows[-1][-1, AT["position"]]), controller))
    return np.concatenate(rows)


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_on_a_rig_it_is_the_controller_that_it_replaces(pair):
    one, two = map(tracked, pair)
    for name in ("position", "torque_command", "compensation_torque"):
        assert one[:, AT[name]] == pytest.approx(two[:, AT[name]], abs=2e-9), name


def test_blocks_and_samples_give_the_same_numbers():
    assert np.array_equal(tracked(OBSERVED, blocks=True), tracked(OBSERVED, blocks=False))


def test_an_observer_follows_closer_and_takes_over_without_a_jump():
    errors = {}
    for name, controller in (("alone", PAIRS["PD + FF"][0]), ("observed", OBSERVED)):
        rows = tracked(controller)
        assert rows[100, AT["torque_command"]] == pytest.approx(rows[99, AT["torque_command"]], abs=1e-12)
        error = rows[300:800, AT["position_reference"]] - rows[300:800, AT["position"]]
        errors[name] = float(np.sqrt(np.mean(error**2)))
    assert errors["observed"] < 0.7 * errors["alone"]


def test_one_controller_hands_over_to_the_other_kind_and_back():
    with Loop(AxisRig()) as loop:
        rows = loop.run(sine(300), PAIRS["PID"][1])
        for controller in (OBSERVED, PAIRS["PID"][1], PAIRS["PID"][0]):
            position, speed = rows[-1, AT["position"]], rows[-1, AT["velocity"]]
            last = rows[-1, AT["torque_command"]]
            ahead = setpoints(200, position=position + speed * T * np.arange(200), velocity=speed, closed=1.0)
            rows = loop.run(ahead, controller)
            assert rows[0, AT["torque_command"]] == pytest.approx(last, abs=1e-12)
            assert rows[0, AT["velocity"]] == pytest.approx(speed, abs=0.2)


def test_another_sample_time_is_refused():
    with (
        pytest.raises(InputError, match=r"sample_time = 0\.002 s, that of the rig is 0\.001 s"),
        Loop(AxisRig()) as loop,
    ):
        loop.run(sine(10), Controller(loop=PD, sample_time=2e-3))
