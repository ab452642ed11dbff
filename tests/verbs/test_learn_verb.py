"""The verb learn: what it learns makes the motion better, and is given on by the controller that it writes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.control.files import read_controller
from stickslip.core.errors import InputError
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Harmonics
from support.golden_rows import INERTIA, ROWS

FRICTION = ss.Model(
    "gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018
)
AXIS = ss.RigidAxis(INERTIA, FRICTION)
BRISK = ss.Reference("sine", amplitude=0.1, frequency=2.0)
RIPPLE = Machine(
    "ripple",
    INERTIA,
    Contact(FRICTION),
    cogging=Harmonics((126,), (0.05,), (-0.5 * math.pi,)),
    encoder=Encoder(),
)
"""The reference's bench of learning: 0.05 sin(126 theta) N·m on the thesis's axis.

Its files do not say so; order and size follow from the ten errors that they give without learning, to 6e-4.
"""
BENCH = ss.Reference("sine", amplitude=0.1, frequency=0.4)
FILE = """
[axis]
inertia = 3.8623e-4
[friction]
law = "coulomb"
fc = 0.285
sigma2 = 0.018
[reference]
kind = "sine"
amplitude = 0.1
frequency = 2.0
duration = 0.5
[controller]
sample_time = 0.001
torque_limit = 1.0
placement = {bandwidth_hz = 20.0, damping = 1.0}
loop = {law = "pd"}
observer = {law = "disturbance_observer", corner = 200.0}
"""


def error_with(controller, reference, duration, axis=AXIS):
    record = ss.simulate(axis, controller, reference, duration, metered=False)
    error = (record["position_reference"] - record["position"])[record["event"] == 0.0]
    return math.sqrt(float(np.mean(error[: round(duration / 1e-3)] ** 2)))


def test_a_motion_that_repeats_becomes_better_over_time():
    found = ss.learn(AXIS, ROWS["PD + DOB 200"], BRISK, 0.5, repetitions=4)
    assert len(found.errors) == 4
    assert found.errors[3] < 0.3 * found.errors[0]
    assert found.errors[0] == pytest.approx(error_with(ROWS["PD + DOB 200"], BRISK, 0.5), rel=1e-6)
    assert error_with(found.controller, BRISK, 0.5) == pytest.approx(min(found.errors), rel=1e-6)
    assert found.block.law.option_of("over") == "time"
    assert "|Q (1 - L T)| is at most" in str(found)


def test_what_was_learned_over_the_angle_serves_another_motion():
    found = ss.learn(AXIS, ROWS["PD + DOB 200"], BRISK, 0.5, over="angle", repetitions=5)
    assert found.errors[4] < 0.4 * found.errors[0]
    up, down = (np.array(getattr(found.block.parameters, name)) for name in ("forward", "backward"))
    middle = slice(20, 44)
    assert up[middle] == pytest.approx(0.285, rel=0.15)  # F_C and a part of sigma2 v
    assert down[middle] == pytest.approx(-0.285, rel=0.15)
    slower = ss.Reference("sine", amplitude=0.1, frequency=1.0)
    alone = error_with(ROWS["PD + DOB 200"], slower, 1.0)
    assert error_with(found.controller, slower, 1.0) < 0.6 * alone


@pytest.mark.slow
@pytest.mark.parametrize(
    ("row", "before", "after"),
    [
        ("PD + DOB 200", (1.36089, 1.59696), 0.28445),
        ("PID + FF LuGre .9", (1.08048, 1.09760), 0.49656),
        ("PD + FF LuGre .9 + DOB 200 residual", (0.75458, 0.76879), 0.40211),
    ],
)
def test_cogging_is_learned_as_on_the_bench_of_the_reference(row, before, after):
    alone = ss.simulate(RIPPLE, ROWS[row], BENCH, 5.0, metered=False)
    error = 1e3 * (alone["position_reference"] - alone["position"])[:5000].reshape(2, 2500)
    assert np.sqrt(np.mean(error**2, axis=1)) == pytest.approx(before, rel=0.02)
    found = ss.learn(RIPPLE, ROWS[row], BENCH, 2.5, over="angle", repetitions=10)
    assert 1e3 * np.median(found.errors[5:]) == pytest.approx(after, rel=0.05)


def test_what_diverges_is_refused_in_a_line():
    with pytest.raises(InputError, match=r"at 1\d\d Hz, not below 1.*lower corner or rate") as refused:
        ss.learn(AXIS, ROWS["PD + DOB 200"], BRISK, 0.5, corner=400.0)
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"not below 1.*lower bins or rate"):
        ss.learn(AXIS, ROWS["PD + DOB 200"], BRISK, 0.5, over="angle", bins=2048)
    with pytest.raises(InputError, match=r"rate = 2\.5 converges with no filter"):
        ss.learn(AXIS, ROWS["PD + DOB 200"], BRISK, 0.5, rate=2.5)


def test_what_cannot_be_repeated_is_refused():
    step = ss.Reference("step", amplitude=0.01, tau=0.02)
    for more, said in (
        ({"over": "angle", "reference": step}, "rad from its start"),
        ({"duration": 0.50001}, "whole number of samples"),
        ({"repetitions": 0}, "repetitions = 0"),
        ({"over": "angle", "corner": 20.0}, "belong to learning over time"),
        ({"over": "speed"}, "over = 'speed' must be 'time' or 'angle'"),
        ({"controller": ROWS["PD + FF LuGre .9 + DOB 400 whole (wrong)"]}, "cancels every feedforward"),
        ({"controller": ss.Controller(ss.pd(6.0, 0.1))}, "continuous time"),
    ):
        given = {"controller": ROWS["PD + DOB 200"], "reference": BRISK, "duration": 0.5, **more}
        with pytest.raises(InputError, match=said):
            ss.learn(AXIS, **given)


def test_the_command_writes_a_controller_that_runs(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("my.toml").write_text(FILE)
    assert main(["learn", "my.toml", "--repetitions", "3", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["controller"] == "my-learned.toml"
    controller = read_controller("my-learned.toml")
    assert isinstance(controller, ss.Controller)
    axis = ss.RigidAxis(INERTIA, ss.Model("coulomb", fc=0.285, sigma2=0.018))
    assert error_with(controller, BRISK, 0.5, axis) == pytest.approx(min(said["errors"]), rel=1e-6)
    assert main(["learn", "my.toml", "--corner", "400"]) == 2


def test_a_machine_learns_at_its_own_sample_time_alone() -> None:
    gains = ss.place("PD", INERTIA, 20.0)
    with pytest.raises(InputError, match=r"sample_time = 0\.002 s, that of the machine ripple is 0\.001 s"):
        ss.learn(RIPPLE, ss.Controller(gains, sample_time=2e-3), BRISK, 0.5)
