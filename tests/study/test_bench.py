"""The bench of compensators: its file, its runs, going on, and the decision table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from stickslip.control.catalogue import CATALOGUE, Belief, compensated
from stickslip.core.errors import ConfigError, ParameterError, UnknownName
from stickslip.core.record import Record
from stickslip.machines.files import machine
from stickslip.models.model import Model
from stickslip.report.bench_report import table_of, write_bench_report
from stickslip.studies.bench import BenchRun, planned, read_bench, run_bench
from stickslip.studies.bench_decision import choices, knowledge_of, standings
from stickslip.studies.bench_metrics import judged

SMALL = """
bench = "compensators"
title = "Small"
compensators = ["none", "dob"]
loops = ["PD"]
[machines.one]
machine = "ideal"
models = "two"
[machines.two]
machine = "thesis-dry"
only = []
[references.stop]
kind = "ramp"
velocity = 2.0
end = 0.3
duration = 0.5
[changes.believed]
[changes.weaker]
friction = 0.7
"""


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


def test_the_bench_of_the_package_holds_four_machines_and_seven_changes():
    bench = read_bench()
    assert list(bench.machines) == ["ideal", "gear", "dry", "grease"]
    assert {"low", "high", "step", "stop"} == set(bench.motions)
    assert {"believed", "weaker", "stronger", "drop", "warm-up", "coarse", "late"} == set(bench.changes)
    runs = planned(bench)
    assert len({p.run.key for p in runs}) == len(runs)
    assert {p.run.compensator for p in runs} == set(CATALOGUE)
    assert all(p.machine.encoder.counts == (65536.0 if p.run.change == "coarse" else 2.0**20) for p in runs)
    assert all(p.run.counts == p.machine.encoder.counts for p in runs)
    assert all((p.machine.delay == 1.0) == (p.run.change == "late") for p in runs)
    weaker = next(p for p in runs if p.run.key.startswith("grease/weaker/"))
    before = machine("thesis-grease").contact.direction
    assert weaker.machine.contact.direction == pytest.approx([0.7 * x for x in before])


def test_a_bench_runs_and_goes_on_where_it_was(small, tmp_path):
    out = tmp_path / "out"
    first = run_bench(small, out, ["one", "PD", "none"])
    assert [r.key for r in first.runs] == ["one/believed/stop/PD/none", "one/weaker/stop/PD/none"]
    assert not any(r.failure for r in first.runs)
    strong, weak = (r.metrics["rms_rad"] for r in first.runs)
    assert 0.5 * strong < weak < 0.9 * strong  # a PD's error follows the friction
    lines = (out / "results.jsonl").read_text()
    seen = []
    again = run_bench(small, out, ["one", "none"], progress=lambda done, of: seen.append((done, of)))
    assert seen == []  # nothing was left to do
    assert (out / "results.jsonl").read_text() == lines
    assert [r.metrics for r in again.runs] == [r.metrics for r in first.runs]
    (out / "results.jsonl").write_text(lines.splitlines()[0] + "\n" + lines.splitlines()[1][:40])  # cut short
    third = run_bench(small, out, ["one", "none"], progress=lambda done, of: seen.append((done, of)))
    assert seen == [(2, 2)]
    assert [r.metrics for r in third.runs] == [r.metrics for r in first.runs]
    run_bench(small, out, ["one", "none"], progress=lambda done, of: seen.append((done, of)))
    assert seen == [(2, 2)]  # the line after the one cut short is whole
    small.write_text(SMALL.replace("friction = 0.7", "friction = 0.8"))
    changed = run_bench(small, out, ["one", "none"])
    assert changed.runs[0].metrics == first.runs[0].metrics
    assert weak < changed.runs[1].metrics["rms_rad"] < strong
    page = write_bench_report(changed).read_text(encoding="utf-8")
    # The bare PD creeps on after its stop and hunts nowhere: it is what the table chooses here.
    cell = '<td class="text">PD<br><span class="why">1.00, at worst 1.00</span></td>\n'
    assert f'<td>one</td><td class="text">nothing</td>\n{2 * cell}' in page
    assert page.count("data:image/svg+xml;base64,") == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('machine = "ideal"\nmodels = "two"', 'machine = "ideal"', "machine 'one' has no model lugre"),
        ('models = "two"', 'models = "three"', "'three' names no machine of this file"),
        ('["none", "dob"]', '["none", "dop"]', "dop"),
        ('["none", "dob"]', '["dob"]', "must hold 'none'"),
        ('["PD"]', '["PID"]', "must hold 'PD'"),
        ("friction = 0.7", "friction = -0.7", "friction = -0.7 must be greater than 0"),
        ("friction = 0.7", 'numbers = {"encoder.count" = 1.0}', "encoder.count"),
    ],
)
def test_what_is_wrong_with_a_bench_is_said_in_a_line(small, old, new, said):
    small.write_text(SMALL.replace(old, new))
    with pytest.raises((ConfigError, UnknownName), match=said) as refused:
        planned(read_bench(small))
    assert "\n" not in str(refused.value)


def test_a_part_of_a_name_that_there_is_not(small):
    with pytest.raises(UnknownName, match="part of a run's name"):
        planned(read_bench(small), ["dry"])


# ---- catalogue -----------------------------------------------------------------------------------------------------


def belief():
    law = Model("lugre", sigma0=3.5e4, sigma1=0.0, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
    return Belief(3.8623e-4, law, bandwidth=20.0)


def test_what_a_compensator_lacks_is_said():
    with pytest.raises(ParameterError, match="no GMS law is known"):
        compensated("ff-gms", "PD", belief())
    with pytest.raises(ParameterError, match="'dob' stands in a PD, not in a PID"):
        compensated("dob", "PID", belief())
    with pytest.raises(UnknownName, match="unknown compensator 'dobs'; did you mean 'dob'"):
        compensated("dobs", "PD", belief())
    with pytest.raises(ParameterError, match="friction is a coulomb law; give a LuGre law"):
        Belief(1e-4, Model("coulomb", fc=0.1))


def test_numbers_of_the_catalogue_are_those_of_the_reference_on_its_axis():
    found = compensated("makkar", "PD", belief()).values()
    assert found["observer_rate"] == pytest.approx([12.0] * 3, rel=0.02)
    assert found["observer_slope"] == pytest.approx(62.83, rel=1e-3)
    assert (found["observer_steep"], found["observer_wide"]) == pytest.approx((1000.0, 100.0))
    assert compensated("scale-dob", "PD", belief()).values()["feedforward_slowest"] == pytest.approx(0.015)
    assert compensated("twisting", "PD", belief()).values()["loop_rate"] == pytest.approx(2e4, rel=0.01)
    assert compensated("gradient", "PD", belief()).values()["feedforward_rate"] == pytest.approx(
        100.0, rel=0.1
    )


# ---- metrics and decision ------------------------------------------------------------------------------------------


def record(error, torque, moving=400):
    time = 1e-3 * np.arange(error.size)
    speed = np.where(np.arange(error.size) < moving, 0.2, 0.0)
    reference = np.cumsum(speed) * 1e-3
    channels = {"position_reference": reference, "velocity_reference": speed, "position": reference - error,
                "torque_command": torque}  # fmt: skip
    units = dict.fromkeys(channels, "-")
    return Record(time, channels, units, {})


def test_metrics_of_a_motion_made_by_hand():
    k = np.arange(1000)
    error = np.where(k < 400, 2e-3, 1e-4 * np.sin(2 * np.pi * k / 50))
    torque = np.where(k < 700, 0.3, 0.3 + 0.01 * (-1.0) ** k)
    found = judged(record(error, torque))
    assert found["rms_rad"] == pytest.approx(2e-3)
    assert found["peak_rad"] == pytest.approx(2e-3)
    assert found["hunting_rad"] == pytest.approx(2e-4, rel=0.1)
    assert found["rest_rad"] == pytest.approx(0.0, abs=1e-6)
    assert found["chatter_Nm"] == pytest.approx(0.02, rel=0.01)
    assert found["chatter_moving_Nm"] == pytest.approx(0.0)
    assert found["recovery_s"] is None


def test_a_creep_at_rest_is_no_limit_cycle():
    k = np.arange(1000)
    creep = np.where(k < 400, 2e-3, 1e-3 * np.exp(-(k - 400) / 300.0))
    assert judged(record(creep, 0.3 + 0.0 * k))["hunting_rad"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("cycles", [1.0, 1.3, 1.75, 2.5])
def test_a_limit_cycle_has_its_whole_swing_wherever_the_record_cuts_it(cycles):
    k = np.arange(2000)
    error = 1e-3 * np.cos(
        2.0 * np.pi * cycles * (k - 1400) / 600.0
    )  # metrics look at the last 600 rows or more
    found = judged(record(error, 0.0 * k, moving=800))["hunting_rad"]
    assert found == pytest.approx(2e-3, rel=0.02)


def test_one_jump_at_rest_is_no_limit_cycle():
    k = np.arange(1000)
    jump = np.where(k < 900, 1e-3, -1e-3)
    assert judged(record(jump, 0.0 * k))["hunting_rad"] == 0.0


def test_a_part_of_a_bench_brings_the_pd_alone_with_it(small):
    keys = [p.run.key for p in planned(read_bench(small), ["one", "weaker", "dob"])]
    assert keys == ["one/weaker/stop/PD/none", "one/weaker/stop/PD/dob"]


def test_recovery_is_when_a_tenth_of_the_deviation_is_left():
    k = np.arange(1000)
    error = 1e-3 + np.where(k > 100, -4e-3 * np.exp(-(k - 100) / 40.0), 0.0)
    found = judged(record(error, 0.0 * k, moving=900), event=0.1)
    assert found["recovery_s"] == pytest.approx(1e-3 * 40.0 * math.log(10.0), abs=2e-3)


def runs_of(**errors):
    """One machine, one change, one reference: error RMS (and chatter, hunting) by compensator."""
    out = []
    for name, (error, chatter, hunting) in errors.items():
        metrics = {
            "rms_rad": error,
            "chatter_Nm": chatter,
            "hunting_rad": hunting,
            "effort_Nm": 0.3,
            "recovery_s": None,
        }
        out.append(BenchRun("m", "believed", "stop", "PD", name.replace("_", "-"), metrics))
    return out


def test_what_hunts_or_chatters_or_is_not_worth_it_is_not_chosen_and_the_reason_said():
    runs = runs_of(
        none=(1e-2, 0.0, 0.0), dob=(1e-3, 0.0, 1e-3), dob_reset=(2e-3, 0.0, 1e-5), eso=(1e-3, 0.1, 0.0),
        ff_dob=(1.9e-3, 0.0, 0.0), lugre_observer=(1e-4, 0.0, 0.0), scale_dob=(1e-3, 0.0, 0.0),
    )  # fmt: skip
    why = {s.compensator: s.why_not for s in standings(runs)}
    assert why["dob"] == "hunts: 1000 µrad peak to peak at rest"
    assert "chatters" in why["eso"]
    assert "3 %" in why["lugre-observer"]
    assert why["dob-reset"] == why["ff-dob"] == why["scale-dob"] == ""
    by = {(c.knowledge, c.condition): c.chosen for c in choices(runs)}
    assert by["nothing", "friction as believed"].label == "PD"
    assert by["its inertia", "friction as believed"].label == "PD + dob-reset"
    assert by["a friction law", "friction as believed"].label == "PD + scale-dob"
    assert by["a friction law", "friction as believed"].mean == pytest.approx(0.1)


def test_nothing_is_decided_for_a_condition_that_was_not_run():
    believed = runs_of(none=(1e-2, 0.0, 0.0), dob_reset=(2e-3, 0.0, 1e-5))
    weaker = [replace(r, change="weaker") for r in believed]
    assert {c.condition for c in choices(believed)} == {"friction as believed"}
    assert {c.condition for c in choices(weaker)} == {"friction off, and changing"}
    labels = {cell["label"] for row in table_of(choices(believed)) for cell in row["cells"][1:]}
    assert labels == {"not run"}


@pytest.mark.parametrize(
    ("counts", "swing", "said"),
    [
        (2.0**16, 2.8e-4, ""),  # within the two neighbours of a count, rad: no loop holds an axis closer
        (2.0**16, 3.0e-4, "hunts: 300 µrad peak to peak at rest"),
        (2.0**20, 2.8e-4, "hunts: 280 µrad peak to peak at rest"),
        (2.0**20, 1.9e-4, ""),
    ],
)
def test_what_goes_to_and_fro_within_the_neighbours_of_a_count_does_not_hunt(counts, swing, said):
    bare, observed = runs_of(none=(1e-2, 0.0, 0.0), dob=(1e-3, 0.0, swing))
    found = {s.compensator: s for s in standings([bare, replace(observed, counts=counts)])}
    assert found["dob"].why_not == said
    assert found["dob"].hunting == swing


def test_the_limit_cycle_that_is_told_is_one():
    bare, fine = runs_of(none=(1e-2, 0.0, 0.0), dob=(1e-3, 0.0, 2.2e-4))
    coarse = replace(fine, change="coarse", counts=2.0**16, metrics={**fine.metrics, "hunting_rad": 2.8e-4})
    found = {s.compensator: s for s in standings([bare, replace(bare, change="coarse"), fine, coarse])}
    assert found["dob"].why_not == "hunts: 220 µrad peak to peak at rest"
    assert found["dob"].hunting == 2.8e-4


def test_a_run_that_ends_early_rules_its_compensator_out():
    runs = runs_of(none=(1e-2, 0.0, 0.0), dob=(1e-3, 0.0, 0.0))
    broken = BenchRun("m", "late", "stop", "PD", "dob", {}, "the drive switched off")
    bare = BenchRun("m", "late", "stop", "PD", "none", runs[0].metrics)
    found = {s.compensator: s for s in standings([*runs, bare, broken])}
    assert math.isinf(found["dob"].mean)
    assert found["dob"].why_not == "late, stop: the drive switched off"


def test_every_compensator_says_what_it_needs():
    assert {knowledge_of(name) for name in CATALOGUE} == {0, 1, 2, 3}
    assert all(c.against.count("\n") == 0 for c in CATALOGUE.values())
