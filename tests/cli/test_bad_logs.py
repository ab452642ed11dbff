"""Bad logs, models and manifests: the line on stderr names what is wrong, and a file of another kind its verb."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main

DATA = Path(__file__).parents[1] / "data"
HEAD = "time [s],position [rad],motor_torque [N·m]"
T = np.arange(1500) * 1e-3
Q = 0.3 * np.sin(2.0 * np.pi * T)
TORQUE = 0.285 * np.sign(np.cos(2.0 * np.pi * T)) + 0.02 * np.cos(2.0 * np.pi * T)
MODEL = """
format = "stickslip-model-1"
law = "coulomb"
[parameters]
fc = 0.3
[axis]
inertia = 4e-4
[[estimates]]
name = "fc"
unit = "N·m"
value = 0.3
std = 0.01
lower = 0.28
upper = 0.32
identified = true
[correlation]
names = ["fc"]
matrix = [[1.0]]
"""
# The model with one thing changed: what stands in it, what is put there.
MODELS = {
    "model.toml": ("", ""),
    "other_schema.toml": ("stickslip-model-1", "stickslip-model-99"),
    "heavy.toml": ("inertia = 4e-4", 'inertia = "heavy"'),
    "negative.toml": ("inertia = 4e-4", "inertia = -1.0"),
    "no_value.toml": ("value = 0.3", "valu = 0.3"),
    "wide.toml": ("[[1.0]]", "[[1.0, 0.0]]"),
}
MANIFESTS = {"no_json": "not json", "a_list": "[1, 2]", "another": '{"schema": 99, "runs": []}'}
IDENTIFY = ["--law", "coulomb", "--no-report"]
# What is found only while it is computed, after a look at whether the result may be written.
COMPUTED = [*IDENTIFY, "--out", "found.toml"]
SIBLINGS = [
    (["identify", "short.csv", *COMPUTED], "60 samples hold 0 independent ones in motion"),
    (["identify", "short.csv", *COMPUTED, "--law", "stribeck"], "60 samples hold 0 independent ones in motion"),
    (["identify", "short.csv", *COMPUTED, "--set", "fc=0.3"], "or say where the search starts with --set inertia=.."),
    (["identify", "brief.csv", *COMPUTED], "the effects of fc and offset cannot be distinguished in this motion"),
    (["identify", "undriven.csv", *IDENTIFY], "--map torque=COLUMN:UNIT"),
    (["identify", "folder", *IDENTIFY], "folder is a folder"),
    (["doctor", "folder"], "folder is a folder"),
    (["identify", "good.csv", *COMPUTED, "--set", "inertia=-1"], "inertia = -1 kg·m² must be greater than 0"),
    (["identify", "good.csv", *COMPUTED, "--set", "fx=1"], "unknown parameter 'fx'"),
    (["identify", "good.csv", *COMPUTED, "--free", "fx"], "unknown parameter 'fx'"),
    (["identify", "good.csv", *IDENTIFY, "--counts-per-rev", "nan"], "--counts-per-rev: nan is not a number"),
    (["doctor", "good.csv", "--torque-constant", "nan"], "--torque-constant: nan is not a number"),
    (["identify", "good.csv", *IDENTIFY, "--loop", "kp=1"], "--loop needs the reference position"),
    (["identify", "closed.csv", *IDENTIFY, "--loop", "kp=nan"], "--loop kp=nan: nan must be a finite number"),
    (["identify", "closed.csv", *IDENTIFY, "--loop", "kp=-7,kd=0.1"], "kp = -7 must be a finite number of 0 or more"),
    (["identify", "closed.csv", *IDENTIFY, "--loop", "kp=1,span=0"], "span = 0 must be 1 or 2"),
    (["identify", "closed.csv", *IDENTIFY, "--loop", "kp=1,limit=-1"], "limit = -1 must be greater than 0"),
    (["compare", "heavy.toml", "model.toml"], "axis.inertia = 'heavy' must be a number"),
    (["compare", "no_value.toml", "model.toml"], "lacks 'value'"),
    (["compare", "wide.toml", "model.toml"], "cannot be read"),
    (["compare", "other_schema.toml", "model.toml"], "identify the axis again"),
    (["compare", "one_run.toml", "model.toml"], "one_run.toml is a simulation, not a model"),
    (["compare", "empty.toml", "model.toml"], "empty.toml holds no model"),
    (["export", "small_study.toml", "--to", "c99"], "small_study.toml is a study, not a model"),
    (["recommend", "heavy.toml"], "axis.inertia = 'heavy' must be a number"),
    (["recommend", "negative.toml"], "inertia = -1 kg·m² must be greater than 0"),
    (["recommend", "model.toml", "--inertia", "nan"], "--inertia: nan is not a number"),
    (["recommend", "model.toml", "--amplitude=1", "--frequency=1e6"], "--frequency 1e+06 Hz is more than a tenth"),
    (["simulate", "model.toml"], "model.toml holds a model, not a closed loop"),
    (["rig", "run", "breakaway", "--rig", "ideal", "--set", "rate=-1"], "rate = -1 must be 0 or greater"),
    (["rig", "run", "breakaway", "--rig", "ideal", "--set", "rate=0"], "breakaway: no plan is possible with rate = 0"),
    (["rig", "run", "sliding", "--rig", "ideal", "--set", "velocities=1,nan"], "velocities = 1,nan must be finite"),
    (["rig", "run", "sliding", "--rig", "ideal", "--set", "rest=-1"], "sliding: rest = -1 must be 0 or greater"),
    (["rig", "run", "inertia", "--rig", "ideal", "--set", "current=1,-1"], "current = -1 must be 0 or greater"),
    (["rig", "run", "stickslip", "--rig", "ideal", "--set", "amplitude=-9"], "amplitude = -9 must be 0 or greater"),
    (["rig", "run", "sliding", "--rig", "ideal", "--set", "velocities=0"], "possible with velocities = (0.0,)"),
    (["rig", "commission", "--rig", "ideal", "--dry-run", "--limit", "speed=1e-3"], "leaves 0 of the velocities"),
    (["rerun", "no_json"], "is not JSON"),
    (["rerun", "a_list"], "lists no inputs of a study"),
    (["rerun", "another"], "lists no inputs of a study"),
]  # fmt: skip


@pytest.fixture(scope="module")
def siblings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records that are too short, lack a signal or hold no numbers; models and manifests with one fault each."""
    folder = tmp_path_factory.mktemp("siblings")
    for name, head, columns in (
        ("good.csv", HEAD, (T, Q, TORQUE)),
        ("short.csv", HEAD, (T[:60], Q[:60], TORQUE[:60])),
        ("brief.csv", HEAD, (T[:150], Q[:150], TORQUE[:150])),
        ("undriven.csv", "time [s],position [rad]", (T, Q)),
        ("closed.csv", f"{HEAD},position_reference [rad]", (T, Q, TORQUE, Q)),
    ):
        np.savetxt(folder / name, np.column_stack(columns), "%.9g", ",", header=head, comments="")
    for name, (old, new) in MODELS.items():
        (folder / name).write_text(MODEL.replace(old, new, 1), encoding="utf-8")
    for name, text in MANIFESTS.items():
        (folder / name).mkdir()
        (folder / name / "manifest.json").write_text(text)
    for name in ("small_study.toml", "one_run.toml", "motion.csv"):
        shutil.copy(DATA / name, folder)
    (folder / "empty.toml").touch()
    (folder / "folder").mkdir()
    return folder


@pytest.mark.parametrize(("argv", "named"), SIBLINGS, ids=[" ".join(argv) for argv, _ in SIBLINGS])
def test_what_is_wrong_is_named(
    siblings: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    argv: list[str],
    named: str,
) -> None:
    monkeypatch.chdir(siblings)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(siblings / "config"))
    assert main(argv) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    *warnings, line = streams.err.splitlines()
    assert named in line
    assert all(argv[1] in warning for warning in warnings)  # the doctor's, about this record
    assert not (siblings / "config").exists()  # nothing of a refused call is kept for later ones


def test_rows_without_numbers_are_left_out_as_the_doctor_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    holed = Q.copy()
    holed[700:705] = np.nan
    np.savetxt("holed.csv", np.column_stack((T, holed, TORQUE)), "%.9g", ",", header=HEAD, comments="")
    assert main(["identify", "holed.csv", "--inverse", "--no-report", "--json"]) == 0
    streams = capsys.readouterr()
    assert "5 of 1500 rows are left out: rows 701:705" in streams.err
    printed = json.loads(streams.out)
    assert printed["data"][0]["rows"] == 1495
    fc = next(e["value"] for e in printed["estimates"] if e["name"] == "fc")
    assert fc == pytest.approx(0.285, rel=0.02)


def test_a_unit_that_nobody_knows_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    head = HEAD.replace("[rad]", "[furlong]")
    np.savetxt("far.csv", np.column_stack((T, Q, TORQUE)), "%.9g", ",", header=head, comments="")
    assert main(["doctor", "far.csv"]) == 2
    assert "'position [furlong]' is in 'furlong', which is none that is known" in capsys.readouterr().out
    assert main(["doctor", "far.csv", "--map", "position=position [furlong]:rad"]) == 0


def test_columns_that_are_not_used_are_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    more = (f"foo{i}" for i in range(10))
    table = np.column_stack((T, Q, TORQUE, *(np.ones_like(T) for _ in range(10))))
    np.savetxt("wide.csv", table, "%.9g", ",", header=",".join((HEAD, *more)), comments="")
    assert main(["doctor", "wide.csv"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert f"not used: {', '.join(repr(f'foo{i}') for i in range(8))} and 2 more" in said
    assert main(["doctor", "wide.csv", "--map", "temperature=foo3:°C"]) == 0
    assert "'foo3'" not in next(x for x in capsys.readouterr().out.splitlines() if x.startswith("not used"))


@pytest.mark.parametrize(
    ("verb", "file", "is_a", "verbs"),
    [
        ("identify", "model.toml", "is a model, not a record", "stickslip export"),
        ("doctor", "model.toml", "is a model, not a record", "stickslip recommend"),
        ("analyse position", "study.toml", "is a study, not a record", "stickslip study"),
        ("doctor", "report.html", "is a report, not a record", "browser"),
        ("recommend", "log.csv", "is a record, not a model", "stickslip identify log.csv"),
        ("compare model.toml", "log.csv", "is a record, not a model", "stickslip identify log.csv"),
        ("compare model.toml", "run.toml", "is a simulation, not a model", "stickslip simulate run.toml"),
        ("tune", "log.csv", "is a record, not a sweep", "stickslip identify log.csv"),
        ("tune", "model.toml", "is a model, not a sweep", "stickslip recommend"),
        (
            "sweep",
            "model.toml",
            "is a model, not a sweep (`study` and tables [vary.NAME])",
            "stickslip recommend",
        ),
        ("sweep", "study.toml", "is a study, not a sweep", "stickslip study study.toml"),
        (
            "simulate",
            "tune.toml",
            "is a sweep with a table [tune], not a simulation",
            "stickslip tune tune.toml",
        ),
        ("study", "sweep.toml", "is a sweep, not a study", "stickslip sweep sweep.toml"),
        ("export --to c99", "log.csv", "is a record, not a model", "stickslip identify log.csv"),
        ("export --to c99", "study.toml", "is a study, not a model", "stickslip study study.toml"),
        ("rig run breakaway --rig", "study.toml", "is a study, not a rig", "stickslip study study.toml"),
        ("rig run breakaway --rig", "model.toml", "holds no inertia", "identify the axis"),
        ("rig commission --rig", "log.csv", "is a record, not a rig", "stickslip identify log.csv"),
    ],
)
def test_a_file_of_another_kind_is_named_with_the_verb_that_takes_it(
    verb: str, file: str, is_a: str, verbs: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    shutil.copy(DATA / "small_study.toml", tmp_path / "study.toml")
    shutil.copy(DATA / "one_run.toml", tmp_path / "run.toml")
    texts = {
        "model.toml": 'law = "coulomb"\n[parameters]\nfc = 0.2\n', "log.csv": "t,q\n0,0\n1,1\n",
        "report.html": "<html>", "sweep.toml": 'study = "thesis"\n',
        "tune.toml": 'study = "thesis"\n[tune."controller.gain"]\nrange = [0.0, 1.0]\n',
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    assert main([*verb.split(), file]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"{file} {is_a}" in said
    assert verbs in said
