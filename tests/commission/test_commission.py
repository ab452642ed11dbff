"""Commissioning knows nothing of the machine and recovers what was put in."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from stickslip.analyse.tracking import tracking_metrics
from stickslip.cli import main
from stickslip.cli._files import listed, written
from stickslip.commission import commission as commissioning
from stickslip.commission.commission import commission, planned, tried
from stickslip.commission.recommended import Following, write_identified_machine, write_recommended
from stickslip.commission.resume import claimed
from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError, LimitCrossed
from stickslip.identification.compare.change import compare_models
from stickslip.identification.estimate import Identification
from stickslip.identification.identified_file import read_identified
from stickslip.identification.model_file import write_model
from stickslip.identification.steady_friction.segments import constant_velocity_segments
from stickslip.machines.angle import AngleMap
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.files import load_machine, machine
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier, Harmonics
from stickslip.models.model import Model
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.notes import notes_on
from stickslip.recommendation.recommendation import Recommendation
from stickslip.report.identified import Source, write_identification
from stickslip.rigs.loop import Loop
from stickslip.rigs.narrower_limits import limited
from stickslip.rigs.procedures.base import Check, CheckFailed, perform
from stickslip.rigs.procedures.moves import holder, move
from stickslip.rigs.procedures.track import RECOMMENDED, Track
from stickslip.rigs.rig import setpoints
from stickslip.rigs.virtual import VirtualRig, virtual_rig
from stickslip.sweeps.numbers import varied
from stickslip.sweeps.plan import load

OTHER = Machine(
    "other",
    1.3e-3,
    Contact(
        Model(
            "gms",
            k=[900.0, 300.0],
            alpha=[0.5, 0.5],
            c=60.0,
            fs=0.5,
            fc=0.42,
            vs=0.05,
            delta_s=1.5,
            sigma2=0.01,
        ),
        Harmonics((1.0, 4.0), (0.08, 0.04), (0.3, 1.1)),
    ),
    amplifier=Amplifier(0.5, 8.0, 800.0, current_noise=0.003, monitor_noise=0.004),
    encoder=Encoder(400000.0, 2e-6, 60.0),
    limits={"torque": 3.0, "following_error": 1.0},
    seed=5,
)
"""A rigid machine that is not in the library: three times the inertia, another motor, encoder and friction."""


def mean_truth(m, record):
    """Speed and mean torque of both directions: averaged over the angle and over the record's own time and warmth."""
    clutch, bearings, drift, heat = m.clutch, m.contact.bearings, m.contact.drift, m.contact.heat
    found = {}
    for s in constant_velocity_segments(record):
        rows = (record.time >= s.start) & (record.time <= s.end)
        factor = 1.0 - drift.change * np.expm1(-record.time[rows] / drift.time)
        factor = factor * np.exp(heat.coefficient * (record["temperature"][rows] - heat.reference))
        friction = abs(clutch.law.steady(s.velocity, clutch.parameters)) * factor.mean()
        friction += bearings.coulomb + bearings.viscous * abs(s.velocity)
        found.setdefault(float(f"{abs(s.velocity):.2g}"), []).append(friction)
    return {v: float(np.mean(t)) for v, t in found.items()}


def held_to_the_bars(m, done):
    """J within 3 %, the curve within 3 %, stiffness within 10 %, the map of break-away correlated above 0.9."""
    assert done.inertia == pytest.approx(m.inertia, rel=0.03)
    assert done.stiffness == pytest.approx(m.visible_stiffness, rel=0.10)
    truth = mean_truth(m, done.stage("sliding").performed.record)
    assert len(truth) >= 3
    for v, torque in truth.items():
        assert done.model.law.steady(v, done.model.parameters) == pytest.approx(torque, rel=0.03), v
    breaks = done.stage("breakaway").found.details["breaks"]
    for direction in (1, -1):
        near = [b for b in breaks if b.direction == direction]
        level = abs(m.clutch.law.steady(direction * 1e-6, m.clutch.parameters))
        true = [
            level * (1.0 + m.contact.ripple.at(b.angle)) - direction * m.cogging.at(b.angle) for b in near
        ]
        assert np.corrcoef(true, [b.torque for b in near])[0, 1] > 0.9


def test_a_machine_that_is_not_in_the_library(tmp_path):
    done = commission(
        VirtualRig(OTHER),
        folder=tmp_path,
        velocities=(5.0, 3.0, 1.0, 0.5, 0.2),
        duration=25.0,
        interval=30.0,
        lugre_too=False,
        cogging="rotation",
    )
    held_to_the_bars(OTHER, done)
    the_map = done.result.details["map"]
    for n, a in zip(OTHER.cogging.order, OTHER.cogging.amplitude, strict=True):
        assert dict(zip(the_map.even.order, the_map.even.amplitude, strict=True))[n] == pytest.approx(
            a, rel=0.1
        )
    tracks = {f"track-{share}-{how}" for share in (100, 75, 50) for how in ("alone", "mean", "helped")}
    assert {p.stem for p in tmp_path.glob("*.npz")} == {
        "inertia", "breakaway", "sliding", "presliding", "attraction", "cogging", "resonance"
    } | tracks  # fmt: skip
    assert done.angle.ripple.order == (1.0, 4.0)
    assert done.angle.ripple.amplitude == pytest.approx((0.08, 0.04), rel=0.05)
    advised = done.recommended
    assert advised.advice.chosen.setting.kind == "feedforward"
    assert advised.tracked[0].ratio >= 3.0
    mine = load_machine(
        write_identified_machine(tmp_path / "machine.toml", advised, VirtualRig(OTHER), done.lugre)
    )
    known = advised.known.machine(VirtualRig(OTHER))
    assert replace(mine, name=known.name, title="", models={}) == known
    assert {"gms", "coulomb"} <= set(mine.models)
    # What the file recommends, run as the command line does, is what was measured.
    file = write_recommended(tmp_path / "recommended.toml", advised)
    again = Track(compensator="recommended", model=str(file))
    rig = VirtualRig(replace(OTHER, seed=6))
    metrics = tracking_metrics(perform(again, rig).record)
    assert metrics["position_rms_rad"] < advised.tracked[0].alone / 3.0
    assert "as the encoder sees it" in done.result.notes[0] or "at the encoder" in done.result.notes[0]
    assert math.isfinite(done.model.parameters.c)
    written = Model.from_file(write_model(tmp_path / "model.toml", done.result))
    assert written.parameters == done.model.parameters
    the_model_is_known_to_sweeps_recommendations_and_comparisons(tmp_path)
    sources = [Source(s.name, s.performed.record) for s in done.stages]
    report = write_identification(tmp_path / "report.html", done.result, sources, title="Commissioning")
    assert "Total pre-sliding stiffness" in report.read_text()


STUDY = """
[axis]
inertia = 1.3e-3
[friction.found]
law = {model = "model.toml"}
[references.sine]
kind = "sine"
amplitude = 0.1
frequency = 2.0
duration = 0.05
placement = {bandwidth_hz = 10.0, damping = 1.0}
[controllers.PD]
linear = "PD"
"""


def the_model_is_known_to_sweeps_recommendations_and_comparisons(folder):
    """A sweep varies the friction and says what it leaves out, and so do a recommendation and a comparison."""
    (folder / "study.toml").write_text(STUDY)
    (folder / "sweep.toml").write_text(
        'study = "study.toml"\nmodel = "model.toml"\ncases = 16\ncheck = false\n'
    )
    sweep = load(folder / "sweep.toml")
    names = set(sweep.drawn.names)
    assert {"axis.inertia", "friction.fs", "friction.fc", "friction.k[0]", "friction.alpha[0]"} <= names
    assert {"presliding.stiffness", "breakaway.fs_positive", "angle.ripple[1]"} <= set(sweep.left_out)
    drawn = dict(zip(sweep.drawn.names, sweep.drawn.block(0, 512).T, strict=True))
    # The share of a single element, where the record resolves no second one, is 1.
    single = {"friction.alpha[0]"} if "friction.alpha[1]" not in drawn else set()
    assert {name for name, x in drawn.items() if np.ptp(x) == 0.0} == single
    # The elements are not told apart; their sum is, to what six seeds give: a spread of 0 to 15 % of it.
    total = sum(x for name, x in drawn.items() if name.startswith("friction.k["))
    assert np.std(total) < 0.2 * np.mean(total)
    assert abs(np.mean(total) - OTHER.visible_stiffness) < 2.0 * np.std(total)
    assert sum(x for name, x in drawn.items() if "alpha" in name) == pytest.approx(1.0)
    for row in sweep.drawn.block(0, 64):
        values = {k: v[0].tolist() for k, v in sweep.values(sweep.runs[0], row[None, :]).items()}
        varied(sweep.runs[0], values)  # the law refuses none
    found = read_identified(folder / "model.toml")
    plants = list(plants_of(found, 1.3e-3, 4, 1))
    assert len({p.friction.parameters for p in plants}) == 5
    none = Recommendation(None, None, {}, 0.0, math.nan, math.inf, (), 1)
    assert not any("no intervals" in note for note in notes_on(found, none))
    content = tomllib.loads((folder / "model.toml").read_text())
    for e in (e for e in content["estimates"] if e["name"] in ("fs", "fc")):
        # Fc reaches down to 0 (no slow level tells it from the fall): a change must exceed that.
        content["parameters"][e["name"]] *= 4.0
        e |= {key: 4.0 * e[key] for key in ("value", "std", "lower", "upper")}
    (folder / "worn.toml").write_text(tomli_w.dumps(content))
    assert not compare_models(found, found, top=5.0).changed
    assert compare_models(found, read_identified(folder / "worn.toml"), top=5.0).changed
    # A file whose estimates the law does not know varies nothing in silence.
    for e in (e for e in content["estimates"] if e["name"] != "inertia"):
        e["name"] = f"stage.{e['name']}"
    (folder / "model.toml").write_text(tomli_w.dumps(content))
    with pytest.raises(InputError, match=r"no parameter of its law gms .*stage\.fs"):
        load(folder / "sweep.toml")


def test_a_record_of_tracking_names_the_lead():
    helper = Feedforward(Model("coulomb", fc=0.3), lead=2e-3)
    using = Controller(place("PD", 1e-3, 10.0, 1.0), helper, sample_time=1e-3)
    assert Following(using=using).options()["compensator"]["lead"] == 2e-3


@pytest.mark.parametrize("error", [InputError("the position does not answer"), LimitCrossed("speed")])
def test_a_recommendation_that_fails_leaves_the_model(error):
    def fails():
        raise error

    found, said = tried(fails)
    assert found is None
    assert str(error) in said[0]


def test_what_is_recommended_is_run_as_it_was_measured_and_nothing_beside_it_is_lost(tmp_path):
    file = tmp_path / "recommended.toml"
    file.write_text(
        write_model_text(tmp_path)
        + '[recommended]\ncompensator = "feedback"\nbandwidth = 8.0\ndamping = 1.0\ninertia = 1e-3\ngain = 0.9\n'
    )
    options = {"compensator": "recommended", "model": str(file)}
    rig = VirtualRig(replace(OTHER, filter=10.0))
    using = Track(**options).made(rig)
    assert using.compensator.filter_hz is None  # not the machine's own: it was measured without one
    assert using.gains == place("PD", 1e-3, 8.0, 1.0)
    for name in RECOMMENDED:
        with pytest.raises(
            InputError, match=f"{name} = .* cannot be combined with compensator = recommended"
        ):
            Track.with_options({**options, name: str(getattr(Track, name))})
    with pytest.raises(InputError, match="bandwidth = 12"):
        Track(**options, bandwidth=12.0).made(rig)
    file.write_text(file.read_text() + f"machine = {rig.name!r}\n")
    Track(**options).compensated(VirtualRig(OTHER.without("cogging")))
    with pytest.raises(
        InputError, match=r"recommended for 'virtual .*', and this is 'virtual thesis-dry'.*commission"
    ):
        Track(**options).compensated(virtual_rig("thesis-dry"))


def write_model_text(folder):
    """A model.toml of Coulomb friction."""
    law = Model("coulomb", fc=0.3)
    return write_model(folder / "law.toml", Identification("test", law, (), np.eye(0), {})).read_text()


def test_an_interrupted_commissioning_goes_on_from_its_records(monkeypatch, tmp_path):
    """What has the same settings is not measured again; other settings, another rig or a failed check are."""
    short, said = Track(duration=0.2, bandwidth=8.0), []

    def course(rig, resume=True):
        return commissioning._Course(rig, tmp_path, said.append, False, resume)

    first = course(VirtualRig(OTHER)).run(short)
    with monkeypatch.context() as patch:
        patch.setattr(commissioning, "perform", None)
        again = course(VirtualRig(OTHER)).run(short)
    assert "as recorded" in said[-1]
    assert again.passed
    assert again.segments == first.segments
    np.testing.assert_array_equal(again.part("low")["position"], first.part("low")["position"])
    for other, rig, resume in (
        (replace(short, bandwidth=9.0), VirtualRig(OTHER), True),
        (short, limited(VirtualRig(OTHER), {"torque": 0.5}), True),
        (short, VirtualRig(replace(OTHER, seed=77)), True),
        (short, VirtualRig(OTHER), False),
    ):
        course(rig, resume).run(other)
        assert "follow low" in said[-1]
    bad = Check("tracking", False, "no")
    monkeypatch.setattr(Track, "checks", lambda *_: (bad,))
    for _ in range(2):
        with pytest.raises(CheckFailed):
            course(VirtualRig(OTHER), True).run(replace(short, bandwidth=7.0))
        assert "follow low" in said[-1]


def test_a_folder_with_results_or_another_rigs_records_is_refused(tmp_path):
    rig = VirtualRig(OTHER)

    def claim(rig, anew=False):
        claimed(tmp_path, rig, anew=anew, own=listed)

    claim(rig)
    commissioning._Course(rig, tmp_path, lambda _: None, False).run(
        Track(duration=0.2, bandwidth=8.0), name="track-100-alone"
    )
    claim(rig)
    with pytest.raises(
        InputError, match=r"alone\.npz is a record of 'virtual other'.*thesis-dry.*force to measure"
    ):
        claim(virtual_rig("thesis-dry"))
    (tmp_path / "model.toml").write_text("")
    written([tmp_path / "model.toml"])
    with pytest.raises(InputError, match=r"holds model\.toml already; give another folder \(folder\)"):
        claim(rig)
    claim(rig, anew=True)
    assert not (tmp_path / "model.toml").exists()


@pytest.mark.parametrize("name", ["model.toml", "report.html", "inertia.npz", "track-75-mean.npz"])
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_files_of_somebody_else_are_not_overwritten(name, force, tmp_path, capsys):
    (tmp_path / name).write_bytes(b"PK my own")
    (tmp_path / "notes.npz").write_bytes(b"mine, in nobody's way")
    assert main(["rig", "commission", "--rig", "ideal", "--out", str(tmp_path), *force]) == 2
    error = capsys.readouterr().err
    assert name in error
    assert "--out" in error
    assert (tmp_path / name).read_bytes() == b"PK my own"
    assert (tmp_path / "notes.npz").exists()


def test_a_damaged_record_is_named(tmp_path):
    rig, short = VirtualRig(OTHER), Track(duration=0.2, bandwidth=8.0)
    course = commissioning._Course(rig, tmp_path, lambda _: None, False, True)
    course.run(short, name="track-100-mean")
    file = tmp_path / "track-100-mean.npz"
    file.write_bytes(file.read_bytes()[:-400])
    content = file.read_bytes()
    for again in (
        lambda: claimed(tmp_path, rig, anew=False, own=listed),
        lambda: course.run(short, name="track-100-mean"),
    ):
        with pytest.raises(
            InputError, match=r"track-100-mean\.npz is not a record .*; move it away, so that"
        ):
            again()
    assert file.read_bytes() == content


def test_a_resumed_commissioning_reports_where_it_starts(tmp_path):
    rig, said = VirtualRig(OTHER), []
    first = Track(duration=0.3, bandwidth=8.0)
    commissioning._Course(rig, tmp_path, said.append, False, True).run(first, name="track-100-mean")
    course = commissioning._Course(VirtualRig(OTHER), tmp_path, said.append, False, True)
    left = course.run(first, name="track-100-mean").record["position"][-1]
    assert not course.notes
    start = course.run(first, name="track-75-mean").record["position"][0]
    assert len(course.notes) == 1
    assert f"track-75-mean starts at {start:.4g} rad" in course.notes[0]
    assert f"ended at {left:.4g} rad" in course.notes[0]
    assert said[-1] == course.notes[0]


def test_the_tracking_runs_are_said_once():
    plans = planned(VirtualRig(OTHER))
    lines = [line for plan in plans for line in plan.text if "follow" in line]
    assert len(lines) == 1
    assert "9 times" in lines[0]
    assert plans[-1].duration == pytest.approx(9 * Track().plan(VirtualRig(OTHER)).duration)


def test_a_limit_crossed_while_looking_for_the_lag_leaves_the_rest(monkeypatch):
    def crosses(self, procedure, **_):
        raise LimitCrossed("speed: 41 rad/s beyond 40")

    monkeypatch.setattr(commissioning._Course, "run", crosses)
    course = commissioning._Course(VirtualRig(OTHER), None, print, False)
    found, said = commissioning._attraction(course, 1e-3, AngleMap(), OTHER.clutch)
    assert found is None
    assert "41 rad/s beyond 40" in said[0]


def test_a_stick_slip_stage_that_is_left_out_is_said(monkeypatch):
    def crosses(self, procedure, **_):
        raise LimitCrossed("speed: 41 rad/s beyond 40")

    monkeypatch.setattr(commissioning._Course, "run", crosses)
    course = commissioning._Course(VirtualRig(OTHER), None, print, False)
    found, said = commissioning._stickslip(course, 1e-3, 0.4, {"fs": 0.5, "fc": 0.4})
    assert found is None
    assert "LuGre" in said[0]
    assert "41 rad/s beyond 40" in said[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed"), [("thesis-dry", 11), pytest.param("thesis-grease", 11, marks=pytest.mark.long)]
)
def test_the_thesis_machines(name, seed):
    m = replace(machine(name), seed=seed)
    done = commission(VirtualRig(m))
    held_to_the_bars(m, done)
    flexible, drivetrain = m.flexible, done.stage("resonance").found.details["drivetrain"]
    assert drivetrain.sliding == pytest.approx(flexible.modes[1], rel=0.02)
    assert done.angle.ripple.order == m.contact.ripple.order
    assert done.angle.beside.order == m.cogging.order
    # The error is at least 3 times smaller than that of the same PD alone (issue 5), and from any angle.
    advised = done.recommended
    assert advised.tracked[0].ratio >= 3.0
    for start in np.arange(0.5, 6.2, 1.4):
        runs = advised.controllers(VirtualRig(m), advised.known.bandwidth)
        error = {name: rms_from(m, start, *runs[name]) for name in ("alone", "helped")}
        assert error["alone"] / error["helped"] >= 3.0, start


def rms_from(m, start, controller, angle):
    """RMS error on the slow sinusoid an hour after the machine was switched on, from an angle."""
    rig = VirtualRig(m)
    loop = holder(rig, m.inertia, 8.0)
    with Loop(rig) as run:
        run.run(move(rig, loop, 0.0, start, m.inertia).setpoints, loop)
        run.run(setpoints(200))
    rig.pause(3600.0)
    done = perform(Following(using=controller, over=angle), rig)
    return tracking_metrics(done.record)["position_rms_rad"]
