"""`stickslip analyse`: every analysis prints, prints JSON, draws, and complains in one line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.cli.analyse import ANALYSES
from stickslip.core.record import Record

TIME = np.arange(20000) / 1000.0
TRAIN = ["--stiffness", "17800,396", "--inertia", "1.8e-4,6e-5,1.8757e-4", "--torque", "dry=0.2951"]
COMMANDS = {
    "spectrum": ["run.npz"],
    "repeatability": ["PID=run.npz", "PID=again.npz"],
    "flexibility": TRAIN,
    "sides": ["run.npz", "again.npz"],
    "position": ["run.npz"],
    "attraction": ["gms.toml"],
    "stability": ["--rig", "thesis-dry", "--bandwidth", "10", "--law", "lugre"],
}


@pytest.fixture(autouse=True)
def records(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    for name, more in (("run", 0.0), ("again", 1e-3)):
        channels = {
            "position": TIME + more * np.sin(TIME),
            "position_reference": TIME + 1e-3 * np.sin(600.0 * TIME),
            "motor_torque": 0.35 + 0.01 * np.cos(TIME),
            "sensor_torque": 0.30 + 0.01 * np.cos(TIME),
        }
        units = {k: "N·m" if "torque" in k else "rad" for k in channels}
        Record(TIME, channels, units).save(f"{name}.npz")
    (tmp_path / "gms.toml").write_text(
        "law = 'gms'\n[parameters]\nk = [1e4]\nalpha = [1.0]\nc = 24.0\nfs = 0.335\nfc = 0.285\nvs = 0.01\n"
    )


@pytest.mark.parametrize("name", ANALYSES)
def test_every_analysis_prints_and_draws(name, capsys, tmp_path):
    assert main(["analyse", name, *COMMANDS[name], "--plot", "picture.svg"]) == 0
    assert "picture: picture.svg" in capsys.readouterr().out
    assert (tmp_path / "picture.svg").read_bytes().startswith(b"<?xml")
    assert main(["analyse", name, *COMMANDS[name], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)


def test_numbers_of_the_flexibility(capsys):
    assert main(["analyse", "flexibility", *TRAIN, "--claimed", "270"]) == 0
    out = capsys.readouterr().out
    assert "303.0 Hz" in out
    assert "270 Hz is impossible" in out
    assert "1.66e-05, 0.000745 rad" in out
    shaft = [
        "--stiffness",
        "17800",
        "--shaft",
        "0.012,0.396,77e9",
        "--inertia",
        "4.2757e-4",
        "--claimed",
        "270,2750",
    ]
    assert main(["analyse", "flexibility", *shaft]) == 0
    out = capsys.readouterr().out
    assert "springs 17800, 395.8" in out
    assert "a second mode at 2750 Hz is possible" in out


@pytest.mark.parametrize(
    "command",
    [
        ["spectrum", "none.npz"],
        ["spectrum", "run.npz", "--channel", "positions"],
        ["spectrum", "run.npz", "--mode", "elastic"],
        ["spectrum", "run.npz", "--resolution", "0"],
        ["repeatability", "PID=run.npz"],
        ["flexibility", "--stiffness", "soft", "--inertia", "1"],
        ["flexibility", "--stiffness", "1,2", "--inertia", "1,2"],
        ["flexibility", "--inertia", "1"],
        ["flexibility", "--inertia", "1", "--shaft", "0.012,0.4"],
        ["position", "run.npz", "--transient", "100000"],
        ["position", "run.npz", "--plot", "picture.doc"],
        ["stability", "--rig", "none"],
        ["stability", "--rig", "ideal", "--law", "gmss"],
        ["stability", "--rig", "thesis-dry", "--sample-time", "0"],
        ["stability", "--rig", "thesis-dry", "--filter", "-1"],
        [],
    ],
)
def test_bad_input_is_one_line(command, capsys):
    assert main(["analyse", *command]) == 2
    said = capsys.readouterr().err
    assert said.startswith("stickslip: ")
    assert said.count("\n") == 1
