"""A sweep or tuning given as a mapping of objects is that of its file: the same cases and numbers, the same folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.sweeps.plan import load
from stickslip.sweeps.rerun import rerun
from stickslip.verbs.plain_given import file_of
from stickslip.verbs.study_given import sweep_tables
from support.given_studies import AXIS, COULOMB, LUGRE, PD, PLAIN, RECORDED, SINE, base

FEEDFORWARD = ss.Controller(PD, ss.Feedforward(COULOMB, gain=0.9))
STUDY = base(
    machines={"plain": PLAIN},
    references={"recorded": (RECORDED, 0.1), "sine": (SINE, 0.05)},
    controllers={"PD": ss.Controller(PD), "FF": FEEDFORWARD},
)


def sweep(**changes: Any) -> dict[str, Any]:
    """A mapping that can be run."""
    varied = {"friction.fs": {"scale": np.array([0.8, 1.2])}, "axis.inertia": {"range": (3e-4, 5e-4)}}
    own = {"study": STUDY, "only": ("recorded", "lugre"), "cases": np.int64(12), "vary": varied, "seed": 3}
    return {**own, "metrics": ["position_rms_rad", "torque_rms_Nm"], **changes}


@pytest.fixture(scope="module")
def identified() -> ss.IdentificationResult:
    """An axis with Coulomb friction, from its log."""
    t = np.arange(0.0, 4.0, 1e-3)
    motion = ss.Reference.table(
        t, 3.0 * (1.0 - np.cos(0.8 * np.pi * t)) + 0.3 * (1.0 - np.cos(6.0 * np.pi * t))
    )
    loop = ss.Controller(PD, sample_time=1e-3, torque_limit=3.0)
    run = ss.simulate(ss.RigidAxis(4e-4, COULOMB), loop, motion, duration=4.0)
    rows = run["event"] < 0.5
    torque = run["motor_torque"][rows] + np.random.default_rng(1).normal(0.0, 2e-3, int(rows.sum()))
    return ss.identify(t=run.time[rows], position=run["position"][rows], torque=torque, law="coulomb")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> ss.SweepResult:
    return ss.sweep(sweep(), tmp_path_factory.mktemp("given") / "robust", jobs=1, figures=False)


def test_a_case_is_what_simulate_gives_of_the_same_objects(ran: ss.SweepResult) -> None:
    assert [row["controller"] for row in ran.rows] == ["PD", "FF"]
    found = ran.columns(0)
    for case in range(3):
        axis = ss.RigidAxis(found["axis.inertia"][case], LUGRE.scaled(fs=found["friction.fs"][case]))
        alone = ss.simulate(axis, ss.Controller(PD), RECORDED, duration=0.1, tolerance=1e-7, output=0.1)
        assert alone.meta["metrics"]["position_rms_rad"] == found["position_rms_rad"][case]


def test_its_folder_goes_on_and_runs_again(ran: ss.SweepResult) -> None:
    assert ran.sweep.source.read_bytes() == ran.sweep.study.source.read_bytes()
    again = ss.sweep(sweep(), ran.folder, jobs=1, figures=False)
    assert again.manifest["timings"]["blocks_computed"] == 0
    assert rerun(ran.folder).differences == []
    with pytest.raises(ss.InputError, match="finished blocks of another sweep"):
        ss.sweep(sweep(seed=4), ran.folder, jobs=1, figures=False)
    with pytest.raises(ss.InputError, match="finished blocks of another sweep"):
        ss.sweep(sweep(), ran.folder, cases=6, jobs=1, figures=False)
    assert rerun(ran.folder).differences == []  # what was refused has changed nothing
    manifest = json.loads((ran.folder / "manifest.json").read_text(encoding="utf-8"))
    assert [entry["copy"] for entry in manifest["inputs"]] == ["inputs/robust.toml"]


def test_its_file_is_a_sweep_as_any(ran: ss.SweepResult, tmp_path: Path) -> None:
    result = ss.sweep(ran.folder / "inputs" / "robust.toml", tmp_path / "again", jobs=1, figures=False)
    for row in range(len(ran.rows)):
        for name, values in ran.columns(row).items():
            np.testing.assert_array_equal(result.columns(row)[name], values)


def test_a_study_may_be_a_file_or_one_that_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = ss.study(STUDY, tmp_path / "kept", only=["sine", "lugre", "PD"], report=False)
    file = kept.folder / "inputs" / "kept.toml"
    monkeypatch.chdir(tmp_path)
    for study in (file, str(file.relative_to(tmp_path)), "thesis"):
        only = ["low", "nominal", "PD", "signed"] if study == "thesis" else ["recorded", "lugre"]
        with file_of(sweep(study=study, only=only), "own", "sweep", sweep_tables) as (path, shown):
            found = load(path, shown=shown)
        assert found.name == "own"
        assert found.study.name == ("thesis" if study == "thesis" else "kept")


def test_what_was_identified_is_drawn_from(
    identified: ss.IdentificationResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same numbers as from its file, which the study and the sweep may name."""
    study = {
        **STUDY,
        "axis": identified,
        "machines": {"identified": identified},
        "laws": {"found": identified},
    }
    study["controllers"] = {"FF": {"gains": PD, "compensator": "feedforward", "law": "found"}}
    changes = {
        "study": study,
        "only": ["sine", "coulomb"],
        "cases": 4,
        "vary": {"reference.amplitude": {"scale": [0.9, 1.1]}},
    }
    mine = ss.sweep(sweep(**changes, model=identified), tmp_path / "mine", jobs=1, figures=False)
    assert {"friction.fc", "axis.inertia"} <= mine.columns(0).keys()
    assert rerun(mine.folder).differences == []
    identified.save(tmp_path / "model.toml")
    monkeypatch.chdir(tmp_path)
    study["friction"] = study["laws"] = {"coulomb": {"law": {"model": "model.toml"}}}
    study["machines"] = {"identified": {"machine": "model.toml"}}
    study["controllers"]["FF"]["law"] = "coulomb"
    named = ss.sweep(sweep(**changes, model="model.toml"), "named", jobs=1, figures=False)
    for name, values in mine.columns(0).items():
        np.testing.assert_array_equal(named.columns(0)[name], values)


def test_a_tuning_is_that_of_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = sweep(only=["sine", "lugre", "FF"], cases=4, tune={"controller.gain": {"range": [0.5, 1.2]}})
    (kept,) = ss.tune(content, tmp_path / "tuned", figures=False)
    (alone,) = ss.tune(content)
    assert dict(kept.settings) == dict(alone.settings)
    file = tmp_path / "tuned" / "inputs" / "tuned.toml"
    (again,) = ss.tune(file)
    assert dict(again.settings) == dict(kept.settings)
    assert main(["tune", str(file), "--out", str(tmp_path / "again")]) == 0
    capsys.readouterr()


VARIED = {"friction.fs": {"scale": [0.5, 2.0]}}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"study": 3},
            "sweep: study = 3 must be a mapping, the path of a study's file, or the name of a study that",
        ),
        ({"study": "thesiss"}, "sweep: study: unknown study 'thesiss'; did you mean 'thesis'"),
        ({"study": base(axis=3)}, "sweep: study.axis = 3 must be a RigidAxis, "),
        ({"study": base(title=3)}, "sweep: study.title = 3 must be a string in quotes"),
        ({"study": base(foo=3)}, "sweep: study.foo: unknown key; "),
        ({"model": AXIS}, "sweep: model = RigidAxis("),
        ({"vary": {}}, "sweep: vary is missing"),
        ({"vary": {"friction.xx": {"scale": [0.5, 2.0]}}}, "sweep: vary: no run has a number 'friction.xx'"),
        ({"vary": {"friction.fs": {"scale": [0.5, LUGRE]}}}, "sweep: vary.'friction.fs'.scale[1] = Model("),
        ({"tune": {"controller.kp": {}}}, "sweep has a table [tune]; run `ss.tune(...)`"),
        ({"cases": 2.5}, "sweep: cases = 2.5 must be a whole number"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_cannot_be_is_refused_in_a_line_that_names_the_key(
    changes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    content = {"study": base(), "cases": 4, "vary": VARIED, **changes}
    with pytest.raises(ss.InputError) as refused:
        ss.sweep(content, tmp_path / "mine", figures=False)
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "mine").exists()


def test_a_mapping_needs_a_folder_and_a_tuning_something_to_tune() -> None:
    with pytest.raises(ss.InputError, match=r"sweep: folder is missing, .* give one, folder='my-sweep'"):
        ss.sweep(sweep())
    with pytest.raises(ss.InputError, match=r"tune has no table \[tune\]; give at least one"):
        ss.tune(sweep())
    for verb in (ss.study, ss.sweep, ss.tune):
        with pytest.raises(
            ss.InputError, match=r"file = \{\} is empty; give the path of a TOML file, or a mapping"
        ):
            verb({})


def test_what_a_sweep_lacks_and_what_is_chosen_and_uncertain_at_once_is_told() -> None:
    with pytest.raises(
        InputError, match=r"study is missing; give the name of a study .* or a table \[study\]"
    ):
        ss.tune({"cases": 2, "vary": {"friction.fs": {"scale": [0.9, 1.1]}}})
    both = {"controller.gain": {"range": [0.5, 1.0]}}
    with pytest.raises(InputError, match=r"controller\.gain varies too"):
        ss.tune(
            {"study": "thesis", "only": ["low", "signed", "nominal"], "cases": 2, "vary": both, "tune": both}
        )
