"""`rig run track` with a controller made of control laws, from a TOML file."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.record import Record
from stickslip.rigs.procedures import procedure
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.virtual import virtual_rig

OWN = Path(__file__).parents[1] / "support" / "sliding_mode.py"
PLACED = "placement = {bandwidth_hz = 25.0, damping = 1.0}"
FILE = f"""
[controller]
sample_time = 1e-3
{PLACED}
loop = {{law = "pd"}}
"""
AHEAD = 'feedforward = {law = "friction_feedforward", friction = "lugre"}\n'
OBSERVER = 'observer = {law = "disturbance_observer", corner = 300.0}\n'


def tracked(**options):
    return perform(
        procedure("track").with_options({"duration": "1", **options}), virtual_rig("thesis-dry")
    ).record


def rms(record):
    return float(np.sqrt(np.mean((record["position_reference"] - record["position"]) ** 2)))


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "controller.toml"

    def write(text):
        path.write_text(text)
        return str(path)

    return write


def test_a_file_says_what_the_options_say(file):
    """Gains placed with the nominal inertia, the limit below the rig's."""
    by_file, by_options = tracked(controller=file(FILE)), tracked()
    for name in ("position", "torque_command", "compensation_torque"):
        assert by_file[name] == pytest.approx(by_options[name], abs=2e-9), name


def test_what_is_learned_is_kept_from_run_to_run(tmp_path):
    path = tmp_path / "learned.toml"
    options = {"compensator": "scale-dob", "reference": "high", "duration": "3", "learned": str(path)}
    first = tracked(**options)
    kept = tomllib.loads(path.read_text())
    name = "feedforward_scale"
    assert kept["learned"][name] == first.meta["learned"][name]["value"] != 1.0
    assert kept["uncertainty"][name] == first.meta["learned"][name]["uncertainty"] > 0.0
    assert any(c["text"].startswith("friction over that of the law") for c in first.meta["checks"])
    path.write_text(path.read_text().replace(f"{name} = 0.9", f"{name} = 0.5", 1))
    begun = tracked(**{**options, "duration": "0.2"})  # it has not slid far by then
    assert begun.meta["learned"][name]["value"] < 0.8
    with pytest.raises(InputError, match="was learned with other laws"):
        tracked(**{**options, "compensator": "rls-dob"})
    with pytest.raises(InputError, match="no law of this controller learns"):
        tracked(**{**options, "compensator": "dob"})


def test_an_observer_tracks_closer_and_the_plan_names_the_file(file):
    path = file(FILE + AHEAD + OBSERVER)
    observed, ahead, alone = (
        rms(tracked(controller=path)),
        rms(tracked(controller=file(FILE + AHEAD))),
        rms(tracked()),
    )
    assert observed < 0.7 * ahead
    assert ahead < 0.7 * alone
    plan = procedure("track").with_options({"controller": path}).plan(virtual_rig("thesis-dry"))
    assert plan.text == (f"follow low for 5 s: by the controller of {path}",)


def test_a_file_without_a_sample_time_takes_that_of_the_rig(file):
    text = (FILE + OBSERVER).replace("sample_time = 1e-3\n", "")
    made = procedure("track").with_options({"controller": file(text)}).made(virtual_rig("thesis-dry"))
    assert made.sample_time == 1e-3


def test_the_limit_of_the_rig_is_kept_and_a_lower_one_too(file):
    rig = virtual_rig("thesis-dry")
    free = procedure("track").with_options({"controller": file(FILE)}).made(rig)
    low = procedure("track").with_options({"controller": file(FILE + "torque_limit = 0.1\n")}).made(rig)
    assert free.torque_limit < rig.limits.torque
    assert low.torque_limit == 0.1


def test_the_file_of_a_run_serves_with_its_own_laws_and_inertia(tmp_path, monkeypatch, capsys):
    shutil.copy(OWN, tmp_path)
    monkeypatch.chdir(tmp_path)
    Path("run.toml").write_text(
        """
plugins = ["sliding_mode.py"]
[axis]
inertia = 4e-4
[friction]
law = "coulomb"
fc = 0.2
[reference]
kind = "sine"
amplitude = 0.05
frequency = 2.0
duration = 0.2
[controller]
time_step = 1e-4
sample_time = 1e-3
loop = {law = "sliding_mode", slope = 62.8, torque = 0.3, layer = 0.5}
"""
    )
    line = [
        "rig",
        "run",
        "track",
        "--rig",
        "thesis-dry",
        "--set",
        "controller=run.toml",
        "--set",
        "duration=1",
    ]
    assert main([*line, "--allow-code", "--out", "out.npz"]) == 0
    assert "error" in capsys.readouterr().out
    assert len(Record.load(Path("out.npz"))) == 1000


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (
            FILE,
            {"gain": "0.9"},
            "gain = 0.9 cannot be combined with controller = controller.toml, which defines it",
        ),
        (FILE.replace("1e-3", "2e-3"), {}, "sample_time = 0.002 s, that of the rig is 0.001 s"),
        (FILE.replace('loop = {law = "pd"}', 'linear = "PD"'), {}, "names no control laws; give it a loop"),
        (FILE + AHEAD.replace("lugre", "lugri"), {}, "friction = 'lugri' is not known; did you mean 'lugre'"),
        (FILE.replace(PLACED, ""), {}, "kp"),
        (None, {}, "no file controller.toml"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(tmp_path, monkeypatch, capsys, text, options, words):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("controller.toml").write_text(text)
    given = {"controller": "controller.toml", **options}
    line = ["rig", "run", "track", "--rig", "thesis-dry"]
    assert main([*line, *(x for k, v in given.items() for x in ("--set", f"{k}={v}"))]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_a_compensator_of_the_catalogue_runs_by_its_name():
    given = {"bandwidth": "10", "reference": "high"}
    assert rms(tracked(compensator="dob", **given)) < 0.5 * rms(tracked(**given))
    with pytest.raises(ParameterError, match="adaptive_friction cannot adapt while the axis sticks"):
        tracked(compensator="makkar", **given)
