"""The xl330 servo: one load-dependent law, DC motor and firmware loop against measured positions."""

from __future__ import annotations

import importlib.util
from typing import Any

import pytest

from support import places
from support.places import ROOT, needs_data

DATA = places.DATA / "xl330_pendulum"

pytestmark = needs_data("xl330_pendulum")


@pytest.fixture(scope="module")
def example() -> Any:
    spec = importlib.util.spec_from_file_location("identify_servo", ROOT / "examples" / "identify_servo.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_position_error_with_one_law_for_all_records(example: Any) -> None:
    experiments = [example.experiment(p) for p in sorted(DATA.glob("kp*.json"))]
    assert len(experiments) == 12
    found = example.identify(experiments, "coulomb")
    assert example.mean_absolute(found, experiments) <= 0.046
