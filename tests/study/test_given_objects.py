"""A study given as a mapping of objects is the study of its file: the same objects, numbers and folder."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.cli import main
from stickslip.control.belief import Belief
from stickslip.control.catalogue import CATALOGUE, LOOPS, compensated
from stickslip.studies.plan import load
from stickslip.studies.rerun import rerun
from support import laws
from support.given_studies import (
    AXIS,
    CONTROLLERS,
    COULOMB,
    FLEXIBLE,
    GMS,
    LESS,
    LUGRE,
    OBSERVER,
    PD,
    PLAIN,
    RECORDED,
    SINE,
    T,
    base,
    read,
)  # fmt: skip


def same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether metrics are the same, bit for bit."""
    return one.keys() == other.keys() and np.array_equal([*one.values()], [*other.values()], equal_nan=True)


# ---- the same numbers --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], ss.StudyResult]:
    """Two machines and an axis, three controllers, a recorded reference and one of a kind."""
    content = base(
        machines={"flexible": FLEXIBLE, "plain": {"machine": PLAIN, "start_angle": 0.5}},
        references={"recorded": (RECORDED, 0.12), "sine": (SINE, np.float32(0.125))},
        controllers=CONTROLLERS,
    )
    return content, ss.study(content, tmp_path_factory.mktemp("given") / "mine", report=False)


def test_it_gives_what_simulate_gives_of_the_same_objects(ran: tuple[dict[str, Any], ss.StudyResult]) -> None:
    axes = {"lugre": AXIS, "flexible": FLEXIBLE, "plain": replace(PLAIN, start_angle=0.5)}
    motions = {"recorded": (RECORDED, 0.12), "sine": (SINE, 0.125)}
    assert len(ran[1].runs) == len(axes) * len(motions) * len(CONTROLLERS)
    for run in ran[1].runs:
        motion, duration = motions[run.reference]
        alone = ss.simulate(axes[run.friction], CONTROLLERS[run.controller], motion, duration=duration)
        assert same(run.metrics, alone.meta["metrics"]), run.key


def test_its_folder_runs_again_and_its_file_is_a_study_as_any(
    ran: tuple[dict[str, Any], ss.StudyResult], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = ran[1].folder
    assert rerun(folder).differences == []
    file = folder / "inputs" / "mine.toml"
    edited = folder.parent / "edited.toml"
    edited.write_text(
        file.read_text(encoding="utf-8").replace("amplitude = 0.01", "amplitude = 0.02"), encoding="utf-8"
    )
    printed = [
        "study",
        str(edited),
        "--only",
        "sine,PD",
        "--no-report",
        "--out",
        str(folder.parent / "edited"),
    ]
    assert main(printed) == 0
    former = {run.key: run.metrics for run in ran[1].runs}
    for run in ss.study(edited, folder.parent / "edited", only=["sine", "PD"], report=False).runs:
        assert run.metrics["position_rms_rad"] > former[run.key]["position_rms_rad"]
    capsys.readouterr()


def test_it_is_the_study_of_the_file_that_somebody_writes(tmp_path: Path) -> None:
    PLAIN.write(tmp_path / "plain.toml")
    (tmp_path / "written.toml").write_text(
        """
        [axis]
        inertia = 4e-4
        [friction.lugre]
        law = "lugre"
        sigma0 = 3.5e4
        sigma1 = 0.1
        sigma2 = 0.018
        fs = 0.335
        fc = 0.285
        vs = 0.01
        [machines.plain]
        machine = "plain.toml"
        [references.sine]
        kind = "sine"
        amplitude = 0.01
        frequency = 4.0
        duration = 0.1
        placement = {bandwidth_hz = 20.0, damping = 1.0}
        [laws.believed]
        law = "coulomb"
        fc = 0.285
        sigma2 = 0.018
        [controllers.FF]
        linear = "PD"
        compensator = "feedforward"
        law = "believed"
        gain = 0.9
        """
    )
    placed = {"kind": SINE, "duration": 0.1, "placement": {"bandwidth_hz": 20.0, "damping": np.float64(1.0)}}
    mine = base(
        machines={"plain": PLAIN}, laws={"believed": COULOMB}, references={"sine": placed},
        controllers={"FF": {"linear": "PD", "compensator": ss.Feedforward(COULOMB, gain=0.9)}},
    )  # fmt: skip
    found, written = read(mine), load(tmp_path / "written.toml")
    assert [run.fingerprint for run in found.runs] == [run.fingerprint for run in written.runs]


@pytest.mark.parametrize("name", ["thesis", "imperfections"])
def test_a_file_that_ships_is_the_same_as_a_mapping(name: str) -> None:
    shipped = load(name)
    found = read(tomllib.loads(shipped.source.read_text(encoding="utf-8")))
    runs = [*shipped.runs, *shipped.extras]
    assert [run.fingerprint for run in (*found.runs, *found.extras)] == [run.fingerprint for run in runs]
    assert (found.responses, found.drives) == (shipped.responses, shipped.drives)


def test_the_same_call_goes_on_and_a_changed_mapping_runs_what_changed(tmp_path: Path) -> None:
    both = base(controllers={"PD": ss.Controller(PD), "stiff": ss.Controller(ss.pd(20.0, 0.2))})
    ss.study(both, tmp_path / "mine", report=False)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "mine" / "records").rglob("*.npz")}
    assert len(before) == 2
    ss.study(both, tmp_path / "mine", report=False)
    assert {p: p.stat().st_mtime_ns for p in before} == before
    both["controllers"]["stiff"] = ss.Controller(ss.pd(30.0, 0.2))
    one = ss.study(both, tmp_path / "mine", only=["stiff"], report=False)
    assert [run.controller for run in one.runs] == ["stiff"]
    changed = {p.stem for p in before if p.stat().st_mtime_ns != before[p]}
    assert changed == {"stiff"}
    with pytest.raises(ss.InputError, match="holds the study 'mine'"):
        ss.sweep(
            {"study": both, "cases": 2, "vary": {"friction.fs": {"scale": [0.9, 1.1]}}}, tmp_path / "mine"
        )


# ---- the same objects --------------------------------------------------------------------------------------------


NUMBER = st.floats(0.0, 1e6)
GAINS = st.builds(ss.Gains, NUMBER, NUMBER, NUMBER, NUMBER)
MODELS = st.sampled_from([LUGRE, LESS, COULOMB, GMS])
AHEAD = st.builds(
    ss.Feedforward, MODELS, NUMBER, st.none() | st.floats(1.0, 300.0), NUMBER, NUMBER,
    st.floats(-1e3, 1e3), NUMBER, st.integers(1, 1000),
)  # fmt: skip
BACK = st.builds(ss.Feedback, MODELS, NUMBER, st.none() | st.floats(1.0, 300.0), deadband=NUMBER)
SHORT = st.builds(
    ss.Controller, GAINS | st.builds(ss.Cascade, NUMBER, NUMBER, NUMBER, NUMBER), st.none() | AHEAD | BACK,
    st.just(math.inf) | st.floats(0.01, 100.0), st.floats(1e-4, 1e-3), st.just(0.0) | st.floats(1.0, 1e6),
    st.floats(0.0, 300.0), observer=st.sampled_from([None, OBSERVER, [OBSERVER, OBSERVER]]),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.lists(SHORT, min_size=1, max_size=4))
def test_controllers_are_read_as_they_were_given(given: list[ss.Controller]) -> None:
    """Whatever their numbers; laws of several controllers are kept apart."""
    names = [f"c{i}" for i in range(len(given))]
    found = read(base(controllers=dict(zip(names, given, strict=True)), laws={"lugre": COULOMB}))
    assert [run.control for run in found.runs] == given


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_compensator_of_the_catalogue_can_be_given(name: str) -> None:
    for loop in CATALOGUE[name].loops or LOOPS[:1]:
        made = compensated(name, loop, Belief(4e-4, LUGRE, GMS, torque_limit=3.0))
        laws_of = [block.law for block in made.blocks.values()]
        if any(x.adapts for x in laws_of) and not any(x.integrates for x in laws_of):
            with pytest.raises(
                ss.InputError, match=r"study: controllers\.own: .* add a loop with an integral"
            ):
                read(base(controllers={"own": made}))
            continue
        (run,) = read(base(controllers={"own": made})).runs
        assert run.control == replace(made, alone=False)


@pytest.mark.parametrize("law", [*laws.registered(), *laws.variants()], ids=laws.label)
def test_every_law_can_be_given_as_friction_and_as_belief(law: ss.Law) -> None:
    model = ss.Model(law, **law.example)
    held = ss.Controller(loop=ss.ControlBlock("pd", kp=6.0, kd=0.1), sample_time=1e-3,
                         feedforward=ss.ControlBlock("friction_feedforward", model))  # fmt: skip
    (run,) = read(base(friction={"own": model}, controllers={"own": held})).runs
    assert run.axis.friction == model
    assert run.control == held


def test_machines_are_read_as_they_were_given() -> None:
    dry = ss.load_machine("thesis-dry")
    given = {"flexible": FLEXIBLE, "plain": PLAIN, "dry": dry}
    found = read(
        base(machines=given, controllers={"own": {"gains": PD, "compensator": "feedforward", "law": COULOMB}})
    )
    for run in found.runs[1:]:
        assert run.axis == replace(given[run.friction], name=run.friction)
        assert run.control.sample_time == given[run.friction].sample_time


def test_a_name_that_means_a_machines_own_model_goes_on_meaning_it() -> None:
    """A controller's object may hold another law of the same name."""
    machine = replace(PLAIN, models={"coulomb": COULOMB})
    other = COULOMB.scaled(fc=0.5)
    controllers = {
        "object": ss.Controller(PD, ss.Feedforward(other)),
        "table": {"gains": PD, "compensator": "feedforward", "law": "coulomb"},
    }
    content = {"machines": {"m": machine}, "references": {"sine": (SINE, 0.1)}, "controllers": controllers}
    held = {run.controller: run.control.frictions["compensator"] for run in read(content).runs}
    assert held == {"object": other, "table": COULOMB}


def test_tables_take_objects_in_their_places(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "points.csv", np.transpose([T, 0.1 * T]), delimiter=",")
    content = base(
        title="Objects within tables",
        friction={"dry": {"law": LUGRE}, "worn": {"like": "dry", "scale": {"fs": 0.8}},
                  "ready": {"law": {"model": COULOMB}}},
        references={
            "list": {"kind": "table", "time": T, "position": list(T), "duration": 0.1},
            "file": {"kind": "table", "file": tmp_path / "points.csv", "duration": 0.1},
        },
        controllers={
            "cascade": {"gains": ss.Cascade(20.0, 0.1, 1.0), "sample_time": 1e-3},
            "blocks": {"loop": ss.ControlBlock("pd", kp=6.0, kd=0.1), "sample_time": 1e-3,
                       "feedforward": [{"law": "friction_feedforward", "friction": LESS}]},
        },
        comparisons={"worse": {"references": ["list"], "frictions": ["worse"], "controllers": ["stiff"],
                               "friction": {"worse": LESS}, "controller": {"stiff": ss.Controller(ss.pd(20.0, 0.2))}}},
    )  # fmt: skip
    found = read(content)
    assert {run.friction: run.axis.friction for run in found.runs} == {
        "dry": LUGRE, "worn": LUGRE.scaled(fs=0.8), "ready": COULOMB,
    }  # fmt: skip
    motions = {run.reference: run.motion for run in found.runs}
    assert motions == {"list": ss.Reference.table(T, T), "file": ss.Reference.table(T, 0.1 * T)}
    controls = {run.controller: run.control for run in found.runs}
    assert controls["cascade"] == ss.Controller(ss.Cascade(20.0, 0.1, 1.0), sample_time=1e-3)
    assert controls["blocks"].frictions == {"feedforward": LESS}
    (extra,) = found.extras
    assert (extra.axis.friction, extra.control) == (LESS, ss.Controller(ss.pd(20.0, 0.2)))
