"""Prediction error of an axis: truth inside honest intervals, on simulated records whose truth is known."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.errors import InputError
from stickslip.identify.axis_prediction import axis_prediction, encoder_resolution
from stickslip.identify.axis_trial import trial_of
from stickslip.machines.servo import ServoAxis

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
AXIS = ServoAxis(drive_side="load")


@pytest.fixture(scope="module")
def generator() -> Any:
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import coverage_records
    finally:
        sys.path.remove(str(BENCHMARKS))
    return coverage_records


def test_inertia_and_friction_of_one_record(generator: Any) -> None:
    case = generator.make(0, "coulomb")
    found = axis_prediction([trial_of(case.record, AXIS)], AXIS, case.model.law)
    for e in found.estimates:
        assert e.identified, e
        width = e.upper - e.lower
        # Four half-widths: an interval of 95 % that fails here is wrong, not unlucky.
        assert e.lower - 1.5 * width < case.truth[e.name] < e.upper + 1.5 * width
    by_name = {e.name: e.value for e in found.estimates}
    assert by_name["inertia"] == pytest.approx(case.truth["inertia"], rel=0.03)
    assert by_name["fc"] == pytest.approx(case.truth["fc"], rel=0.02)


def test_same_seed_same_numbers(generator: Any) -> None:
    case = generator.make(0, "coulomb")
    trials = [trial_of(case.record, AXIS)]
    one, two = (axis_prediction(trials, AXIS, case.model.law, draws=4, seed=3) for _ in range(2))
    assert [e.as_dict() for e in one.estimates] == [e.as_dict() for e in two.estimates]


@pytest.mark.parametrize("count", [2.0 * np.pi / 16384, 6.28e-6])
def test_resolution_of_a_counted_position(count: float) -> None:
    q = np.sin(np.linspace(0.0, 20.0, 5000))
    assert encoder_resolution(count * np.round(q / count)) == pytest.approx(count, rel=1e-3)
    assert encoder_resolution(q) == 0.0


def test_a_record_without_drive_is_refused(generator: Any) -> None:
    case = generator.make(0, "coulomb")
    t = trial_of(case.record, AXIS)
    closed = replace(t, drive=None, reference=t.position, loop=generator.Loop(kp=1.0))
    with pytest.raises(InputError, match="drive's signal"):
        axis_prediction([closed], AXIS, case.model.law)


@pytest.mark.slow
def test_short_coverage_study(generator: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.spec_from_file_location("interval_coverage", BENCHMARKS / "interval_coverage.py")
    assert spec is not None
    assert spec.loader is not None
    coverage = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "interval_coverage", coverage)
    spec.loader.exec_module(coverage)
    rows = [r for seed in (0, 1, 4, 5, 9, 10, 14, 15) for r in coverage.study(seed)]
    for name in coverage.ALWAYS:
        assert sum(r.identified for r in rows if r.name == name) >= 7, name
    sure = [r for r in rows if r.name in coverage.ALWAYS and r.identified]
    # 24 intervals of 95 %: fewer than 18 that hold would have a chance below 1e-4.
    assert sum(r.inside for r in sure) >= 0.75 * len(sure)
