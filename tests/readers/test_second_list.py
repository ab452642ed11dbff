"""Files of drives, robots and instruments: every channel holds the values of its column, in its unit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.readers import Drive, read

T = np.arange(500) * 0.004
Q = 2.5 * np.sin(3.0 * T)
W = 7.5 * np.cos(3.0 * T)
TORQUE = 0.12 * np.tanh(W / 0.02) - 0.05 * np.sin(3.0 * T)


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))


def write(
    name: str, head: str, *columns: np.ndarray, sep: str = ",", end: str = "", form: str = ".10g"
) -> str:
    rows = [sep.join(format(x, form) for x in row) + end for row in zip(*columns)]
    Path(name).write_text("\n".join([head, *rows]) + "\n")
    return name


def holds(record, **channels: np.ndarray) -> None:
    assert np.allclose(record.time - record.time[0], T, atol=1e-6)
    for name, values in channels.items():
        assert np.allclose(record.channels[name], values, atol=1e-5), name


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(("sep", "quote"), [(" ", '"'), (",", ""), (";", "")])
def test_row_numbers_without_a_name_shift_no_column(first, sep, quote):
    names = sep.join(f"{quote}{n}{quote}" for n in ("time_s", "q_rad", "v_rad_s", "tau_Nm"))
    record = read(write("log.txt", names, first + np.arange(T.size), T, Q, W, TORQUE, sep=sep))
    holds(record, position=Q, velocity=W, motor_torque=TORQUE)
    assert "row-numbers" in [f["code"] for f in record.meta["reading"]["findings"]]


def test_a_name_too_few_is_refused():
    name = write("log.csv", "time [s],position [rad],torque [Nm]", T, Q, W, TORQUE)
    with pytest.raises(InputError, match=r"has 3 cells, the rows below have 4; add the name"):
        read(name)


def test_a_separator_at_the_end_of_the_rows_shifts_nothing():
    name = write("log.csv", "time [s],position [rad],torque [Nm]", T, Q, TORQUE, end=",")
    holds(read(name), position=Q, motor_torque=TORQUE)


def test_the_torque_of_a_robot_state_goes_before_its_command():
    signals = ("state.q", "state.dq", "state.tau_J", "cmd.tau_J_d")
    head = ",".join(["time", *(f"{signal}[{i}]" for signal in signals for i in (0, 1))])
    name = write("franka.csv", head, T, 0 * T, Q, 0 * T, W, 0 * T, TORQUE, 1 + 0 * T, 2 + 0 * T)
    holds(read(name, ["position=state.q[1]"]), position=Q, velocity=W, motor_torque=TORQUE)


def test_the_torque_of_actuators_in_mujoco():
    np.savez(
        "log.npz", time=T, qpos=np.c_[0 * T, Q], qvel=np.c_[0 * T, W], qfrc_actuator=np.c_[0 * T, TORQUE]
    )
    holds(read("log.npz", ["position=qpos[1]"]), position=Q, velocity=W, motor_torque=TORQUE)


def test_motors_in_a_list_within_each_sample():
    rows = [
        {"t": t, "motor": [{"q": 0.0, "dq": 0.0, "tauEst": 0.0}, {"q": q, "dq": w, "tauEst": m}]}
        for t, q, w, m in zip(T, Q, W, TORQUE)
    ]
    Path("log.jsonl").write_text("\n".join(map(json.dumps, rows)))
    holds(read("log.jsonl", ["position=motor[1].q"]), position=Q, velocity=W, motor_torque=TORQUE)


def test_two_columns_of_nanoseconds_since_1970():
    stamps = [str(1_700_000_000_000_000_000 + round(1e9 * t)) for t in T]
    head = "%time,field.header.seq,field.header.stamp,field.position0,field.velocity0,field.effort0"
    rows = [f"{s},{i},{s},{q},{w},{m}" for i, (s, q, w, m) in enumerate(zip(stamps, Q, W, TORQUE))]
    Path("topic.csv").write_text("\n".join([head, *rows]))
    holds(read("topic.csv"), position=Q, velocity=W, motor_torque=TORQUE)


def test_a_column_of_dates_is_the_time_whatever_its_name():
    rows = [f"2024-01-16T10:11:{12 + t:09.6f}Z,{q},{m}" for t, q, m in zip(T, Q, TORQUE)]
    Path("log.csv").write_text("\n".join(["UTC,axis position (rad),torque (Nm)", *rows]))
    holds(read("log.csv"), position=Q, motor_torque=TORQUE)


def test_labelled_values_of_a_serial_plotter():
    rows = [f"angle:{q:.6f}, speed:{w:.6f}, torque:{m:.6f}" for q, w, m in zip(Q, W, TORQUE)]
    Path("log.txt").write_text("\n".join([rows[0][9:], *rows[1:]]))
    record = read("log.txt", sample_time=0.004)
    assert np.allclose(record.channels["position"], Q[1:], atol=1e-5)
    assert np.allclose(record.channels["motor_torque"], TORQUE[1:], atol=1e-5)


def test_a_row_of_units_with_the_increment_of_an_oscilloscope():
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e+00,4.000000e-03"
    name = write("scope.csv", head, np.arange(T.size), W / 10.0, TORQUE, end=",,")
    holds(read(name, ["velocity=CH1:10 rad/s", "torque=CH2:Nm"]), velocity=W, motor_torque=TORQUE)


@pytest.mark.parametrize(
    ("position", "velocity", "torque"),
    [
        ("axis0.encoder.pos_estimate", "axis0.encoder.vel_estimate", "torque [Nm]"),
        ("servo_stats.position", "servo_stats.velocity", "servo_stats.torque_Nm"),
        ("Position (rot) {TalonFX-1}", "Velocity (rps) {TalonFX-1}", "torque [Nm]"),
    ],
)
def test_tools_that_count_revolutions(position, velocity, torque):
    name = write(
        "log.csv", f"time [s],{position},{velocity},{torque}", T, Q / 2 / np.pi, W / 2 / np.pi, TORQUE
    )
    holds(read(name), position=Q, velocity=W, motor_torque=TORQUE)


def test_parameters_of_a_drive_have_its_units():
    name = write(
        "log.csv", "time [ms];Drive_1.r61[0];Drive_1.r80[0]", 1e3 * T, W * 30 / np.pi, TORQUE, sep=";"
    )
    holds(read(name), velocity=W, motor_torque=TORQUE)


def test_counts_a_millisecond_and_parts_of_a_thousand():
    turn = 65536 / 2 / np.pi
    head = "Time(sec)\tActual Position(cts)\tActual Velocity(cts/msec)\tTorque actual value [per thousand]"
    name = write("log.txt", head, T, Q * turn, W * turn / 1e3, TORQUE / 2 * 1e3, sep="\t")
    record = read(name, drive=Drive(counts_per_rev=65536, rated_torque=2.0))
    holds(record, position=Q, velocity=W, motor_torque=TORQUE)


def test_units_of_the_user_are_asked_for(capsys):
    head = "Time (sec),Position Feedback (X) (Units),Velocity Feedback (X) (Units/sec),Torque (Nm)"
    name = write("log.csv", head, T, np.degrees(Q), np.degrees(W), TORQUE)
    assert main(["doctor", name]) == 2
    assert "'Units', which is none that is known" in capsys.readouterr().out


def test_a_table_of_steady_points_with_a_position_says_what_to_do(capsys):
    speed = np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])
    torque = 0.3 * np.sign(speed) + 0.1 * speed
    name = write("log.csv", "position [rad],speed [rad/s],torque [Nm]", 0 * speed + 1.0, speed, torque)
    assert main(["identify", name, "--method", "sliding", "--out", "out"]) == 2
    assert "--map position=none" in capsys.readouterr().err
    assert main(["identify", name, "--method", "sliding", "--out", "out", "--map", "position=none"]) == 0


def test_a_column_of_deviations_is_no_torque():
    name = write("log.csv", "time_s,q_rad,tau_Nm,std_Nm", T, Q, TORQUE, 0.01 + 0 * T)
    holds(read(name), position=Q, motor_torque=TORQUE)


def test_a_time_stamp_in_seconds_and_nanoseconds():
    head = "header.stamp.sec,header.stamp.nanosec,position,velocity,effort"
    name = write("topic.csv", head, 1_700_000_000 + T // 1, np.round(T % 1 * 1e9), Q, W, TORQUE)
    holds(read(name), position=Q, velocity=W, motor_torque=TORQUE)


def test_durations_of_a_timetable():
    rows = [f"{t:.4g} sec,{q},{m}" for t, q, m in zip(T, Q, TORQUE)]
    Path("log.csv").write_text("\n".join(["Time,theta_rad,torque_Nm", *rows]))
    holds(read("log.csv"), position=Q, motor_torque=TORQUE)


@pytest.mark.parametrize("form", ["{} {} {}", "/joint_states/{}_joint/{} [{}]", "{} {} ({})"])
def test_the_joint_of_a_mapped_position_is_that_of_the_torque(form, capsys):
    names = [
        form.format(joint, quantity, unit)
        for joint in ("elbow", "wrist")
        for quantity, unit in (("position", "rad"), ("velocity", "rad/s"), ("torque", "Nm"))
    ]
    name = write("log.csv", ",".join(["time [s]", *names]), T, 0 * T + 1, 0 * T, 0 * T + 2, Q, W, TORQUE)
    assert main(["doctor", name]) == 2
    assert "say which, such as --map" in capsys.readouterr().out
    record = read(name, [f"position={names[3]}"])
    holds(record, position=Q, velocity=W, motor_torque=TORQUE)
