"""A model that runs but is seldom meant is remarked upon where a person makes or reads it, and goes on to run."""

from __future__ import annotations

import warnings

import pytest

from stickslip.cli import main
from stickslip.errors import ModelRemark
from stickslip.model import Model

RISING = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.2, "fc": 0.285, "vs": 0.01}
FALLING = {**RISING, "fs": 0.335}


def test_a_static_torque_below_the_coulomb_torque_is_remarked_upon():
    """It passed without a word, though every page says Stribeck; thesis Table 9 has such a model: it stays possible."""
    with pytest.warns(ModelRemark, match=r"lugre: fs = 0\.2 N·m lies below fc = 0\.285 N·m") as caught:
        model = Model("lugre", **RISING)
    assert model.parameters.fs == 0.2
    assert caught[0].filename == __file__


def test_in_the_other_direction_too():
    with pytest.warns(ModelRemark, match="for v < 0"):
        Model("lugre", {"symmetry": "asymmetric"}, **FALLING, fs_negative=0.1)


@pytest.mark.parametrize("values", [FALLING, {**FALLING, "fs": 0.285}])
def test_no_word_about_others_nor_inside_the_package(values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = Model("lugre", **values)
        assert model.scaled(fs=0.5).law.remark(model.scaled(fs=0.5).parameters)


def toml(values) -> str:
    return "\n".join(f"{k} = {v}" for k, v in values.items())


RUN = """
[axis]
inertia = 4e-4
[friction]
{friction}
[reference]
kind = "sine"
amplitude = 0.01
frequency = 4.0
duration = 0.05
[controller]
linear = "PD"
placement = {{bandwidth_hz = 36.0, damping = 1.0}}
"""


def test_the_command_line_says_it_once_in_a_line(tmp_path, capsys):
    (tmp_path / "model.toml").write_text(f'law = "lugre"\n[parameters]\n{toml(RISING)}\n')
    for friction in ('law = "lugre"\n' + toml(RISING), 'law = {model = "model.toml"}'):
        (tmp_path / "run.toml").write_text(RUN.format(friction=friction))
        assert main(["simulate", str(tmp_path / "run.toml"), "--out", str(tmp_path / "run.npz")]) == 0
        err = capsys.readouterr().err
        assert err.count("note:") == 1
        assert err.startswith("stickslip: note: ")
        assert "lies below fc" in err
    assert main(["law", "gms", "--set", "fs=0.2"]) == 0
    assert "lies below fc" in capsys.readouterr().err
    assert main(["law", "gms"]) == 0
    assert not capsys.readouterr().err


def test_no_exchange_is_proposed_for_what_was_identified(tmp_path):
    """Nobody mistook one number for the other: the identification's own notes say that friction rises."""
    file = tmp_path / "model.toml"
    file.write_text(f'format = "stickslip-model-1"\nlaw = "lugre"\n[parameters]\n{toml(RISING)}\n')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Model.from_file(file).parameters.fs == 0.2
    file.write_text(f'law = "lugre"\n[parameters]\n{toml(RISING)}\n')
    with pytest.warns(ModelRemark, match="exchange them"):
        Model.from_file(file)
