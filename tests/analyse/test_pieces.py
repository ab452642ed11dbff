"""Records of procedures, taken apart into runs."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stickslip.analyse.dependence import dependence
from stickslip.analyse.motor_vs_sensor import sides
from stickslip.analyse.repeatability import repeatability
from stickslip.analyse.split_runs import pieces
from stickslip.cli import main
from stickslip.machines.files import machine
from stickslip.report.analysis_pictures import draw_analysis, picture_of_dependence
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.repeat import Repeat
from stickslip.rigs.procedures.sliding import Sliding
from stickslip.rigs.virtual import VirtualRig

GREASE = machine("thesis-grease")


def test_a_sliding_record_is_a_run_per_velocity_and_direction(tmp_path):
    record = perform(Sliding(velocities=(3.0, 1.5, 1.5), rest=900.0), VirtualRig(GREASE)).record
    runs = dict.fromkeys(name for name, _ in pieces("slide", record))
    assert list(runs) == ["slide +3 rad/s", "slide -3 rad/s", "slide +1.5 rad/s", "slide -1.5 rad/s"]
    parts = pieces("slide", record)
    assert len(parts) == 6
    assert all(len(set(np.sign(part["velocity_reference"]))) == 1 for _, part in parts)
    # What the bearings between motor and sensor take is what the machine has.
    found = sides({f"{i} {name}": part for i, (name, part) in enumerate(parts)})
    assert found.coulomb == pytest.approx(GREASE.contact.bearings.coulomb, rel=0.1)
    # Half an hour apart the level has changed, the shape has not (figure 4.32); both sides in one picture.
    later = dict(zip("ab", (parts[2][1], parts[4][1]), strict=True))
    over = dependence(later, "sensor_torque")
    assert over.alike > 0.98
    assert over.drift > 0.005
    both = dependence(later, "motor_torque", "sensor_torque")
    assert {p.name for p in both.passes} == {"a, motor", "a, sensor", "b, motor", "b, sensor"}
    draw_analysis(picture_of_dependence(both), tmp_path / "both.png")


def test_a_repeat_is_its_repetitions():
    record = perform(
        Repeat(times=3, interval=60.0, bandwidth=10.0, damping=0.85, duration=1.0), VirtualRig(GREASE)
    ).record
    parts = pieces("PID", record)
    assert [name for name, _ in parts] == ["PID 1", "PID 2", "PID 3"]
    found = repeatability({"PID": [part for _, part in parts]})
    assert found[0].runs.shape[0] == 3


def test_the_repeatability_of_the_thesis_by_command(tmp_path, capsys):
    """Section 4.4: with the positions at which the runs start counted as spread, it was 1.64 mrad."""
    file = tmp_path / "PID.npz"
    settings = ["--set", "bandwidth=10", "--set", "damping=0.85"]
    assert main(["rig", "run", "repeat", "--rig", "thesis-grease", *settings, "--out", str(file)]) == 0
    capsys.readouterr()
    assert main(["analyse", "repeatability", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rms_spread"] == pytest.approx(0.45e-3, rel=0.02)
    assert found["range_of_starts"] == pytest.approx(3.96e-3, rel=0.01)


def test_figure_4_32_by_command(tmp_path, capsys):
    """With both directions in one range, the change over an hour was 5.0 %."""
    file = tmp_path / "later.npz"
    settings = ["--set", "velocities=0.3,0.3,0.3", "--set", "rest=1800"]
    assert main(["rig", "run", "sliding", "--rig", "thesis-grease", *settings, "--out", str(file)]) == 0
    capsys.readouterr()
    assert main(["analyse", "position", str(file), "--channel", "sensor_torque", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["drift"] == pytest.approx(0.0203, abs=5e-4)
    means = np.array([one["mean"] for one in found["passes"]]).reshape(3, 2)
    assert found["drift"] == pytest.approx(np.max(np.ptp(means, axis=0) / np.mean(means, axis=0)), rel=1e-6)


def test_other_records_stay_whole():
    record = perform(Repeat(times=2, interval=30.0, duration=0.5), VirtualRig(GREASE)).record
    plain = type(record)(record.time, record.channels, record.units)
    assert pieces("any", plain) == [("any", plain)]
