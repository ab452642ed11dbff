"""stickslip identify on a tribometer's record: friction itself, along a motion, under a normal load."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stickslip import Model
from stickslip.cli import main
from stickslip.simulation.prescribed.motion import Along

FC, STIFFNESS, LOAD = 2.0, 4e4, 5.0


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    time = np.arange(0.0, 10.0, 1e-2)
    position = 1.2e-4 * np.sin(2.0 * np.pi * 0.5 * time)
    law = Model("dahl", sigma0=STIFFNESS, fc=FC, delta_d=0.5)
    friction = Along(law.law, time, position).of(law) + 0.02 * np.random.default_rng(0).standard_normal(
        time.size
    )
    table = np.stack([time, 1e3 * position, 1e6 * friction, np.full(time.size, 1e6 * LOAD)], axis=1)
    head = "Time [s],Position [mm],Friction [uN],Normal [uN]"
    np.savetxt("tribometer.csv", table, "%.9g", ",", header=head, comments="")
    return "tribometer.csv"


def test_friction_alone_is_fitted_along_its_motion(log, capsys):
    assert main(["identify", log, "--json"]) == 0
    streams = capsys.readouterr()
    assert "--method hysteresis is taken" in streams.err
    found = json.loads(streams.out)
    values = {e["name"]: e for e in found["estimates"]}
    assert values["fc"]["value"] == pytest.approx(FC, rel=0.03)
    assert values["fc"]["unit"] == "N"
    assert values["sigma0"]["value"] == pytest.approx(STIFFNESS, rel=0.05)
    assert values["sigma0"]["unit"] == "N/m"
    notes = " ".join(found["notes"])
    assert "Chosen: Dahl" in notes
    assert "Normal load recorded: 5 N" in notes
    assert "coefficient of friction F_C / N of 0.4" in notes or "F_C / N of 0.39" in notes
    assert Path("report.html").exists()


def test_a_law_that_is_no_hysteresis_is_named(log, capsys):
    assert main(["identify", log, "--law", "stribeck", "--no-report"]) == 2
    assert "dahl, maxwell_slip" in capsys.readouterr().err


def test_nothing_that_acts_is_one_line(log, capsys):
    """A curve of 0.1 mN for a friction of 2 N ended in a KeyError."""
    curve = [x for name in ("fs", "fc", "vs") for x in ("--set", f"{name}=1e-4")]
    assert main(["identify", log, "--method", "presliding", *curve, "--no-report"]) == 2
    assert "check the values and units given" in capsys.readouterr().err
