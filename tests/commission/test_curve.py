"""The sliding curve of a commissioning, and break-away: what sticks, creeps or is coarse is not taken for either."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.commission import commission as commissioning
from stickslip.commission.curve import moving
from stickslip.core.record import Record
from stickslip.identification.presliding.breakaway import identify_breakaway
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier
from stickslip.models.model import Model
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.sliding import Sliding
from stickslip.rigs.virtual import VirtualRig

WEAK = Machine(
    "weak",
    6e-5,
    Contact(Model("lugre", sigma0=60.0, sigma1=0.02, fs=0.022, fc=0.016, vs=0.08, delta_s=1.4, sigma2=4e-4)),
    amplifier=Amplifier(0.05, 4.0, 1500.0, current_noise=0.002, monitor_noise=0.002),
    encoder=Encoder(65536.0, 1e-6, 60.0),
    limits={"torque": 0.15, "following_error": 1.0},
    seed=3,
)
"""A tenth of the thesis's friction, seen by 16 bits, and a Stribeck effect of a third."""


def test_creep_of_a_few_counts_is_no_break_away():
    course = commissioning._Course(VirtualRig(WEAK), None, lambda _: None, False)
    fs, std, resolution = commissioning._breakaway(course, WEAK.inertia, 0.016, 90.0)
    assert resolution == pytest.approx(2.0 * math.pi / 65536.0)
    assert fs == pytest.approx(0.022, rel=0.06)
    assert std < 0.02 * fs
    # A single count within the window of a velocity would be motion at the threshold for fine encoders.
    early = identify_breakaway(course.stages[0].performed.record)
    assert early["fs_positive"].value < 0.93 * fs


def test_no_sliding_torque_is_read_from_sticking_and_slipping():
    done = perform(Sliding(velocities=(1.0, 0.7, 0.5, 0.3, 0.06), inertia=WEAK.inertia), VirtualRig(WEAK))
    slid = moving(done.record, 0.022)
    assert slid.points.velocity == pytest.approx([0.3, 0.5, 0.7, 1.0])
    assert "left out with both directions: 0.06" in slid.notes[-1]
    truth = [WEAK.clutch.law.steady(v, WEAK.clutch.parameters) for v in slid.points.velocity.tolist()]
    assert slid.points.torque == pytest.approx(truth, rel=0.02)
    # Where break-away is the torque of sliding, the mean over sticking and slipping is it too.
    assert len(moving(done.record, truth[0]).points) == 5


def run_at(v, torque, standing=0.0):
    """Time, position, torque and velocity asked for: it stands a part of the time, and catches up."""
    t = np.arange(0.0, 7.0 / abs(v), min(0.02, 0.002 / abs(v)))
    phase = np.mod(t, t[-1] / 10.0) / (t[-1] / 10.0)
    late = np.where(phase < standing, phase, standing * (1.0 - phase) / (1.0 - standing))
    return t, v * (t - late * t[-1] / 10.0), np.full(t.size, torque), np.full(t.size, v)


def test_a_speed_that_sticks_in_one_direction_is_left_out_with_both():
    rows, time, place = [], 0.0, 0.0
    for v in (2.0, 1.0, 0.5, 0.3, 0.2, 0.1):
        for side, friction in ((1.0, 0.12), (-1.0, -0.08)):
            t, x, torque, speed = run_at(side * v, friction, 0.05 if side * v == -0.1 else 0.0)
            rows.append((time + t, place + x, torque, speed))
            time, place = time + t[-1] + 1.0, place + x[-1]
    t, x, torque, speed = (np.concatenate(c) for c in zip(*rows, strict=True))
    channels = {"position": x, "motor_torque": torque, "velocity_reference": speed}
    record = Record(t, channels, {"position": "rad", "motor_torque": "N·m", "velocity_reference": "rad/s"})
    slid = moving(record, 0.2)
    assert slid.points.velocity == pytest.approx([0.2, 0.3, 0.5, 1.0, 2.0])
    assert slid.points.torque == pytest.approx(np.full(5, 0.1))
    assert len(slid.segments) == 10
    assert "left out with both directions: 0.1 rad/s" in slid.notes[-1]
    # A speed with one direction only has no mean of both.
    once = (speed != -0.5) & (speed != -0.1)
    half = moving(Record(t[once], {k: c[once] for k, c in channels.items()}, record.units), 0.2)
    assert half.points.velocity == pytest.approx([0.2, 0.3, 1.0, 2.0])
    assert "one direction only, left out: 0.1, 0.5 rad/s" in half.notes[-1]


@pytest.mark.parametrize("counts", [1e6, 2048.0])
def test_a_coarse_count_is_no_rest(counts):
    law = Model("lugre", sigma0=300.0, sigma1=0.3, fs=0.22, fc=0.16, vs=0.03, delta_s=1.4, sigma2=4e-3)
    m = Machine("coarse", 1e-3, Contact(law), encoder=Encoder(counts), seed=3)
    done = perform(Sliding(velocities=(1.0, 0.5, 0.3, 0.1), inertia=1e-3), VirtualRig(m))
    assert not [c.text for c in done.checks if "sticks" in c.text]
    slid = moving(done.record, 0.22, 2.0 * math.pi / counts)
    assert slid.points.velocity == pytest.approx([0.1, 0.3, 0.5, 1.0])
    assert len(slid.notes) == 1
