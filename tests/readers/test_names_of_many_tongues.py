"""Names that drives' tools write in other languages, and what is said where none is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.readers import Drive, read
from stickslip.readers._names import role_of
from stickslip.readers._units import parse_unit

NAMES = {
    "Momentistwert [%]": "motor_torque", "Motormoment": "motor_torque", "Schlittenposition [mm]": "position",
    "M_soll[Nm]": "motor_torque", "Temps (ms)": "time", "Couple réel (%)": "motor_torque",
    "Vitesse réelle (mm/s)": "velocity", "Tempo [s]": "time", "Posizione [mm]": "position",
    "Spindelposition [mm]": "position", "Vorschubkraft (N)": "motor_torque", "Reibmoment [Nm]": "friction_torque",
    "Droop pulses [pulse]": "position_error", "Cumulative feedback pulses [pulse]": "position",
    "Feedback pulse counter[encoder pulse]": "position", "PL.FB (Counts16Bit)": "position",
    "Torque actual [% In]": "motor_torque", "actual_qd_0": "velocity", "target_qd_0": "velocity_reference",
    "I nominal [A]": "current_reference",
    "Velocità [giri/min]": "velocity", "Coppia [Nm]": "motor_torque", "Position réelle (mm)": "position",
}  # fmt: skip


@pytest.mark.parametrize(("name", "role"), NAMES.items(), ids=NAMES)
def test_what_a_name_says(name, role):
    assert role_of(name).role == role


UNITS = {
    "torque_nm": "Nm", "motor_torque_mnm": "mNm", "TORQUE_NM": "Nm", "Torque [mnm]": "mNm", "force_kn": "kN",
    "current_ma": "mA", "position_nm": "nm", "vel_rad_per_s": "rad/s", "velocityRpm": "rpm", "TimeMs": "ms",
    "torque_Nm_filtered": "Nm", "pos_deg_act": "deg", "q_deg_2": "deg", "torque_act [% In]": "% In",
    "motorTorqueNm": "Nm", "actPosDeg": "deg", "speedRadPerSec": "rad/sec", "current_a": "", "torqueMin": "",
}  # fmt: skip


@pytest.mark.parametrize(("name", "unit"), UNITS.items(), ids=UNITS)
def test_a_unit_in_a_name_of_one_case_is_the_units_of_such_a_quantity(name: str, unit: str) -> None:
    """`torque_nm` was a torque in nanometres, and therefore none; milliamperes were taken as amperes."""
    assert role_of(name).role
    assert role_of(name).unit == unit


def test_a_unit_of_one_case_is_taken_from_a_row_of_units_and_from_a_map(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = "".join(f"{k},{k},{k}\n" for k in range(1, 10))
    path.write_text(f"time,position,torque\nms,deg,MNM\n{rows}")
    assert read(path)["motor_torque"][0] == pytest.approx(1e-3)
    path.write_text(f"time_ms,position_deg,x7\n{rows}")
    assert read(path, {"motor_torque": "x7:ncm"})["motor_torque"][0] == pytest.approx(1e-2)


def test_a_measured_torque_goes_before_a_commanded_one(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t [s],q [rad],M_soll[Nm],M_ist[Nm]\n" + "".join(f"{k},{k},5,{k}\n" for k in range(9)))
    assert read(path)["motor_torque"][3] == 3.0


def test_giri_are_turns():
    unit = parse_unit("giri/min")
    assert unit is not None
    assert unit.factor == pytest.approx(2.0 * np.pi / 60.0)


def test_unused_columns_with_a_unit_of_torque_are_named():
    """The message did not say which column might hold it."""
    t = np.arange(400) * 1e-3
    said = str(ss.doctor({"time [s]": t, "q [rad]": np.sin(9.0 * t), "Kanal 7 [%]": t, "Kanal 8 [V]": t}))
    assert "(not used, with a unit that may say it: 'Kanal 7 [%]')" in said


def test_the_velocity_of_cia_402_is_in_counts_where_its_position_is(tmp_path):
    """0x606C was taken in rad/s beside a position in counts."""
    path = tmp_path / "log.csv"
    rows = "".join(f"{k},{4096 * k},{4096000 + k % 2}\n" for k in range(30))
    path.write_text("t_ms,0x6064:00 Position actual value,0x606C:00 Velocity actual value\n" + rows)
    record = read(path, drive=Drive(counts_per_rev=4096))
    assert record["position"][1] == pytest.approx(2.0 * np.pi)
    assert record["velocity"][0] == pytest.approx(2.0 * np.pi * 1e3)
