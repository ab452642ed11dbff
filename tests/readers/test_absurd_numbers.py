"""Logs whose numbers are none, infinite or beyond computing: one line from every verb and method, no traceback."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.doctor import examine
from stickslip.readers import read

N = 400
TIME = np.arange(N) * 1e-3
CHANNELS = {
    "position": np.sin(20 * TIME),
    "motor_torque": np.cos(20 * TIME),
    "velocity": 20 * np.cos(20 * TIME),
}
UNITS = {"position": "rad", "motor_torque": "N·m", "velocity": "rad/s"}
COLUMNS = {
    "time": "time_s",
    "position": "position_rad",
    "motor_torque": "torque_Nm",
    "velocity": "velocity_rad_s",
}
ABSURD = {
    "nan": lambda i, x: "nan",
    "infinite": lambda i, x: "-inf",
    "overflow": lambda i, x: "1e400",
    "huge": lambda i, x: str(1e308 * (-1) ** i),
    "empty": lambda i, x: "",
    "denormal": lambda i, x: str(x * 1e-320),
    "three rows": lambda i, x: str(x) if i < 3 else "nan",
}
METHODS = ("axis", "inertia", "sliding", "breakaway", "presliding", "attraction", "lugre")


def log(folder: Path, damaged: str, kind: str) -> str:
    columns = {"time": TIME, **CHANNELS}
    rows = [",".join(COLUMNS.values())]
    for i in range(N):
        cells = [
            ABSURD[kind](i, float(x[i])) if c == damaged else str(float(x[i])) for c, x in columns.items()
        ]
        rows.append(",".join(cells))
    (folder / "log.csv").write_text("\n".join(rows))
    return str(folder / "log.csv")


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.mark.parametrize("kind", ABSURD)
@pytest.mark.parametrize("damaged", ["time", "position", "motor_torque"])
def test_the_doctor_tells_what_is_wrong(tmp_path, capsys, damaged, kind):
    file = log(tmp_path, damaged, kind)
    code = main(["doctor", file])
    said = capsys.readouterr().out
    assert code == 2
    assert "error" in said
    # Nothing that was accepted lets a method compute with no rows, or with no time between them.
    for method in METHODS if kind in ("nan", "denormal", "three rows") and damaged == "time" else ():
        words = ["identify", file, "--method", method, "--accept", "nan", "--accept", "too-short",
                 "--accept", "no-clock", "--no-report"]  # fmt: skip
        assert main(words) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("channel", ["position", "motor_torque", "velocity"])
@pytest.mark.parametrize("factor", [1e-310, 1e-200, 1e-160])
def test_a_signal_smaller_than_any_axis_has_is_one_error(tmp_path, capsys, channel, factor):
    columns = {name: (factor if name == channel else 1.0) * x for name, x in CHANNELS.items()}
    record = Record(TIME, columns, UNITS).save(tmp_path / "small.npz")
    for words in (["doctor", str(record)], ["identify", str(record), "--no-report", "--accept", "too-small"]):
        assert main(words) == 2
        printed = capsys.readouterr()
        assert f"{channel} never exceeds" in printed.out + printed.err
        assert "Traceback" not in printed.out + printed.err


@pytest.mark.parametrize("kind", ["infinite", "huge"])
def test_a_spectrum_over_absurd_times_is_one_line(tmp_path, capsys, kind):
    assert main(["analyse", "spectrum", log(tmp_path, "time", kind), "--channel", "position"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("header", "changed"),
    [
        ({"units": UNITS, "meta": [1]}, {}),
        ({"units": UNITS, "meta": None}, {}),
        ({"units": {**UNITS, "position": 3}, "meta": {}}, {}),
        ({"units": UNITS, "meta": {}}, {"position": np.zeros(N, dtype=[("a", "f8")])}),
        ({"units": UNITS, "meta": {}}, {"position": np.array(["x"] * N)}),
        ({"units": UNITS, "meta": {}}, {"position": np.zeros(N, dtype=complex)}),
        ({"units": UNITS, "meta": {}}, {"time": np.zeros(N, dtype="datetime64[s]")}),
        (None, {"__header__": np.zeros(3, dtype=[("units", "U3"), ("meta", "f8")])}),
    ],
)
def test_a_record_with_another_header_or_other_arrays_is_no_record(tmp_path, header, changed):
    arrays = {"time": TIME, **CHANNELS, "__header__": np.array(json.dumps(header)), **changed}
    np.savez(tmp_path / "log.npz", **arrays)
    for reader in (read, Record.load):
        with pytest.raises(InputError, match="not a record of this package"):
            reader(tmp_path / "log.npz")


def test_a_record_without_usable_rows_is_too_short():
    nothing = {name: np.full(N, np.nan) for name in CHANNELS}
    found = examine(Record(TIME, nothing, UNITS, {}), accept=["too-short"])
    assert "too-short" in {f.code for f in found.errors}
