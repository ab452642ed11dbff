"""stickslip identify: from a file to model.toml, which other commands read."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import pytest

from stickslip import Model
from stickslip.cli import main
from stickslip.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[1] / "identify"))
import axis_cases as cases

LOOP = "kp=8,kd=0.08,kr=0.08,limit=3"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identify") / "log.csv"
    t = cases.trial("coulomb", noise=2e-3)
    assert t.drive is not None
    assert t.reference is not None
    rows = [
        f"{a:.6f},{b:.9f},{c:.9f},{d:.9f}" for a, b, c, d in zip(t.time, t.position, t.drive, t.reference)
    ]
    header = "time [s],position [rad],motor_torque [N·m],position_reference [rad]"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


def test_a_log_becomes_a_model_that_is_read_back(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model.toml"
    assert main(["identify", str(log), "--law", "coulomb", "--loop", LOOP, "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    model = Model.from_file(out)
    assert model.parameters.fc == pytest.approx(cases.FC, rel=0.02)
    written = tomllib.loads(out.read_text(encoding="utf-8"))
    assert written["data"][0]["sha256"] == printed["data"][0]["sha256"] != ""
    assert {e["name"] for e in written["estimates"]} == {"inertia", "offset", "fc", "sigma2"}
    assert written["axis"]["inertia"] == pytest.approx(cases.INERTIA, rel=0.05)
    study = tmp_path / "run.toml"
    study.write_text(
        '[axis]\ninertia = 4e-4\n[friction]\nlaw = {model = "model.toml"}\n[reference]\nkind = "sine"\n'
        'amplitude = 0.3\nfrequency = 1.0\nduration = 0.5\n[controller]\nlinear = "PD"\n'
        "placement = {bandwidth_hz = 20.0, damping = 1.0}\n",
        encoding="utf-8",
    )
    assert main(["simulate", str(study), "--out", str(tmp_path / "run.npz")]) == 0


def test_the_terminal_shows_intervals_and_errors(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "m.toml")
    assert main(["identify", str(log), "--inverse", "--out", out]) == 0
    shown = capsys.readouterr().out
    assert "inertia" in shown
    assert "kg·m²" in shown
    assert Model.from_file(out).law.name == "coulomb"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--law", "coulom"], "coulomb"),
        (["--loop", "kq=3"], "kq"),
        (["--set", "inertia"], "NAME=VALUE"),
        (["--freeze", "fx", "--law", "coulomb"], "fx"),
        (["--harmonics", "-1"], "0 or more"),
    ],
)
def test_bad_input_is_one_line(
    log: Path, tmp_path: Path, extra: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(log), "--out", str(tmp_path / "m.toml"), *extra]) == 2
    complaint = capsys.readouterr().err.strip().splitlines()[-1]
    assert complaint.startswith("stickslip: ")
    assert message in complaint


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text('law = "coulomb"\n', encoding="utf-8")
    with pytest.raises(InputError, match="parameters is missing"):
        Model.from_file(other)
    other.write_text('format = "stickslip-model-9"\nlaw = "coulomb"\n', encoding="utf-8")
    with pytest.raises(InputError, match="another version"):
        Model.from_file(other)
