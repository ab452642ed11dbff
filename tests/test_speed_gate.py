"""What CI lets pass of our time over C's, and what not."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture
def benchmark(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    spec = importlib.util.spec_from_file_location("closed_loop_gate", BENCHMARKS / "closed_loop.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "RATIOS", tmp_path / "ratios.json")
    return module


def measured(ratios):
    """A measurement that gives these ratios one after the other, the last one for ever."""
    left = list(ratios)
    return lambda _: left.pop(0) if len(left) > 1 else left[0]


def test_a_ratio_that_rose_by_half_fails(benchmark):
    benchmark.gate(measured([1.2]), record=True)
    benchmark.gate(measured([1.75]), record=False)
    with pytest.raises(SystemExit, match=r"none: 1\.90 times the time of C, 1\.20 when it was recorded"):
        benchmark.gate(measured([1.9]), record=False)


def test_one_slow_measurement_does_not_fail(benchmark, capsys):
    benchmark.gate(measured([1.2]), record=True)
    benchmark.gate(measured([5.0, 1.3]), record=False)
    # The first kind of loop is measured again; the others give what is left.
    assert capsys.readouterr().out.splitlines()[-1].endswith(": 1.30, 1.30, 1.30, 1.30, 1.30")
    with pytest.raises(SystemExit, match=r"none: 4\.00 times"):
        benchmark.gate(measured([5.0, 4.5, 4.0]), record=False)


def test_a_missing_record_is_told(benchmark):
    with pytest.raises(SystemExit, match="has no ratio for none"):
        benchmark.gate(measured([1.0]), record=False)


def test_every_kind_of_loop_has_a_record():
    kept = json.loads((BENCHMARKS / "c_ratios.json").read_text())
    assert set(kept) == {"none", "GMS feedback", "LuGre feedforward", "PID", "LuGre feedback"}
    assert all(0.2 < ratio < 2.0 for ratio in kept.values())
