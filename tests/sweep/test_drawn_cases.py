"""Which cases a sweep draws: Sobol, Latin and grid points, nested ones, a model's intervals."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.model_file import write_model
from stickslip.models.model import Model
from stickslip.sweeps.plan import load
from stickslip.sweeps.sample import Drawn, Spread


@pytest.mark.parametrize("method", ["sobol", "latin"])
def test_blocks_are_parts_of_the_whole(method):
    drawn = Drawn(method, (Spread("a", 1.0, 2.0), Spread("b", 0.1, 10.0, logarithmic=True)), 600, 5)
    whole = drawn.block(0, 600)
    assert np.array_equal(whole[256:512], drawn.block(256, 512))
    assert whole.min(axis=0) == pytest.approx([1.0, 0.1], rel=0.03)
    assert whole.max(axis=0) == pytest.approx([2.0, 10.0], rel=0.03)
    # Even in the logarithm: half of the cases lie below 1.
    assert np.mean(whole[:, 1] < 1.0) == pytest.approx(0.5, abs=0.01)


def test_a_latin_hypercube_has_one_case_in_every_slice():
    drawn = Drawn("latin", (Spread("a", 0.0, 1.0), Spread("b", 0.0, 1.0)), 50, 1)
    for column in drawn.block(0, 50).T:
        assert sorted(np.floor(column * 50).astype(int)) == list(range(50))


def test_a_grid_has_every_point_with_every_other():
    drawn = Drawn("grid", (Spread("a", 1.0, 3.0, points=3), Spread("b", 0.0, 0.0, values=(5.0, 7.0))), 6, 1)
    assert drawn.block(0, 6).tolist() == [[1, 5], [1, 7], [2, 5], [2, 7], [3, 5], [3, 7]]
    assert drawn.block(4, 6).tolist() == [[3, 5], [3, 7]]


def test_a_nested_sweep_stays_within_the_level_that_it_drew():
    drawn = Drawn("sobol", (Spread("a", 0.7, 1.3), Spread("b", 0.7, 1.3)), 512, 1, nested=True)
    a, b, level = drawn.block(0, 512).T
    assert np.all(np.maximum(abs(a - 1.0), abs(b - 1.0)) <= 0.3 * level + 1e-12)
    assert np.mean(level < 0.25) == pytest.approx(0.25, abs=0.01)


def test_a_model_is_drawn_with_its_intervals_and_correlation():
    estimates = (
        Estimate("fs", "N·m", "F_S", 0.3, 0.03, 0.3 * np.exp(-0.196), 0.3 * np.exp(0.196), True),
        Estimate("inertia", "kg·m²", "J", 4e-4, 1e-5, 4e-4 * np.exp(-0.0196), 4e-4 * np.exp(0.0196), True),
    )
    drawn = Drawn("sobol", (), 4096, 1, estimates, ((1.0, 0.8), (0.8, 1.0)))
    assert drawn.names == ("friction.fs", "axis.inertia")
    logs = np.log(drawn.block(0, 4096) / [0.3, 4e-4])
    assert logs.std(axis=0) == pytest.approx([0.1, 0.01], rel=0.02)
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(0.8, abs=0.01)


def test_a_sweep_says_which_estimates_of_its_model_it_leaves_out(tmp_path, capsys):
    estimate = Estimate("fs", "N·m", "F_S", 0.335, 0.01, 0.32, 0.35, True)
    found = Identification(
        "commission",
        Model("gms", k=[1e4, 5e3], alpha=[0.5, 0.5], fs=0.335, fc=0.285, vs=0.01, delta_s=2.0, sigma2=0.018, c=24.0),
        (estimate, replace(estimate, name="breakaway.fs_positive")), np.eye(2), {},
    )  # fmt: skip
    write_model(tmp_path / "model.toml", found)
    (tmp_path / "study.toml").write_text(
        '[axis]\ninertia = 4e-4\n[friction.it]\nlaw = {model = "model.toml"}\n[references.s]\nkind = "sine"\n'
        "amplitude = 0.01\nfrequency = 4.0\nduration = 0.02\nplacement = {bandwidth_hz = 20.0, damping = 1.0}\n"
        '[controllers.PD]\nlinear = "PD"\n'
    )
    (tmp_path / "s.toml").write_text('study = "study.toml"\nmodel = "model.toml"\ncases = 2\ncheck = false\n')
    assert load(tmp_path / "s.toml").drawn.names == ("friction.fs",)
    assert main(["sweep", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--no-report"]) == 0
    assert (
        "not varied, as the model's law has no such parameters: breakaway.fs_positive"
        in capsys.readouterr().err
    )
