"""A sweep in a SIMD batch: within a percent of the exact one or flagged, and what it cannot run is told."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.errors import ConfigError
from stickslip.simulation.many import simd_batch
from stickslip.sweep import block, forecast, metric_check
from stickslip.sweep.plan import load
from support.sweeps import SMALL, table


def in_lanes(tmp_path, more=""):
    """The small sweep in lanes, of few cases."""
    text = SMALL.read_text().replace("../data", (SMALL.parents[1] / "data").as_posix())
    text = text.replace("cases = 600", f'cases = 12\nintegrator = "lanes"\n{more}')
    path = tmp_path / "simd_batch.toml"
    path.write_text(text)
    return path


def test_lanes_are_within_a_percent_or_flagged(tmp_path):
    sweep = load(in_lanes(tmp_path))
    assert sweep.step == 1e-4
    for run in range(len(sweep.runs)):
        exact = block.compute(replace(sweep, step=0.0), run, 0)
        for step, most in ((1e-4, 0.3), (5e-3, 1.0)):
            fast = block.compute(replace(sweep, step=step), run, 0)
            assert not any(fast.failures)
            assert np.all(fast.flagged | ~metric_check.differ(exact.metrics, fast.metrics, sweep.metrics))
            assert np.mean(fast.flagged) <= most
            assert not np.array_equal(fast.metrics, exact.metrics)
        assert fast.flagged.any()  # of steps as long as 5 ms
    assert sweep.fingerprint(0) != replace(sweep, step=0.0).fingerprint(0)


def test_a_step_with_more_switches_than_were_followed_is_flagged(tmp_path, monkeypatch):
    sweep = load(in_lanes(tmp_path, "check = false"))
    assert not block.compute(sweep, 0, 0).flagged.any()

    def run(many, *args, run=simd_batch.Lanes.run, **more):
        return replace(run(many, *args, **more), unresolved=np.arange(12) % 3)

    monkeypatch.setattr(simd_batch.Lanes, "run", run)
    assert block.compute(sweep, 0, 0).flagged.tolist() == [False, True, True] * 4


def test_a_run_that_lanes_refuse_is_told_of(tmp_path, capsys):
    path, data = in_lanes(tmp_path), SMALL.parents[1] / "data"
    study = (data / "small_study.toml").read_text().replace("motion.csv", (data / "motion.csv").as_posix())
    (tmp_path / "study.toml").write_text(study.replace('"signed"', '"literal"'))
    path.write_text(re.sub("study = .*", 'study = "study.toml"', path.read_text()))
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "--no-report"]) == 0
    told = capsys.readouterr().err
    assert "FF-lugre: integrator exact, not in lanes: no lanes: slip rule 'literal' needs its events" in told
    run = json.loads((tmp_path / "out" / "manifest.json").read_text())["runs"][0]
    assert run["integrator"] == "exact"
    assert "needs its events" in run["because"]
    assert set(table(tmp_path / "out")["integrator"].to_pylist()) == {"exact"}


def test_a_missing_gpu_is_told_before_anything_runs(tmp_path, capsys):
    path = in_lanes(tmp_path, 'device = "gpu"')
    assert load(path).device == "gpu"  # Reading needs none: another machine may run it.
    assert main(["sweep", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "looked for NVIDIA's driver" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("device", "cases"), [("cpu", 256), ("gpu", 16_384)])
def test_a_block_fills_the_device(tmp_path, device, cases):
    assert forecast.size_timed(load(in_lanes(tmp_path, f'device = "{device}"')), 0) == cases


def test_what_lanes_do_not_measure_is_told(tmp_path):
    path = in_lanes(tmp_path)
    path.write_text(path.read_text().replace('"velocity_rms_rad_s"]', '"standstills"]'))
    with pytest.raises(ConfigError, match="'standstills', which lanes do not measure"):
        load(path)
