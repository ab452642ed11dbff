"""Logs of several axes or joints: an index is no unit, and columns of different joints make no record."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError
from stickslip.readers import read
from stickslip.readers._names import role_of

T = np.linspace(0.0, 4.5, 600)
JOINT = np.arange(1.0, 4.0)
Q = 0.4 * np.sin(2.5 * T[:, None]) * JOINT
QD = np.gradient(Q, T, axis=0)
TAU = 0.5 * np.tanh(20.0 * QD) + 0.2 * QD
EE = 0.3 + 0.01 * Q


def taken(record: ss.Record) -> dict[str, str]:
    return {c["channel"]: c["column"] for c in record.meta["reading"]["columns"] if c["channel"] != "time"}


def saved(folder: Any, **arrays: Any) -> Any:
    np.savez(folder / "log.npz", time=T, **arrays)
    return folder / "log.npz"


@pytest.mark.parametrize(
    "name", ["tau[1]", "tau[ 1 ]", "tau (1)", "tau/1", "torque[1]", "joint_torque[1]", "effort.1"]
)
def test_an_index_is_no_unit(name):
    """The second joint's torque was a share of the rated torque, 7 times too large."""
    said = role_of(name)
    assert (said.role, said.unit, said.axis) == ("motor_torque", "", "1")


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_every_joint_has_its_torque_in_newton_metres(tmp_path, joint):
    path = saved(tmp_path, q=Q, qd=QD, tau_measured=TAU)
    record = read(path, [f"position=q[{joint}]:rad", f"torque=tau_measured[{joint}]"])
    np.testing.assert_allclose(record["motor_torque"], TAU[:, joint])
    np.testing.assert_allclose(record["velocity"], QD[:, joint])


def test_the_hand_is_no_joint(tmp_path):
    """`ee_pos[0]` was the angle of the joint."""
    path = saved(tmp_path, q=Q, qd=QD, q_cmd=Q, qd_cmd=QD, tau_measured=TAU, ee_pos=EE)
    record = read(path)
    assert taken(record) == {
        "position": "q[0]", "velocity": "qd[0]", "position_reference": "q_cmd[0]", "velocity_reference": "qd_cmd[0]",
        "motor_torque": "tau_measured[0]",
    }  # fmt: skip
    (warning,) = [f for f in record.meta["reading"]["findings"] if f["code"] == "ambiguous-column"]
    assert "'q[0]', 'q[1]', 'q[2]': the file has several axes; axis 0 was taken" in warning["message"]


@pytest.mark.parametrize(
    "name",
    ["ee_pos[0]", "eePos_x", "actual_TCP_pose_0", "actual_TCP_force_1", "wrench.torque.z", "end_effector_position",
     "tau_ext_hat_filtered[2]", "O_T_EE[3]", "CartPos_1", "robot.ee.position[0]"],
)  # fmt: skip
def test_names_of_no_joint(name):
    assert role_of(name).role == ""


@pytest.mark.parametrize(
    ("name", "role", "axis"),
    [
        ("q_0", "position", "0"), ("q0", "position", "0"), ("joint_pos[3]", "position", "3"),
        ("actual_q_2", "position", "2"), ("joint3.position", "position", "3"), ("joint_3_position", "position", "3"),
        ("J1_pos", "position", "1"), ("axis0.encoder.pos_estimate", "position", "0"),
        ("Axis A Position", "position", "a"), ("Axis 1.ActPos (mm)", "position", "1"), ("dq_J_2", "velocity", "2"),
        ("tau_J_3", "motor_torque", "3"), ("motor_2_torque", "motor_torque", "2"), ("i_q_2", "current", "2"),
        ("GVL.aAxis[2].fActTorque", "motor_torque", "2"), ("GVL.Axis.fActTorque", "motor_torque", ""),
        ("Position Ch1", "position", ""), ("Torque Ch2", "motor_torque", ""), ("motor_i", "current", ""),
        ("axis_i_act", "current", ""), ("GVL.fPosAct", "position", ""),
    ],
)  # fmt: skip
def test_the_axis_in_a_name(name, role, axis):
    said = role_of(name)
    assert (said.role, said.axis) == (role, axis)


@pytest.mark.parametrize("other", [{"qdd": np.gradient(QD, T, axis=0)}, {"q_des": Q}, {}])
def test_qd_is_the_rate_of_q(tmp_path, other):
    """In robotics; beside `qdd` it was a reference."""
    record = read(saved(tmp_path, q=Q, qd=QD, tau=TAU, **other))
    assert taken(record)["velocity"] == "qd[0]"
    assert "qd[0]" not in {v for k, v in taken(record).items() if k != "velocity"}


def test_qd_that_the_position_follows_is_its_reference(tmp_path):
    record = read(saved(tmp_path, q=Q, qd=Q + 0.01, tau=TAU))
    assert taken(record)["position_reference"] == "qd[0]"


def test_columns_of_another_joint_are_not_combined(tmp_path):
    path = saved(tmp_path, q=Q[:, 1], tau=TAU)
    with pytest.raises(
        InputError,
        match=r"motor_torque may be any of 'tau\[0\]', .*; position 'q' names no axis, so none was",
    ):
        read(path)
    path = tmp_path / "log.csv"
    np.savetxt(path, np.stack([T, Q[:, 1], TAU[:, 2]]).T, header="time,q_1,tau_2", delimiter=",", comments="")
    with pytest.raises(InputError, match="none belongs to axis 1 of position 'q_1'"):
        read(path)
    record = read(path, ["position=q_1", "torque=tau_2"])
    (warning,) = [f for f in record.meta["reading"]["findings"] if f["code"] == "ambiguous-column"]
    assert warning["message"] == "motor_torque 'tau_2' is of axis 2, position 'q_1' of axis 1"


def test_the_axis_that_has_a_torque_is_taken(tmp_path):
    columns = {"time": T, "q1": Q[:, 0], "q2": Q[:, 1], "tau2": TAU[:, 1]}
    assert taken(ss.read(columns)) == {"position": "q2", "motor_torque": "tau2"}


def test_one_torque_for_an_array_of_joints_is_not_guessed(tmp_path):
    path = saved(tmp_path, q=Q, tau=TAU[:, 1])
    with pytest.raises(
        InputError, match=r"the file has several axes, and its torque or current names none; choose"
    ):
        read(path)
    assert taken(read(path, ["position=q[1]"])) == {"position": "q[1]", "motor_torque": "tau"}


def test_arrays_of_another_size_are_not_combined(tmp_path):
    """The force on a hand has three directions; the arm has six joints."""
    path = saved(tmp_path, q=np.hstack([Q, Q]), force=TAU)
    with pytest.raises(InputError, match=r"motor_torque may be any of 'force\[0\]'"):
        read(path)


def test_phase_currents_are_not_guessed(tmp_path):
    record = read(saved(tmp_path, position=Q[:, 0], current=TAU))
    assert "current" not in record.channels


@pytest.mark.parametrize("rows", [150, 600])
def test_a_velocity_of_another_motion_is_an_error(rows):
    every = slice(None, None, 600 // rows)
    t, q, tau = T[every], Q[every, 0], TAU[every, 0]
    other = np.gradient(0.3 * np.sin(5.7 * t + 1.0), t)
    found = ss.doctor({"time": t, "q": q, "velocity": other, "torque": tau})
    assert "velocity-mismatch" in {f.code for f in found.errors}
    assert not ss.doctor({"time": t, "q": q, "velocity": QD[every, 0], "torque": tau}).errors
