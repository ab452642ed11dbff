"""Machines with their imperfections in studies, single runs and sweeps, by the same commands as ideal axes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.control.linear import place
from stickslip.core.errors import ConfigError
from stickslip.machines.files import LIBRARY, machine
from stickslip.machines.machine import IMPERFECTIONS
from stickslip.simulation.machine.loop import FINER, simulate_machine
from stickslip.studies import study as studies
from stickslip.studies.plan import load, load_run
from stickslip.sweeps import plan as sweep_plan
from stickslip.sweeps.measured import measured
from stickslip.sweeps.metric_check import checked
from stickslip.sweeps.numbers import known, varied

STUDY = """
[machines.all]
machine = "thesis-dry"

[machines.bare]
machine = "thesis-dry"
only = []

[machines.only]
machine = "thesis-dry"
each_alone = ["cogging", "flexibility"]

[references.low]
kind = "sine"
amplitude = 0.05
frequency = 1.0
duration = 1.0
placement = {bandwidth_hz = 10.0, damping = 0.85}

[controllers.PD]
linear = "PD"

[controllers.FF]
linear = "PD"
compensator = "feedforward"
law = "lugre"
"""
RUN = """
[machine]
machine = "thesis-dry"
without = ["cogging"]
start_angle = 0.3

[reference]
kind = "sine"
amplitude = 0.05
frequency = 1.0
duration = 0.5

[controller]
linear = "PD"
placement = {bandwidth_hz = 10.0, damping = 0.85}
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "run.toml").write_text(RUN)
    return tmp_path / "run.toml"


def test_a_study_runs_machines_by_name_and_finds_them_again(study: Path) -> None:
    planned = load(study)
    names = ["all", "bare", "only-cogging", "only-flexibility"]
    assert list(dict.fromkeys(r.friction for r in planned.runs)) == names
    assert len({r.fingerprint for r in planned.runs}) == 8
    result = studies.run(planned, study.parent / "out")
    assert not any(r.failure for r in result.runs)
    again = studies.run(planned, study.parent / "out")
    assert [r.metrics["position_rms_rad"] for r in again.runs] == [
        r.metrics["position_rms_rad"] for r in result.runs
    ]
    here = next(r for r in planned.runs if (r.friction, r.controller) == ("only-cogging", "FF"))
    bare = machine("thesis-dry").without(*(n for n in IMPERFECTIONS if n != "cogging"))
    alone = ss.simulate(bare, here.control, here.motion, here.duration)
    there = next(r for r in result.runs if (r.friction, r.controller) == ("only-cogging", "FF"))
    assert there.metrics["position_rms_rad"] == alone.meta["metrics"]["position_rms_rad"]


def test_laws_of_the_machines_file_serve_controllers(study: Path) -> None:
    planned = load(study)
    (helped,) = {r.control.compensator for r in planned.runs if r.controller == "FF"}
    assert helped.model.as_dict() == machine("thesis-dry").models["lugre"].as_dict()


def test_a_single_run_takes_a_machine(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    planned = load_run(run)
    assert planned.axis.start_angle == 0.3
    assert main(["simulate", str(run), "--out", str(run.parent / "run.npz")]) == 0
    record = ss.Record.load(run.parent / "run.npz")
    assert record.meta["machine"]["without"] == ["cogging"]
    assert np.ptp(record["position_measured"] - record["position"]) > 0.0
    said = capsys.readouterr().out
    assert "position_rms" in said
    assert f"within about {record.meta['accuracy']['error_rad']:.1g} rad, by a run at a thousandth" in said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('without = ["cogging"]', 'without = ["cogging"]\nonly = ["delay"]'), "exclude each other"),
        (('without = ["cogging"]', 'without = ["warp"]'), "warp"),
        (('without = ["cogging"]', 'each_alone = ["cogging"]'), "a single run has one"),
        (("[machine]", "[axis]\ninertia = 1.0\n\n[machine]"), "exclude each other"),
        (('machine = "thesis-dry"', 'machine = "nowhere"'), "nowhere"),
        (("[controller]", "[controller]\nsample_time = 0.0005"), "sample_time = 0.0005"),
    ],
)
def test_what_cannot_be_is_said_before_anything_runs(run: Path, change: tuple[str, str], said: str) -> None:
    run.write_text(RUN.replace(*change))
    with pytest.raises((ConfigError, ss.InputError), match=said):
        load_run(run).check()


def test_an_angle_of_start_moves_what_depends_on_it(run: Path) -> None:
    planned = load_run(run)
    there = varied(planned, {"machine.start_angle": 0.3 + 2.0 * np.pi})
    here, again, other = (
        ss.simulate(r.axis, r.control, r.motion, r.duration)["position"]
        for r in (planned, there, varied(planned, {"machine.start_angle": 1.0}))
    )
    assert np.max(np.abs(again - here)) < 1e-9
    assert np.max(np.abs(other - here)) > 1e-6


def test_a_sweep_varies_any_number_of_a_machine(run: Path) -> None:
    planned = load_run(run)
    names = known(planned)
    assert "axis.inertia" not in names
    stiff, counts = names["machine.flexible.elasticity"], names["machine.encoder.counts"]
    values = {
        "machine.flexible.elasticity": np.array([stiff, 2.0 * stiff, stiff]),
        "machine.encoder.counts": np.array([counts, counts, counts / 8.0]),
    }
    found = measured(planned, values, ["position_rms_rad"], 3)
    assert found.integrators == ["machine"] * 3
    assert len(set(found.metrics[:, 0].tolist())) == 3
    alone = ss.simulate(planned.axis, planned.control, planned.motion, planned.duration)
    assert found.metrics[0, 0] == alone.meta["metrics"]["position_rms_rad"]


def test_a_swept_machine_is_checked_by_one_finer_run(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[float] = []

    def counted(*given: Any, tolerance: float, **more: Any) -> ss.Record:
        ran.append(tolerance)
        return simulate_machine(*given, tolerance=tolerance, **more)

    monkeypatch.setattr("stickslip.sweeps.measured.simulate_machine", counted)
    planned, metrics = load_run(run), ["position_rms_rad"]
    values = {"machine.encoder.counts": np.array([known(planned)["machine.encoder.counts"]])}
    found = measured(planned, values, metrics, 1)
    sure, _ = checked(planned, values, metrics, found)
    assert ran == pytest.approx([1e-9, FINER * 1e-9])  # as simulate(check=True) does
    assert sure.metrics[0, 0] == found.metrics[0, 0]


def test_a_sweep_of_a_machine_from_its_file(study: Path) -> None:
    sweep = study.parent / "sweep.toml"
    sweep.write_text(
        'study = "study.toml"\nonly = ["only-cogging", "PD"]\ncases = 3\nmetrics = ["position_rms_rad"]\n\n'
        '[vary."machine.start_angle"]\nrange = [0.0, 1.0]\n'
    )
    code = main(["sweep", str(sweep), "--out", str(study.parent / "swept"), "--jobs", "1"])
    assert code == 0


def test_the_study_of_imperfections_ships() -> None:
    planned = load("imperfections")
    assert len({r.controller for r in planned.runs}) == 10
    assert len({r.friction for r in planned.runs}) == 14


POLES = "placement = {bandwidth_hz = 10.0, damping = 0.85}"
OBSERVED = """
[controllers.observed]
loop = {law = "pd"}
observer = {law = "disturbance_observer", corner = 100.0}
"""


def test_controllers_without_a_sample_time_take_that_of_each_machine(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slower = (LIBRARY / "ideal.toml").read_text().replace("sample_time = 1e-3", "sample_time = 2e-3")
    (study.parent / "slower.toml").write_text(slower)
    study.write_text(
        STUDY.partition("[machines.bare]")[0]
        + '[machines.slower]\nmachine = "slower.toml"\n\n[references.low]'
        + STUDY.partition("[references.low]")[2].replace("duration = 1.0", "duration = 0.2")
        + OBSERVED
    )
    planned = load(study)
    times = {(r.friction, r.controller): r.control.sample_time for r in planned.runs}
    assert times == {
        (m, c): t for m, t in (("all", 1e-3), ("slower", 2e-3)) for c in ("PD", "FF", "observed")
    }
    assert main(["study", str(study), "--out", str(study.parent / "out"), "--no-report"]) == 0
    assert "controllers sampled every 0.001, 0.002 s" in capsys.readouterr().out
    entries = json.loads((study.parent / "out" / "manifest.json").read_text())["runs"]
    assert {e["sample_time_s"] for e in entries} == {1e-3, 2e-3}


def test_an_ideal_axis_beside_a_machine_has_no_sample_time_to_give(study: Path) -> None:
    axis = '[axis]\ninertia = 4e-4\n\n[friction.rigid]\nlaw = "coulomb"\nfc = 0.3\n\n'
    study.write_text(axis + STUDY + OBSERVED)
    with pytest.raises(ConfigError, match=r"controllers\.observed: .* give a sample_time"):
        load(study)
    study.write_text(axis + STUDY + OBSERVED + "sample_time = 1e-3\n")
    assert {r.friction for r in load(study).runs} >= {"rigid", "all"}


def test_gains_are_placed_for_the_inertia_of_each_axis_unless_the_file_gives_one(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A machine beside a rigid axis had the gains, and the inertias left out, of the other."""
    axis = '[axis]\ninertia = 1e-3\n\n[friction.rigid]\nlaw = "coulomb"\nfc = 0.3\n\n'
    text = STUDY.partition("[machines.bare]")[0] + STUDY[STUDY.index("[references.low]") :]
    fed = '[controllers.fed]\nsample_time = 1e-3\nloop = {law = "pd"}\nfeedforward = {law = "inertia_feedforward"}\n'
    study.write_text(axis + text.replace("duration = 1.0", "duration = 0.1") + fed)
    loops = {(r.friction, r.controller): r.control for r in load(study).runs}
    gains = {f: loops[f, "PD"].gains for f in ("rigid", "all")}
    assert gains["rigid"] == place("PD", 1e-3, 10.0, 0.85)
    assert gains["all"] == place("PD", machine("thesis-dry").inertia, 10.0, 0.85)
    assert loops["all", "fed"].numbers()["feedforward_inertia"] == machine("thesis-dry").inertia
    assert main(["study", str(study), "--out", str(study.parent / "out"), "--only", "PD"]) == 0
    said = "gains that are placed, and inertias left out, are those of each axis: rigid 0.001, all 0.00042757 kg·m²"
    assert said in capsys.readouterr().out
    report = (study.parent / "out" / "report.html").read_text(encoding="utf-8")
    assert said in report
    assert "Reversals, standstills and velocities within a sample are not seen" in report
    study.write_text("design_inertia = 5e-4\n" + study.read_text())
    assert {r.control.gains for r in load(study).runs if r.controller == "PD"} == {
        place("PD", 5e-4, 10.0, 0.85)
    }


TWO = """
[machines.a]
machine = "thesis-dry"

[machines.b]
machine = "thesis-grease"
"""


def test_controllers_on_two_machines_hold_what_was_identified_on_each(study: Path) -> None:
    """Such a study could not be run, and what its error advised did not help."""
    rest = STUDY[STUDY.index("[references.low]") :]
    study.write_text(TWO + rest)
    held = {r.friction: r.control.compensator.model for r in load(study).runs if r.control.compensator}
    assert held == {"a": machine("thesis-dry").models["lugre"], "b": machine("thesis-grease").models["lugre"]}
    study.write_text(TWO + rest + '\n[laws.lugre]\nlaw = "coulomb"\nfc = 0.2\n')
    held = {r.friction: r.control.compensator.model for r in load(study).runs if r.control.compensator}
    assert held == dict.fromkeys("ab", ss.Model("coulomb", fc=0.2))


def test_a_law_of_two_machines_on_a_third_axis_is_asked_for(study: Path) -> None:
    axis = '[axis]\ninertia = 4e-4\n\n[friction.rigid]\nlaw = "coulomb"\nfc = 0.3\n\n'
    rest = STUDY[STUDY.index("[references.low]") :]
    said = r"study\.toml: controllers\.FF on rigid: 'lugre' is another law on .* a, b; give .* as \[laws\.lugre\]"
    study.write_text(axis + TWO + rest)
    with pytest.raises(ConfigError, match=said):
        load(study)
    drawn = '\n[responses.r]\nreference = "low"\nlaws = ["lugre"]\n'
    study.write_text(TWO + rest + drawn)
    with pytest.raises(ConfigError, match=r"study\.toml: responses\.r\.laws: 'lugre' is another law on"):
        load(study)
    study.write_text(axis + TWO + rest.partition("[controllers.FF]")[0])
    assert {r.friction for r in load(study).runs} == {"rigid", "a", "b"}


def test_a_single_run_and_a_sweep_take_the_machines_sample_time(run: Path, study: Path) -> None:
    run.write_text(RUN.partition("[controller]")[0] + OBSERVED.replace("controllers.observed", "controller"))
    run.write_text(run.read_text().replace("duration = 0.5", f"duration = 0.2\n{POLES}"))
    planned = load_run(run)
    assert planned.control.sample_time == 1e-3
    found = measured(
        planned, {"controller.observer_corner": np.array([80.0, 100.0])}, ["position_rms_rad"], 2
    )
    alone = ss.simulate(planned.axis, planned.control, planned.motion, planned.duration)
    assert found.failures == ["", ""]
    assert found.metrics[1, 0] == alone.meta["metrics"]["position_rms_rad"]
    study.write_text(STUDY + OBSERVED)
    tuning = study.parent / "tuning.toml"
    tuning.write_text(
        'study = "study.toml"\nonly = ["bare", "observed"]\ncases = 2\nmetrics = ["position_rms_rad"]\n\n'
        '[vary."machine.start_angle"]\nrange = [0.0, 1.0]\n\n'
        '[tune."controller.observer_corner"]\nrange = [50.0, 90.0]\n'
    )
    assert sweep_plan.load(tuning).runs[0].control.sample_time == 1e-3


@pytest.mark.parametrize("given", ["0.0005", "0.002"])
def test_experiments_take_no_other_sample_time_than_the_machines(study: Path, given: str) -> None:
    experiment = (
        '[experiments.one]\nmachine = "all"\nreference = "low"\n'
        'linear = "PD"\nbandwidth_hz = 10.0\ndamping = 0.85\n'
    )
    text = STUDY.replace(f"{POLES}\n", "") + OBSERVED
    study.write_text(text + experiment)
    assert {r.control.sample_time for r in load(study).runs} == {1e-3}
    study.write_text(text + f"sample_time = {given}\n" + experiment)
    with pytest.raises(
        ConfigError, match=rf"controllers\.observed: .*sample_time = {given} s, that of the machine"
    ):
        load(study)
