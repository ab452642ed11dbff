"""What would take for ever, or more memory than there is, is refused with the number before anything starts."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.presliding.hysteresis import Loop
from stickslip.identification.presliding.presliding import GRID, identify_presliding
from stickslip.identification.regression.inverse import refuse_harmonics
from stickslip.models.model import Model
from stickslip.readers import read

LOG = str(Path(__file__).parents[2] / "src" / "stickslip" / "demo.csv")
MODEL = (
    'law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n[axis]\ninertia = 4e-4\n[correlation]\n'
    'matrix = [[1.0]]\n[[estimates]]\nname = "fc"\nunit = "N·m"\nvalue = 0.3\nstd = 0.01\nlower = 0.28\n'
    "upper = 0.32\nidentified = true\n"
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(MODEL)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "number"),
    [
        (["recommend", "m.toml", "--amplitude=0.1", "--axes", "1000000000"], "e+05 h"),
        (["recommend", "m.toml", "--amplitude=0.1", "--confirm", "1000000000"], "h; give fewer axes"),
        (["recommend", "m.toml", "--amplitude=0.1", "--sample-time", "1e-12"], "1e-12 s"),
        (["recommend", "m.toml", "--amplitude=0.1", "--frequency", "1e-9"], "a motion of 2e+09 s"),
        (["recommend", "m.toml", "--bandwidth", "1e-9"], "--bandwidth 1e-09 Hz"),
        (["recommend", "m.toml", "--amplitude", "1e-300"], "--amplitude 1e-300"),
        (["identify", LOG, "--harmonics", "1000000"], "2000007 parameters"),
        (["identify", LOG, "--harmonics", "1000000", "--inverse"], "at most 996"),
        (["identify", LOG, "--harmonics", "900"], "about 33 h; give at most 771"),
    ],
)
def test_it_is_refused_with_the_number(capsys, words, number):
    assert main(words) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert number in complaint


def test_the_memory_of_the_equations_is_counted():
    class Long:
        time = np.empty(50_000_000)

    refuse_harmonics([Long()], 0)
    with pytest.raises(InputError, match=r"20 harmonics .* 37\.6 GB; give at most 1$"):
        refuse_harmonics([Long()], 20)


def test_a_loop_has_no_more_elements_than_its_fit_tells_apart():
    time = np.arange(400) * 1e-2
    channels = {"position": np.sin(time), "motor_torque": np.sin(time - 0.3)}
    record = Record(time, channels, {"position": "rad", "motor_torque": "N·m"}, {})
    with pytest.raises(InputError, match=f"elements = 100000000 must be at most {GRID}"):
        identify_presliding(
            Loop.of(record, "motor_torque"), Model("stribeck_plain", fs=1.2, fc=1.0, vs=0.1), elements=10**8
        )


@pytest.mark.parametrize(
    "words",
    [
        ("doctor", "pipe.csv"),
        ("identify", "pipe.csv"),
        ("identify", LOG, "--method", "presliding", "--model", "pipe.toml"),
        ("analyse", "spectrum", "pipe.npz"),
        ("recommend", "pipe.toml"),
        ("export", "pipe.toml", "--to", "c99"),
        ("compare", "m.toml", "pipe.toml"),
        ("simulate", "pipe.toml"),
        ("study", "pipe.toml"),
        ("sweep", "pipe.toml"),
        ("cite", "pipe.toml"),
        ("rig", "run", "breakaway", "--rig", "pipe.toml", "--dry-run"),
    ],
)
def test_a_named_pipe_is_not_waited_for(folder, capsys, words):
    for name in ("pipe.csv", "pipe.toml", "pipe.npz"):
        os.mkfifo(folder / name)
    assert main(words) == 2
    assert "is a pipe or device" in capsys.readouterr().err


def test_the_library_does_not_wait_for_a_pipe_either(folder):
    os.mkfifo(folder / "pipe.npz")
    for reader in (read, Record.load):
        with pytest.raises(InputError, match="pipe or device"):
            reader(folder / "pipe.npz")
