"""What the inertia feedforward gives without friction compensation: a row of its own, and what friction adds to it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.recommended import read_recommended
from stickslip.identification.estimate import Estimate
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.candidates import Candidate, Setting
from stickslip.recommendation.recommend import adds, recommend
from stickslip.verbs.recommendation import RecommendationResult

INERTIA = 4e-4
FAST = Drive(20.0, amplitude=0.5, frequency=5.0, torque_limit=3.0)
FED = Setting("coulomb", "feedforward", 0.0, inertia_feedforward=INERTIA)
FRICTION = Setting("coulomb", "feedforward", 0.8, inertia_feedforward=INERTIA)


def identified(friction: float, spread: float) -> Identified:
    """A model of this Coulomb torque, N·m, whose inertia has that standard deviation of its logarithm."""

    def estimate(name: str, unit: str, value: float, spread: float) -> Estimate:
        low, high = value * math.exp(-1.96 * spread), value * math.exp(1.96 * spread)
        return Estimate(name, unit, name, value, spread * value, low, high, True)

    estimates = (
        estimate("fc", "N·m", friction, 0.02), estimate("sigma2", "N·m·s/rad", 1e-4, 0.05),
        estimate("inertia", "kg·m²", INERTIA, spread),
    )  # fmt: skip
    model = Model("coulomb", fc=friction, sigma2=1e-4)
    return Identified(Path("m.toml"), model, estimates, np.eye(3), {"inertia": INERTIA})


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One gain, so that a recommendation is quick."""
    monkeypatch.setattr(recommending, "GAINS", (0.8,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


@pytest.mark.usefixtures("few")
def test_where_friction_compensation_adds_nothing_the_inertia_feedforward_is_recommended_alone(
    tmp_path: Path,
) -> None:
    """A drive engineer was told a feedforward of friction takes 86 %: the inertia alone took 88 %."""
    found = identified(0.004, 0.1)
    advice = RecommendationResult(recommend(found, FAST, axes=2, confirm=6), found)
    assert advice.chosen is not None
    assert not advice.chosen.setting.compensates
    assert advice.recommendation.inertia_alone == advice.chosen
    assert advice.confidence == pytest.approx(5.0 / 7.0)
    said = advice.details
    assert "switch on:         inertia feedforward alone, without friction compensation\n" in said
    assert "inertia alone   feedforward      0 " in said
    assert (
        "No friction compensation beyond the inertia feedforward is recommended: on the sampled axes" in said
    )
    assert "gain margin" not in said
    assert "inertia feedforward alone" in repr(advice)
    file = advice.save(tmp_path / "recommended.toml")
    again = read_recommended(file)
    assert (again.gain, again.inertia_feedforward) == (0.0, pytest.approx(INERTIA))
    assert again.controller(Model.from_file(str(file))).as_dict() == advice.controller.as_dict()
    exported = ss.export(file, to="c99", compensator="recommended", name="a")
    assert any("gives no friction torque (gain 0), " in note for note in exported.notes)


@pytest.mark.usefixtures("few")
def test_what_friction_compensation_adds_to_the_inertia_feedforward_is_said() -> None:
    found = identified(0.1, 0.005)
    advice = RecommendationResult(recommend(found, FAST, axes=1, confirm=4), found)
    assert advice.chosen is not None
    assert advice.chosen.setting.compensates
    alone = advice.recommendation.inertia_alone
    assert alone is not None
    assert len(alone.errors) == len(advice.chosen.errors)
    given, beyond = (
        round(100.0 * (1.0 - e)) for e in (alone.errors[0], advice.chosen.errors[0] / alone.errors[0])
    )
    (line,) = [line for line in advice.details.splitlines() if line.startswith("of this:")]
    assert f"inertia feedforward alone gives {given} % on the best estimate" in line
    assert f"friction compensation takes {beyond} %" in line
    assert "not surely" not in line
    assert advice.as_dict()["inertia_alone"]["errors"] == list(alone.errors)


@pytest.mark.usefixtures("few")
def test_without_inertia_feedforward_there_is_no_such_row() -> None:
    advice = recommend(identified(0.1, 0.005), FAST, axes=1, confirm=2, feed_inertia=False)
    assert advice.inertia_alone is None
    assert all(c.setting.compensates for c in advice.candidates)


@pytest.mark.parametrize(
    ("friction", "alone", "better"),
    [
        ((0.1, 0.1, 0.1), (0.2, 0.2, 0.2), True), ((0.1, 0.19, 0.1), (0.2, 0.2, 0.2), True),
        ((0.1, 0.1, 0.5), (0.2, 0.2, 0.2), False), ((0.19, 0.19, 0.19), (0.2, 0.2, 0.2), False),
    ],
)  # fmt: skip
def test_friction_compensation_adds_something_by_more_than_a_tenth(
    friction: tuple[float, ...], alone: tuple[float, ...], better: bool
) -> None:
    assert adds(Candidate(FRICTION, friction, ()), Candidate(FED, alone, ())) is better


def test_beside_control_laws_the_inertia_feedforward_alone_holds_no_friction_law() -> None:
    loop = Controller(loop=ControlBlock("pd", kp=6.0, kd=0.1), sample_time=1e-3)
    made = FED.on(loop, Model("coulomb", fc=0.1, sigma2=1e-4))
    assert [b.law.name for b in made.blocks.values()][1:] == ["inertia_feedforward", "pd"]
