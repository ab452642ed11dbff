"""The study of thesis chapter 4 on the virtual machines: cases, variants, what is kept, a small run."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.machines.machine import machine
from stickslip.study import rig_study
from stickslip.study.rig_cases import GROUPS
from stickslip.study.rig_study import NOMINAL, all_cases, run_case, run_rig_study, variant
from stickslip.thesis.rig_claims import CLAIMS
from stickslip.thesis.rig_verdicts import Judged, main_share


def test_every_experiment_of_chapter_4_is_a_case():
    cases = all_cases()
    assert len({c.key for c in cases}) == len(cases)
    for group in GROUPS:
        names = {c.controller for c in cases if c.group is group}
        assert {
            f"{way}-{law}" for way in ("FF", "FB") for law in ("coulomb", "stribeck", "lugre", "gms")
        } < names
        assert {"FB-gms10", group.linear} < names
    figures = {f for g in GROUPS for f in g.figures}
    assert {"4.15", "4.16", "4.39", "4.51", "7.2", "7.3", "7.4", "7.5"} <= figures
    low = next(c for c in cases if c.key == "dry-low-PD36/FB-gms10")
    assert low.control.gains.kp == pytest.approx(19.7612, rel=1e-4)  # Table 6
    assert low.control.compensator
    assert low.control.compensator.filter_hz == 10.0


def test_variants_differ_in_what_they_say():
    plant = machine("thesis-dry")
    assert variant(plant, NOMINAL) is plant
    assert variant(plant, "without delay").switched_off == ("delay",)
    other = variant(plant, "seed 3")
    assert other.seed != plant.seed
    assert other.contact.ripple.amplitude == plant.contact.ripple.amplitude
    assert other.contact.ripple.phase != plant.contact.ripple.phase


def test_a_run_is_the_same_twice_and_feels_its_seed():
    case = next(c for c in all_cases(["grease-low-PD25"]) if c.controller == "PD")
    plant = machine("thesis-grease")
    first, stopped = run_case(plant, case)
    again, _ = run_case(plant, case)
    other, _ = run_case(variant(plant, "seed 1"), case)
    assert not stopped
    assert len(first) == 5000
    assert np.array_equal(first["position"], again["position"])
    assert not np.array_equal(first["position"], other["position"])


@pytest.mark.slow
def test_a_small_study_is_judged_kept_and_reported(tmp_path, capsys, monkeypatch):
    out = tmp_path / "rig"
    command = [
        "study",
        "thesis-rig",
        "--only",
        "grease-step-PID10",
        "--seeds",
        "1",
        "--no-ablation",
        "--out",
        str(out),
    ]
    assert main([*command, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    judged = {s["id"]: s["word"] for s in told["statements"]}
    assert judged["grease-step-PID10-FB"] in ("holds", "does not hold")
    assert judged["dry-low-PID"] == "not run"
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "grease-step-PID10-FB" in report
    assert "thesis-grease" in (out / "manifest.json").read_text(encoding="utf-8")
    lines = (out / "metrics.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + 2 * 10

    def never(*_):
        raise AssertionError("a finished run was run again")

    monkeypatch.setattr(rig_study, "run_case", never)
    assert len(run_rig_study(out, only=["grease-step-PID10"], seeds=1, ablation=False).runs) == 20


def test_main_statements_are_counted_over_what_was_run():
    ran = {"dry-low-PID": True, "dry-low-FB-gms": False, "grease-low-FB-gms": True}
    judged = [Judged(c, ran.get(c.id), "", 0, 0, (), main=True) for c in CLAIMS]
    assert main_share(judged) == {"PID of 36 Hz oscillates": (1, 1), "GMS feedback is unstable": (1, 2)}


@pytest.mark.parametrize("more", [["--only", "lowest"], ["--seeds", "-1"], ["--jobs", "0"], ["--print"]])
def test_bad_input_is_one_line(more, capsys):
    assert main(["study", "thesis-rig", *more]) == 2
    assert capsys.readouterr().err.count("\n") == 1
