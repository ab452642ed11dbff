"""A model that runs but is seldom meant is remarked upon where a person makes or reads it, and goes on to run."""

from __future__ import annotations

import copy
import dataclasses
import warnings

import pytest

from stickslip.cli import main
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.core.errors import ModelRemark, ParameterError
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

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
        model = Model("lugre", {"symmetry": "asymmetric"}, **FALLING, fs_negative=0.1)
    assert model.parameters.fs_negative == 0.1


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


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"sample_time": 1e-3, "velocity_filter": 1e4}, "velocity_filter = 10000 Hz hardly filters"),
        ({"sample_time": 1.0}, "sample_time = 1 s is slow for a drive; a millisecond is 0.001 s"),
    ],
)
def test_numbers_of_a_controller_that_are_hardly_meant(numbers, said):
    with pytest.warns(ModelRemark, match=said) as caught:
        controller = Controller(Gains(kp=1.0), **numbers)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Controller(Gains(kp=1.0), sample_time=1e-3, velocity_filter=400.0)
        controller.with_numbers({"kp": 2.0})


def test_a_file_says_it_too(tmp_path, capsys):
    (tmp_path / "run.toml").write_text(
        RUN.format(friction='law = "coulomb"\nfc = 0.1') + "sample_time = 1e-3\nvelocity_filter = 1e4\n"
    )
    assert main(["simulate", str(tmp_path / "run.toml"), "--out", str(tmp_path / "run.npz")]) == 0
    assert capsys.readouterr().err.count("velocity_filter = 10000 Hz hardly filters") == 1


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Gains(kp=-3.0), "Gains: kp = -3 N·m/rad must be at least 0"),
        (lambda: Cascade(1.0, -1.0), "Cascade: kvp = -1 N·m·s/rad must be at least 0"),
        (lambda: Gains(kp=float("inf")), "Gains: kp = inf N·m/rad must be a finite number"),
        (lambda: Controller(Gains(1.0), sample_time=1e-3, encoder_counts=0.5), "encoder_counts = 0.5 must be"),
        (
            lambda: simulate(
                RigidAxis(1e-3, Model("coulomb", fc=0.1)), Controller(Gains(1.0)),
                Reference("sine", amplitude=0.1, frequency=1.0), 0.1, output=[],
            ),
            "output holds no times",
        ),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(make, said):
    with pytest.raises(ParameterError, match=said):
        make()


@pytest.mark.parametrize("change", [dataclasses.replace, getattr(copy, "replace", dataclasses.replace)])
def test_a_changed_controller_is_remarked_upon_where_it_is_changed(change):
    """It was in dataclasses.py."""
    usual = Controller(Gains(10.0, 0.1), sample_time=1e-3)
    with pytest.warns(ModelRemark, match="slow for a drive") as said:
        change(usual, sample_time=1.0)
    assert [w.filename for w in said] == [__file__]
