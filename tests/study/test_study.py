"""A study: what it plans, what it writes, how it goes on after an interruption."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.studies import study as studies
from stickslip.studies.files import KEYS
from stickslip.studies.plan import load, select
from stickslip.studies.rerun import rerun
from support.thesis_loops import INERTIA, thesis_run

DATA = Path(__file__).parents[1] / "data"


# ---- the thesis's study ------------------------------------------------------------------------------------------


def test_the_thesis_is_180_runs_in_order() -> None:
    thesis = load("thesis")
    controllers = [
        "PD",
        "PID",
        *(f"{way}-{law}" for way in ("FF", "FB") for law in ("coulomb", "stribeck", "lugre", "gms")),
    ]
    expected = [
        f"{rule}/{reference}/{friction}/{controller}"
        for rule in ("signed", "literal")
        for reference in ("low", "high", "step")
        for friction in ("nominal", "plus10", "minus10")
        for controller in controllers
    ]
    assert [run.key for run in thesis.runs] == expected
    assert [run.key for run in thesis.extras] == [
        "signed/high/none/PR", "signed/high/none/PD", "signed/high/nominal/PR",
    ]  # fmt: skip
    assert [r.figure for r in thesis.responses] == ["3.5", "3.10", "3.11", "3.13", "3.14", "3.20"]


def test_the_thesis_file_says_what_the_tables_say() -> None:
    for run in load("thesis").runs:
        axis, control, motion, duration = thesis_run(run.key.split("/", 1)[1])
        assert run.axis.inertia == INERTIA
        assert run.axis.friction.parameters == axis.friction.parameters
        assert run.control.gains == control.gains
        assert (run.duration, run.motion.parameters) == (duration, motion.parameters)
        ours, theirs = run.control.compensator, control.compensator
        assert type(ours) is type(theirs)
        if ours and theirs:
            assert ours.model.parameters == theirs.model.parameters
            assert (ours.gain, ours.filter_hz) == (1.0, None)


@pytest.mark.slow
def test_the_thesis_runs(tmp_path: Path, study_reference: dict[tuple[str, str], dict[str, Any]]) -> None:
    result = studies.run(load("thesis"), tmp_path, ["low", "step", "nominal"])
    assert len(result.runs) == 2 * 2 * 10
    assert not [run.key for run in result if run.failure]
    for run in result:
        value, room = study_reference[run.slip_rule, run.case]["metrics"]["rms_e"]
        if study_reference[run.slip_rule, run.case]["cls"] == "W":
            assert abs(run.metrics["position_rms_rad"] - value) <= room, run.key


# ---- selection ---------------------------------------------------------------------------------------------------


def test_selection_is_any_within_a_family_and_all_of_the_families() -> None:
    runs = load("thesis").runs
    assert {r.reference for r in select(runs, ["low", "step"])} == {"low", "step"}
    assert len(select(runs, ["low", "step"])) == 120
    assert [r.key for r in select(runs, ["FF-lugre", "low", "nominal", "signed"])] == [
        "signed/low/nominal/FF-lugre"
    ]
    assert select(runs, []) == list(runs)
    with pytest.raises(InputError, match="'minus10'"):
        select(runs, ["minus1"])


# ---- what a study writes ------------------------------------------------------------------------------------------


def test_files_and_their_content(small: studies.Study, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = studies.run(small, out)
    keys = [f"signed/{r}/{f}/{c}" for r in ("sine", "points") for f in ("nominal", "plus10")
            for c in ("PD", "FF-lugre", "FF-coulomb")]  # fmt: skip
    assert [run.key for run in result] == keys
    with (out / "metrics.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:4] == list(KEYS)
    assert ["/".join(row[k] for k in KEYS) for row in rows] == keys
    for row, run in zip(rows, result):
        record = Record.load(out / "records" / f"{run.key}.npz")
        assert record.meta["metrics"].keys() == run.metrics.keys()
        for name, value in run.metrics.items():
            assert row[name] == ("" if math.isnan(value) else repr(value))
        assert run.record().time[-1] == pytest.approx(0.1)
    assert rows[0]["limit_cycle_period_s"] == ""
    manifest = json.loads((out / "manifest.json").read_text())
    assert [entry["run"] for entry in manifest["runs"]] == keys + [run.key for run in result.extras]
    assert {entry["written"] for entry in manifest["inputs"]} == {"small_study.toml", "motion.csv"}
    assert all(len(entry["sha256"]) == 64 for entry in manifest["inputs"])
    assert manifest["versions"].keys() >= {"stickslip", "python", "numpy", "numba"}
    assert manifest["configuration"] == small.config
    assert not list(out.rglob("*.part"))


def test_parquet_holds_the_same_table(small: studies.Study, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    result = studies.run(small, tmp_path / "out")
    rows = parquet.read_table(tmp_path / "out" / "metrics.parquet").to_pylist()
    for row, run in zip(rows, result, strict=True):
        assert row["controller"] == run.controller
        assert row["position_rms_rad"] == run.metrics["position_rms_rad"]
        assert row["limit_cycle_period_s"] is None


def test_threads_change_no_number(small: studies.Study, tmp_path: Path) -> None:
    studies.run(small, tmp_path / "one", jobs=1)
    studies.run(small, tmp_path / "two", jobs=2)
    assert (tmp_path / "one" / "metrics.csv").read_bytes() == (tmp_path / "two" / "metrics.csv").read_bytes()


# ---- going on -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupted_study_goes_on(
    small: studies.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    whole = studies.run(small, tmp_path / "whole")

    def interrupt(done: int, total: int) -> None:
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        studies.run(small, tmp_path / "parts", jobs=jobs, progress=interrupt)
    kept = len(list((tmp_path / "parts").rglob("*.npz")))
    assert 5 <= kept < len(whole.runs) + len(whole.extras)

    executed: list[str] = []
    real = studies.execute

    def counted(planned: studies.PlannedRun) -> Any:
        executed.append(planned.key)
        return real(planned)

    monkeypatch.setattr(studies, "execute", counted)
    studies.run(small, tmp_path / "parts", jobs=jobs)
    assert len(executed) == len(whole.runs) + len(whole.extras) - kept
    assert (tmp_path / "whole" / "metrics.csv").read_bytes() == (
        tmp_path / "parts" / "metrics.csv"
    ).read_bytes()
    executed.clear()
    studies.run(small, tmp_path / "parts")
    assert executed == []


def test_only_what_changed_runs_again(
    small: studies.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    studies.run(small, out)
    (out / "records" / "signed" / "sine" / "nominal" / "PD.npz").write_bytes(b"cut off")
    small.source.write_text(small.source.read_text().replace("gain = 0.9", "gain = 0.8"))
    executed: list[str] = []
    real = studies.execute
    monkeypatch.setattr(studies, "execute", lambda p: executed.append(p.key) or real(p))
    studies.run(load(small.source), out)
    assert sorted(executed) == sorted(
        ["signed/sine/nominal/PD"]
        + [f"signed/{r}/{f}/FF-lugre" for r in ("sine", "points") for f in ("nominal", "plus10")]
    )


def test_a_selection_keeps_the_other_finished_runs(small: studies.Study, tmp_path: Path) -> None:
    out = tmp_path / "out"
    whole = studies.run(small, out)
    table = (out / "metrics.csv").read_bytes()
    again = studies.run(small, out, ["PD", "sine"])
    assert [r.key for r in again] == [r.key for r in whole]
    assert [r.key for r in again.extras] == [r.key for r in whole.extras]
    assert (out / "metrics.csv").read_bytes() == table
    assert [e["run"] for e in again.manifest["runs"]] == [e["run"] for e in whole.manifest["runs"]]
    assert again.manifest["only"] == ["PD", "sine"]
    assert rerun(out).differences == []
    # A record that is no longer what the study asks for is not a result of it.
    small.source.write_text(small.source.read_text().replace("gain = 0.9", "gain = 0.8"))
    changed = studies.run(load(small.source), out, ["PD", "sine"])
    assert [r.key for r in changed] == [r.key for r in whole if r.controller != "FF-lugre"]
    assert len((out / "metrics.csv").read_text().splitlines()) == 1 + len(changed.runs)


def test_selections_add_up_in_the_order_of_the_study(small: studies.Study, tmp_path: Path) -> None:
    whole = studies.run(small, tmp_path / "whole")
    for part in ("points", "sine"):
        parts = studies.run(small, tmp_path / "parts", [part])
    assert [r.key for r in parts] == [r.key for r in whole]
    for name in ("metrics.csv", "metrics.parquet"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_fingerprints_tell_runs_apart() -> None:
    thesis = load("thesis")
    every = [run.fingerprint for run in (*thesis.runs, *thesis.extras)]
    assert len(set(every)) == len(every)
    assert every == [run.fingerprint for run in (*load("thesis").runs, *load("thesis").extras)]


@pytest.mark.parametrize(
    ("written", "said"),
    [("4", ""), ("2.5", "substeps = 2.5 must be a whole number"), ("1001", "substeps = 1001 must be")],
)
def test_a_file_divides_the_samples_of_a_compensator(
    small: studies.Study, tmp_path: Path, written: str, said: str
) -> None:
    file, own = tmp_path / "small_study.toml", "[controllers.FF-lugre]\n"
    text = file.read_text().replace(own, f"{own}sample_time = 1e-3\n")
    file.write_text(text.replace(own, f"{own}substeps = {written}\n"))
    if said:
        with pytest.raises(InputError, match=said):
            load(file)
        return
    found = next(run for run in load(file).runs if run.controller == "FF-lugre")
    assert found.control.compensator
    assert found.control.compensator.substeps == 4
    file.write_text(text)
    assert next(r for r in load(file).runs if r.key == found.key).fingerprint != found.fingerprint


def test_rerun_is_identical_and_sees_a_change(small: studies.Study, tmp_path: Path) -> None:
    out = tmp_path / "out"
    studies.run(small, out, ["sine"])
    small.source.unlink()  # The folder holds all that is needed.
    (tmp_path / "motion.csv").unlink()
    found = rerun(out, jobs=2)
    assert (found.runs, found.differences, found.notes) == (6 + 3, [], [])
    manifest = json.loads((out / "manifest.json").read_text())
    manifest["runs"][0]["metrics"]["position_rms_rad"] *= 1.0 + 1e-12
    (out / "manifest.json").write_text(json.dumps(manifest))
    assert len(rerun(out).differences) == 1
    (out / "inputs" / "small_study.toml").write_text("")
    with pytest.raises(InputError, match="was changed"):
        rerun(out)


def test_ctrl_c_is_acknowledged_at_once_and_held_back_until_what_is_in_hand_is_kept(
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = signal.getsignal(signal.SIGINT)
    with studies.interrupts_between_runs("stopping") as check:
        check()
        signal.raise_signal(signal.SIGINT)
        assert capfd.readouterr().err.splitlines() == ["stickslip: stopping"]
        with pytest.raises(KeyboardInterrupt):
            check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    with studies.interrupts_between_runs():
        signal.raise_signal(signal.SIGINT)
    assert "press Ctrl-C again to abort" in capfd.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_the_line_of_an_interruption_does_not_run_into_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[bytes] = []
    monkeypatch.setattr(studies.os, "isatty", lambda fd: True)
    monkeypatch.setattr(studies.os, "write", lambda fd, text: written.append(text))
    with studies.interrupts_between_runs("stopping"):
        signal.raise_signal(signal.SIGINT)
    newline = os.linesep.encode()
    assert written == [newline + b"stickslip: stopping" + newline]


# ---- runs that end early -------------------------------------------------------------------------------------------


def test_a_run_that_ends_early_is_kept_and_the_others_go_on(small: studies.Study, tmp_path: Path) -> None:
    text = small.source.read_text()
    # Far too large a gain against samples of 10 ms: the loop diverges.
    wild = "[controllers.wild]\ngains = {kp = 500.0, kd = 50.0, kr = 50.0}\nsample_time = 1e-2\n\n[controllers.PD]"
    small.source.write_text(
        text.replace("[controllers.PD]", wild, 1).replace("duration = 0.1", "duration = 5.0", 1)
    )
    study = load(small.source)
    result = studies.run(study, tmp_path / "out", ["wild", "PD", "sine", "nominal"])
    failed = result.find("signed/sine/nominal/wild")
    assert "ended at" in failed.failure
    assert failed.metrics == {}
    assert 0 < len(failed.record()) < len(result.find("signed/sine/nominal/PD").record())
    assert result.find("signed/sine/nominal/PD").failure == ""
    again = studies.run(study, tmp_path / "out", ["wild", "PD", "sine", "nominal"])
    assert again.find("signed/sine/nominal/wild").failure == failed.failure
    rows = (tmp_path / "out" / "metrics.csv").read_text().splitlines()
    assert any(row.startswith("signed,sine,nominal,wild,,,") for row in rows)
    assert rerun(tmp_path / "out").differences == []
