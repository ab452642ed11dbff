"""Methods beside `axis` on records of a linear axis: newtons and metres in every word, number, picture and file."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identification.identified_file import read_identified

ANGULAR = re.compile(r"N·m|(?<![a-z])m?rad(?![a-z])|kg·m²")


@pytest.fixture(scope="module")
def staircase(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Speeds of a Stribeck contact, both ways, force in N."""
    rng = np.random.default_rng(0)
    levels = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
    v = np.concatenate([np.full(1500, side * s) for s in levels for side in (1.0, -1.0)])
    v = np.convolve(v, np.ones(50) / 50.0, "same")
    friction = np.sign(v) * (20.0 + 6.0 * np.exp(-((v / 0.01) ** 2))) + 30.0 * v
    table = np.column_stack([1e-3 * np.arange(v.size), 1e-3 * np.cumsum(v), friction])
    table[:, 1:] += rng.standard_normal((v.size, 2)) * [1e-7, 0.1]
    path = tmp_path_factory.mktemp("linear") / "log.csv"
    np.savetxt(
        path, table, delimiter=",", header="time [s],position [m],force [N]", comments="", encoding="utf-8"
    )
    return path


def test_sliding_says_newtons_everywhere(
    staircase: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["--method", "sliding", "--law", "stribeck", "--law", "coulomb"]
    assert main(["identify", str(staircase), *given, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "worst_N " in said
    assert not ANGULAR.search(said)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    pictures = re.findall(r'data:image/svg\+xml;base64,([^"]+)"', html)
    letters = re.findall(r">([^<]+)</text>", "".join(base64.b64decode(p).decode() for p in pictures))
    assert any("friction torque (N)" in t for t in letters)
    assert not [t for t in letters if ANGULAR.search(t)]
    assert not ANGULAR.search(re.sub(r'base64,[^"]+', "", html))
    assert read_identified(tmp_path / "model.toml").motion == "linear"


def test_the_axis_of_a_linear_record_says_newtons(
    staircase: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Inertia, level and slope of a staircase: what is not identified says so in N and m."""
    assert main(["identify", str(staircase), "--law", "lugre", "--no-report", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert " N·s/m" in said
    assert not ANGULAR.search(said)


def test_a_pendulum_along_a_line_is_refused(staircase: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It gave "gravity 1.68e7 N"."""
    assert main(["identify", str(staircase), "--pendulum", "--no-report"]) == 2
    assert "leave out --pendulum" in capsys.readouterr().err


def test_misfits_in_json_are_named_by_their_unit(
    staircase: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words_ = ["identify", str(staircase), "--method", "sliding", "--law", "stribeck", "--json", "--no-report"]
    assert main([*words_, "--out", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["misfit"]["rms_N"] < 0.01
    assert "rms_Nm" not in found["misfit"]
