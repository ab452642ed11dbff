"""The three answers at the head of a report: what the friction is, whether to trust it, what to do now."""

from __future__ import annotations

import dataclasses
import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip import Model
from stickslip.core.finding import Finding
from stickslip.core.messages import Surface, render, shown_on
from stickslip.core.record import Record
from stickslip.identification.axis import identify_axis
from stickslip.identification.estimate import Estimate, Held, Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.needed_motions import EXPERIMENTS, MOTIONS
from stickslip.machines.servo import ServoAxis
from stickslip.report.answers import answers_of, either_way, evidence, meaning_of, one_number_each
from stickslip.report.axis_pictures import pictures_of
from stickslip.report.identified import Source, rendered, symbol, tally
from stickslip.report.next_steps import counts_of, forward, lacking
from stickslip.report.result_text import result_lines, result_lines_in_python
from stickslip.report.sliding_torque import over_all_rows, sliding_of
from stickslip.report.torque_pictures import friction_points, with_gaps

COUNT = 2.0 * math.pi / 65536
J, FC, SIGMA2, OFFSET, LATE = 8e-4, 0.2, 0.01, 0.02, 2e-3


@cache
def log() -> Record:
    """Moves with a dwell, the torque that friction and inertia take along them, written down `LATE` seconds behind."""
    fine = 1e-4 * np.arange(80000)
    velocity = 12.0 * np.sin(2.0 * math.pi * 0.7 * fine) + 6.0 * np.sin(2.0 * math.pi * 1.9 * fine)
    velocity[(fine > 3.0) & (fine < 3.4)] = 0.0
    velocity = np.convolve(velocity, np.hanning(401) / 200.0, "same")
    torque = J * np.gradient(velocity, fine) + FC * np.sign(velocity) + SIGMA2 * velocity + OFFSET
    position = 1e-4 * np.cumsum(velocity)
    time = fine[::10]
    noise = 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    channels = {
        "position": COUNT * np.round(position[::10] / COUNT),
        "motor_torque": np.interp(time - LATE, fine, torque) + noise,
    }
    return Record(time, channels, {"position": "rad", "motor_torque": "N·m"})


@cache
def identified() -> Identification:
    record = log()
    experiment = Experiment("log.csv", record.time, record["position"], record["motor_torque"])
    return identify_axis([experiment], ServoAxis(drive_side="load"), ["coulomb"])


def test_the_torque_of_the_model_is_compared_where_the_axis_slides_and_when_it_acted() -> None:
    sliding = sliding_of(identified())
    assert sliding is not None
    assert sliding.certain
    assert sliding.rms == pytest.approx(np.sqrt(np.mean((sliding.model - sliding.measured) ** 2)))
    # Noise, and nothing else: the delay is taken out, reversals and the dwell are left out.
    as_written = np.interp(sliding.time, log().time, log()["motor_torque"])
    assert sliding.rms < 1.6e-3 < 0.5 * np.sqrt(np.mean((sliding.model - as_written) ** 2))
    assert np.all(np.abs(sliding.velocity) > 0.0)
    assert not np.any((sliding.time > 3.1) & (sliding.time < 3.3))
    assert 0.5 < sliding.share < 0.95
    for side, (speed, torque) in zip((1.0, -1.0), friction_points(sliding, OFFSET), strict=True):
        assert side * torque == pytest.approx(side * (FC + SIGMA2 * speed), rel=0.02)
    every = over_all_rows(identified())
    assert every is not None
    assert np.linalg.norm(every.residual) / np.linalg.norm(every.measured) == pytest.approx(
        identified().misfit["force_relative"]
    )


def test_lines_stop_where_rows_are_missing() -> None:
    time = np.concatenate([np.arange(5.0), 20.0 + np.arange(5.0)])
    x, y = with_gaps(time, time**2)
    assert np.flatnonzero(np.isnan(x)).tolist() == np.flatnonzero(np.isnan(y)).tolist() == [5]
    assert x.size == 11


def test_three_answers_stand_at_the_head_and_no_drift_of_an_open_loop() -> None:
    found = identified()
    page = rendered(
        found, [Source("log", log(), about={"file": "log.csv"})], "t", {}, model_file="out/model.toml"
    )
    sections = (
        "friction", "sliding-curve", "result", "trust", "torque-stretch", "torque-velocity", "next", "fits",
        "residuals", "records", "data",
    )  # fmt: skip
    order = [page.index(f'id="{x}"') for x in sections]
    assert order == sorted(order)
    head = page[: page.index('id="fits"')]
    assert "Coulomb torque <i>F</i><sub>C</sub>" in head
    assert "viscous friction coefficient <i>σ</i><sub>2</sub>" in head
    assert "position error of the simulation" not in page
    assert "position rms" not in page[: page.index('id="data"')]
    assert "lets it drift" in page[page.index('id="data"') :]
    names = [p.name for p in pictures_of(found, {"positive": np.linspace(1.0, 10.0, 11)})]
    assert not [n for n in names if n.startswith(("fit-", "slow-", "residual-position"))]
    assert {"residual-torque-over-velocity", "residual-torque-over-time", "torque-whole-1"} <= set(names)


def test_the_curve_marks_the_recorded_speeds() -> None:
    tenths = {
        "positive": np.linspace(1.0, 11.0, 11).tolist(),
        "negative": np.linspace(2.0, 12.0, 11).tolist(),
    }
    curve = next(p for p in pictures_of(identified(), tenths) if p.name == "sliding-curve")
    (marks,) = [t for t in curve.traces if t.kind == "rug"]
    assert marks.label == "recorded speeds"
    assert marks.x.size == 102
    assert marks.x[0] == pytest.approx(1.0)
    assert marks.x[-1] == pytest.approx(12.0)


def test_what_was_given_is_not_called_identified() -> None:
    found = identified()
    given = Held("inertia", "kg·m²", "J", found["inertia"].value)
    beside = dataclasses.replace(
        found, estimates=tuple(e for e in found.estimates if e.name != "inertia"), held=(given,)
    )
    assert answers_of(beside, [log()]).trust == "Yes: every number is identified; given: inertia."
    for shown, said in ((found, "determine every number"), (beside, "determine every other number")):
        assert said in rendered(shown, [Source("log.csv", log())], "", {})


def test_the_answers_say_friction_error_timing_and_the_next_command() -> None:
    found = identified()
    answers = answers_of(found, [log()], "out dir/model.toml", ["log.csv"])
    assert re.search(r"takes 0\.2\d+ N·m at [\d.]+ rad/s, .* at \d\d\.?\d* rad/s\.", answers.friction[0])
    assert answers.friction[-1].startswith("Recorded speeds: ")
    assert answers.trust == "Yes: every number is identified."
    assert "in gross sliding" in answers.evidence[0].lower()
    assert "plain least squares" in answers.evidence[1]
    assert [s.command for s in answers.steps] == [
        "stickslip recommend 'out dir/model.toml' --bandwidth 10 --sample-time 0.001 --counts-per-rev 65536"
        " --out 'out dir/recommended.toml'",
        "stickslip export 'out dir/recommended.toml' --to c99 --compensator recommended",
    ]
    looped = dataclasses.replace(log(), meta={"loop": "kp=8,kd=0.08,limit=3,span=2"})
    assert "--loop kp=8,kd=0.08,limit=3 " in answers_of(found, [looped]).steps[0].command


def test_a_pendulum_needs_its_gravity() -> None:
    found = identified()
    gravity = Estimate("gravity", "N·m", "m g l", 0.2, 0.2, 0.0, 0.6, False, "not told from 0")
    assert lacking(found) == []
    assert lacking(dataclasses.replace(found, estimates=(*found.estimates, gravity))) == ["gravity"]


def test_what_is_missing_is_recorded_next() -> None:
    found = identified()
    wide = tuple(
        dataclasses.replace(e, identified=False, verdict="too wide") if e.name in ("inertia", "sigma2") else e
        for e in found.estimates
    )
    poor = dataclasses.replace(found, estimates=wide, measure_next=("Record stronger accelerations.",))
    assert lacking(poor) == ["inertia"]
    answers = answers_of(poor, [log()], "model.toml", ["a b.csv"])
    assert answers.trust == "Yes, as far as identified: offset, fc; not inertia, sigma2."
    assert answers.steps[0].what == "Record stronger accelerations."
    assert [s.command for s in answers.steps[1:]] == [
        "stickslip rig run inertia --rig machine.toml --out inertia.npz",
        "stickslip identify 'a b.csv' inertia.npz --out model.toml  # with the options of this run",
    ]
    assert one_number_each(wide) == ["inertia, sigma2 not identified: too wide"]
    told = [line for line in result_lines(poor, answers) if line.startswith("measure next")]
    assert told[1] == (
        "measure next: To settle inertia, record accelerations back and forth with your drive, or let a rig do it: "
        "stickslip rig run inertia --rig machine.toml --out inertia.npz"
    )
    in_python = [x for x in result_lines_in_python(poor, answers) if x.startswith("measure next")]
    assert in_python[0] == told[0]
    assert in_python[1] == told[1].replace("stickslip rig", "`stickslip rig") + "` in a shell"
    # Every procedure that a number may ask for is told in words.
    assert set(EXPERIMENTS.values()) == MOTIONS.keys()


def test_a_loop_that_is_simulated_is_told_beside_the_torque() -> None:
    found = identified()
    seen = dataclasses.replace(found, misfit={**found.misfit, "drive_relative": 0.123})
    said = "The loop, simulated with the model, makes a drive signal 12.3 % off the recorded one."
    assert said in evidence(seen, None)
    assert not any(
        line.startswith("drive_relative") for line in result_lines(seen, answers_of(seen, [log()]))
    )


@pytest.mark.parametrize(
    ("misfit", "findings", "doubt"),
    [
        ({"held_out_force_relative": 0.9}, (), "on records held out its force error is 90 %"),
        ({}, (Finding("warning", "gap", "a gap"),), "the doctor warns of the record (gap)"),
    ],
)
def test_what_speaks_against_it_is_said(misfit: dict[str, float], findings: Any, doubt: str) -> None:
    found = identified()
    doubted = dataclasses.replace(found, misfit={**found.misfit, **misfit}, findings=findings)
    answers = answers_of(doubted, [log()])
    assert answers.trust.startswith("With care: ")
    assert doubt in answers.trust
    assert doubt in " ".join(answers.as_dict()["doubts"])
    assert answers.as_dict()["trust"] == answers.trust
    assert answers_of(found, [log()]).as_dict()["doubts"] == []


def test_a_model_that_misses_the_torque_is_not_called_right() -> None:
    found = identified()
    wrong = dataclasses.replace(found, model=Model("coulomb", fc=0.35, sigma2=0.0))
    said = answers_of(wrong, [log()], "o/model.toml", ["log.csv"])
    assert said.steps[0].command.startswith("stickslip identify log.csv --inverse --out o/plain.toml  #")
    assert said.steps[1].command.startswith("stickslip recommend ")
    assert "misses" in said.trust
    assert "plain least squares (inverse=True) explains the torque better where the axis slides" in said.trust
    assert "in place of" not in said.trust  # its inertia was fitted
    assert not any("reversals alone" in line for line in said.evidence)
    # The number that makes the difference is named.
    reason = r"which minimizes this error alone, by (fc|sigma2) = \S+ N·m\S* in place of (0.35|0)\."
    assert re.search(reason, said.evidence[0])
    assert said.evidence[1].endswith("not significantly less.")
    sliding = sliding_of(found)
    assert sliding is not None
    assert sliding.plain == pytest.approx(sliding.rms, rel=0.2)
    assert "%" in next(t["count"] for t in tally(wrong, []) if "gross sliding" in t["words"])


def test_an_inertia_that_was_given_is_named_where_the_model_is_beaten() -> None:
    found = identified()
    wrong = dataclasses.replace(found, model=Model("coulomb", fc=0.35, sigma2=0.0))
    held = dataclasses.replace(wrong, estimates=tuple(e for e in wrong.estimates if e.name != "inertia"))
    given = held.details["mechanics"].inertia
    assert (
        f"kg·m² in place of the {given:.3g} that was given: check that first"
        in answers_of(held, [log()]).trust
    )


def test_along_a_line_it_is_a_force() -> None:
    found = identified()
    wrong = dataclasses.replace(found, model=Model("coulomb", fc=0.35, sigma2=0.0))
    details = {**wrong.details, "axis": dataclasses.replace(wrong.details["axis"], motion="linear")}
    said = answers_of(dataclasses.replace(wrong, details=details), [log()])
    assert "the model's force is" in said.evidence[0]
    assert "explains the force better" in said.trust


def test_other_methods_have_words_and_a_next_command() -> None:
    estimates = (Estimate("fs_positive", "N·m", "F_S", 0.3, 0.01, 0.28, 0.32, True),)
    found = Identification("breakaway", None, estimates, np.eye(1), {"rms_Nm": 2e-3})
    assert meaning_of(found) == {"fs_positive": "break-away torque, v > 0"}
    answers = answers_of(found, [], "o/model.toml", ["b.npz"])
    assert answers.steps[-1].command == "stickslip identify sliding.npz --method sliding --out o/model.toml"
    assert "2 mN·m" in answers.evidence[0]
    sliding = Identification("sliding", Model("coulomb", fc=0.3), (dataclasses.replace(estimates[0], name="fc"),),
                             np.eye(1), {})  # fmt: skip
    assert answers_of(sliding, [], Path("m.toml")).steps[0].command == "stickslip export m.toml --to c99"


def test_a_linear_axis_has_force_and_mass() -> None:
    found = identified()
    line = dataclasses.replace(
        found, details={**found.details, "axis": ServoAxis("linear", drive_side="load")}
    )
    words = meaning_of(line)
    assert (words["inertia"], words["fc"]) == ("mass", "Coulomb force")
    assert symbol("sigma_2") == ("σ", "2")
    assert symbol("J") == ("J", "")
    assert symbol("F_C^-") == ("F", "C⁻")


def test_counts_are_those_of_an_encoder() -> None:
    assert counts_of(log()) == 65536
    smooth = Record(log().time, {"position": np.sin(log().time)}, {"position": "rad"})
    assert counts_of(smooth) == 0


@pytest.mark.parametrize(
    ("step", "counts"), [(2.5e-6, 2513274), (5e-7, 12566371), (5e-3 / 65536, 0), (1e-5, 0), (1e-7, 0)]
)
def test_counts_of_a_linear_scale_are_those_of_2_pi_metres(step: float, counts: int) -> None:
    position = step * np.round(log()["position"] / COUNT)
    line = Record(log().time, {"position": position}, {"position": "m"})
    assert counts_of(line) == counts
    ahead = forward(identified(), [line], "model.toml")[0]
    assert (f"--counts-per-rev {counts}" in ahead.command) is (counts > 0)
    assert (f"counts_per_rev={counts}" in ahead.python) is ("of 2π m" in ahead.what) is (counts > 0)


def test_the_command_line_prints_the_same_in_short() -> None:
    found = identified()
    out = "\n".join(result_lines(found, answers_of(found, [log()], "model.toml"))).splitlines()
    assert next(line for line in out if line.startswith("fc ")).endswith("identified      Coulomb torque")
    trust = next(i for i, line in enumerate(out) if line.startswith("trust: "))
    assert "In gross sliding" in out[trust + 1]
    assert not [line for line in out if line.startswith("position_")]
    assert out[-2].startswith("next: stickslip recommend model.toml")


def test_python_is_told_what_to_do_next_in_python() -> None:
    found = identified()
    out = result_lines_in_python(found, answers_of(found, [log()], "model.toml"))
    assert out[-2].startswith("next: advice = ss.recommend(found, bandwidth=10, sample_time=")
    assert out[-1] == 'next: ss.export(advice, to="c99", folder="c")'
    with shown_on(Surface.COMMAND_LINE):
        shell = result_lines(found, answers_of(found, [log()], "model.toml"))[:-2]
    assert any("--per-direction" in line for line in shell)
    assert out[:-2] == [line.replace("--per-direction", "per_direction=True") for line in shell]


def test_a_constant_torque_may_be_friction_that_differs_by_direction() -> None:
    found = identified()
    (said,) = either_way(found)
    assert re.search(r"friction that is (19|20|21)[.0-9]* % of its level greater in one direction; ", said)
    assert render(said) in answers_of(found, [log()]).evidence
    small = [dataclasses.replace(e, value=0.01 * FC) if e.name == "offset" else e for e in found.estimates]
    assert either_way(dataclasses.replace(found, estimates=tuple(small))) == []


def test_numbers_with_one_verdict_share_a_line() -> None:
    why = "cannot be distinguished from 0"
    one = Estimate("fc", "N·m", "F_C", 0.3, 0.1, 0.0, 0.5, False, why)
    two = dataclasses.replace(one, name="sigma2")
    assert one_number_each([one]) == [f"fc not identified: {why}"]
    assert one_number_each([one, two]) == [f"fc, sigma2 not identified: {why}"]
    assert one_number_each([dataclasses.replace(e, verdict="") for e in (one, two)]) == [
        "fc, sigma2 not identified: not determined by the data"
    ]
