"""The study of thesis chapter 4 on the virtual machines: its runs, variants, what is kept, a small run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import ConfigError, Interrupted
from stickslip.core.record import Record
from stickslip.machines.files import machine
from stickslip.report import rig_report
from stickslip.studies import study as studies
from stickslip.studies.experiments import NOMINAL, ExperimentRun, ExperimentView, experiments_of, variant
from stickslip.studies.plan import load, select
from stickslip.studies.rerun import rerun
from stickslip.thesis.rig_claims import CLAIMS
from stickslip.thesis.rig_reasons import WHY
from stickslip.thesis.rig_verdicts import Judged, judged_over, main_share, tally_imperfections, tally_starts

LAWS = ("coulomb", "stribeck", "lugre", "gms")
NOT_MORE = {"seeds": 0, "ablation": False}


@pytest.fixture(scope="module")
def chapter_4():
    return load("thesis-rig", given=NOT_MORE)


def test_every_experiment_of_chapter_4_is_there(chapter_4):
    runs = chapter_4.runs
    assert len(runs) == len({r.key for r in runs}) == 138
    experiments = experiments_of(chapter_4.config)
    for e in experiments:
        names = {r.compared for r in runs if r.experiment == e.name}
        assert {f"{way}-{law}" for way in ("FF", "FB") for law in LAWS} < names
        assert {"FB-gms10", e.linear, *e.beside} < names
    figures = {f for e in experiments for f in e.figures}
    assert {"4.15", "4.16", "4.39", "4.51", "7.2", "7.3", "7.4", "7.5"} <= figures
    assert [f for e in experiments for f in e.enlarged] == ["4.20", "4.22", "4.46"]
    low = next(r for r in runs if r.key == "own/low/dry/PD36-FB-gms10")
    assert low.control.gains.kp == pytest.approx(19.7612, rel=1e-4)  # Table 6
    assert low.control.compensator.filter_hz == 10.0
    assert (low.control.torque_limit, low.control.sample_time) == (1.085, 1e-3)


def test_with_every_imperfection_and_twenty_starts_it_has_5244_runs():
    assert len(load("thesis-rig").runs) == 138 * (1 + 17 + 20)


def test_parts_of_names_select_runs_in_every_variant():
    runs = load("thesis-rig", given={"seeds": 1, "ablation": False}).runs
    assert {r.friction for r in select(runs, ["grease"])} == {"grease", "grease-seed-1"}
    some = select(runs, ["grease-low-PD25", "FF-gms"])
    assert [r.key for r in some] == ["own/low/grease/PD25-FF-gms", "own/low/grease-seed-1/PD25-FF-gms"]


def test_variants_differ_in_what_they_say():
    plant = machine("thesis-dry")
    assert variant(plant, NOMINAL) is plant
    assert variant(plant, "without delay").switched_off == ("delay",)
    other = variant(plant, "seed 3")
    assert other.seed != plant.seed
    assert other.contact == plant.contact
    assert other.start_angle != plant.start_angle


def test_a_run_is_the_same_twice_and_feels_its_seed():
    runs = {r.key: r for r in load("thesis-rig", given={"seeds": 1, "ablation": False}).runs}
    first = runs["own/low/grease/PD25-PD"].execute()
    again = runs["own/low/grease/PD25-PD"].execute()
    other = runs["own/low/grease-seed-1/PD25-PD"].execute()
    assert not first.failure
    assert len(first.record) == 5000
    assert len(other.record) == 2  # of a variant the ends are kept
    assert np.array_equal(first.record["position"], again.record["position"])
    assert first.metrics == again.metrics
    assert first.metrics["position_rms_rad"] != other.metrics["position_rms_rad"]


def test_an_interrupted_run_is_no_result(chapter_4, monkeypatch):
    def asked(self, plant):
        raise Interrupted("SIGINT requested the end")

    monkeypatch.setattr(ExperimentRun, "measured", asked)
    with pytest.raises(Interrupted):
        chapter_4.runs[0].execute()


@pytest.mark.slow
def test_a_small_study_is_judged_kept_reported_and_run_again(tmp_path, capsys, monkeypatch):
    out = tmp_path / "rig"
    command = ["study", "thesis-rig", "--only", "grease-step-PID10", "--seeds", "1", "--no-ablation"]
    assert main([*command, "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    judged = {s["id"]: s["word"] for s in told["statements"]}
    assert judged["grease-step-PID10-FB"] in ("holds", "does not hold")
    assert judged["dry-low-PID"] == "not run"
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "grease-step-PID10-FB" in report
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert {"thesis-dry.toml", "thesis-grease.toml"} <= {entry["written"] for entry in manifest["inputs"]}
    lines = (out / "metrics.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + 2 * 10
    found = rerun(out)
    assert (found.runs, found.differences) == (20, [])

    def never(*_):
        raise AssertionError("a finished run was run again")

    monkeypatch.setattr(studies, "execute", never)
    study = load("thesis-rig", given={"seeds": 1, "ablation": False})
    again = studies.run(study, out, ["grease-step-PID10"])
    assert len(again.runs) == 20
    assert ExperimentView(again).varied() == ["as it is", "seed 1"]


@pytest.mark.slow
@pytest.mark.long  # ten minutes; the documentation's build runs the part without seeds
def test_the_page_shows_what_a_fresh_run_prints(tmp_path, capsys):
    """The tables had been typed, and a fresh run gave others."""
    page = (Path(__file__).parents[2] / "docs" / "howto" / "rig_study.md").read_text(encoding="utf-8")
    after = page.partition("stickslip study thesis-rig --seeds 20\n```")[2]
    shown = after.partition("```text\n")[2].partition("```")[0]
    assert main(["study", "thesis-rig", "--seeds", "20", "--out", str(tmp_path / "rig")]) == 0
    printed = capsys.readouterr().out.splitlines()
    rows = [line for line in shown.splitlines() if line.strip() not in ("", "...")]
    assert len(rows) > 10
    assert [line for line in rows if line not in printed] == []


OWN = """
title = "Mine"
[machines.mine]
machine = "ideal"
[references.slow]
kind = "sine"
amplitude = 0.1
frequency = 1.0
duration = 0.2
[laws.half]
law = "coulomb"
fc = 0.1
sigma2 = 0.0
[controllers.FF-half]
compensator = "feedforward"
law = "half"
[experiments.first]
machine = "mine"
reference = "slow"
linear = "PD"
bandwidth_hz = 10.0
damping = 1.0
"""


def test_experiments_of_ones_own_are_a_study(tmp_path, capsys):
    """Another machine, reference and law, run and reported by the same command."""
    file = tmp_path / "mine.toml"
    file.write_text(OWN)
    assert main(["study", str(file), "--out", str(tmp_path / "out"), "--seeds", "1"]) == 0
    said = capsys.readouterr().out
    assert "PD10-FF-half" in said
    assert "mine-seed-1" in said
    assert "Least RMS error" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('machine = "mine"', 'machine = "other"', "experiments.first.machine = 'other' is not known"),
        ('linear = "PD"', 'linear = "P"', "experiments.first.linear = 'P' is not known"),
        ('title = "Mine"', "seeds = 1.5", "seeds = 1.5 must be a whole number"),
        ('title = "Mine"', "ablation = 1", "ablation = 1 must be true or false"),
        (
            "[experiments.first]",
            "[experiments.first]\nbeside = []",
            "experiments.first.beside = \\[\\] is empty",
        ),
    ],
)
def test_what_cannot_be_an_experiment_is_said(old, new, said, tmp_path):
    file = Path(tmp_path / "mine.toml")
    file.write_text(OWN.replace(old, new))
    with pytest.raises(ConfigError, match=said):
        load(file)


def test_main_statements_are_counted_over_what_was_run():
    ran = {"dry-low-PID": True, "dry-low-FB-gms": False, "grease-low-FB-gms": True}
    judged = [Judged(c, ran.get(c.id), "", 0, 0, 0, (), main=True) for c in CLAIMS]
    assert main_share(judged) == {"PID of 36 Hz oscillates": (1, 1), "GMS feedback is unstable": (1, 2)}


class Numbers:
    """Metrics of runs, the same in every variant but those named."""

    def __init__(self, metrics, **variants):
        self.metrics, self.variants = metrics, variants

    def metric(self, rule, case, name):
        return {**self.metrics, **self.variants.get(rule, {})}[case, name]

    def record(self, rule, case):
        raise KeyError(case)


def near(lugre, gms):
    group = "grease-low-PD25"
    values = {"coulomb": 8.63e-3, "stribeck": 2.32e-3, "lugre": lugre, "gms": gms}
    return {(f"{group}/FF-{law}", "near_zero_rms_rad"): x for law, x in values.items()}


def judgement(view, variants, id):
    return next(j for j in judged_over(view, variants) if j.claim.id == id)


def test_reasons_are_the_numbers_of_the_runs():
    """`GMS is better` was printed whatever the runs gave, and an imperfection was denied that nobody had tried."""
    view = Numbers(near(1.42e-3, 0.779e-3), **{"without position": near(0.5e-3, 0.779e-3)})
    alone = judgement(view, ["as it is"], "grease-low-lugre")
    assert "FF-gms: less error near zero velocity than FF-lugre, by up to 45 %" in alone.reason
    assert alone.reason.endswith("Not tried without single imperfections.")
    tried = judgement(view, ["as it is", "without position", "without cogging"], "grease-low-lugre")
    assert tried.reason.endswith("It holds without position.")
    same = judgement(Numbers(near(1.42e-3, 0.779e-3)), ["as it is", "without cogging"], "grease-low-lugre")
    assert same.reason.endswith("No single imperfection decides it.")
    assert judgement(Numbers(near(0.5e-3, 0.779e-3)), ["as it is"], "grease-low-lugre").reason == ""


def test_a_steady_state_error_that_feedforward_keeps_is_named():
    group, values = "grease-step-PID10", {"PID": 1.23, "FF-coulomb": 0.583, "FF-lugre": 0.051, "FF-gms": 1.36}
    view = Numbers({(f"{group}/{name}", "steady_state_error_rad"): 1e-3 * x for name, x in values.items()})
    reason = judgement(view, ["as it is"], "grease-step-PID10-steady").reason
    assert "less with FF-coulomb 0.583 mrad, FF-lugre 51 µrad; not with FF-gms 1.36 mrad" in reason


def test_the_error_of_lugre_above_stribeck_is_computed():
    group = "grease-low-PD25"
    rms = {"coulomb": 6.75, "stribeck": 1.73, "lugre": 1.93, "gms": 1.17}
    values = {(f"{group}/FF-{law}", "position_rms_rad"): 1e-3 * x for law, x in rms.items()}
    reason = judgement(
        Numbers({**values, **near(1.42e-3, 0.779e-3)}), ["as it is"], "grease-low-dynamic"
    ).reason
    assert "12 % above Stribeck's; near zero velocity it is smaller" in reason


def test_sticking_away_from_reversals_is_judged_and_its_lack_is_explained():
    """4.3.1.2.2 and 4.3.2.2.2 say three times that friction over position makes the axis stick at full speed."""
    group, shares = "grease-high-PD10", {"coulomb": 0.117, "stribeck": 0.0, "lugre": 0.0, "gms": 0.0}
    view = Numbers({(f"{group}/FF-{law}", "sticking_share"): x for law, x in shares.items()})
    judged = judgement(view, ["as it is"], "grease-high-FF-nonzero")
    assert judged.holds is False
    assert "never stops with FF-stribeck, FF-lugre, FF-gms; part" in judged.reason
    assert "FF-coulomb 12 %" in judged.reason
    all_stick = Numbers({(f"{group}/FF-{law}", "sticking_share"): 0.01 for law in shares})
    assert judgement(all_stick, ["as it is"], "grease-high-FF-nonzero").holds is True


def test_every_reason_belongs_to_a_statement():
    assert {claim.id for claim in CLAIMS} >= set(WHY)


def test_statements_are_counted_over_starts_and_imperfections():
    by_id = {
        "dry-low-PID": (True, 4, ("delay",)),
        "dry-low-FB-gms": (False, 0, ("delay",)),
        "45-PD36": (False, 2, ()),
    }
    judged = [
        Judged(c, by_id[c.id][0], "", 4, by_id[c.id][1], 2, by_id[c.id][2], True)
        for c in CLAIMS
        if c.id in by_id
    ]
    found = {t.words: (t.statements, t.hold, t.always, t.never, t.share) for t in tally_starts(judged)}
    assert found == {
        "dry, slow sine": (2, 1, 1, 1, 0.5), "4.5, resonances": (1, 0, 0, 0, 0.5), "all": (3, 1, 1, 1, 0.5)
    }  # fmt: skip
    assert tally_imperfections(judged) == {"delay": (1, 1)}
    assert tally_starts([Judged(c, True, "", 0, 0, 0, (), False) for c in CLAIMS]) == []


# Neither refusals nor the file hang on how many machines the study builds: further starts and ablation are 74 of them.
FEW = ("--seeds", "0", "--no-ablation")


@pytest.mark.parametrize("more", [["--only", "lowest", *FEW], ["--seeds", "-1"], ["--jobs", "0", *FEW]])
def test_bad_input_is_one_line(more, capsys):
    assert main(["study", "thesis-rig", *more]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_its_file_is_printed(capsys):
    assert main(["study", "thesis-rig", "--print", *FEW]) == 0
    assert "[experiments.dry-low-PD36]" in capsys.readouterr().out


def test_seeds_are_for_experiments(capsys):
    assert main(["study", "thesis", "--seeds", "3"]) == 2
    assert "thesis.toml has no [experiments.NAME]; leave out seeds" in capsys.readouterr().err


# ---- pictures ---------------------------------------------------------------------------------------------------


class Ran:
    """A run whose record is given."""

    def __init__(self, error: float) -> None:
        time = np.linspace(0.0, 1.0, 101)
        goal = 0.01 * time
        channels = {"position_reference": goal, "position": goal + error * np.sin(np.pi * time)}
        self.made = Record(time, channels, dict.fromkeys(channels, "rad"))

    def record(self) -> Record:
        return self.made


def test_a_response_stays_in_its_picture_and_one_far_away_is_named():
    """Figures 4.15 and 4.16: feedforward of 36 Hz overshoots by as much as the reference travels."""
    panel = rig_report._panel(
        {"PD": Ran(0.001), "FF-lugre": Ran(0.019), "FB-gms": Ran(0.2)}, (0.0, 1.0), "all"
    )
    low, high = panel.y_limits
    shown = {c.label: c.y for c in panel.curves if c.y.size}
    assert low < 0.0
    assert shown["lugre"].max() < high < shown["gms"].max()
    assert "off scale: gms by 200 mrad" in panel.note
    assert "lugre" not in panel.note


@pytest.mark.slow
def test_reversals_of_the_fast_sine_are_enlarged(tmp_path, chapter_4):
    """Figures 4.20, 4.22 and 4.46: where 1 rad hides it, PID alone lags and LuGre feedforward does not."""
    result = studies.run(chapter_4, tmp_path, ["grease-high-PID10"])
    figures = {f["id"]: f for f in rig_report.draw_experiments(result, tmp_path / "figures")}
    enlarged = figures["grease-high-PID10-enlarged"]
    assert "thesis figure 4.46" in enlarged["title"]
    assert (tmp_path / "figures" / "grease-high-PID10-enlarged.png").exists()
    window = rig_report.REVERSALS["high"]
    runs = {run.controller.partition("-")[2]: run for run in result.runs}
    errors = {name: rig_report._error_within(runs[name], window) for name in ("PID", "FF-lugre")}
    assert errors["FF-lugre"] < 0.5 * errors["PID"]
