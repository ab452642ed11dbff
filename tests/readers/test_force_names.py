"""Columns of forces: the motor's, a sensor's, and the normal force."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import stickslip as ss
from stickslip import Record

TIME = np.arange(400) * 1e-3
MOTION = np.sin(9.0 * TIME)


def read(position: str, *forces: str) -> Record:
    columns = {"time [s]": TIME, position: MOTION}
    return ss.read(pd.DataFrame(columns | {name: 20.0 * np.cos(9.0 * TIME) for name in forces}))


@pytest.mark.parametrize(
    "name",
    [
        "F_motor [N]", "F [N]", "F_N", "F_act_N", "Fm [N]", "F_ref [N]", "Motorkraft [N]", "motor force [N]",
        "Force (N)",
    ],
)  # fmt: skip
def test_the_motor_s_force_of_an_axis_along_a_line(name):
    assert read("x_act [mm]", name).units["motor_torque"] == "N"


def test_what_is_measured_is_taken_before_a_command():
    record = read("x [mm]", "F_cmd [N]", "F_act [N]")
    taken = {c["channel"]: c["column"] for c in record.meta["reading"]["columns"]}
    assert taken["motor_torque"] == "F_act [N]"


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("sensor_force [N]", "sensor_torque"),
        ("force sensor [N]", "sensor_torque"),
        ("load cell [N]", "load"),
        ("normal force [N]", "load"),
        ("F_normal [N]", "load"),
        ("Normalkraft [N]", "load"),
        ("friction force [N]", "friction_torque"),
        ("F_N [N]", None),
        ("Fx [N]", None),
        ("F", None),
    ],
)
def test_another_force_is_not_the_motor_s(name, channel):
    assert set(read("x [mm]", name).channels) == {"position"} | ({channel} if channel else set())


def test_a_sensor_of_the_motor_s_torque_is_the_motor_s():
    assert set(read("q [deg]", "sensor_torque_motor [Nm]").channels) == {"position", "motor_torque"}


def test_a_force_by_its_symbol_alone_is_no_motor_s_where_the_axis_turns():
    assert "motor_torque" not in read("q [deg]", "F_N").channels
    both = read("x [mm]", "F_N", "motor force [N]")
    assert {c["column"] for c in both.meta["reading"]["columns"]} == {"time [s]", "x [mm]", "motor force [N]"}


def test_that_a_normal_force_may_be_meant_is_said():
    said = ss.doctor(pd.DataFrame({"time [s]": TIME, "x [mm]": MOTION, "F_N": 20.0 * MOTION}))
    assert 'it may be a normal force; if it is, say map={"torque": "none", "load": "F_N:N"}' in str(said)


@pytest.mark.parametrize(("position", "unit"), [("x [mm]", "N"), ("q [deg]", "Nm")])
def test_the_doctor_offers_the_unit_of_the_axis(position, unit):
    said = ss.doctor(pd.DataFrame({"time [s]": TIME, position: MOTION, "Fx [N]": MOTION}))
    assert f'map={{"torque": "COLUMN:{unit}"}}' in str(said)
