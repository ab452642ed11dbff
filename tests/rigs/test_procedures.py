"""Procedures: what they plan, record and refuse; the identification takes their records as they are."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.record import Record
from stickslip.core.spec import Surroundings
from stickslip.identification.experiment import experiment_of
from stickslip.identification.presliding.breakaway import find_breaks
from stickslip.identification.response.inertia import inertia
from stickslip.identification.steady_friction.segments import sliding_points
from stickslip.machines.files import machine
from stickslip.machines.servo import ServoAxis
from stickslip.rigs.procedures import PROCEDURES, procedure
from stickslip.rigs.procedures.base import CheckFailed, perform
from stickslip.rigs.virtual import VirtualRig, virtual_rig
from support.sampled_text import Memory, sampled_by, settings

SHORT = {
    "cogging": {"velocities": "0.9", "degrees": "380"},
    "standstill": {"places": "24"},
    "inertia": {"duration": "25"},
    "resonance": {"duration": "8"},
    "breakaway": {"interval": "60"},
    "sliding": {"velocities": "5,1,0.3"},
    "presliding": {"frequency": "0.5", "amplitude": "0.15"},
    "stickslip": {"cycles": "3"},
    "attraction": {"cycles": "4"},
    "track": {"compensator": "feedforward", "model": "lugre"},
    "repeat": {"times": "2", "interval": "60", "bandwidth": "10", "damping": "0.85"},
    "learn": {"times": "3"},
}

GREASED = {"stickslip": {"amplitude": "0.35"}, "attraction": {"mean": "0.3", "swing": "0.15"}}


def run(name, rig, **options):
    if "grease" in rig.name:
        options = {**GREASED.get(name, {}), **options}
    return perform(procedure(name).with_options({**SHORT[name], **options}), rig)


@pytest.mark.parametrize("name", PROCEDURES)
@pytest.mark.parametrize("where", ["thesis-dry", "thesis-grease"])
def test_every_procedure_keeps_to_its_plan_and_passes_its_checks(name, where, tmp_path):
    rig = virtual_rig(where)
    before = rig.open().time
    result = run(name, rig)
    plan = result.plan
    assert result.passed, result.checks
    spent = rig.open().time - before
    assert spent <= plan.duration + plan.pauses + 30.0
    record = result.record
    assert np.abs(record["torque_command"]).max() <= max(plan.torque, 0.0) + 1e-9
    assert record.meta["procedure"] == name
    assert record.meta["machine"]["name"] == where
    assert np.all(np.diff(record.time) > 0.0)
    path = record.save(tmp_path / "r.npz")
    assert Record.load(path).meta == record.meta


@pytest.mark.parametrize("where", ["thesis-dry", "thesis-grease"])
def test_inertia_is_recovered(where):
    result = run("inertia", virtual_rig(where))
    axis = ServoAxis()
    found = inertia([experiment_of(result.part(label), axis) for label, *_ in result.segments], axis)
    assert found["inertia"].value == pytest.approx(4.2757e-4, rel=0.03)


def test_the_response_shows_the_modes_of_the_machine_and_no_others():
    """The encoder's mount (85 Hz, 4.2) and the shaft (308 Hz, as `machines/library/thesis-dry.toml` says)."""
    result = run("inertia", virtual_rig("thesis-dry"), band="400", current="1.6")
    records = [experiment_of(result.part(label), ServoAxis()) for label, *_ in result.segments]
    assert inertia(records, ServoAxis()).details["resonances"] == pytest.approx([85.0, 308.0], rel=0.02)


def test_two_currents_about_rest_differ_at_low_frequencies_and_over_a_speed_they_do_not(tmp_path, capsys):
    """Figure 4.4: friction separates the responses where they are slow, inertia brings them together."""
    found = {}
    for about, options in {"rest": {"band": "100", "current": "1.6,2.2"}, "speed": {}}.items():
        path = run("inertia", virtual_rig("thesis-dry"), about=about, **options).record.save(
            tmp_path / "r.npz"
        )
        command = ["identify", str(path), "--method", "inertia", "--json", "--out", str(tmp_path / about)]
        assert main(command) == 0
        found[about] = {e["name"]: e["value"] for e in json.loads(capsys.readouterr().out)["estimates"]}
    assert found["rest"]["viscous[0]"] > 1.5 * found["rest"]["viscous[1]"]
    assert found["speed"]["viscous[0]"] == pytest.approx(found["speed"]["viscous[1]"], rel=0.05)
    report = (tmp_path / "rest" / "report.html").read_text(encoding="utf-8")
    slow, fast = map(float, re.search(r"differ by ([\d.]+)\s+dB.*? by ([\d.]+)\s+dB", report).groups())
    assert slow > 5.0 > 4.0 > fast


def test_an_excitation_about_what_no_axis_has_is_refused():
    with pytest.raises(InputError, match="speed or rest"):
        procedure("inertia").with_options({"about": "midair"})


def test_inertia_refuses_a_run_that_slows_down_too_far():
    result = run("inertia", virtual_rig("thesis-grease"), speed="2.2")
    assert not result.passed
    with pytest.raises(CheckFailed, match="friction keeps its sign"):
        result.insist()


def test_breaks_are_found_at_every_angle_and_direction():
    record = run("breakaway", virtual_rig("thesis-grease")).record
    breaks = find_breaks(record)
    assert sum(b.direction > 0 for b in breaks) == 6
    assert sum(b.direction < 0 for b in breaks) == 6
    angles = sorted(math.degrees(b.angle) % 360.0 for b in breaks if b.direction > 0)
    assert np.diff(angles) == pytest.approx(60.0, abs=3.0)


def test_sliding_points_are_those_of_the_ideal_machine():
    m = machine("ideal")
    points, _ = sliding_points(run("sliding", VirtualRig(m)).record)
    assert len(points) == 6
    for v, torque in zip(points.velocity, points.torque, strict=True):
        truth = m.clutch.law.steady(v, m.clutch.parameters)
        assert torque == pytest.approx(truth, rel=2e-3)


def test_presliding_that_breaks_away_is_refused():
    result = run("presliding", virtual_rig("thesis-dry"), amplitude="0.5")
    assert not result.passed
    with pytest.raises(CheckFailed, match="lower amplitude"):
        result.insist()


def test_repeat_spreads_by_drift_only_little():
    result = run("repeat", virtual_rig("thesis-grease"))
    assert len(result.segments) == 2
    assert result.record.time[-1] - result.record.time[0] > 60.0


def test_a_plan_beyond_the_limits_is_refused_before_anything_moves():
    rig = virtual_rig("thesis-dry")
    with pytest.raises(InputError, match="speed of 60 rad/s"):
        run("sliding", rig, velocities="60")
    assert rig.open().time == 0.0


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("sliding", {"velocitys": "1"}, "did you mean 'velocities'"),
        ("sliding", {"velocities": "a"}, "numbers separated by commas"),
        ("track", {"model": "gsm"}, "give a model.toml or one of"),
        ("track", {"compensator": "both"}, "compensator 'both'"),
        ("track", {"reference": "slow"}, "reference 'slow'"),
        (
            "track",
            {"compensator": "feedforward", "model": "lugre", "substeps": "0"},
            "substeps = 0 must be a whole number from 1",
        ),
    ],
)
def test_options_that_make_no_sense(name, options, says):
    with pytest.raises(InputError, match=says):
        run(name, virtual_rig("thesis-dry"), **options)
    with pytest.raises(UnknownName):
        procedure("breakaways")


def test_track_divides_the_laws_step_as_it_is_told():
    """The law answers to the reference as plain Python does, in as many steps, whatever was measured before."""
    rig, compensation = virtual_rig("thesis-dry"), {}
    given = {"compensator": "feedforward", "model": "lugre", "duration": "1", "filter": "400"}
    for parts in (1, 4):
        chosen = procedure("track").with_options({**given, "substeps": str(parts)})
        controller = chosen.made(rig)
        assert controller.compensator.substeps == parts
        assert ("4 steps a sample" in chosen.plan(rig).text[0]) == (parts == 4)
        record = perform(chosen, rig).record
        law, p = controller.compensator.model.law, controller.compensator.model.parameters
        z, n = law.state(p), settings(controller)
        m = SimpleNamespace(**dict.fromkeys(Memory._fields, 0.0))
        u = SimpleNamespace(**Surroundings()._asdict())
        sample = sampled_by(law)
        expected = []
        for position, velocity in zip(record["position"], record["velocity_reference"]):
            sample(float(position), float(position), float(velocity), 0.0, n, m, z, p, u)
            expected.append(m.compensation)
        assert record["compensation_torque"] == pytest.approx(expected, abs=1e-12)
        compensation[parts] = record["compensation_torque"]
    assert np.abs(compensation[1] - compensation[4]).max() > 1e-7


def test_an_option_with_a_direction_may_be_below_zero_and_a_plan_then_is_no_lighter(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name, option, text in (("resonance", "speed", "5"), ("sliding", "velocities", "1,0.5")):
        plans = []
        for given in (text, ",".join(f"-{v}" for v in text.split(","))):
            line = [
                "rig",
                "run",
                name,
                "--rig",
                "thesis-dry",
                "--dry-run",
                "--json",
                "--set",
                f"{option}={given}",
            ]
            assert main(line) == 0
            plans.append({k: v for k, v in json.loads(capsys.readouterr().out).items() if k != "text"})
        assert plans[0] == plans[1]
    assert run("resonance", virtual_rig("thesis-dry"), speed="-5").passed


@pytest.mark.parametrize(
    ("name", "option"),
    [("presliding", "amplitude"), ("breakaway", "rate"), ("attraction", "mean"), ("repeat", "interval")],
)
def test_an_option_that_is_a_size_may_not_be_below_zero(name, option):
    with pytest.raises(InputError, match=f"{name}: {option} = -1 must be 0 or greater"):
        procedure(name)(**{option: -1.0})


def test_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["rig", "list"]) == 0
    assert "thesis-grease" in capsys.readouterr().out
    assert main(["rig", "run", "sliding", "--rig", "thesis-dry", "--dry-run"]) == 0
    out = capsys.readouterr().out
    for word in ("travel", "speed", "torque", "time"):
        assert word in out
    assert not Path("sliding.npz").exists()
    code = main(
        ["rig", "run", "presliding", "--rig", "thesis-dry", "--without", "cogging", "--set", "frequency=1"]
    )
    assert code == 0
    assert Record.load("presliding.npz").meta["machine"]["without"] == ["cogging"]
    assert (
        main(
            [
                "rig",
                "run",
                "presliding",
                "--rig",
                "thesis-dry",
                "--set",
                "amplitude=0.6",
                "--set",
                "frequency=1",
            ]
        )
        == 1
    )
    for bad in (
        ["rig", "run", "presliding", "--rig", "nowhere"],
        ["rig", "run", "presliding", "--rig", "thesis-dry", "--without", "nothing"],
        ["rig", "run", "preslidng", "--rig", "thesis-dry"],
        ["rig", "run", "presliding", "--rig", "none.toml"],
        ["rig", "run", "presliding", "--rig", "thesis-dry", "--set", "amplitude"],
    ):
        assert main(bad) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_noise_too_short_for_its_band_is_refused_before_any_torque():
    rig = virtual_rig("thesis-dry")
    with pytest.raises(InputError, match=r"duration = 0\.001 s has no frequency from lowest = 5 Hz"):
        run("resonance", rig, duration="0.001")


@pytest.mark.parametrize("name", ["track", "repeat"])
def test_a_bandwidth_beyond_what_the_samples_can_hold_is_refused_before_any_torque(name):
    """At 200 Hz of 1 kHz the torque stood at its limit for 96 % of the run, and every check passed."""
    rig = virtual_rig("thesis-dry")
    with pytest.raises(
        InputError, match="bandwidth = 200 Hz is more than a tenth of the sample rate 1000 Hz"
    ):
        run(name, rig, bandwidth="200")
