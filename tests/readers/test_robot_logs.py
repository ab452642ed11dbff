"""Logs of other people's tools: WPILib, PX4, VESC Tool, Universal Robots and LeRobot, each read as what it is."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pyarrow as pa
import pyarrow.parquet
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.readers import Drive, open_table, read

N = 600
T = np.arange(N) * 0.005
W = 12.0 * np.cos(4.0 * T)
Q = 3.0 * np.sin(4.0 * T)
TORQUE = 0.1 * np.sign(W) + 0.004 * W - 0.002 * 48.0 * np.sin(4.0 * T)


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))


def doctor(capsys: Any, *words: str) -> tuple[int, str]:
    """Exit code and text of `stickslip doctor`."""
    code = main(["doctor", *words])
    printed = capsys.readouterr()
    assert "Traceback" not in printed.err
    return code, printed.out + printed.err


# ---- WPILib -------------------------------------------------------------------------------------------------

Entries = list[tuple[str, str, str, list[tuple[float, bytes]]]]
"""Name, type, metadata and samples with their times in s."""


def write_wpilog(path: Path, entries: Entries, spare: bytes = b"") -> None:
    out = bytearray(b"WPILOG\x00\x01" + struct.pack("<I", len(spare)) + spare)

    def text(words: str) -> bytes:
        return struct.pack("<I", len(words.encode())) + words.encode()

    def record(number: int, time: float, payload: bytes) -> None:
        # Fields as short as they can be, as WPILib writes them.
        stamp = round(1e6 * time)
        lengths = [max(1, (x.bit_length() + 7) // 8) for x in (number, len(payload), stamp)]
        bits = (lengths[0] - 1) | (lengths[1] - 1) << 2 | (lengths[2] - 1) << 4
        out.append(bits)
        for value, length in zip((number, len(payload), stamp), lengths):
            out.extend(value.to_bytes(length, "little"))
        out.extend(payload)

    for number, (name, kind, metadata, _) in enumerate(entries, 1):
        record(0, 0.0, b"\0" + struct.pack("<I", number) + text(name) + text(kind) + text(metadata))
    samples = sorted(
        (time, number, data) for number, e in enumerate(entries, 1) for time, data in e[3]
    )  # fmt: skip
    for time, number, data in samples:
        record(number, time, data)
    path.write_bytes(bytes(out))


def doubles(values: Any, delay: float = 0.0) -> list[tuple[float, bytes]]:
    return [(t + 1.0 + delay, struct.pack("<d", x)) for t, x in zip(T, values)]


def arm() -> Entries:
    """As the routines of SysId log a mechanism: units are in the metadata."""
    return [
        ("position-motor-arm", "double", "Rotation", doubles(Q / (2 * np.pi))),
        ("velocity-motor-arm", "double", "Rotation per Second", doubles(W / (2 * np.pi))),
        ("current-motor-arm", "double", '{"unit": "Ampere"}', doubles(TORQUE / 0.05, 0.0012)),
        ("sysid-test-state-arm", "string", "", [(1.0, b"quasistatic-forward")]),
        ("enabled", "boolean", "", [(t + 1.0, b"\1") for t in T[::50]]),
        ("module", "int64[]", "", [(t + 1.0, struct.pack("<2q", 1, -2)) for t in T[::50]]),
        ("/pose", "struct:Pose2d", "", [(t + 1.0, struct.pack("<dd3if", 1, 2, 3, 4, 5, 6)) for t in T[::50]]),
        (
            "/.schema/struct:Pose2d",
            "structschema",
            "",
            [(0.5, b"Translation2d t;enum{a=1} int32 n[3]; float h")],
        ),
        ("/.schema/struct:Translation2d", "structschema", "", [(0.5, b"double x;double y")]),
    ]


def test_wpilog_entries_become_columns_with_units_and_clocks(tmp_path):
    write_wpilog(tmp_path / "a.wpilog", arm(), b"extra header")
    record = read(tmp_path / "a.wpilog", drive=Drive(torque_constant=0.05))
    assert dict(record.units) == {
        "position": "rad", "velocity": "rad/s", "current": "A", "motor_torque": "N·m"
    }  # fmt: skip
    assert np.allclose(record.time - record.time[0], T)
    assert np.allclose(record["position"], Q)
    assert np.allclose(record["velocity"], W)
    # The current has its own times and is interpolated at those of the position.
    inner = np.interp(T, T + 0.0012, TORQUE)[1:]
    assert np.allclose(record["motor_torque"][1:], inner, atol=1e-6)
    table = open_table(tmp_path / "a.wpilog")
    values = {c.name: c.values[0] for c in table.columns}
    assert (values["/pose.t.x"], values["/pose.n[2]"]) == (1.0, 5.0)
    assert values["module[1]"] == -2.0
    assert list(table.unread) == ["sysid-test-state-arm"]


def test_a_voltage_is_no_torque_and_the_remedy_is_named(tmp_path, capsys):
    entries = [e for e in arm() if not e[0].startswith("current")]
    entries.append(("voltage-motor-arm", "double", "Volt", doubles(TORQUE)))
    write_wpilog(tmp_path / "a.wpilog", entries)
    _, said = doctor(capsys, "a.wpilog")
    assert "there is a voltage and no torque" in said
    assert "--resistance OHM and --torque-constant" in said
    assert "motor_torque" not in read("a.wpilog").channels


def test_the_torque_producing_current_is_a_current(tmp_path, capsys):
    entries = [(n.replace("current-motor-arm", "TorqueCurrent"), k, "", s) for n, k, _, s in arm()]
    write_wpilog(tmp_path / "a.wpilog", entries)
    code, said = doctor(capsys, "a.wpilog")
    assert code == 2
    assert "there is current but no torque; give --torque-constant" in said


def test_the_current_of_the_supply_is_not_the_motors(tmp_path):
    entries = [(n.replace("current-motor-arm", "SupplyCurrent"), k, "", s) for n, k, _, s in arm()]
    write_wpilog(tmp_path / "a.wpilog", entries)
    assert set(read("a.wpilog").channels) == {"position", "velocity"}


@pytest.mark.parametrize("part", [0.02, 0.3, 0.999])
def test_a_wpilog_that_is_cut_off_gives_what_it_has(tmp_path, part):
    write_wpilog(tmp_path / "a.wpilog", arm())
    whole = (tmp_path / "a.wpilog").read_bytes()
    (tmp_path / "a.wpilog").write_bytes(whole[: int(part * len(whole))])
    if part < 0.05:  # within the names of the entries
        with pytest.raises(InputError, match=r"a\.wpilog"):
            open_table("a.wpilog")
    else:
        assert any(f.code == "cut-off" for f in open_table("a.wpilog").findings)


# ---- SysId --------------------------------------------------------------------------------------------------

RESISTANCE, CONSTANT = 0.2, 0.05
TESTS = {
    "slow-forward": (1, 0.0),
    "slow-backward": (-1, 20.0),
    "fast-forward": (1, 40.0),
    "fast-backward": (-1, 60.0),
}


def sysid_rows(name: str, absolute: bool = False) -> list[list[float]]:
    """Time, voltage, rotations, rotations/s of a motor with inertia 2e-3, Coulomb 0.1 and viscous 2e-3."""
    sign, start = TESTS[name]
    speed = position = 0.0
    rows: list[list[float]] = []
    for k in range(500):
        t = 0.005 * k
        voltage = sign * (0.5 + 1.6 * t if name.startswith("slow") else 4.0)
        rows.append(
            [start + t, abs(voltage) if absolute else voltage, position / (2 * np.pi), speed / (2 * np.pi)]
        )
        for _ in range(20):
            torque = CONSTANT * (voltage - CONSTANT * speed) / RESISTANCE
            speed += 0.00025 * (torque - 0.1 * np.tanh(speed / 0.01) - 0.002 * speed) / 2e-3
            position += 0.00025 * speed
    return rows


def write_sysid(path: Path, absolute: bool = False, width: int = 4) -> None:
    tests = {name: sysid_rows(name, absolute) for name in TESTS}
    if width == 9:
        tests = {
            n: [[r[0], r[1], r[1], r[2], r[2], r[3], r[3], 0.0, 0.0] for r in rows]
            for n, rows in tests.items()
        }
    if width == 10:
        tests = {n: [[r[0], 12.0, 0.1, r[1], r[1], r[2], r[2], r[3], r[3], 0.0] for r in rows]
                 for n, rows in tests.items()}  # fmt: skip
    path.write_text(json.dumps({"sysid": True, "test": "Simple", "units": "Rotations", **tests}))


@pytest.mark.parametrize("absolute", [False, True], ids=["signed", "unsigned"])
def test_sysid_tests_identify_a_motor_by_its_voltage(tmp_path, absolute):
    write_sysid(tmp_path / "a.json", absolute)
    found = ss.identify("a.json", resistance=RESISTANCE, torque_constant=CONSTANT)
    assert found["fc"].value == pytest.approx(0.1, rel=0.05)
    assert found["inertia"].value == pytest.approx(2e-3, rel=0.05)
    codes = {f["code"] for f in read("a.json").meta["reading"]["findings"]}
    assert ("sysid-sign" in codes) == absolute


@pytest.mark.parametrize("width", [9, 10])
def test_the_side_of_a_drivetrain_is_the_users_choice(tmp_path, capsys, width):
    write_sysid(tmp_path / "a.json", width=width)
    code, said = doctor(capsys, "a.json")
    assert code == 2
    assert "position may be any of 'left_position', 'right_position'" in said
    chosen = [f"{c}=left_{c}" for c in ("position", "velocity", "voltage")]
    assert {"position", "velocity", "voltage"} <= set(read("a.json", chosen).channels)


def test_a_test_that_is_no_table_is_refused(tmp_path):
    (tmp_path / "a.json").write_text(
        json.dumps({"slow-forward": [[1, 2, 3]], "slow-backward": [[1, 2, 3, 4]]})
    )
    with pytest.raises(InputError, match="'slow-forward' is not a table of numbers with 4, 9 or 10 columns"):
        read("a.json")


# ---- PX4 ----------------------------------------------------------------------------------------------------


def write_ulog(path: Path) -> None:
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def message(kind: str, body: bytes) -> None:
        out.extend(struct.pack("<HB", len(body), ord(kind)) + body)

    def info(kind: str, key: bytes, value: bytes) -> None:
        message(kind, bytes([len(key)]) + key + value)

    message("B", bytes(40))
    info("I", b"char[3] sys_name", b"PX4")
    info("P", b"float GAIN", struct.pack("<f", 2.5))
    message("F", b"esc_report:uint64_t timestamp;int32_t esc_rpm;uint8_t[4] _padding0;")
    message("F", b"esc_status:uint64_t timestamp;uint8_t n;uint8_t[7] _padding0;esc_report[2] esc;")
    message("F", b"vehicle_torque_setpoint:uint64_t timestamp;float[3] xyz;uint8_t[4] _padding0;")
    message("A", b"\0" + struct.pack("<H", 7) + b"esc_status")
    message("A", b"\1" + struct.pack("<H", 8) + b"vehicle_torque_setpoint")
    for k, speed in enumerate(W):
        stamp = 5000 * k
        reports = [struct.pack("<Qi", stamp, round(1e3 * speed)), struct.pack("<Qi", stamp, -1)]
        # The padding of the last report is not stored.
        message("D", struct.pack("<HQB7x", 7, stamp, 2) + reports[0] + bytes(4) + reports[1])
        message("D", struct.pack("<HQfff", 8, stamp + 77, TORQUE[k], 0.0, 0.0))
    path.write_bytes(bytes(out))


def test_a_ulog_is_read_and_nothing_of_it_is_guessed(tmp_path, capsys):
    write_ulog(tmp_path / "a.ulg")
    table = open_table("a.ulg")
    values = {c.name: c for c in table.columns}
    assert np.allclose(values["esc_status.esc[0].esc_rpm"].values, np.round(1e3 * W))
    assert np.allclose(values["vehicle_torque_setpoint.1.xyz[0]"].clock, T + 77e-6)
    assert table.constants == {"sys_name": "PX4", "GAIN": 2.5}
    code, said = doctor(capsys, "a.ulg")
    assert code == 2
    assert "normalised" in said
    record = read("a.ulg", {"velocity": "esc_status.esc[0].esc_rpm:rpm"})
    assert np.allclose(record["velocity"], np.round(1e3 * W) * 2 * np.pi / 60)


def test_a_ulog_of_a_later_version_is_refused(tmp_path):
    write_ulog(tmp_path / "a.ulg")
    data = bytearray((tmp_path / "a.ulg").read_bytes())
    data[16 + 3 + 8] = 2  # an incompatible flag that is not known
    (tmp_path / "a.ulg").write_bytes(data)
    with pytest.raises(InputError, match="later version"):
        read("a.ulg")


# ---- VESC Tool ----------------------------------------------------------------------------------------------

VESC = (
    "ms_today;input_voltage;temp_mos_max;temp_motor;current_motor;current_in;d_axis_current;q_axis_current;erpm;"
    "tachometer;encoder_position;d_axis_voltage;q_axis_voltage;ms_today_setup;speed_meters_per_sec;ms_today_imu;accX;"
    "gyroX;gnss_posTime;gnss_gVel;"
)


def write_vesc(path: Path) -> None:
    lines = [VESC]
    for t, w, torque in zip(T, W, TORQUE):
        current = torque / 0.05
        cells = (36_000_000 + round(1e3 * t), 24.1, 31, 30, current * np.sign(w), 1, 0.01, current,
                 w * 60 / (2 * np.pi) * 7, 12, 0, 0, 1, 36_000_000, w * 0.1, 36_000_000, 0, 0, 0, 0)  # fmt: skip
        lines.append(";".join(f"{x:.9g}" for x in cells) + ";")
    path.write_text("\n".join(lines))


def test_vesc_logs_need_pole_pairs_and_a_torque_constant(tmp_path, capsys):
    write_vesc(tmp_path / "a.csv")
    code, said = doctor(capsys, "a.csv")
    assert code == 2
    assert "electrical revolutions per minute (eRPM); give --pole-pairs N" in said
    code, said = doctor(capsys, "a.csv", "--pole-pairs", "7")
    assert code == 2
    assert "there is current but no torque; give --torque-constant" in said
    assert "current_motor is positive when the motor drives" in said
    for record in (
        ss.read("a.csv", pole_pairs=7, torque_constant=0.05),
        ss.read(pandas.read_csv("a.csv", sep=";"), pole_pairs=7, torque_constant=0.05),
    ):
        assert np.allclose(record["velocity"], W, rtol=1e-6)
        assert np.allclose(record["motor_torque"], TORQUE, atol=1e-8)
        assert np.allclose(record.time - record.time[0], np.round(1e3 * T) * 1e-3)
        assert "position" not in record.channels  # without an encoder it is 0 throughout


def test_pole_pairs_must_be_positive():
    with pytest.raises(InputError, match="pole_pairs = -7 must be greater than 0"):
        ss.read(t=T, velocity=W, torque=TORQUE, units={"velocity": "erpm"}, pole_pairs=-7)


# ---- Universal Robots ---------------------------------------------------------------------------------------

UR = ("target_q", "target_qd", "target_moment", "actual_q", "actual_qd", "actual_current", "actual_TCP_force",
      "actual_TCP_speed", "actual_joint_voltage")  # fmt: skip


def write_ur(path: Path, *more: str) -> None:
    values = {"target_q": Q, "target_qd": W, "target_moment": 9.0 * np.sin(T), "actual_q": Q, "actual_qd": W,
              "actual_current": TORQUE / 0.05, "actual_TCP_force": 5 + T, "actual_TCP_speed": 0.1 * T,
              "actual_joint_voltage": 48 + 0 * T, "actual_current_as_torque": TORQUE}  # fmt: skip
    columns = {"timestamp": 7000.0 + T}
    columns |= {f"{name}_{j}": (j + 1) * values[name] for name in (*UR, *more) for j in range(6)}
    columns |= {"actual_execution_time": 0.2 + 0 * T, "speed_scaling": 1 + 0 * T}
    pandas.DataFrame(columns).to_csv(path, sep=" ", index=False)


def test_the_target_moment_of_a_robot_is_no_measured_torque(tmp_path, capsys):
    write_ur(tmp_path / "a.csv")
    code, said = doctor(capsys, "a.csv")
    assert code == 2
    assert "target_moment is the torque that the controller's model predicts" in said
    assert "there is current but no torque; give --torque-constant" in said
    record = ss.read("a.csv", map={"position": "actual_q_2"}, torque_constant=0.05)
    assert {c["column"] for c in record.meta["reading"]["columns"]} == {
        "timestamp", "actual_q_2", "actual_qd_2", "target_q_2", "target_qd_2", "actual_current_2"
    }  # fmt: skip
    assert np.allclose(record["motor_torque"], 3 * TORQUE)
    assert "voltage" not in record.channels


def test_a_robot_that_logs_its_torque_needs_no_constant(tmp_path):
    write_ur(tmp_path / "a.csv", "actual_current_as_torque")
    record = ss.read("a.csv", map={"position": "actual_q_1"})
    assert np.allclose(record["motor_torque"], 2 * TORQUE)


# ---- LeRobot ------------------------------------------------------------------------------------------------


def lists(*columns: Any, width: int = -1) -> Any:
    return pa.array(np.stack(columns, axis=1).tolist(), pa.list_(pa.float32(), width))


def write_lerobot(path: Path, episodes: int = 1, **more: Any) -> None:
    each = N // episodes
    table = {
        "observation.state": lists(Q, np.degrees(Q)), "action": lists(Q, np.degrees(Q), width=2), **more,
        "timestamp": pa.array(T % (0.005 * each - 1e-9), pa.float32()), "frame_index": np.arange(N) % each,
        "episode_index": np.arange(N) // each, "index": np.arange(N), "task": ["push"] * N,
    }  # fmt: skip
    pyarrow.parquet.write_table(pa.table(table), path)


def test_a_dataset_of_lerobot_is_mapped_joint_by_joint(tmp_path, capsys):
    write_lerobot(tmp_path / "a.parquet", **{"observation.effort": lists(0 * Q, 1e3 * TORQUE)})
    code, said = doctor(capsys, "a.parquet")
    assert code == 2
    assert "a dataset states no units" in said
    assert "--map 'position=observation.state[0]:deg'" in said
    record = read("a.parquet", ["position=observation.state[1]:deg", "torque=observation.effort[1]:mNm"])
    assert np.allclose(record["position"], Q, atol=1e-5)
    assert np.allclose(record["motor_torque"], TORQUE, atol=1e-6)
    assert set(record.channels) == {"position", "motor_torque"}


def test_without_a_torque_a_dataset_cannot_be_identified(tmp_path, capsys):
    write_lerobot(tmp_path / "a.parquet")
    assert main(["identify", "a.parquet", "--map", "position=observation.state[0]:rad"]) == 2
    assert "map the torque or current" in capsys.readouterr().err


def test_episodes_are_separate_records(tmp_path, capsys):
    write_lerobot(tmp_path / "a.parquet", 3, **{"observation.effort": lists(0 * Q, TORQUE)})
    said = doctor(capsys, "a.parquet", "--map", "position=observation.state[1]:deg", "--map",
                  "torque=observation.effort[1]:Nm")[1]  # fmt: skip
    assert "backward-time" not in said
    assert "gap" not in said


def test_lists_of_different_lengths_are_left_out(tmp_path):
    table = pa.table({"t": T[:3], "q": T[:3], "x": pa.array([[1.0], [1.0, 2.0], None]), "n": ["a", "b", "c"]})
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    found = open_table("a.parquet")
    assert [c.name for c in found.columns] == ["t", "q"]
    assert [f.message for f in found.findings] == [
        "column 'x' holds lists of different lengths; it was left out",
        "column 'n' holds string, not numbers; it was left out",
    ]


# ---- damage -------------------------------------------------------------------------------------------------


def write_arm(path: Path) -> None:
    write_wpilog(path, arm())


@pytest.mark.parametrize(
    ("name", "write"),
    [("a.wpilog", write_arm), ("a.ulg", write_ulog), ("a.json", write_sysid), ("a.parquet", write_lerobot)],
    ids=["wpilog", "ulog", "sysid", "lerobot"],
)
def test_a_damaged_file_gets_one_line(tmp_path, name, write):
    write(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(50)
    for _ in range(60):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), rng.integers(1, 6)):
            near = int(at) if rng.random() < 0.5 else int(at) % 2000  # headers are at the start
            data[near : near + int(rng.integers(1, 9))] = rng.bytes(int(rng.integers(0, 9)))
        (tmp_path / name).write_bytes(data)
        try:
            read(name)
        except InputError as error:
            said = str(error)
            assert "\n" not in said
