"""Controllers made of control laws in files: studies, single runs, what a sweep varies, the C export."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.contract.control_laws import examine
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.control.registry import control_law
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import ConfigError
from stickslip.studies.study import execute, load, load_run
from stickslip.sweeps.numbers import as_columns, known, value_of, varied

OWN = Path(__file__).parents[1] / "support" / "sliding_mode.py"
STUDY = """
plugins = ["sliding_mode.py"]
slip_rules = ["signed"]
time_step = 2e-4
[axis]
inertia = 3.8623e-4
[friction.nominal]
law = "lugre"
sigma0 = 3.5e4
sigma1 = 0.1
sigma2 = 0.018
fs = 0.335
fc = 0.285
vs = 0.01
[references.sine]
kind = "sine"
amplitude = 0.05
frequency = 2.0
duration = 0.3
placement = {bandwidth_hz = 20.0, damping = 1.0}
[laws.less]
law = "lugre"
sigma0 = 3.5e4
sigma2 = 0.018
fs = 0.30
fc = 0.25
vs = 0.01
[controllers.PD]
sample_time = 1e-3
loop = {law = "pd"}
[controllers.observed]
sample_time = 1e-3
torque_limit = 1.0
loop = {law = "pd"}
feedforward = [{law = "friction_feedforward", friction = "less"}, {law = "inertia_feedforward"}]
observer = {law = "disturbance_observer", corner = 400.0, order = "second"}
estimator = {law = "filtered_difference", corner = 2000.0}
[controllers.sliding]
sample_time = 1e-3
loop = {law = "sliding_mode", slope = 62.8, torque = 0.45, layer = 0.5}
"""
RUN = """
[axis]
inertia = 3.8623e-4
[friction]
law = "coulomb"
fc = 0.2
[reference]
kind = "sine"
amplitude = 0.05
frequency = 2.0
duration = 0.2
placement = {bandwidth_hz = 20.0, damping = 1.0}
[controller]
sample_time = 1e-3
loop = {law = "pid", anti_windup = "back_calculation", tracking_time = 0.02}
observer = {law = "disturbance_observer", corner = 300.0, at_rest = "reset"}
"""


@pytest.fixture
def study(tmp_path):
    shutil.copy(OWN, tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    with allow_code():
        return load(tmp_path / "study.toml")


def test_a_study_runs_them_by_name(study):
    runs = {run.controller: run for run in study.runs}
    assert list(runs) == ["PD", "observed", "sliding"]
    observed = runs["observed"].control
    assert list(observed.blocks) == ["estimator", "feedforward", "feedforward_2", "observer", "loop"]
    assert observed.values()["loop_kp"] == pytest.approx(6.0991, rel=1e-4)
    assert observed.values()["observer_inertia"] == observed.values()["feedforward_2_inertia"] == 3.8623e-4
    done = {name: execute(run) for name, run in runs.items()}
    assert [d.failure for d in done.values()] == ["", "", ""]
    errors = {name: d.metrics["position_rms_rad"] for name, d in done.items()}
    assert errors["observed"] < 0.2 * errors["PD"]
    assert errors["sliding"] < errors["PD"]


def test_a_fingerprint_knows_every_number_of_every_law(study):
    run = study.runs[1]
    seen = {run.fingerprint}
    for name in (
        "observer_corner",
        "feedforward_friction_fc",
        "feedforward_gain",
        "estimator_corner",
        "loop_kd",
    ):
        changed = run.control.with_values({name: 1.01 * run.control.values()[name]})
        seen.add(replace(run, control=changed).fingerprint)
    assert len(seen) == 6


def test_a_sweep_varies_their_numbers_by_name(study):
    run = study.runs[1]
    assert value_of(run, "controller.observer_corner") == 400.0
    assert "controller.feedforward_friction_fs" in known(run)
    other = varied(
        run,
        {
            "controller.observer_corner": 250.0,
            "controller.feedforward_friction_fs": 0.31,
            "controller.torque_limit": 2.0,
        },
    )
    assert other.control.values()["observer_corner"] == 250.0
    assert other.control.blocks["feedforward"].friction.parameters.fs == 0.31
    assert other.control.torque_limit == 2.0
    assert other.control.laws == run.control.laws


def test_in_continuous_time_a_sweep_varies_them_as_gains_and_a_compensator(study):
    base = study.runs[1]
    laws = {
        "loop": base.control.loop,
        "feedforward": ControlBlock(
            "friction_feedforward", base.control.blocks["feedforward"].friction, gain=0.9
        ),
    }
    run = replace(base, control=Controller(sample_time=0.0, **laws))
    swept = {
        "controller.bandwidth_hz": np.array([20.0, 30.0]),
        "controller.feedforward_gain": np.array([0.5, 0.6]),
        "controller.feedforward_friction_fc": np.array([0.2, 0.25]),
        "axis.inertia": np.array([3e-4, 4e-4]),
    }
    found = as_columns(run, swept)
    assert found.pop("law.fc") == pytest.approx([0.2, 0.25])
    assert found.pop("gain") == pytest.approx([0.5, 0.6])
    assert found.pop("inertia") == pytest.approx([3e-4, 4e-4])
    plain = replace(run, control=Controller(place("PD", 3.8623e-4, 20.0, 1.0)))
    gains = as_columns(plain, {"controller.bandwidth_hz": np.array([20.0, 30.0])})
    assert list(found) == list(gains) == ["kp", "ki", "kd", "kr"]
    for name, column in gains.items():
        assert found[name] == pytest.approx(column, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"pd"}\n[controllers.o', '"dp"}\n[controllers.o', r"controllers\.PD\.loop\.law = .dp. is not known"),
        ("corner = 400.0", "corner = -1.0", r"controllers\.observed\.observer: .*corner = -1"),
        ("corner = 400.0", "korner = 400.0", r"no parameter 'korner'; did you mean .*corner"),
        ('friction = "less"', 'friction = "more"', r"friction = .*more.* is not known"),
        ('law = "inertia_feedforward"', 'law = "pd"', r"feedforward = 'pd' cannot be used as feedforward"),
        ("sample_time = 1e-3\nloop = {law = \"sliding", "loop = {law = \"sliding", "acts on samples only"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(tmp_path, old, new, words):
    assert old in STUDY
    shutil.copy(OWN, tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    with allow_code(), pytest.raises(ConfigError, match=words) as wrong:
        load(tmp_path / "study.toml")
    assert "\n" not in str(wrong.value)


def test_a_run_of_a_file_is_exported_to_c_as_it_is(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("run.toml").write_text(RUN)
    assert load_run(Path("run.toml")).control.values()["loop_tracking_time"] == 0.02
    assert main(["export", "run.toml", "--to", "c99", "--controller", "--check"]) == 0
    said = capsys.readouterr().out
    if shutil.which("gcc") or shutil.which("clang"):
        assert "at most 0 N·m off the definition" in said
    assert Path("run-c99/run.c").read_text().count("loop_integral") > 2
    for target in ("arduino", "python", "matlab", "st", "fmu"):
        assert main(["export", "run.toml", "--to", target, "--controller", "--check"]) == 0
        assert Path(f"run-{target}", "README.md").exists()
    assert main(["export", "run.toml", "--to", "urdf", "--controller"]) == 2


def test_the_law_of_the_documentation_keeps_its_contract():
    law = control_law(str(OWN))
    assert [f"{v.name}: {v.text}" for v in examine(law) if v.passed is False] == []
