"""The sweeps that ship: they load, and a handful of their cases run and are drawn."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.report import sweep_pictures
from stickslip.report.sweep_pictures import draw
from stickslip.report.swept_names import number_named, symbol
from stickslip.studies.study import load as study_of
from stickslip.sweeps import execute
from stickslip.sweeps.block import compute
from stickslip.sweeps.gains import recommended
from stickslip.sweeps.plan import BUILT_IN, load


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


def gains_of(tmp_path, more):
    """A sweep of the gain of a small study, not yet run."""
    data = (Path(__file__).parents[1] / "data" / "small_study.toml").as_posix()
    path = tmp_path / "mine.toml"
    path.write_text(
        f'study = "{data}"\nonly = ["nominal", "sine", "FF-lugre"]\ncheck = "no"\n{more[0]}\n'
        f'[vary."controller.gain"]\nrange = [0.5, 1.1]\n{more[1]}\n[vary."friction.fs"]\nscale = [0.9, 1.1]\n{more[2]}'
    )
    return path


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (("cases = 149", "", ""), "149 cases are too few for .*; take 150 or more"),
        (("method = 'grid'", "points = 20", "points = 19"), "each gain of the grid has 19 cases"),
    ],
)
def test_no_gain_is_recommended_from_too_few_cases(tmp_path, capsys, more, why):
    path, out = gains_of(tmp_path, more), tmp_path / "out"
    assert main(["sweep", str(path), "--out", str(out)]) == 0
    assert re.search(f"no gain is recommended: {why}", capsys.readouterr().err)
    assert not list(out.rglob("gain-*"))
    assert list(out.rglob("percentiles-*"))


def test_a_gain_of_a_grid_is_one_of_its_points(tmp_path, monkeypatch):
    sweep = load(gains_of(tmp_path, ("method = 'grid'", "points = 5", "points = 20")))
    execute.run(sweep, tmp_path / "out")
    found = recommended(tmp_path / "out", sweep, sweep.runs[0])
    assert found.gains.tolist() == pytest.approx([0.5, 0.65, 0.8, 0.95, 1.1])
    drawn = {}
    monkeypatch.setattr(sweep_pictures, "draw_panels", lambda stem, *about: drawn.update({stem.name: about}))
    draw(tmp_path / "out", sweep)
    title, message, panels, _ = drawn["gain-signed-sine-nominal"]
    assert title == "mine: 2 parameters of study small_study varied"
    assert panels[0].y_label == "RMS position error,\n95th percentile (mrad)"
    assert message.startswith(f"Best gain: FF-lugre\u00a0{found.gain:.2f} ({sweep.drawn.cases} cases")
    assert all(name.isascii() and "." not in name for name in drawn_names(drawn))


def drawn_names(drawn):
    """What stands along y in the tornado pictures."""
    return [
        n.replace("$", "") for stem, about in drawn.items() if "tornado" in stem for n in about[2][0].y_names
    ]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("axis.inertia", ("$J$", "kg·m²")),
        ("friction.fs", ("$F_{S}$", "N·m")),
        ("friction.sigma2", (r"$\sigma_{2}$", "N·m·s/rad")),
        ("law.fc", ("$F_{C}$, model", "N·m")),
        ("controller.bandwidth_hz", ("bandwidth", "Hz")),
        ("controller.gain", ("compensator gain", "")),
        ("controller.observer_corner", ("observer corner", "")),
    ],
)
def test_a_number_is_shown_as_the_field_writes_it(name, shown):
    run = next(r for r in study_of("thesis").runs if r.controller == "FF-lugre")
    assert number_named(run, name) == shown


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("F_S", "$F_{S}$"),
        ("sigma_0", r"$\sigma_{0}$"),
        ("DV", "DV"),
        ("v(t - tau_L)", "v(t - tau_L)"),
        ("a$b", "ab"),
    ],
)
def test_a_symbol_that_mathtext_cannot_set_is_written_plainly(written, shown):
    assert symbol(written) == shown


def test_a_gain_drawn_as_a_factor_is_told_as_a_gain(tmp_path):
    path = gains_of(tmp_path, ("method = 'grid'", "points = 2", "points = 20"))
    path.write_text(path.read_text().replace("range", "scale"))
    sweep = load(path)
    execute.run(sweep, tmp_path / "out")
    own = sweep.runs[0].control.compensator.gain
    found = recommended(tmp_path / "out", sweep, sweep.runs[0])
    assert own != 1.0
    assert found.gains.tolist() == pytest.approx([0.5 * own, 1.1 * own])
