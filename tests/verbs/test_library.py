"""The library's functions: arrays, frames, files and records give the numbers that the command line gives."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.identification.identified_file import read_identified
from support import axis_cases as cases

LOOP = {"kp": 8.0, "kd": 0.08, "kr": 0.08, "limit": 3.0}


@pytest.fixture(scope="module")
def signals() -> dict[str, np.ndarray]:
    """An axis of known friction, as its numbers are in the file too."""
    t = cases.experiment("coulomb", noise=2e-3)
    columns = {"t": t.time, "position": t.position, "torque": t.drive, "reference": t.reference}
    return {name: np.array([float(f"{x:.9f}") for x in values]) for name, values in columns.items()}


@pytest.fixture(scope="module")
def log(signals: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("library") / "log.csv"
    head = "time [s],position [rad],motor_torque [N·m],position_reference [rad]"
    np.savetxt(path, np.stack(list(signals.values()), axis=1), "%.9f", ",", header=head, comments="")
    return path


@pytest.fixture(scope="module")
def result(signals: dict[str, np.ndarray]) -> ss.IdentificationResult:
    return ss.identify(**signals, law="coulomb", loop=LOOP)


def numbers(found: ss.IdentificationResult) -> dict[str, tuple[float, float, float]]:
    return {e.name: (e.value, *e.interval) for e in found.parameters.values()}


def test_a_mapping_of_arguments_names_means_what_the_arguments_mean(signals: dict[str, np.ndarray]) -> None:
    """The same arrays in a mapping were doubted for units that nobody stated."""
    told = ss.doctor(dict(signals))
    assert "assumed-unit" not in {f.code for f in told.findings}
    assert told.findings == ss.doctor(**signals).findings
    assert ss.read(dict(signals), units={"position": "deg"})["position"][-1] == pytest.approx(
        np.radians(signals["position"][-1])
    )
    other = {"q": signals["position"], **{n: x for n, x in signals.items() if n != "position"}}
    assert "assumed-unit" in {f.code for f in ss.doctor(other).findings}


def test_the_same_log_gives_the_same_numbers_from_the_command_line_and_from_python(
    log: Path, result: ss.IdentificationResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = ",".join(f"{k}={v}" for k, v in LOOP.items())
    out = str(tmp_path / "axis")
    options = ["--law", "coulomb", "--loop", text, "--out", out, "--no-report", "--json"]
    assert main(["identify", str(log), *options]) == 0
    printed = json.loads(capsys.readouterr().out)
    said = {e["name"]: (e["value"], e["lower"], e["upper"]) for e in printed["estimates"]}
    from_file = ss.identify(log, law="coulomb", loop=LOOP)
    assert numbers(from_file) == said
    assert numbers(result) == said
    assert from_file.misfit == printed["misfit"]
    saved = read_identified(tmp_path / "axis" / "model.toml")
    assert {e.name: (e.value, *e.interval) for e in saved.estimates} == said


def test_a_data_frame_and_a_record_are_logs_too(
    signals: dict[str, np.ndarray], result: ss.IdentificationResult
) -> None:
    frame = pandas.DataFrame({
        "time [s]": signals["t"], "position [rad]": signals["position"], "torque [Nm]": signals["torque"],
        "position_reference [rad]": signals["reference"],
    })  # fmt: skip
    for log in (frame, frame.set_index("time [s]"), ss.read(frame), dict(frame)):
        assert numbers(ss.identify(log, law="coulomb", loop=LOOP)) == numbers(result)


def test_a_result_has_parameters_with_interval_and_verdict(result: ss.IdentificationResult) -> None:
    fc = result.parameters["fc"]
    assert fc.interval[0] < cases.FC < fc.interval[1]
    assert fc.identified
    assert fc.verdict == ""
    assert result.verdict.startswith(("Yes", "With care"))
    assert result.model.law.name == "coulomb"
    assert result.axis.inertia == pytest.approx(result.parameters["inertia"].value, rel=1e-12)
    assert result.axis.friction.parameters == result.model.parameters
    assert str(result).splitlines()[0] == "axis: law 'coulomb'"
    assert repr(result) == "<IdentificationResult: method 'axis', law 'coulomb', 4 of 4 identified>"
    assert result.to_pandas().loc["fc", "value"] == fc.value
    with pytest.raises(ss.InputError, match="did you mean 'fc'"):
        result["fcc"]


def test_a_notebook_shows_a_table_in_which_nothing_of_the_user_is_markup(
    result: ss.IdentificationResult,
) -> None:
    shown = result._repr_html_()
    assert shown.count("<tr>") == 1 + len(result.parameters)
    assert f"{result.parameters['fc'].value:.5g}" in shown
    assert "Trust:" in shown
    odd = ss.doctor({"t": np.arange(10.0), "position": np.arange(10.0), "<b>torque</b>": np.arange(10.0)})
    assert "<b>" not in odd._repr_html_()


def test_report_and_model_are_written_and_read_back(result: ss.IdentificationResult, tmp_path: Path) -> None:
    model = result.save(tmp_path / "new" / "axis.toml")
    assert result.save(tmp_path) == tmp_path / "model.toml"
    saved, here = read_identified(model), result.identified()
    assert saved.estimates == here.estimates
    assert dict(saved.axis) == dict(here.axis)
    assert saved.trajectory is not None
    assert here.trajectory is not None
    assert np.array_equal(saved.trajectory.position, here.trajectory.position)
    page = result.report(tmp_path / "page.html", model)
    assert "axis.toml" in page.read_text(encoding="utf-8")


def test_what_is_known_is_not_fitted(signals: dict[str, np.ndarray]) -> None:
    known = ss.identify(
        **signals, law="coulomb", loop=LOOP, inertia=5e-4, values={"offset": 0.0}, frozen=["offset"]
    )
    assert set(known.parameters) == {"fc", "sigma2"}
    assert known.axis.inertia == 5e-4


def test_units_of_arrays_are_converted_and_named(signals: dict[str, np.ndarray]) -> None:
    turned = np.degrees(signals["position"])
    record = ss.read(t=signals["t"], position=turned, torque=1e3 * signals["torque"],
                     units={"position": "deg", "torque": "mNm"})  # fmt: skip
    assert np.allclose(record["position"], signals["position"], rtol=1e-12)
    assert np.allclose(record["motor_torque"], signals["torque"], rtol=1e-12)
    along = ss.read(t=signals["t"], position=turned, torque=turned, velocity=turned, units={"position": "mm"})
    assert dict(along.units) == {"position": "m", "motor_torque": "N", "velocity": "m/s"}
    assert not [f for f in ss.doctor(record).findings if f.code == "assumed-unit"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "no log; give a path"),
        ({"t": [0.0, 1.0], "position": [0.0]}, "differ in length"),
        ({"t": [0.0, 1.0], "position": ["a", "b"]}, "position is no array of numbers"),
        ({"t": [[0.0]], "position": [0.0]}, "shape"),
        ({"t": [0.0], "position": [0.0], "units": {"torque": "Nm"}}, "units names 'torque'"),
        ({"t": [0.0], "position": [0.0], "units": {"position": "furlong"}}, "is not a unit that is known"),
        ({"t": [0.0], "position": [0.0], "map": {"position": "q"}}, "map applies to columns"),
        ({"tork": [0.0]}, "did you mean 'torque'"),
        (
            {"t": [0.0, 1e-3], "position": [0.0, 0.1], "sample_time": 5e-4},
            "t and sample_time = 0.0005 exclude each",
        ),
    ],
)
def test_bad_arrays_are_refused_in_one_line(given: dict[str, object], said: str) -> None:
    with pytest.raises(ss.InputError, match=said):
        ss.read(**given)  # type: ignore[arg-type]


def test_two_logs_in_one_call_and_columns_of_a_record_are_refused(signals: dict[str, np.ndarray]) -> None:
    record = ss.read(**signals)
    with pytest.raises(ss.InputError, match="exclude each other"):
        ss.read(record, **signals)
    with pytest.raises(ss.InputError, match="map applies to columns"):
        ss.read(record, map={"position": "q"})
    with pytest.raises(ss.InputError, match="without columns of numbers"):
        ss.read(object())
    with pytest.raises(ss.InputError, match=r"no column names; give the signals by name: t="):
        ss.read(signals["t"])
    with pytest.raises(ss.InputError, match=re.escape('map={"position": "Pos(deg)"}: the file has no')):
        ss.read({"t": signals["t"], "Pos (deg)": signals["position"]}, map={"position": "Pos(deg)"})


def test_a_rate_that_a_column_of_times_contradicts_is_said(signals: dict[str, np.ndarray]) -> None:
    columns = {"time [s]": signals["t"], "position [rad]": signals["position"]}
    step = float(np.median(np.diff(signals["t"])))
    assert "time-overruled" not in {f.code for f in ss.doctor(columns, sample_time=step).findings}
    found = {f.code: f for f in ss.doctor(columns, sample_time=0.5 * step).findings}
    assert f"{step:g} s apart" in found["time-overruled"].message


def test_whole_milliseconds_of_a_fast_log_do_not_contradict_its_rate(signals: dict[str, np.ndarray]) -> None:
    """They were said to be 0 s apart."""
    rows = signals["position"].size
    columns = {"time [ms]": np.floor(0.25 * np.arange(rows)), "position [rad]": signals["position"]}
    assert "time-overruled" not in {f.code for f in ss.doctor(columns, sample_time=0.25e-3).findings}
    found = {f.code: f for f in ss.doctor(columns, sample_time=1e-3).findings}["time-overruled"]
    apart = float(found.message.rpartition("rows are ")[2].split()[0])
    assert apart == pytest.approx(0.25e-3, rel=1e-2)
    assert found.remedy == "leave sample_time out if the column is right"


def test_a_rate_of_a_profile_that_a_column_contradicts_names_the_profile(
    signals: dict[str, np.ndarray], tmp_path: Path
) -> None:
    (tmp_path / "rate.toml").write_text("sample_time = 0.5\n")
    columns = {"time [s]": signals["t"], "position [rad]": signals["position"]}
    found = {f.code: f for f in ss.doctor(columns, profile=tmp_path / "rate.toml").findings}
    assert "the profile says sample_time" in found["time-overruled"].remedy


def test_the_doctor_says_the_same_from_python(
    log: Path, signals: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor", str(log), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["findings"]
    assert [f.as_data() for f in ss.doctor(log).findings] == printed
    broken = {**signals, "t": np.zeros_like(signals["t"])}
    found = ss.doctor(**broken)
    assert found.errors
    with pytest.raises(ss.InputError):
        found.raise_for_errors()


def test_a_mapping_is_kept_only_where_that_is_asked_for(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    mapping = {"position": "position [rad]:deg"}
    once = ss.read(log, map=mapping)
    assert not (tmp_path / "config").exists()
    ss.read(log, map=mapping, remember=True)
    assert np.array_equal(ss.read(log, remember=True)["position"], once["position"])
    assert np.allclose(ss.read(log)["position"], np.degrees(once["position"]))


def test_an_unchanged_axis_compares_as_unchanged(result: ss.IdentificationResult, tmp_path: Path) -> None:
    twice = ss.compare(result, result)
    assert not [c for c in twice.changes if c.changed]
    assert twice.as_dict() == ss.compare(result.save(tmp_path), result).as_dict()
    assert repr(twice) == f"<Comparison: {twice.summary}>"
    assert str(twice).endswith(twice.summary)
    assert "sliding curve" in twice._repr_html_()


@pytest.mark.parametrize(
    "first",
    [
        "import stickslip.identification.axis",
        "from stickslip.identification import doctor",
        "import stickslip.verbs.identify",
    ],
)
def test_the_function_is_there_whatever_was_imported_first(first: str) -> None:
    code = (
        f"{first}\nimport stickslip as ss, inspect\n"
        "assert callable(ss.identify) and 'inertia' in inspect.signature(ss.identify).parameters\n"
        "import stickslip.identification.axis as axis\nassert axis.identify_axis\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stderr


def test_signatures_are_those_of_the_functions() -> None:
    from stickslip.verbs.identify import identify

    assert inspect.signature(ss.identify) == inspect.signature(identify)


def test_a_recommendation_is_that_of_the_command_line_and_runs_in_a_simulation(
    result: ss.IdentificationResult, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    for name, few in (("GAINS", (0.9,)), ("LEADS", (0.5,)), ("BEYOND", (1.5,))):
        monkeypatch.setattr(f"stickslip.recommendation.recommend.{name}", few)
    out, options = (
        tmp_path / "recommended.toml",
        {"bandwidth": 20.0, "counts_per_rev": 65536.0, "axes": 1, "confirm": 2},
    )
    advice = ss.recommend(result, **options)
    words = [w for k, v in options.items() for w in (f"--{k.replace('_', '-')}", str(v))]
    assert main(["recommend", str(result.save(tmp_path)), *words, "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["chosen"] == advice.as_dict()["chosen"]
    assert printed["model"] == advice.as_dict()["model"]
    assert advice.chosen is not None
    own, theirs = (tomllib.loads(f.read_text()) for f in (advice.save(tmp_path / "own.toml"), out))
    # Notes name an option as who asked does: sample_time= or --sample-time.
    for table in (own, theirs):
        assert table.pop("notes")
    assert own == theirs
    slow = ss.Reference("sine", amplitude=0.1, frequency=0.4)
    errors = [
        ss.simulate(result.axis, c, slow, duration=2.5).meta["metrics"]["position_rms_rad"]
        for c in (advice.controller, advice.loop)
    ]
    assert errors[0] < 0.5 * errors[1]
    assert "Error reduction" in advice._repr_html_()
    assert str(advice).startswith("switch on:")


@pytest.mark.parametrize("given", [5, None, ss.Model("coulomb", fc=0.1)])
def test_what_is_no_model_is_said_by_kind(given: Any) -> None:
    wanted = rf"= {re.escape(repr(given))} must be a path or what `identify` returned"
    with pytest.raises(ss.InputError, match=f"compare: first {wanted}"):
        ss.compare(given, given)


def test_what_a_run_is_not_made_of_is_said_by_kind() -> None:
    """Gains in a controller's place, arrays in a reference's, arguments in another order."""
    axis, gains = ss.RigidAxis(1e-3, ss.Model("coulomb", fc=0.1)), ss.place("PD", 1e-3, 10.0, 1.0)
    slow, run = ss.Reference("sine", amplitude=0.1, frequency=1.0), ss.Controller(gains)
    time = np.linspace(0.0, 1.0, 1000)
    for wrong, words in (
        ((axis, gains, slow, 1.0), r"controller = Gains\(.* must be a Controller: of gains"),
        ((axis, slow, run, 1.0), r"controller = Reference\(.* must be"),
        (
            (axis, run, (time, time), 1.0),
            r"reference = \(array.* must be a Reference, of arrays Reference\.table",
        ),
        ((axis, run, slow, "1"), r"duration = '1' must be a number"),
        ((1e-3, run, slow, 1.0), r"axis = 0.001 must be a RigidAxis or a Machine"),
    ):
        with pytest.raises(ss.InputError, match=words):
            ss.simulate(*wrong)
    assert len(repr(ss.Reference.table(time.tolist(), time.tolist()))) < 200


def test_an_export_is_that_of_the_command_line(
    result: ss.IdentificationResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = result.save(tmp_path / "model.toml")
    for options, own in (
        ([], {}),
        (["--compensator", "ff", "--gain", "0.9"], {"compensator": "ff", "gain": 0.9}),
    ):
        folder = tmp_path / f"c{len(options)}"
        assert main(["export", str(model), "--to", "c99", *options, "--out", str(folder), "--json"]) == 0
        printed = json.loads(capsys.readouterr().out)
        for source in (model, result):
            made = ss.export(source, to="c99", **own)
            assert list(made.notes) == printed["notes"]
            assert {n: (folder / n).read_text() for n in made.files} == made.files
    written = ss.export(result.model, to="python", folder=tmp_path / "python")
    assert [p.name for p in written.paths] == list(written.files)
    assert all(p.exists() for p in written.paths)


def test_a_controller_is_exported_from_memory_and_what_a_target_lacks_is_refused() -> None:
    lugre = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
    pd = ss.place("PD", inertia=4e-4, bandwidth=10.0)
    made = ss.export(ss.Controller(pd, ss.Feedforward(lugre), sample_time=1e-3), to="c99", name="axis1")
    assert any("axis1" in name for name in made.files)
    with pytest.raises(ss.InputError, match="has no controller"):
        ss.export(lugre, to="c99", controller=True)
    alone = ss.export(ss.Controller(pd, sample_time=1e-3), to="st", name="axis1")
    assert "loop_kp" in str(alone.files["axis1.st"])
    with pytest.raises(ss.InputError, match="continuous time"):
        ss.export(ss.Controller(pd), to="c99")
    with pytest.raises(ss.InputError, match="gain belongs to compensator; give"):
        ss.export(lugre, to="c99", gain=0.9)
    with pytest.raises(ss.InputError, match="supports the law alone"):
        ss.export(lugre, to="urdf", compensator="ff")
    with pytest.raises(ss.InputError, match="unknown"):
        ss.export(lugre, to="c98")


SMALL = Path(__file__).parents[1] / "sweep"


@pytest.mark.slow
def test_a_sweep_is_that_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = str(SMALL / "small.toml"), str(tmp_path / "cli")
    assert main(["sweep", file, "--cases", "4", "--no-report", "--out", out, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["runs"]
    found = ss.sweep(file, tmp_path / "library", cases=4, figures=False)
    assert [dict(row) for row in found.rows] == printed
    assert len(found.to_pandas()) == len(printed)
    assert found.columns(0)[found.sweep.metrics[0]].shape == (4,)
    assert found._repr_html_().count("<tr>") == 1 + len(printed)
    lines = repr(found).splitlines()
    assert len([line for line in lines if "signed/" in line]) == len(printed)
    assert f"{printed[0][found.sweep.metrics[0] + '_p95']:.4g}" in lines[2]
    with pytest.raises(ss.InputError, match="at least 1"):
        ss.sweep(file, tmp_path, cases=0)
    with pytest.raises(ss.InputError, match="has no table"):
        ss.tune(file)


def test_machines_are_loaded_by_name_or_file() -> None:
    assert ss.load_machine("thesis-dry").name == "thesis-dry"
    with pytest.raises(ss.InputError, match="thesis-dry"):
        ss.load_machine("thesis-dri")


def test_a_record_prints_short(signals: dict[str, np.ndarray]) -> None:
    """Its arrays and everything that was read filled pages."""
    record = ss.read(**signals)
    assert repr(record).startswith(f"<Record: {len(record)} rows, ")
    assert "position [rad]" in repr(record)
    assert len(repr(record)) < 300
