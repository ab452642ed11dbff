"""The angle at which a pendulum hangs: near where it moved, whatever the record counts from."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import Model
from stickslip.identification.axis import identify_axis
from stickslip.identification.estimate import Estimate
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.gravity import hanging, nearest, within_a_turn
from stickslip.identification.sliding import estimate_sliding
from stickslip.machines.contact import Contact
from stickslip.machines.motor import Harmonics
from stickslip.machines.servo import ServoAxis
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

SWING = np.linspace(-1.2, 1.2, 50)


@pytest.mark.parametrize("middle", [0.0, math.pi, -math.pi, 2.0 * math.pi, 11.0])
@pytest.mark.parametrize("off", [-0.05, 0.05])
def test_the_angle_does_not_jump_where_atan2_does(middle, off):
    wanted = middle + off
    size, angle = hanging(2.0 * math.cos(wanted), -2.0 * math.sin(wanted), middle + SWING)
    assert size == pytest.approx(2.0)
    assert angle == pytest.approx(wanted)


def test_an_axis_that_turns_many_times_has_an_angle_of_the_first_turn():
    assert abs(nearest(5.0, np.linspace(0.0, 100.0, 9))) <= math.pi


def test_an_interval_wider_than_a_turn_tells_nothing():
    e = Estimate("gravity_angle", "rad", "q_0", 0.3, 1e6, -2e6, 2e6, False, "too wide")
    (told,) = within_a_turn([e], SWING)
    assert (told.lower, told.upper) == pytest.approx((0.3 - math.pi, 0.3 + math.pi))
    assert not told.identified
    other = Estimate("offset", "N·m", "T_0", 0.3, 1e6, -2e6, 2e6, False, "too wide")
    assert within_a_turn([other], SWING) == (other,)


def test_an_arm_that_hangs_at_half_a_turn():
    """Hanging at pi + 0.04 is -pi + 0.04 to atan2; the interval belongs to the value said."""
    time = np.arange(0.0, 3.0, 2e-3)
    reference = math.pi + np.sin(3.0 * time) + 0.4 * np.sin(11.0 * time)
    drive = Drive(time, reference, "feedback", Loop(kp=8.0, kd=0.08), start=(math.pi, 0.0), max_step=5e-4)
    mechanics = Mechanics(2e-3, gravity=0.3, gravity_angle=math.pi + 0.04)
    out = drive_axis(mechanics, Model("coulomb", fc=0.2, sigma2=0.02), drive)
    noisy = out[:, 2] + 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    experiment = Experiment("arm", time, out[:, 0], noisy)
    found = identify_axis([experiment], ServoAxis(drive_side="load", gravity="pendulum"), ["coulomb"])
    angle = next(e for e in found.estimates if e.name == "gravity_angle")
    assert angle.value == pytest.approx(math.pi + 0.04, abs=0.03)
    assert angle.lower < angle.value < angle.upper
    assert found.details["mechanics"].gravity_angle == pytest.approx(angle.value)


@pytest.mark.parametrize("swing", [1.5, 1.6])
def test_over_half_a_turn_a_weight_is_no_torque_of_other_orders(swing):
    """Another program's log of a joint: a constant, orders 2, 3, 4 ... of a turn passed for the weight, 14 N·m
    [0, 755]."""
    time = np.arange(0.0, 20.0, 2e-3)
    slow, fast = 2.0 * math.pi * 0.1, 2.0 * math.pi * 1.3
    position = swing * (1.0 - np.cos(slow * time)) + 0.05 * (1.0 - np.cos(fast * time))
    velocity = swing * slow * np.sin(slow * time) + 0.05 * fast * np.sin(fast * time)
    acceleration = np.gradient(velocity, 2e-3)
    friction = 6.3 * np.sign(velocity) + 7.0 * velocity
    torque = 0.79 * acceleration + friction + 14.0 * np.sin(position + 0.35)
    noisy = torque + 0.05 * np.random.default_rng(1).standard_normal(time.size)
    found = estimate_sliding(
        [Experiment("joint", time, position, noisy)], ServoAxis(drive_side="load", gravity="pendulum")
    )
    sine, cosine = found.numbers["gravity_sin"], found.numbers["gravity_cos"]
    assert math.hypot(sine.value, cosine.value) == pytest.approx(14.0, rel=0.02)
    assert max(sine.std, cosine.std) < 0.5
    assert found.interval("fc")[0] < 6.3 < found.interval("fc")[1]


def test_an_identified_pendulum_is_simulated_as_the_machine_that_its_note_names():
    """Cogging of order 1 is gravity, exactly; `axis` has neither, and says so."""
    time = np.arange(0.0, 6.0, 1e-3)
    reference = 1.2 * np.sin(1.5 * time) + 0.4 * np.sin(5.0 * time)
    drive = Drive(time, reference, "feedback", Loop(kp=8.0, kd=0.3), max_step=5e-4)
    law = Model("coulomb", fc=0.2, sigma2=0.02)
    out = drive_axis(Mechanics(2e-2, gravity=0.6, gravity_angle=0.4), law, drive)
    record = {"t": time, "position": out[:, 0], "torque": out[:, 2]}
    found = ss.identify(**record, law="coulomb", pendulum=True)
    (note,) = [n for n in found.notes if "neither gravity nor offset" in n]
    amplitude, phase = (float(note.split(name)[1].split()[0]) for name in ("amplitude ", "phase "))
    assert note in str(found)
    assert (amplitude, phase) == pytest.approx((0.6, 0.5 * math.pi - 0.4), abs=0.01)
    upright = drive_axis(Mechanics(2e-2), law, drive)
    none = ss.identify(t=time, position=upright[:, 0], torque=upright[:, 2], law="coulomb", pendulum=True)
    assert not [n for n in none.notes if "cogging of order 1" in n]
    plain = ss.identify(**record, law="coulomb")
    assert not [n for n in plain.notes if "neither gravity" in n]

    def left(gravity: Harmonics) -> float:
        arm = ss.Machine("arm", 2e-2, Contact(law), cogging=gravity, sample_time=1e-3)
        loop = ss.Controller(ss.Gains(kp=8.0, ki=0.0, kd=0.3, kr=0.0), sample_time=1e-3)
        run = ss.simulate(arm, loop, ss.Reference.table(time, reference), 5.9)
        rows = time < 5.9
        return float(np.std(np.interp(time[rows], run.time, run["position"]) - out[rows, 0]))

    assert left(Harmonics((1.0,), (0.6,), (0.5 * math.pi - 0.4,))) < 1e-6
    assert left(Harmonics()) > 0.04


def test_a_pendulum_behind_a_gear_is_the_loads():
    """A motor's angle under a pendulum at the load: gravity came out as a two-thousandth, under a note alone."""
    ratio, time = 80.0, np.arange(0.0, 10.0, 1e-3)
    angle = 1.5 * np.sin(0.9 * time) + 0.3 * np.sin(4.0 * time)
    speed, acceleration = np.gradient(angle, time), np.gradient(np.gradient(angle, time), time)
    torque = 0.8 * acceleration + 5.0 * np.tanh(speed / 1e-3) + 7.0 * speed + 14.0 * np.sin(angle - 0.4)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    log = {"t": time, "position": ratio * angle, "torque": torque / ratio + noise}
    told: list[str] = []
    found = ss.identify(**log, law="coulomb", pendulum=True, gear_ratio=ratio, tell=told.append)
    (warned,) = [f for f in found.findings if f.code == "gear-ratio"]
    assert warned.level == "warning"
    assert 'a pendulum is fitted once a turn of the motor; give side="load"' in warned.line()
    assert any(warned.line() in line for line in told)
    assert 'a pendulum is fitted once a turn of the motor; give side="load"' in str(found)
    asked = ss.doctor(**log, gear_ratio=ratio)
    assert [f.code for f in asked.warnings] == ["gear-ratio"]
    assert "0.17" in asked.warnings[0].message
    assert "once a turn of the load" in asked.warnings[0].message
    assert 'give side="load"' in str(asked)
    at_load = {**log, "gear_ratio": ratio, "side": "load"}
    assert [f.code for f in ss.doctor(**at_load).warnings] == ["gravity"]
    good = ss.identify(**at_load, law="coulomb", pendulum=True)
    assert "gear-ratio" not in {f.code for f in good.findings}
    assert good.parameters["gravity"].value == pytest.approx(14.0, rel=0.02)
    assert good.parameters["gravity"].identified
