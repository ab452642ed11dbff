"""A model file with damaged parts is refused by `recommend` in one line."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from stickslip.cli import main

MODEL: dict[str, Any] = {
    "format": "stickslip-model-1", "law": "coulomb", "parameters": {"fc": 0.3, "sigma2": 0.01},
    "axis": {"inertia": 4e-4, "offset": 0.01, "seen_from": "load"}, "misfit": {"force_relative": 0.1},
    "estimates": [
        {"name": "fc", "unit": "N·m", "value": 0.3, "std": 0.01, "lower": 0.28, "upper": 0.32, "identified": True}
    ],
    "correlation": {"names": ["fc"], "matrix": [[1.0]]},
    "data": [{"file": "log.csv", "rows": 9, "sample_time": 1e-3}], "speeds": {"positive": [0.0, 1.0]},
}  # fmt: skip


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda m: m["axis"].update(offset="x"), "axis.offset = 'x' must be a number"),
        (lambda m: m["axis"].update(offset=math.nan), "axis.offset = nan must be a finite number"),
        (lambda m: m["axis"].update(gravity=[1.0]), "axis.gravity = [1.0] must be a number"),
        (lambda m: m.update(axis="x"), "axis = 'x' must be a table"),
        (lambda m: m.update(data="x"), "data = 'x' must be tables [[data]]"),
        (lambda m: m.update(data=["x"]), "data = ['x'] must be tables [[data]]"),
        (lambda m: m.update(misfit="x"), "misfit = 'x' must be a table"),
        (lambda m: m.update(estimates="x"), "estimates = 'x' must be tables"),
        (lambda m: m.update(correlation=1.0), "correlation = 1.0 must be a table"),
        (lambda m: m["speeds"].update(positive=["x"]), "its speeds cannot be read"),
        (lambda m: m["estimates"][0].update(value=math.nan), "the estimate of fc is nan"),
        (lambda m: m["estimates"][0].update(upper=math.nan), "the estimate of fc is 0.3 [0.28, nan]"),
        (lambda m: m["axis"].pop("inertia"), "no inertia; give --inertia in kg·m²"),
    ],
)
def test_a_damaged_part_is_named(
    damage: Callable[[Any], Any], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = copy.deepcopy(MODEL)
    damage(model)
    file = tmp_path / "model.toml"
    file.write_bytes(tomli_w.dumps(model).encode())
    assert main(["recommend", str(file), "--amplitude", "0.5"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1
