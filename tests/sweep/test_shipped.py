"""The sweeps that ship: they load, and a handful of their cases run and are drawn."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip.report.sweep_pictures import draw
from stickslip.sweep import execute
from stickslip.sweep.block import compute
from stickslip.sweep.gains import recommended
from stickslip.sweep.plan import BUILT_IN, load


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_case_of_every_run_is_run(name):
    sweep = load(name)
    few = replace(sweep, drawn=replace(sweep.drawn, cases=1), check=False)
    for run in range(len(few.runs)):
        block = compute(few, run, 0)
        assert block.failures == [""]
        assert np.isfinite(block.metrics).all()


def test_the_gain_is_recommended_where_the_percentile_is_least(tmp_path):
    sweep = load("thesis-gain")
    gms = [run for run in sweep.runs if run.controller == "FB-gms"]
    shorter = [replace(run, duration=0.3) for run in gms]
    few = replace(sweep, runs=shorter, drawn=replace(sweep.drawn, cases=600), check=False)
    execute.run(few, tmp_path)
    found = recommended(tmp_path, few, few.runs[0])
    assert found.least == found.high.min()
    assert found.gain == found.gains[found.high.argmin()]
    assert found.gains.min() > 0.5
    assert found.gains.max() < 1.1
    assert any(path.name.startswith("gain-") for path in draw(tmp_path, few))
