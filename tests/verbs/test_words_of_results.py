"""What a result says in Python names arguments; what to do first is said first."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from support.written_log import written

OPTION = re.compile(r"--[a-z]")
WEIGHT, FC = 0.4, 0.1


@pytest.fixture(scope="module")
def joint() -> dict[str, np.ndarray]:
    """An axis that swings with a weight; it hangs at 0."""
    t = np.arange(6000) * 1e-3
    w = 2.0 * np.pi * np.array([0.3, 0.7])
    q = 1.5 * np.sin(w[0] * t) + 0.6 * np.sin(w[1] * t)
    v = 1.5 * w[0] * np.cos(w[0] * t) + 0.6 * w[1] * np.cos(w[1] * t)
    a = -1.5 * w[0] ** 2 * np.sin(w[0] * t) - 0.6 * w[1] ** 2 * np.sin(w[1] * t)
    torque = 0.02 * a + FC * np.sign(v) + 0.02 * v + WEIGHT * np.sin(q)
    noise = np.random.default_rng(3).normal(0.0, 5e-3, t.size)
    return {"t": t, "position": np.round(q, 5), "torque": torque + noise}


@pytest.fixture(scope="module")
def unweighed(joint: dict[str, np.ndarray]) -> ss.IdentificationResult:
    return ss.identify(**joint, law="coulomb")


def test_gravity_that_nobody_named_is_the_first_thing_to_do(
    joint: dict[str, np.ndarray], unweighed: ss.IdentificationResult
) -> None:
    """Only the doctor said it; the result listed records to make."""
    steps = [line for line in str(unweighed).splitlines() if line.startswith(("next", "measure next"))]
    assert "pendulum=True" in steps[0]
    assert "pendulum=True" not in str(ss.identify(**joint, law="coulomb", pendulum=True))


def test_the_command_names_gravity_first_too(
    joint: dict[str, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(joint, tmp_path)
    main(["identify", str(file), "--law", "coulomb", "--no-report", "--out", str(tmp_path / "m.toml")])
    steps = [x for x in capsys.readouterr().out.splitlines() if x.startswith(("next", "measure next"))]
    assert "--pendulum" in steps[0]
    assert file.name in steps[0]


def test_a_torque_once_a_turn_is_a_weight_whatever_the_doctor_says(joint: dict[str, np.ndarray]) -> None:
    """Where it was found among the torques over the position and is no small part of friction."""
    level = {**joint, "torque": joint["torque"] - WEIGHT * np.sin(joint["position"])}
    made = ss.identify(**level, law="coulomb")
    found, source = made.identification, made.sources[0]
    sliding = found.details["sliding"]

    def first(size: float) -> str:
        details = {**found.details, "sliding": replace(sliding, waves=((1.0, size),))}
        quiet = replace(found, details=details, findings=())
        said = replace(made, identification=quiet, sources=(replace(source, findings=()),))
        return said.answers.steps[0].python

    assert "pendulum=True" in first(0.5 * sliding.friction)
    assert "pendulum=True" not in first(0.1 * sliding.friction)


def test_results_name_arguments_and_no_options(
    joint: dict[str, np.ndarray], unweighed: ss.IdentificationResult
) -> None:
    """Their parts named options where what was printed of them did not."""
    said = [unweighed.verdict, *unweighed.evidence, *unweighed.notes, *(f.line() for f in unweighed.findings)]
    said += [str(unweighed), str(unweighed.as_dict())]
    degrees = ss.doctor({"time": joint["t"], "q": np.degrees(joint["position"]), "tau": joint["torque"]})
    said += [f.line() for f in degrees.findings]
    backwards = ss.doctor(t=joint["t"][::-1], position=joint["position"], torque=joint["torque"])
    said += [f.remedy for f in backwards.findings]
    assert not [text for text in said if OPTION.search(re.sub("`[^`]*`", "", text))]
    assert any("pendulum=True" in f.remedy for f in unweighed.findings)
    assert any("sample_time" in f.remedy for f in backwards.findings)


def test_a_verdict_names_the_argument(unweighed: ss.IdentificationResult) -> None:
    said = f"With care: plain least squares ({name_option('inverse', True)}) explains more."
    answers = replace(unweighed.answers, trust=said)
    found = replace(unweighed)
    vars(found)["answers"] = answers
    assert found.verdict == "With care: plain least squares (inverse=True) explains more."
    assert found.as_dict()["trust"] == found.verdict


def test_what_is_found_is_told_by_the_command_in_its_words(
    joint: dict[str, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(joint, tmp_path)
    main(["doctor", str(file)])
    assert "--pendulum" in capsys.readouterr().out


def test_a_finding_stays_what_it_is(unweighed: ss.IdentificationResult) -> None:
    assert all(isinstance(f, Finding) for f in unweighed.findings)
    assert [f.code for f in unweighed.findings] == [f.code for f in unweighed.identification.findings]
