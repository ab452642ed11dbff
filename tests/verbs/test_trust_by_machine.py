"""What the text of `identify` says of trust is there for who reads its JSON, its model file or its dictionary."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main


def test_trust_doubts_and_evidence_are_in_json_model_and_dictionary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """ "With care: the model misses 10.4 % of the torque" stood in the text alone, "identified: true" in the JSON."""
    t = 1e-3 * np.arange(4000)
    velocity = 12.0 * np.sin(8.0 * t) + 6.0 * np.sin(21.0 * t)
    torque = (
        2e-3 * np.gradient(velocity, t)
        + 0.2 * np.sign(velocity)
        + 0.06 * np.convolve(np.random.default_rng(1).standard_normal(4099), np.ones(100) * 0.1, "valid")
    )
    path = tmp_path / "log.csv"
    table = np.column_stack([t, 1e-3 * np.cumsum(velocity), torque])
    np.savetxt(path, table, "%.9f", ",", header="time [s],position [rad],motor_torque [N·m]", comments="")
    options = ["--law", "coulomb", "--out", str(tmp_path / "axis"), "--no-report"]
    assert main(["identify", str(path), *options]) == 0
    text = capsys.readouterr().out.splitlines()
    assert main(["identify", str(path), *options, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    kept = tomllib.loads((tmp_path / "axis" / "model.toml").read_text(encoding="utf-8"))
    for told in (printed, kept, ss.identify(path, law="coulomb").as_dict()):
        assert f"trust: {told['trust']}" in text
        assert told["doubts"]
        assert all(reason in told["trust"] for reason in told["doubts"])
        assert set(told["evidence"]) <= set(text)
    assert len(printed["steps"]) >= len(printed["next"])
    assert printed["profiles"] == []
