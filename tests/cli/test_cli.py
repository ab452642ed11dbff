"""The command line: what the verbs print and write, and what starting costs."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import stickslip
from stickslip.cli import VERBS, main

DATA = Path(__file__).parents[1] / "data"
START = [sys.executable, "-c", "import sys; from stickslip.cli import main; sys.exit(main())"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("small_study.toml", "motion.csv", "one_run.toml"):
        shutil.copy(DATA / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def output(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """What a call that must succeed prints."""
    assert main(argv) == 0
    streams = capsys.readouterr()
    assert streams.err == ""
    return streams.out


def json_output(capsys: pytest.CaptureFixture[str], *argv: str) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(output(capsys, *argv), parse_constant=refuse)


# ---- starting ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("argv", [["--help"], ["study", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(argv: list[str]) -> None:
    code = (
        "import sys; from stickslip.cli import main; code = main(sys.argv[1:]);"
        "heavy = {'numba', 'numpy', 'scipy', 'pandas', 'matplotlib', 'pyarrow', 'tqdm', 'jinja2'} & set(sys.modules);"
        "print(heavy, file=sys.stderr) if heavy else None; sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


def test_help_takes_little_time() -> None:
    spent = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run([*START, "--help"], capture_output=True, check=True)
        spent.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    assert min(spent) < 0.3


def test_every_verb_is_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    text = output(capsys, "--help")
    assert all(verb in text for verb in VERBS)
    for verb in VERBS:
        assert "usage: stickslip " + verb in output(capsys, verb, "--help")


# ---- what is known -------------------------------------------------------------------------------------------------


def test_versions(capsys: pytest.CaptureFixture[str]) -> None:
    assert output(capsys, "--version") == f"{stickslip.__version__}\n"
    assert f"stickslip {stickslip.__version__}\n" in output(capsys, "version")


def test_laws_are_listed_and_explained(capsys: pytest.CaptureFixture[str]) -> None:
    listed = output(capsys, "laws")
    assert [line.split()[0] for line in listed.splitlines()] == list(stickslip.law_names())
    for name in stickslip.law_names():
        law = stickslip.law(name)
        text = output(capsys, "law", name)
        assert law.equation in text
        assert all(source in text for source in law.source)
        for f in law.fields:
            line = next(
                line for line in text.splitlines() if line.split()[:1] in ([f.name], [f"{f.name}[i]"])
            )
            assert all(word in line for word in (f.par.symbol, f.par.unit, f.par.bounds, f.par.meaning))


def test_a_law_from_a_file_is_named_by_its_path(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(Path(stickslip.__file__).parent / "laws" / "coulomb.py", folder / "my.py")
    assert '\n  law = "my.py"\n' in output(capsys, "law", "my.py")
    assert '\n  law = "coulomb"\n' in output(capsys, "law", "coulomb")


# ---- study -----------------------------------------------------------------------------------------------------------


def test_a_study_prints_its_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = output(capsys, "study", "small_study.toml", "--no-report")
    blocks = text.split("\n\n")
    assert blocks[0].splitlines()[0].split() == ["signed", "/", "sine", "nominal", "plus10"]
    assert [line.split()[0] for line in blocks[0].splitlines()[2:]] == ["PD", "FF-lugre", "FF-coulomb"]
    # One best in each column of each block: 2 frictions x 2 metrics.
    assert [block.count("*") for block in blocks[:2]] == [4, 4]
    assert (folder / "study-small_study" / "metrics.csv").exists()


def test_a_study_as_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = [
        "study",
        "small_study.toml",
        "--no-report",
        "--json",
        "--only",
        "PD,sine",
        "--out",
        "here",
        "--jobs",
        "2",
    ]
    data = json_output(capsys, *argv)
    assert [(r["reference"], r["controller"]) for r in data["runs"]] == [("sine", "PD")] * 2
    assert data["runs"][0]["metrics"]["limit_cycle_period_s"] is None
    assert Path(data["runs"][0]["record"]).exists()
    assert json_output(capsys, *argv)["runs"] == data["runs"]


def test_a_selection_in_a_fuller_folder_shows_itself_and_keeps_the_rest(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output(capsys, "study", "small_study.toml", "--no-report")
    text = output(capsys, "study", "small_study.toml", "--only", "PD,sine")
    assert "FF-lugre" not in text
    assert "2 of the 12 runs in metrics.csv" in text
    assert "FF-lugre" in (folder / "study-small_study" / "report.html").read_text()
    data = json_output(capsys, "study", "small_study.toml", "--no-report", "--json", "--only", "PD,sine")
    assert [(r["reference"], r["controller"]) for r in data["runs"]] == [("sine", "PD")] * 2


def test_the_file_that_ships_can_be_copied_and_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine.toml").write_text(output(capsys, "study", "thesis", "--print"))
    only = "signed,step,nominal,PD"
    data = json_output(capsys, "study", "mine.toml", "--only", only, "--no-report", "--json")
    assert [r["controller"] for r in data["runs"]] == ["PD"]


def test_a_study_ends_with_its_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json_output(capsys, "study", "small_study.toml", "--json", "--only", "PD,sine")
    assert data["report"] == str(Path("study-small_study") / "report.html")
    assert "<html" in (folder / data["report"]).read_text()


def test_rerun(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output(capsys, "study", "small_study.toml", "--no-report", "--only", "sine", "--out", "here")
    assert "all identical" in output(capsys, "rerun", "here")
    manifest = json.loads((folder / "here" / "manifest.json").read_text())
    manifest["runs"][0]["metrics"]["torque_rms_Nm"] *= 2.0
    (folder / "here" / "manifest.json").write_text(json.dumps(manifest))
    assert main(["rerun", "here"]) == 1
    assert "torque_rms_Nm" in capsys.readouterr().out


def test_an_interruption_says_how_to_go_on(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from stickslip.studies import study as studies

    real, calls = studies.execute, []

    def third_is_interrupted(planned: Any) -> Any:
        calls.append(planned)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(planned)

    monkeypatch.setattr(studies, "execute", third_is_interrupted)
    assert main(["study", "small_study.toml", "--no-report"]) == 130
    streams = capsys.readouterr()
    assert streams.err.count("\n") == 1
    assert "finished runs are kept in study-small_study; run the same command again" in streams.err
    assert len(list(folder.rglob("*.npz"))) == 2
    monkeypatch.setattr(studies, "execute", real)
    assert main(["study", "small_study.toml", "--no-report"]) == 0
    assert re.search(r"stickslip: 2 of \d+ runs were already done; going on\n", capsys.readouterr().err)


def test_a_sweep_that_is_interrupted_while_it_is_timed_says_how_to_go_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from stickslip.sweeps import forecast

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(forecast, "paces_of", interrupted)
    assert main(["sweep", "thesis-robustness", "--cases", "500", "--out", str(tmp_path / "out")]) == 130
    assert "run the same command again to resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["study", "thesiss"], "unknown study 'thesiss'; did you mean 'thesis'"),
        (["study", "nothing"], "unknown study 'nothing'; give the path of a TOML file, or one of thesis,"),
        (
            ["sweep", "thesis-robustnes"],
            "unknown sweep 'thesis-robustnes'; did you mean 'thesis-robustness'?",
        ),
    ],
)
def test_a_misspelt_study_is_named_with_the_one_that_is_meant(
    given: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(given) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_ctrl_c_of_a_process(folder: Path) -> None:
    text = (folder / "small_study.toml").read_text().replace("duration = 0.1", "duration = 60.0", 1)
    (folder / "small_study.toml").write_text(text)
    process = subprocess.Popen(
        [*START, "study", "small_study.toml", "--no-report"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120.0
    while not list(folder.rglob("*.npz")) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 130, error
    # A machine that compiles for the first time says so before.
    *_, stopping, interrupted = error.splitlines()
    assert stopping == "stickslip: finishing the running cases; press Ctrl-C again to abort"
    assert interrupted.startswith("stickslip: interrupted; finished runs are kept")


# ---- simulate -----------------------------------------------------------------------------------------------


def test_simulate_writes_a_record_and_prints_metrics(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = output(capsys, "simulate", "one_run.toml")
    record = stickslip.Record.load(folder / "one_run.npz")
    for name in record.meta["metrics"]:
        assert name in text
    assert all(len(line.split()) >= 2 for line in text.splitlines())
    assert any(line.split() == ["limit_cycle_period_s", "none"] for line in text.splitlines())
    assert "accuracy: position within about" in text
    data = json_output(capsys, "simulate", "one_run.toml", "--json", "--out", "other.npz")
    assert data["record"] == "other.npz"
    assert data["metrics"]["position_rms_rad"] == record.meta["metrics"]["position_rms_rad"]


def test_the_example_in_the_help_of_simulate_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = output(capsys, "simulate", "--help")
    (folder / "example.toml").write_text(text[text.index("\n[axis]") : text.index("positional arguments")])
    assert "position_rms_rad" in output(capsys, "simulate", "example.toml")


def test_a_run_that_ends_early_is_one_line_and_code_1(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / "one_run.toml").read_text().replace("duration = 0.1", "duration = 5.0")
    text = (
        text.split("[controller]")[0]
        + "[controller]\ngains = {kp = 500.0, kd = 50.0, kr = 50.0}\nsample_time = 1e-2\n"
    )
    (folder / "one_run.toml").write_text(text)
    assert main(["simulate", "one_run.toml"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "ended at" in error
    assert (folder / "one_run.npz").exists()


def test_a_terminal_without_the_letters_of_units(folder: Path) -> None:
    done = subprocess.run(
        [*START, "law", "gms"],
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_reader_that_leaves_early(folder: Path) -> None:
    command = " ".join(f"'{part}'" for part in START)
    done = subprocess.run(
        ["bash", "-c", f"{command} study thesis --print | head -1"], capture_output=True, check=False
    )
    assert done.stderr == b""


def test_a_chance_that_there_is_not_is_a_dash() -> None:
    from stickslip.identification.compare.text import chance

    assert [chance(p) for p in (float("nan"), 0.25, 1e-9)] == ["-", "0.25", "< 1e-06"]


def test_warnings_of_numpy_are_not_the_users(tmp_path: Path) -> None:
    """`python -W` sees them; a terminal does not."""
    code = (
        "import sys, numpy as np, stickslip.cli as cli\n"
        "cli._dispatch = lambda argv: int(np.isnan(np.array([0.0]) / 0.0)[0]) - 1\n"
        "sys.argv = ['stickslip', 'doctor']\n"
        "sys.exit(cli.main())\n"
    )
    for options, seen in (([], False), (["-W", "default"], True)):
        done = subprocess.run([sys.executable, *options, "-c", code], capture_output=True, text=True)
        assert done.returncode == 0
        assert ("RuntimeWarning" in done.stderr) is seen
