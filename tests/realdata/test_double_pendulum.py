"""The double pendulum: irregular time is diagnosed, and each joint's friction is still found."""

from __future__ import annotations

import importlib.util

import pytest

from support.places import DATA, ROOT, needs_data

pytestmark = needs_data("double_pendulum")


def test_friction_of_both_joints_from_an_irregular_record(capsys: pytest.CaptureFixture[str]) -> None:
    spec = importlib.util.spec_from_file_location("double", ROOT / "examples" / "identify_double_pendulum.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    found = example.identify(next((DATA / "double_pendulum").glob("*_measured.csv")))
    assert "irregular sampling" in capsys.readouterr().out
    for name in ("Fc1", "Fc2", "d", "g2"):
        value, half = found[name]
        assert value - half > 0.0, name
    # Torque that the model does not explain, on the part that was not fitted.
    assert found["not fitted"][0] < 0.3
