"""`stickslip export`: from a model file to files of a target."""

import json

import pytest

from stickslip.cli import main

RUN = """[axis]
inertia = 3.8623e-4
[friction]
law = "coulomb"
fc = 0.28
[reference]
kind = "sine"
amplitude = 0.01
frequency = 0.4
duration = 1.0
[controller]
linear = "PD"
placement = {bandwidth_hz = 36.0, damping = 1.0}
sample_time = 1e-3
compensator = "feedback"
law = "mine"
filter_hz = 10.0
[laws.mine]
law = "coulomb"
fc = 0.25
"""


@pytest.fixture
def model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "my model.toml"
    path.write_text(
        'law = "lugre"\n[parameters]\nsigma0 = 3.5e4\nsigma1 = 0.1\nfs = 0.335\nfc = 0.285\nvs = 0.01\n'
    )
    return str(path)


def test_it_writes_a_folder_named_after_model_and_target(model, tmp_path, capsys):
    assert main(["export", model, "--to", "c99"]) == 0
    written = {p.name for p in (tmp_path / "my_model-c99").iterdir()}
    assert {"my_model.h", "my_model.c", "README.md", "golden.csv"} <= written
    assert "my_model.h" in capsys.readouterr().out


def test_check_runs_the_export(model, capsys):
    assert main(["export", model, "--to", "python", "--check", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["check"]["passed"] is True
    assert said["check"]["python"] == 0.0


def test_a_whole_controller_leaves(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.toml").write_text(RUN)
    assert main(["export", "run.toml", "--to", "c99", "--controller", "--name", "drive", "--check"]) == 0
    assert "drive_sample(" in (tmp_path / "drive-c99" / "drive.h").read_text()


@pytest.mark.parametrize("kind", ["ff", "fb"])
def test_a_compensator_leaves_without_a_controllers_file(kind, model, tmp_path):
    call = ["export", model, "--to", "c99", "--compensator", kind, "--out", "drive", "--check"]
    assert main(call) == 0
    source = (tmp_path / "drive" / "my_model.c").read_text()
    assert f"1.0, /* {'feedforward' if kind == 'ff' else 'observer'}_gain:" in source
    assert "loop_kp" not in source


def test_a_filter_above_half_the_sample_rate_is_refused(model, capsys):
    call = ["export", model, "--to", "c99", "--compensator", "fb", "--filter-hz", "600"]
    assert main(call) == 2
    said = capsys.readouterr().err
    assert "--filter-hz 600 Hz" in said
    assert "at most 495 Hz" in said


def test_the_inertia_comes_from_the_models_file(model, tmp_path):
    with open(model, "a") as file:
        file.write("[axis]\ninertia = 2e-3\n")
    assert main(["export", model, "--to", "fmu-axis"]) == 0
    assert "| inertia | parameter | 0.002 |" in (tmp_path / "my_model-fmu-axis" / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--to", "c98"], "did you mean 'c99'"),
        ([], "--list"),
        (["--to", "python", "--single"], "one precision"),
        (["--to", "urdf", "--controller"], "law alone"),
        (["--to", "urdf", "--compensator", "ff"], "law alone"),
        (["--to", "c99", "--compensator", "fb", "--filter-hz", "0"], "--filter-hz"),
        (["--to", "c99", "--compensator", "fb", "--sample-time", "0"], "sample_time"),
        (["--to", "c99", "--filter-hz", "10"], "--compensator"),
        (["--to", "c99", "--gain", "0.9"], "--compensator"),
        (["--to", "c99", "--compensator", "fb", "--lead", "0.001"], "lead"),
        (["--to", "fmu-axis"], "--set inertia="),
        (["--to", "c99", "--name", "1st"], "no name in most languages"),
        (["--to", "c99", "--out", "/proc/none"], "/proc/none"),
    ],
)
def test_bad_calls_get_one_line(model, capsys, arguments, complaint):
    assert main(["export", model, *arguments]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert len(error.splitlines()) == 1


def test_targets_are_listed(capsys):
    assert main(["export", "--list"]) == 0
    assert "c99" in capsys.readouterr().out
