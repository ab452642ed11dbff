"""From a model to decisions: stickslip compare, recommend, demo."""

from __future__ import annotations

import io
import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from stickslip import Model
from stickslip.cli import _output, main
from stickslip.control.linear import Cascade
from stickslip.control.recommended import read_recommended
from stickslip.report.recommendation_text import parameters, percent
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.virtual import virtual_rig
from support.identified_files import written


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_bar_shows_at_once_how_much_there_is_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", shown := Terminal())
    with _output.progress_bar("it") as progress:
        progress(0, 1200)
        assert "0/1200" in shown.getvalue()
        progress(0, 1300)
        assert "0/1300" in shown.getvalue()


def test_what_was_found_is_not_counted_for_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", shown := Terminal())
    with _output.progress_bar("it") as progress:
        progress(900, 1200)
    assert "900/1200 [00:00<?, ?run/s]" in shown.getvalue()


def test_a_pipe_gets_a_line_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([0.0, 1.0, 25.0, 30.0, 50.0])
    monkeypatch.setattr(_output.time, "monotonic", lambda: next(clock))
    with _output.progress_bar("it") as progress:
        for finished in (100, 200, 210, 300):
            progress(finished, 1000)
    assert capsys.readouterr().err == (
        "stickslip: it: 200 of 1000 done, about 3 min left\nstickslip: it: 300 of 1000 done, about 3 min left\n"
    )


def test_a_recommendation_is_safe_on_the_axes_drawn_and_says_what_to_expect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8, 1.0))
    model = written(tmp_path / "m.toml", 0.03)
    options = [
        "--bandwidth",
        "20",
        "--counts-per-rev",
        "65536",
        "--torque-limit",
        "3",
        "--axes",
        "2",
        "--confirm",
        "7",
    ]
    assert main(["recommend", str(model), *options, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    chosen = result["chosen"]
    assert chosen["unsafe"] == []
    assert result["axes"] == 3
    assert len(chosen["errors"]) == 1 + result["axes_confirmed"] == 8
    assert result["reduction"] == [1.0 - 1.4 * max(chosen["errors"]), 1.0 - min(chosen["errors"]) / 2.0]
    assert result["reduction_confidence"] == 0.75
    assert result["reduction"][0] > 0.8
    assert chosen["gain"] <= 1.0
    # Feedback that cancels everything hunts (thesis 3.2.3), and is found to.
    full = [c for c in result["candidates"] if (c["kind"], c["gain"]) == ("feedback", 1.0)]
    assert any(c["unsafe"] for c in full)
    assert main(["recommend", str(model), *options, "--all"]) == 0
    shown = capsys.readouterr().out
    assert "switch on:" in shown
    assert "75 % interval" in shown
    assert "Model(" not in shown
    line = next(x for x in shown.splitlines() if x.startswith("parameters:"))
    model_parameters = result["model"]
    assert f"fc {model_parameters['fc']:.4g} N·m;" in line


def test_a_torque_limit_below_friction_is_no_safe_axis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recommend", str(written(tmp_path / "m.toml")), "--torque-limit", "0.1"]) == 2
    streams = capsys.readouterr()
    assert "torque limit 0.1 N·m: the drive cannot move the axis, whose friction is" in streams.err
    assert streams.out == ""


def test_the_margin_that_is_printed_is_what_the_table_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (1.0,))
    monkeypatch.setattr("stickslip.recommendation.recommend.LEADS", (0.0,))
    monkeypatch.setattr("stickslip.recommendation.recommend.BEYOND", (1.5, 2.5))
    model = written(tmp_path / "m.toml", law="coulomb")
    assert main(["recommend", str(model), "--bandwidth", "20", "--axes", "1", "--confirm", "0", "--all"]) == 0
    lines = capsys.readouterr().out.splitlines()
    said = next(line for line in lines if line.startswith("gain margin:"))
    rows = [line.split() for line in lines if line.startswith("coulomb         feedforward")]
    unsafe = [float(row[2]) for row in rows if " no: " in f" {' '.join(row)}"]
    safe = [float(row[2]) for row in rows if float(row[2]) < min(unsafe)]
    assert (
        said == f"gain margin:       {max(safe):.3g} (safe at gain {max(safe):.3g}, not at {min(unsafe):.3g})"
    )


def test_no_axes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["recommend", str(written(tmp_path / "m.toml")), "--axes", "0"]) == 2
    assert "--axes 0 must be at least 1" in capsys.readouterr().err


def test_a_negative_gain_is_not_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, out = written(tmp_path / "m.toml"), tmp_path / "out"
    asked = ["export", str(model), "--to", "c99", "--compensator", "ff", "--gain", "-1", "--out", str(out)]
    assert main(asked) == 2
    assert "--gain -1 must be at least 0" in capsys.readouterr().err
    assert not out.exists()


def test_what_is_recommended_is_exported_and_run_by_the_commands_that_are_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.9,))
    monkeypatch.setattr("stickslip.recommendation.recommend.LEADS", (0.5,))
    monkeypatch.chdir(tmp_path)
    model, out = written(tmp_path / "m.toml"), tmp_path / "my axis" / "recommended.toml"
    asked = ["recommend", str(model), "--bandwidth", "20", "--axes", "1", "--confirm", "0", "--out"]
    assert main([*asked, str(out)]) == 0
    said = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("next: "))
    command = shlex.split(said.removeprefix("next: stickslip "))
    assert main(command) == 0
    assert "kp" in capsys.readouterr().out
    found = read_recommended(out)
    assert (found.compensator, found.gain, found.bandwidth, found.sample_time) == (
        "feedforward",
        0.9,
        20.0,
        1e-3,
    )
    assert (found.offset, found.inertia_feedforward) == (0.03, 4e-4)
    assert (
        Track(compensator="recommended", model=str(out)).compensated(virtual_rig("ideal")).compensator.gain
        == 0.9
    )
    for beside in (["--gain", "1"], ["--sample-time", "0.01"]):
        assert main([*command, *beside]) == 2
    assert main(["export", str(model), *command[2:]]) == 2
    assert "no table [recommended]" in capsys.readouterr().err
    assert main([*asked, str(model)]) == 2
    assert main(["export", str(model), "--to", "c99", "--compensator", "ff", "--sample-time", "1"]) == 0
    assert "a reversal up to 1 s late" in capsys.readouterr().out


def test_parameters_and_percentages_are_readable() -> None:
    gms = Model(
        "gms", k=[150.123456, 100.0], alpha=[0.5, 0.5], c=50.0, fs=0.335, fc=0.2850438880791331, vs=0.1
    )
    shown = parameters(gms, lambda unit: unit.replace("rad", "m").replace("N·m", "N"))
    assert "k [150.1, 100] N/m; alpha [0.5, 0.5];" in shown
    assert "fc 0.285 N;" in shown
    assert percent(0.951, 0.954) == "95 %"
    assert percent(0.88, 0.954) == "88 to 95 %"
    assert percent(0.99, 0.9997) == "99 to 99.9 %"


def test_where_the_model_is_unsure_less_is_promised(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8, 1.0))
    kept: list[float] = []
    for relative in (0.01, 0.15):
        model = written(tmp_path / "m.toml", relative)
        assert (
            main(
                [
                    "recommend",
                    str(model),
                    "--bandwidth=20",
                    "--amplitude=0.1",
                    "--frequency=1",
                    "--axes=2",
                    "--confirm=3",
                    "--json",
                ]
            )
            == 0
        )
        chosen = json.loads(capsys.readouterr().out)["chosen"]
        kept.append(max(chosen["errors"]) if chosen else 1.0)
    assert kept[1] > 1.5 * kept[0]


def test_a_recommendation_that_no_longer_holds_is_removed_aloud(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was gone without a word, and export then knew of no such file."""
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8,))
    model, out = written(tmp_path / "m.toml"), tmp_path / "recommended.toml"
    call = ["recommend", str(model), "--amplitude=0.1", "--axes=1", "--confirm=0", f"--out={out}", "--force"]
    assert main([*call, "--bandwidth=20"]) == 0
    assert out.is_file()
    capsys.readouterr()
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.01,))  # takes nothing away
    for said in (
        "nothing is recommended, so the earlier recommendation in it was removed",
        "so it is not written",
    ):
        assert main([*call, "--bandwidth=20", "--no-inertia-feedforward"]) == 0
        assert said in capsys.readouterr().err
        assert not out.exists()
    assert main(["export", str(out), "--to=c99", "--compensator=recommended", f"--out={tmp_path}"]) == 2
    assert "where nothing is recommended" in capsys.readouterr().err


def test_the_demo_goes_the_whole_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", str(tmp_path / "demo")]) == 0
    shown = capsys.readouterr().out
    assert "simulated" in shown.splitlines()[0]
    for verb in ("doctor", "identify", "recommend"):
        assert f"$ stickslip {verb}" in shown
    model = Model.from_file(tmp_path / "demo" / "model.toml")
    assert model.parameters.fc == pytest.approx(0.285, rel=0.02)
    assert (tmp_path / "demo" / "report.html").stat().st_size > 50_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["compare", "none.toml", "none.toml"], "no file"),
        (["compare", "plain.toml", "plain.toml"], "no intervals"),
        (["recommend", "plain.toml"], "--inertia"),
        (["recommend", "plain.toml", "--inertia", "4e-4", "--bandwidth", "0"], "bandwidth"),
        (["recommend", "plain.toml", "--inertia", "4e-4", "--bandwidth", "900"], "sample rate"),
        (["recommend", "plain.toml", "--axes", "-1"], "--axes"),
        (["recommend", "plain.toml", "--confirm", "-1"], "--confirm"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("plain.toml").write_text(
        'law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n', encoding="utf-8"
    )
    assert main(words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]


def test_the_loop_that_the_user_has_goes_all_the_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cascade given by its gains: simulated, written, named by the export, run by a rig."""
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8,))
    monkeypatch.setattr("stickslip.recommendation.recommend.LEADS", (0.0,))
    model, out = written(tmp_path / "m.toml"), tmp_path / "recommended.toml"
    loop = "kv=30,kvp=0.08,kvi=1.2,feed=0.5,filter=200,limit=3"
    asked = ["recommend", str(model), "--loop", loop, "--axes", "1", "--confirm", "2", "--out", str(out)]
    assert main([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["gains"] == {"kv": 30.0, "kvp": 0.08, "kvi": 1.2, "feed": 0.5}
    assert told["drive"]["torque_limit"] == 3.0
    assert told["drive"]["motion"]["amplitude"] == pytest.approx(0.1)
    found = read_recommended(out)
    assert found.linear == Cascade(30.0, 0.08, 1.2, 0.5)
    assert found.offset == 0.03
    loop_run = Track(compensator="recommended", model=str(out)).compensated(virtual_rig("ideal"))
    assert loop_run.gains == found.linear
    assert loop_run.velocity_filter == 200.0
    export = ["export", str(out), "--to", "c99", "--compensator", "recommended", "--out", str(tmp_path / "c")]
    assert main(export) == 0
    said = capsys.readouterr().out
    assert "the loop of kv 30, kvp 0.08, kvi 1.2, feed 0.5 and both torques together within ±3 N·m" in said
    how = (tmp_path / "c" / "README.md").read_text()
    assert "limit their sum to what the motor gives. `n.torque_limit` limits this part alone" in how


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--loop", "kv=30,kp=1"], "unknown number of --loop of a cascade 'kp'"),
        (["--loop", "kv=30"], "give kvp, greater than 0"),
        (["--loop", "kp=1,kd=-1"], "kd = -1 must be a number of 0 or more"),
        (["--loop", "kp=1,limit=2", "--torque-limit", "3"], "--torque-limit 3 and the limit of --loop"),
        (["--amplitude", "0.1", "--motion", "x.csv"], "--motion and --amplitude exclude each other"),
        (["--loop", "kp=8,kd=0.08,limit=0.1"], "N·m; give a --torque-limit (or limit of --loop) above it"),
        (["--torque-limit", "0.1"], "N·m; give a --torque-limit above it"),
        (
            ["--loop", "kp=8,kd=0.08,filter=500", "--sample-time=1e-3"],
            "filter = 500 Hz must lie below half the sample",
        ),
        (["--frequency", "2"], "--frequency 2 needs a sinusoid"),
        (["--loop", "kp=1", "--linear", "PID"], "--linear PID cannot be combined with --loop"),
    ],
)
def test_a_loop_or_motion_that_cannot_be_is_refused(
    tmp_path: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recommend", str(written(tmp_path / "m.toml")), *options]) == 2
    assert message in capsys.readouterr().err


def test_a_motion_of_another_log_is_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8,))
    t = np.linspace(0.0, 2.0, 2001)
    lines = [f"{a:.4f},{b:.6f}" for a, b in zip(t, 0.3 - 0.3 * np.cos(np.pi * t), strict=True)]
    log = tmp_path / "cycle.csv"
    log.write_text("\n".join(["time [s],position [rad]", *lines]), encoding="utf-8")
    model = written(tmp_path / "m.toml")
    assert main(["recommend", str(model), "--motion", str(log), "--axes=1", "--confirm=0", "--json"]) == 0
    motion = json.loads(capsys.readouterr().out)["drive"]["motion"]
    assert motion["source"] == "points of cycle.csv, 0 to 2 s"
    assert motion["amplitude"] == pytest.approx(0.3, rel=1e-3)
