"""Bad input: exit code 2, one line that names the thing and the remedy, nothing lost."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip.cli import main
from stickslip.core.code_approval import asked_for

DATA = Path(__file__).parents[1] / "data"

# What stands in small_study.toml, what is put there, what the line must name.
STUDY = [
    ("inertia = 3.8623e-4", "inertia = -1.0", "axis.inertia = -1.0"),
    ("inertia = 3.8623e-4", "inertia = 0", "axis.inertia = 0"),
    ("inertia = 3.8623e-4", 'inertia = "heavy"', "axis.inertia = 'heavy'"),
    ("inertia = 3.8623e-4", "inertia = true", "axis.inertia = true"),
    ("inertia = 3.8623e-4", "inertia = nan", "axis.inertia = nan"),
    ("inertia = 3.8623e-4", "inertia = inf", "axis.inertia = inf"),
    ("inertia = 3.8623e-4", f"inertia = {'9' * 400}", "axis.inertia = 999"),
    ("inertia = 3.8623e-4", f"inertia = {'9' * 5000}", "invalid TOML"),
    ("inertia = 3.8623e-4", "inertia = 1979-05-27", "axis.inertia"),
    ("inertia = 3.8623e-4", "intertia = 3.8623e-4", "'intertia'"),
    ("inertia = 3.8623e-4", "inertia = 3.8623e-4\nmass = 2.0", "axis.mass"),
    ("[axis]", "[axes]", "axis is missing"),
    ("[axis]", "[[axis]]", "axis"),
    ("[axis]", "[axis", "line 6"),
    ('law = "gms"', 'law = "gmss"', "'gms'"),
    ('law = "gms"', "law = 3", "friction.nominal.law = 3"),
    ('law = "gms"', 'law = "nowhere.py"', "nowhere.py"),
    ('law = "gms"', 'law = "gms"\nslip_rule = "literal"', "slip_rule"),
    ('law = "gms"', 'law = "gms"\ncurve = "straight"', "straight"),
    ("k = [1.0e4, 0.5e4]", "k = []", "k is empty"),
    ("k = [1.0e4, 0.5e4]", "k = 1.0e4", "friction.nominal"),
    ("k = [1.0e4, 0.5e4]", "k = [1.0e4, -0.5e4]", "k[1] = -5000"),
    ("k = [1.0e4, 0.5e4]", "k = [1.0e4, nan]", "friction.nominal.k"),
    ("k = [1.0e4, 0.5e4]", "k = [1.0e4, [0.5e4]]", "friction.nominal.k"),
    ("k = [1.0e4, 0.5e4]", "k = [1.0e4]", "alpha has 2"),
    ("alpha = [0.5, 0.5]", "alpha = [0.5, 0.4]", "adds up to 0.9"),
    ("fs = 0.335\nfc = 0.285\nvs", "fs = -0.2\nfc = 0.285\nvs", "fs = -0.2"),
    ("delta_s = 2.0", "delta_s = 21.0", "delta_s = 21"),
    ("delta_s = 2.0", "delta_ss = 2.0", "'delta_s'"),
    ("c = 24.0", "", "parameter 'c'"),
    ("c = 24.0", "c = {value = 24.0}", "friction.nominal.c"),
    ('like = "nominal"', 'like = "nominl"', "'nominal'"),
    ('like = "nominal"', 'like = "plus10"', "friction.plus10.like"),
    ("scale = {fs = 1.1, fc = 1.1}", "scale = {fx = 1.1}", "'fx'"),
    ("scale = {fs = 1.1, fc = 1.1}", "scale = {fs = -1.1}", "friction.plus10"),
    ("scale = {fs = 1.1, fc = 1.1}", "scale = 1.1", "friction.plus10.scale"),
    ("[friction.plus10]", '[friction."../plus10"]', "../plus10"),
    ("[friction.plus10]", '[friction."plus\\n10"]', "names are letters"),
    ('kind = "sine"', 'kind = "sinus"', "'sine'"),
    ("frequency = 4.0", "frequency = 0.0", "frequency = 0"),
    ("frequency = 4.0", 'frequency = "fast"', "frequency = 'fast'"),
    ("frequency = 4.0", "frequncy = 4.0", "'frequency'"),
    ("duration = 0.1", "duration = 0", "references.sine.duration = 0"),
    ("duration = 0.1", "", "references.sine.duration is missing"),
    ("bandwidth_hz = 36.0", "bandwidth_hz = -36.0", "bandwidth_hz = -36"),
    ("bandwidth_hz = 36.0", "bandwidth = 36.0", "'bandwidth'"),
    ("placement = {bandwidth_hz = 36.0, damping = 1.0}", "", "placement is missing"),
    ('file = "motion.csv"', 'file = "nowhere.csv"', "nowhere.csv"),
    ('file = "motion.csv"', 'file = "small_study.toml"', "small_study.toml"),
    ('file = "motion.csv"', "time = [0.0, 0.1]\nposition = [0.0]", "references.points"),
    ('file = "motion.csv"', "time = [0.0, 0.0]\nposition = [0.0, 1.0]", "time[1] = 0 s must come after time[0] = 0 s"),
    ('file = "motion.csv"', "time = [0.0, 0.1]\nposition = [0.0, nan]", "references.points.position"),
    ('linear = "PD"', 'linear = "PDD"', "controllers.PD.linear"),
    ('linear = "PD"', "", "controllers.PD.linear is missing"),
    ('linear = "PD"', 'linear = "PD"\ngains = {kp = 1.0}', "exclude each other"),
    ('linear = "PD"', 'linear = "PD"\ntorque_limit = 0', "torque_limit = 0"),
    ('linear = "PD"', 'linear = "PD"\nsample_time = -1e-3', "sample_time"),
    ('linear = "PD"', 'linear = "PD"\nencoder_counts = 4096', "sample_time"),
    ('linear = "PD"', 'linear = "PD"\nlaw = "lugre"', "controllers.PD.compensator is missing"),
    ('linear = "PD"', 'linear = "PD"\nintegrator = "ode15s"', "integrator = 'ode15s'"),
    ("kp = 19.8", "kp = -19.8", "kp = -19.8"),
    ("kp = 19.8, ", "", "controllers.FF-coulomb.gains.kp is missing"),
    ('compensator = "feedforward"', 'compensator = "feedfoward"', "'feedforward'"),
    ('law = "lugre"\ngain', 'law = "lugree"\ngain', "'lugre'"),
    ("gain = 0.9", "gain = nan", "gain = nan"),
    ("gain = 0.9", "filter_hz = 0", "filter_hz = 0"),
    ('slip_rules = ["signed"]', 'slip_rules = ["sign"]', "slip_rules"),
    ('slip_rules = ["signed"]', "slip_rules = []", "slip_rules"),
    ('slip_rules = ["signed"]', 'slip_rules = "signed"', "slip_rules"),
    ('slip_rules = ["signed"]', 'slip_rules = ["signed", "signed"]', "twice"),
    ('slip_rules = ["signed"]', "slip_rules = [1]", "slip_rules"),
    ('slip_rules = ["signed"]', 'slip_rule = ["signed"]', "'slip_rules'"),
    ("tolerance = 1e-8", "tolerance = 0.0", "tolerance = 0.0"),
    ("output = 1e-3", "output = 1e-12", "output = 1e-12"),
    ("output = 1e-3", "output = 1e-3\ntolerance = 1e-8", "line 5"),
    ("output = 1e-3", 'plugins = ["nowhere.py"]', "nowhere.py"),
    ("output = 1e-3", 'plugins = ["motion.csv"]', "motion.csv"),
    ("output = 1e-3", "plugins = [3]", "plugins"),
    ("output = 1e-3", 'plugins = ["broken.py"]', "broken.py"),
    ('frictions = ["none", "nominal"]', 'frictions = ["none", "nominel"]', "comparisons.pr-pd.frictions"),
    ("pr-pd.friction.none]", "pr-pd.friction.nominal]", "comparisons.pr-pd.frictions: 'none'"),
    ("pr-pd.controller.PR]", "pr-pd.controller.PD]", "comparisons.pr-pd.controllers: 'PR'"),
    (
        'pr-pd.controller.PR]\nlinear = "PR"',
        'pr-pd.controller.PD]\nlinear = "PR"\n[comparisons.pr-pd.controller.PR]\nlinear = "PR"',
        "means two different runs",
    ),
    ('reference = "sine"', 'reference = "cosine"', "responses.plant.reference"),
    ("damping = 1.0", "damping = -1.0", "damping = -1.0 must be greater than 0\n"),
    ("damping = 1.0", 'damping = "one"', "damping = 'one' must be a number\n"),
    ("gain = 0.9", "gain = true", "gain = true must be a number\n"),
    ('law = "lugre"\ngain', "gain", "law is missing; give one of lugre, coulomb"),
    ('law = "lugre"\ngain', 'law = "dahl"\ngain', "choose from lugre, coulomb, or define it in a table [laws.dahl]"),
    ("fs = 0.335", "f = 0.335", "did you mean 'fs' or 'fc'?"),
]  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("small_study.toml", "motion.csv", "one_run.toml"):
        shutil.copy(DATA / name, tmp_path)
    (tmp_path / "broken.py").write_text("LAW = 1 / 0\n")
    asked_for("broken.py", b"LAW = 1 / 0\n")
    return tmp_path


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def complaint(capsys: pytest.CaptureFixture[str], *argv: str | Path) -> str:
    """The one line on stderr of a call that must fail."""
    code = main([str(a) for a in argv])
    streams = capsys.readouterr()
    assert code == 2, streams
    assert streams.out == ""
    assert streams.err.endswith("\n")
    assert streams.err.count("\n") == 1, streams.err
    assert streams.err.startswith("stickslip: ")
    assert "Traceback" not in streams.err
    return streams.err


@pytest.mark.parametrize(("old", "new", "named"), STUDY, ids=[f"{new[:40]}" for _, new, _ in STUDY])
def test_study_file(folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, named: str) -> None:
    file = folder / "small_study.toml"
    change(file, old, new)
    line = complaint(capsys, "study", file, "--out", folder / "out", "--no-report")
    assert named in line
    assert not (folder / "out" / "records").exists()


@pytest.mark.parametrize(
    ("row", "named"),
    [
        ("0.05,nan,0.02", "line 3"),
        ("0.05,inf,0.02", "line 3"),
        ("0.05,abc,0.02", "line 3"),
        ("0.05,0.001", "line 3"),
        ("0.0,0.001,0.02", "time[1] = 0"),
        ("-1.0,0.001,0.02", "time[1] = -1"),
    ],
)
def test_reference_table(folder: Path, capsys: pytest.CaptureFixture[str], row: str, named: str) -> None:
    change(folder / "motion.csv", "0.05,0.001,0.02", row)
    line = complaint(capsys, "study", folder / "small_study.toml", "--out", folder / "out")
    assert named in line
    assert "references.points" in line


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "no verb"),
        (["studdy"], "unknown verb 'studdy'; did you mean 'study'?"),
        (["study"], "STUDY"),
        (["study", "thesys"], "thesis"),
        (["study", "nowhere.toml"], "nowhere.toml"),
        (["study", "."], "."),
        (["study", "thesis", "--jobs", "0"], "--jobs 0 must"),
        (["study", "thesis", "--jobs", "many"], "many"),
        (["study", "thesis", "--only", "lo"], "'low'"),
        (["study", "thesis", "--only", "low,,step"], "empty"),
        (["study", "thesis", "--only", "FF-lugr"], "'FF-lugre'"),
        (["study", "thesis", "--outt", "x"], "`stickslip study` has no option --outt; did you mean --out?"),
        (["study", "thesis", "--zz"], "has no option --zz; see `stickslip study --help`"),
        (
            ["identify", "motion.csv", "--torque-constant", "-1"],
            "--torque-constant -1 must be greater than 0",
        ),
        (["law", "lugree"], "'lugre'"),
        (["law", "nowhere.py"], "nowhere.py"),
        (["simulate", "nowhere.toml"], "nowhere.toml"),
        (["simulate"], "FILE.toml"),
        (["rerun", "nowhere"], "nowhere"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_command_line(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    argv: list[str],
    named: str,
) -> None:
    monkeypatch.chdir(folder)
    assert named in complaint(capsys, *argv)
    assert not (folder / "study-thesis" / "records").exists()


@pytest.mark.parametrize("place", ["motion.csv", "motion.csv/below", "/proc/nowhere"])
def test_output_that_cannot_be_written(folder: Path, capsys: pytest.CaptureFixture[str], place: str) -> None:
    before = (folder / "motion.csv").read_text()
    line = complaint(capsys, "study", folder / "small_study.toml", "--out", folder / place)
    assert str(folder / place) in line
    assert "--out" in line
    assert ("a file is where a folder is needed" in line) is place.startswith("motion.csv")
    assert (folder / "motion.csv").read_text() == before


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('slip_rule = "signed"', 'slip_rule = "unsigned"', "'signed'"),
        ("[controller]", "[controler]", "'controler'"),
        ("duration = 0.1", "duration = -1", "reference.duration = -1"),
        (
            'linear = "PD"',
            'linear = "PD"\ncompensator = "feedback"\nlaw = "lugre"',
            "controller.law = 'lugre' is not known; define it in a table [laws.lugre]",
        ),
        (
            'linear = "PD"',
            'linear = "PD"\ncompensator = "feedback"',
            "controller.law is missing; define the law in a table [laws.NAME] and name it here",
        ),
        ('linear = "PD"', 'linear = "PD"\nintegrator = "exact"\nsample_time = 1e-3', "exact"),
        ('kind = "sine"', "kind = ", "line 18"),
    ],
)
def test_one_run(folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, named: str) -> None:
    change(folder / "one_run.toml", old, new)
    assert named in complaint(capsys, "simulate", folder / "one_run.toml", "--out", folder / "run.npz")
    assert not (folder / "run.npz").exists()


def test_the_folder_of_another_study(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = [
        "study",
        str(folder / "small_study.toml"),
        "--out",
        str(folder / "out"),
        "--no-report",
        "--only",
        "PD",
    ]
    assert main(argv) == 0
    capsys.readouterr()
    before = (folder / "out" / "metrics.csv").read_bytes()
    assert "small_study" in complaint(capsys, "study", "thesis", "--out", folder / "out")
    assert (folder / "out" / "metrics.csv").read_bytes() == before


@pytest.mark.parametrize("place", [".", "motion.csv/run.npz", "/proc/nowhere/run.npz"])
def test_record_that_cannot_be_written(folder: Path, capsys: pytest.CaptureFixture[str], place: str) -> None:
    assert "--out" in complaint(capsys, "simulate", folder / "one_run.toml", "--out", folder / place)


LAW = """
from typing import Annotated, NamedTuple
from stickslip.core.spec import Law, Par

class Params(NamedTuple):
    level: Annotated[float, Par("N·m", "F_0", "level", lower=0.0)]

def rate(v, z, p, u, dz):
    BODY
    return p.level * v

def step(v0, v1, dt, z, p, u):
    return p.level * v1

LAW = Law("own", Params, step, title="Own", equation="F", source=("none",), example={"level": 0.2}, rate=rate)
"""


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (LAW.replace("BODY", "while v > 1.0: v -= 1.0"), "While"),
        (LAW.replace("BODY", "v = nowhere(v)"), "nowhere()"),
        (LAW.replace("LAW = ", "OTHER = "), "defines no law"),
        (LAW.replace('"own"', '"gms"').replace("BODY", "v = v"), "which exists already"),
        (LAW.replace("(NamedTuple)", "(NamedTuple"), "SyntaxError"),
    ],
    ids=["while", "unknown function", "no law", "name taken", "syntax"],
)
def test_law_files(folder: Path, capsys: pytest.CaptureFixture[str], text: str, named: str) -> None:
    (folder / "own.py").write_text(text)
    asked_for("own.py", text.encode())
    change(folder / "small_study.toml", "[axis]", 'plugins = ["own.py"]\n\n[axis]')
    change(folder / "small_study.toml", "[axis]", '[friction.own]\nlaw = "own"\nlevel = 0.1\n\n[axis]')
    assert named in complaint(capsys, "study", folder / "small_study.toml", "--out", folder / "out")
    assert not (folder / "out" / "records").exists()


def test_files_that_are_no_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in complaint(capsys, "study", folder / "bytes.toml")
    (folder / "deep.toml").write_text("a = " + "[" * 20000)
    assert "deep.toml" in complaint(capsys, "study", folder / "deep.toml")
    (folder / "manifest.json").write_text("{}")
    assert "manifest.json" in complaint(capsys, "rerun", folder)


@pytest.mark.parametrize(
    "argv", [["study", "thesys"], ["law", "lugree"], ["study", "small_study.toml", "--out", "motion.csv"]]
)
def test_as_a_process(folder: Path, argv: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from stickslip.cli import main; sys.exit(main())", *argv],
        cwd=folder, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"}, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


DAMAGED = [
    (lambda m: m.pop("runs"), "'runs' is missing"),
    (lambda m: m.pop("versions"), "'versions' is missing"),
    (lambda m: m["runs"][0].pop("metrics"), "'metrics' is missing"),
    (lambda m: m["runs"][0].update(metrics=[1]), "is damaged"),
    (lambda m: m.update(runs=3), "is damaged"),
    (lambda m: m.update(inputs=[]), "is damaged"),
    (lambda m: m["inputs"][0].update(copy="nowhere.toml"), "nowhere.toml, an input of the study"),
]


def test_a_damaged_manifest_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "out"
    argv = ["study", str(folder / "small_study.toml"), "--only", "PD", "--out", str(out), "--no-report"]
    assert main(argv) == 0
    capsys.readouterr()
    whole = (out / "manifest.json").read_text(encoding="utf-8")
    for damage, named in DAMAGED:
        manifest = json.loads(whole)
        damage(manifest)
        (out / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        assert named in complaint(capsys, "rerun", out)
