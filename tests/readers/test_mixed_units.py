"""Lengths beside torques: the reader asks for the lead, and with it makes forces of torques."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.messages import render
from stickslip.readers import Drive, read
from stickslip.readers.profiles import Profile, merged

LEAD = 0.005
T = np.arange(200) * 1e-3
Q, V, TORQUE = 1e-2 * np.sin(9.0 * T), 9e-2 * np.cos(9.0 * T), 0.7 * np.cos(9.0 * T)


def written(path: Path, head: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.stack([T, *columns], axis=1), "%.12g", ",", header=head, comments="")
    return path


def test_a_length_beside_a_torque_asks_for_the_lead(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "time [s],position [mm],motor_torque [Nm]", 1e3 * Q, TORQUE)
    with pytest.raises(
        InputError, match=r"position 'position .mm.' in mm with motor_torque .* give lead=METRES"
    ):
        read(path)
    for verb in ("doctor", "identify"):
        assert main([verb, str(path)]) == 2
        streams = capsys.readouterr()
        assert "give --lead MM" in streams.out + streams.err
    assert main(["doctor", str(path), "--lead", "5"]) == 0
    assert "5 mm a revolution" in capsys.readouterr().out
    assert main(["doctor", str(path)]) == 0, "the lead is kept in the profile"


def test_the_lead_makes_forces_of_torques(tmp_path):
    path = written(tmp_path / "log.csv", "time [s],position [mm],motor_torque [Nm]", 1e3 * Q, TORQUE)
    for drive, way in ((Drive(lead=LEAD), LEAD), (Drive(lead=LEAD, gear_ratio=4.0), LEAD / 4.0)):
        record = read(path, drive=drive)
        assert record.units == {"position": "m", "motor_torque": "N"}
        assert record["position"] == pytest.approx(Q)
        assert record["motor_torque"] == pytest.approx(TORQUE * 2.0 * math.pi / way)


def test_turns_become_ways_where_the_force_is_known(tmp_path):
    angle, rpm = Q * 360.0 / LEAD, V * 60.0 / LEAD
    head = "time [s],position [deg],velocity [rpm],motor_torque [N]"
    path = written(tmp_path / "log.csv", head, angle, rpm, TORQUE)
    record = read(path, drive=Drive(lead=LEAD))
    assert record.units == {"position": "m", "velocity": "m/s", "motor_torque": "N"}
    assert record["position"] == pytest.approx(Q)
    assert record["velocity"] == pytest.approx(V)
    assert record["motor_torque"] == pytest.approx(TORQUE)


def test_the_torque_constant_of_a_screw_drive(tmp_path):
    path = written(tmp_path / "log.csv", "time [s],position [mm],current [A]", 1e3 * Q, TORQUE)
    linear = read(path, drive=Drive(torque_constant=2.0))
    assert "N/A" in linear.meta["derived"]["motor_torque"]
    said = [render(f["message"]) for f in linear.meta["reading"]["findings"] if f["code"] == "mixed-units"]
    assert said == ["the axis moves along a line: torque_constant=2 was taken in N/A"]
    motor = read(path, drive=Drive(force_constant=2.0))
    assert motor["motor_torque"] == pytest.approx(2.0 * TORQUE)
    assert motor.units["motor_torque"] == "N"
    assert not [f for f in motor.meta["reading"]["findings"] if f["code"] == "mixed-units"]
    screw = read(path, drive=Drive(torque_constant=2.0, lead=LEAD))
    assert screw["motor_torque"] == pytest.approx(2.0 * TORQUE * 2.0 * math.pi / LEAD)
    assert screw.units["motor_torque"] == "N"
    assert not [f for f in screw.meta["reading"]["findings"] if f["code"] == "mixed-units"]


def test_a_share_of_the_rated_torque_of_a_screw_drive(tmp_path):
    path = written(tmp_path / "log.csv", "time [s],position [mm],torque [%]", 1e3 * Q, 100.0 * TORQUE)
    record = read(path, drive=Drive(rated_torque=3.0, lead=LEAD))
    assert record["motor_torque"] == pytest.approx(3.0 * TORQUE * 2.0 * math.pi / LEAD)


def test_a_share_of_a_rated_torque_beside_millimetres_asks_for_the_lead(tmp_path, capsys):
    """It was taken in newtons: 0.31 kg for 395, identified, without a word."""
    path = written(tmp_path / "log.csv", "time [s],position [mm],torque [%]", 1e3 * Q, 100.0 * TORQUE)
    assert main(["doctor", str(path), "--rated-torque", "3"]) == 2
    said = capsys.readouterr().out
    assert "mixed-units" in said
    assert "--lead MM" in said
    assert "--map 'motor_torque=torque [%]:0.03N'" in said
    force = read(path, {"motor_torque": "torque [%]:0.03N"})
    assert force["motor_torque"] == pytest.approx(3.0 * TORQUE)
    assert force.units["motor_torque"] == "N"


def test_a_rated_torque_that_no_unit_asks_for_is_not_passed_over(tmp_path):
    """Percents without a unit were taken as N·m beside --rated-torque: every number 42 times too large."""
    path = written(tmp_path / "log.csv", "time [s],position [rad],torque", Q, 100.0 * TORQUE)
    (found,) = ss.doctor(path, rated_torque=3.0).errors
    assert found.code == "torque-unit"
    assert 'map={"motor_torque": "torque:percent"} (or permille)' in found.remedy
    stated = written(tmp_path / "nm.csv", "time [s],position [rad],torque [Nm]", Q, TORQUE)
    found = ss.doctor(stated, rated_torque=3.0, lead=LEAD)
    assert {"rated-torque", "lead"} <= {f.code for f in found.findings}
    assert not found.errors
    assert not [f for f in ss.doctor(stated).findings if f.code in ("rated-torque", "lead")]


def test_a_lead_in_millimetres_where_metres_are_asked_is_refused():
    with pytest.raises(
        InputError, match=r"lead = 40 m a revolution .* \(0\.04 for 40 mm\), on the command line"
    ):
        Drive(lead=40.0)
    assert Drive(lead=0.04).lead == 0.04
    for screw in (2.0, 5.0, 10.0):
        with pytest.raises(InputError, match="on the command line"):
            Drive(lead=screw)


@pytest.mark.parametrize("lead", ["0", "-3", "nan", "inf"])
def test_a_lead_that_is_none(tmp_path, capsys, lead):
    path = written(tmp_path / "log.csv", "time [s],position [mm],motor_torque [Nm]", 1e3 * Q, TORQUE)
    assert main(["doctor", str(path), "--lead", lead]) == 2
    assert "lead" in capsys.readouterr().err


def test_a_linear_motors_constant_is_no_screws_and_no_turning_motors(tmp_path):
    for beside in ({"lead": LEAD}, {"torque_constant": 2.0}, {"gear_ratio": 5.0, "side": "load"}):
        with pytest.raises(InputError, match=r"force_constant = 3 N/A is a linear motor's.*give one of them"):
            Drive(force_constant=3.0, **beside)
    path = written(tmp_path / "log.csv", "time [s],position [deg],current [A]", Q, TORQUE)
    with pytest.raises(InputError, match="positions are angles; give torque_constant"):
        read(path, drive=Drive(force_constant=3.0))


@pytest.mark.parametrize(
    ("kept", "said", "left"),
    [
        ({"torque_constant": 2.0, "gear_ratio": 5.0}, {"force_constant": 3.0}, {"force_constant": 3.0}),
        ({"lead": LEAD, "rated_current": 4.0}, {"force_constant": 3.0}, {"force_constant": 3.0, "rated_current": 4.0}),
        ({"force_constant": 3.0}, {"lead": LEAD}, {"lead": LEAD}),
        ({"force_constant": 3.0}, {"torque_constant": 2.0}, {"torque_constant": 2.0}),
        ({"force_constant": 3.0}, {"gear_ratio": 5.0}, {"gear_ratio": 5.0}),
        ({"force_constant": 3.0}, {"rated_current": 4.0}, {"force_constant": 3.0, "rated_current": 4.0}),
        ({"lead": LEAD}, {"torque_constant": 2.0}, {"lead": LEAD, "torque_constant": 2.0}),
    ],
)  # fmt: skip
def test_what_is_said_of_one_motor_takes_the_place_of_what_a_profile_says_of_the_other(kept, said, left):
    """One option given ended in "give one of them", since the profile had the other."""
    assert merged([], Drive(**said), None, Profile({}, Drive(**kept))).drive == Drive(**left)
