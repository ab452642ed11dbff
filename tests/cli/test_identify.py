"""stickslip identify: from a file to model.toml, which other commands read."""

from __future__ import annotations

import json
import math
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip import Model
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.messages import Surface, render, shown_on
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.methods.method import Options
from stickslip.models.plugins import law_names
from stickslip.verbs.identify import assumptions
from support import axis_cases as cases

LOOP = "kp=8,kd=0.08,kr=0.08,limit=3"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identify") / "log.csv"
    t = cases.experiment("coulomb", noise=2e-3)
    assert t.drive is not None
    assert t.reference is not None
    rows = [
        f"{a:.6f},{b:.9f},{c:.9f},{d:.9f}" for a, b, c, d in zip(t.time, t.position, t.drive, t.reference)
    ]
    header = "time [s],position [rad],motor_torque [N·m],position_reference [rad]"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


def test_a_log_becomes_a_model_that_is_read_back(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model.toml"
    assert (
        main(
            [
                "identify",
                str(log),
                "--law",
                "coulomb",
                "--loop",
                LOOP,
                "--torque-is",
                "commanded",
                "--delay",
                "0",
                "--out",
                str(out),
                "--json",
            ]
        )
        == 0
    )
    printed = json.loads(capsys.readouterr().out)
    model = Model.from_file(out)
    assert model.parameters.fc == pytest.approx(cases.FC, rel=0.02)
    written = tomllib.loads(out.read_text(encoding="utf-8"))
    assert written["data"][0]["sha256"] == printed["data"][0]["sha256"] != ""
    assert {e["name"] for e in written["estimates"]} == {"inertia", "offset", "fc", "sigma2"}
    assert written["axis"]["inertia"] == pytest.approx(cases.INERTIA, rel=0.05)
    study = tmp_path / "run.toml"
    study.write_text(
        '[axis]\ninertia = 4e-4\n[friction]\nlaw = {model = "model.toml"}\n[reference]\nkind = "sine"\n'
        'amplitude = 0.3\nfrequency = 1.0\nduration = 0.5\n[controller]\nlinear = "PD"\n'
        "placement = {bandwidth_hz = 20.0, damping = 1.0}\n",
        encoding="utf-8",
    )
    assert main(["simulate", str(study), "--out", str(tmp_path / "run.npz")]) == 0


def test_the_terminal_shows_intervals_and_errors(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "m.toml")
    assert main(["identify", str(log), "--inverse", "--out", out]) == 0
    shown = capsys.readouterr().out
    assert "inertia" in shown
    assert "kg·m²" in shown
    assert Model.from_file(out).law.name == "coulomb"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--law", "coulom"], "coulomb"),
        (["--loop", "kq=3"], "kq"),
        (["--set", "inertia"], "NAME=VALUE"),
        (["--freeze", "fx", "--law", "coulomb"], "fx"),
        (["--harmonics", "-1"], "0 or more"),
    ],
)
def test_bad_input_is_one_line(
    log: Path, tmp_path: Path, extra: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(log), "--out", str(tmp_path / "m.toml"), *extra]) == 2
    complaint = capsys.readouterr().err.strip().splitlines()[-1]
    assert complaint.startswith("stickslip: ")
    assert message in complaint


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text('law = "coulomb"\n', encoding="utf-8")
    with pytest.raises(InputError, match="parameters is missing"):
        Model.from_file(other)
    other.write_text('format = "stickslip-model-9"\nlaw = "coulomb"\n', encoding="utf-8")
    with pytest.raises(InputError, match="another version"):
        Model.from_file(other)


def test_a_folder_gets_model_and_report(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "friction"
    assert main(["identify", str(log), "--inverse", "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert Path(printed["report_file"]) == out / "report.html"
    assert "less-than-a-revolution" in [f["code"] for f in printed["findings"]["log.csv"]]
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "less-than-a-revolution" in html
    for name in ("position", "velocity", "time"):
        assert f'id="residual-torque-over-{name}"' in html
    # It needs nothing but itself.
    assert not re.search(r"""(src|href)=["'](?!data:|#)""", html)
    assert "url(" not in html


def test_a_frozen_value_stays(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    extra = ["--law", "coulomb", "--loop", LOOP, "--freeze", "sigma2=0.02", "--no-report", "--json"]
    assert main(["identify", str(log), "--out", str(tmp_path / "m.toml"), *extra]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["model"]["sigma2"] == 0.02
    assert "sigma2" not in [e["name"] for e in printed["estimates"]]
    assert not (tmp_path / "m.html").exists()


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_goes_to_a_terminal_only(
    log: Path, tmp_path: Path, terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    laws = ["--law", "coulomb", "--law", "viscous", "--loop", LOOP, "--json", "--no-report"]
    assert main(["identify", str(log), *laws, "--out", str(tmp_path / "m.toml")]) == 0
    shown = capsys.readouterr()
    json.loads(shown.out)
    assert ("viscous: law 2 of 2" in shown.err) == terminal
    assert ("coulomb: all of the data" in shown.err) == terminal


def test_all_laws_are_tried_and_named(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = tmp_path / "short.csv"
    short.write_text("\n".join(log.read_text(encoding="utf-8").splitlines()[:601]), encoding="utf-8")
    options = ["--law", "all", "--loop", LOOP, "--no-report", "--json", "--out", str(tmp_path / "m.toml")]
    assert main(["identify", str(short), *options]) == 0
    printed = json.loads(capsys.readouterr().out)
    compared = next(n for n in printed["notes"] if "held-out misfit" in n)
    others = next(n for n in printed["notes"] if n.startswith("Not among all laws"))
    for law in law_names():
        assert re.search(rf"\b{law} [\d.]", compared) or re.search(rf"\b{law}\b", others), law
    assert re.search(r"\blugre \d", compared)
    assert re.search(r"\bgms \d", compared)


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Constant velocities in both directions, each for some revolutions, with noise: fs 0.4, fc 0.3, vs 0.1."""
    rng = np.random.default_rng(2)
    speeds = [s * v for v in (0.5, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0, 3.0) for s in (1.0, -1.0)]
    lasts = [max(8.0, 14.0 / abs(v)) if abs(v) > 0.3 else 20.0 for v in speeds]
    dt = 0.01
    v = np.concatenate([np.full(round(t / dt), s) for t, s in zip(lasts, speeds, strict=True)])
    friction = np.sign(v) * (0.3 + 0.1 * np.exp(-((v / 0.1) ** 2))) + 0.02 * v
    table = np.column_stack([
        dt * np.arange(v.size), dt * np.cumsum(v), friction + 2e-3 * rng.standard_normal(v.size)
    ])  # fmt: skip
    path = tmp_path_factory.mktemp("sliding") / "steps.csv"
    np.savetxt(
        path, table, delimiter=",", comments="", header="time [s],position [rad],motor_torque [N·m]", encoding="utf-8",
        fmt="%.7f",
    )  # fmt: skip
    return path


def test_a_sliding_curve(steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = [
        "--method",
        "sliding",
        "--law",
        "stribeck",
        "--freeze",
        "delta_s=2",
        "--out",
        str(tmp_path),
        "--json",
    ]
    assert main(["identify", str(steps), *options]) == 0
    printed = json.loads(capsys.readouterr().out)
    found = {e["name"]: e for e in printed["estimates"]}
    for name, truth in (("fc", 0.3), ("sigma2", 0.02), ("vs", 0.1)):
        assert found[name]["lower"] <= truth <= found[name]["upper"]
        assert found[name]["value"] == pytest.approx(truth, rel=0.1)
    assert 'id="sliding"' in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert Model.from_file(tmp_path / "model.toml").parameters.delta_s == 2.0


def test_sliding_without_a_law_chooses_among_the_curves_of_the_thesis(
    steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(steps), "--method", "sliding", "--out", str(tmp_path), "--no-report"]) == 0
    printed = capsys.readouterr().out
    assert "Chosen: Stribeck (eq. 2.6)" in printed
    for tried in ("Coulomb with viscous", "eq. 4.4", "eq. 4.5"):
        assert tried in printed
    assert Model.from_file(tmp_path / "model.toml").law.name == "stribeck_plain"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--method", "presliding"], "--method sliding"),
        (["--method", "lugre"], "inertia"),
        (["--method", "attraction"], "--method presliding"),
        (["--method", "sliding", "--torque", "sensor"], "motor_torque"),
        (["--method", "sliding", "--hold-out", "x.csv"], "--hold-out"),
        (["--noise", "0"], "greater than 0"),
    ],
)
def test_what_a_method_lacks_is_one_line(
    steps: Path, tmp_path: Path, extra: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(steps), "--out", str(tmp_path), *extra]) == 2
    complaint = capsys.readouterr().err.strip().splitlines()[-1]
    assert message in complaint
    assert "Traceback" not in complaint


def test_break_away_from_ramps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ramps in both directions up to 0.4 N·m; the axis breaks away at 0.3 and 0.33 N·m."""
    dt, rate = 1e-3, 0.2
    torque, position, here = [np.zeros(200)], [np.zeros(200)], 0.0
    for k in range(8):
        side, level = (1.0, 0.3) if k % 2 == 0 else (-1.0, 0.33)
        up = np.arange(0.0, level + 0.02, rate * dt)
        moved = np.cumsum(np.where(up > level, 2.0, 0.0)) * dt
        torque += [side * up, np.zeros(400)]
        position += [here + side * moved, np.full(400, here + side * moved[-1])]
        here += side * float(moved[-1])
    table = np.column_stack(
        [np.zeros(sum(map(len, torque))), np.concatenate(position), np.concatenate(torque)]
    )
    table[:, 0] = dt * np.arange(len(table))
    path = tmp_path / "ramps.csv"
    np.savetxt(path, table, delimiter=",", comments="", header="time [s],position [rad],motor_torque [N·m]",
               encoding="utf-8", fmt="%.7f")  # fmt: skip
    assert main(["identify", str(path), "--method", "breakaway", "--out", str(tmp_path / "o"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    values = sorted(e["value"] for e in printed["estimates"] if e["unit"] == "N·m")
    assert any(v == pytest.approx(0.3, abs=0.01) for v in values)
    assert any(v == pytest.approx(0.33, abs=0.01) for v in values)
    assert (tmp_path / "o" / "report.html").exists()
    again = ["identify", str(path), "--out", str(tmp_path / "o"), "--no-report", "--threshold"]
    assert main([*again, "0.05", "--method", "breakaway"]) == 0
    assert "velocity threshold 0.05 rad/s" in capsys.readouterr().out
    assert main([*again, "-1", "--method", "breakaway"]) == 2
    assert main([*again, "0.05"]) == 2
    assert "does not use --threshold (methods that do: breakaway)" in capsys.readouterr().err


def test_inertia_from_a_frequency_response(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """White torque, held from sample to sample, on 4e-3 kg·m² with 0.02 N·m·s/rad."""
    dt, count, inertia, damping = 1e-3, 80000, 4e-3, 0.02
    torque = np.random.default_rng(4).normal(0.0, 0.5, count)
    position, q, v = np.zeros(count), 0.0, 0.0
    keep = math.exp(-damping / inertia * dt)
    for k in range(count):
        position[k] = q
        end = keep * v + (1.0 - keep) * torque[k] / damping
        q += dt * torque[k] / damping - inertia / damping * (end - v)
        v = end
    path = tmp_path / "noise.csv"
    np.savetxt(path, np.column_stack([dt * np.arange(count), position, torque]), delimiter=",", comments="",
               header="time [s],position [rad],motor_torque [N·m]", encoding="utf-8", fmt="%.9f")  # fmt: skip
    assert main(["identify", str(path), "--method", "inertia", "--out", str(tmp_path / "o"), "--json"]) == 0
    found = {e["name"]: e for e in json.loads(capsys.readouterr().out)["estimates"]}
    assert found["inertia"]["value"] == pytest.approx(inertia, rel=0.02)
    assert (tmp_path / "o" / "report.html").exists()


def test_a_log_without_torque_gets_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    time = 1e-3 * np.arange(3000)
    table = np.column_stack([time, np.sin(3.0 * time)])
    np.savetxt("log.csv", table, "%.9g", ",", header="clock,position", comments="")
    for method in ("axis", "breakaway"):
        assert main(["identify", "log.csv", "--map", "time=clock", "--method", method]) == 2
        *kept, line = capsys.readouterr().err.splitlines()
        assert all("is kept in the profile" in x for x in kept)
        assert "torque" in line
        assert "--map torque=COLUMN:UNIT" in line
    assert kept == []


def test_what_stays_at_a_laws_default_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    """delta_s, and the shares of elements, stayed at the law's example in silence."""
    law = Model("gms", fs=0.3, fc=0.2, vs=0.1, sigma2=0.0, k=[200.0, 100.0], alpha=[0.5, 0.5], c=10.0)
    names = ("fs", "fc", "vs", "sigma2", "k[0]", "k[1]", "c")
    fitted = tuple(Estimate(n, "", n, 1.0, 0.1, 0.8, 1.2, identified=True) for n in names)
    found = Identification("axis", law, fitted, np.eye(len(names)), {})
    assert found.assumed == {"delta_s": 2.0, "alpha[0]": 0.5, "alpha[1]": 0.5}
    assert found.as_dict()["assumed"] == found.assumed
    (said,) = assumptions(found, Options(), "axis")
    assert said.startswith("Assumed, not fitted: ")
    assert "delta_s = 2" in said
    assert "alpha = 0.5, 0.5" in said
    with shown_on(Surface.COMMAND_LINE):
        assert "--free NAME" in render(said)
    given = Options(values={"alpha[0]": 0.5, "alpha[1]": 0.5}, frozen=("delta_s",))
    assert assumptions(found, given, "axis") == []
    assert replace(found, method="inverse dynamics").assumed == {}
