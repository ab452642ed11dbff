"""Formats that need an extra: round trips where it is installed, one line that names it where it is not."""

from __future__ import annotations

import importlib
import sys

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.readers import read

T = 0.5 + np.arange(200) * 1e-3
Q = 90.0 * np.sin(5.0 * T)
M = 250.0 * np.cos(5.0 * T)


def write_mdf(path):
    mdf = pytest.importorskip("asammdf")
    signals = [mdf.Signal(Q, T, name="ActPos", unit="deg"), mdf.Signal(M, T, name="ActTorque", unit="mNm")]
    with mdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(path, overwrite=True)


def write_tdms(path):
    tdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": 1e-3, "wf_start_offset": 0.5}
    with tdms.TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                tdms.ChannelObject("axis", "ActPos", Q, {"unit_string": "deg", **wave}),
                tdms.ChannelObject("axis", "ActTorque", M, {"unit_string": "mNm", **wave}),
            ]
        )


@pytest.mark.parametrize(
    ("name", "write"), [("a.mf4", write_mdf), ("a.tdms", write_tdms)], ids=["mdf", "tdms"]
)
def test_round_trip(tmp_path, name, write):
    write(tmp_path / name)
    record = read(tmp_path / name)
    np.testing.assert_allclose(record.time, T, atol=1e-12)
    np.testing.assert_allclose(record["position"], np.deg2rad(Q), atol=1e-12)
    np.testing.assert_allclose(record["motor_torque"], 1e-3 * M, atol=1e-12)


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_ros_bag(tmp_path, storage):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    types = importlib.import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    joint = store.types["sensor_msgs/msg/JointState"]
    bag = tmp_path / "bag"
    with rosbags.Writer(bag, version=9, storage_plugin=rosbags.StoragePlugin[storage]) as writer:
        connection = writer.add_connection("/joint_states", joint.__msgtype__, typestore=store)
        for t, q, m in zip(T, np.deg2rad(Q), 1e-3 * M):
            ns = 1_700_000_000_000_000_000 + round(t * 1e9)
            message = joint(
                header(stamp(ns // 10**9, ns % 10**9), ""),
                ["elbow"],
                np.array([q]),
                np.array([]),
                np.array([m]),
            )
            writer.write(connection, ns, store.serialize_cdr(message, joint.__msgtype__))
    # A single MCAP file is read as its folder is.
    for path in [bag, *bag.glob("*.mcap")]:
        record = read(path)
        np.testing.assert_allclose(record.time, T - T[0], atol=1e-6)
        np.testing.assert_allclose(record["position"], np.deg2rad(Q), atol=1e-12)
        np.testing.assert_allclose(record["motor_torque"], 1e-3 * M, atol=1e-12)


@pytest.mark.parametrize(
    ("head", "module", "extra"),
    [
        (b"MDF     4.10", "asammdf", "mdf"),
        (b"TDSm", "nptdms", "tdms"),
        (b"#ROSBAG V2.0\n", "rosbags", "rosbag"),
        (b"PAR1", "pyarrow", "parquet"),
    ],
)
def test_what_is_missing_is_named(tmp_path, monkeypatch, head, module, extra):
    for name in [m for m in sys.modules if m.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "log.dat").write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=rf"pip install 'stickslip\[{extra}\]'"):
        read(tmp_path / "log.dat")


@pytest.mark.parametrize(
    ("head", "what"), [(b"MDF     4.10", "MDF"), (b"TDSm", "TDMS"), (b"#ROSBAG V2.0\n", "ROS bag")]
)
def test_damaged(tmp_path, head, what):
    pytest.importorskip({"MDF": "asammdf", "TDMS": "nptdms", "ROS bag": "rosbags"}[what])
    (tmp_path / "log.dat").write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=what):
        read(tmp_path / "log.dat")
