"""The one reason why nothing is recommended: the attribute that decides, its numbers, and what to do."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from test_inertia_alone import identified

from stickslip.control.linear import Cascade
from stickslip.core.errors import InputError
from stickslip.core.messages import render
from stickslip.identification.estimate import Estimate
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.candidates import Candidate, Setting
from stickslip.recommendation.motion_notes import by_attribute
from stickslip.recommendation.notes import notes_on
from stickslip.recommendation.recommend import recommend
from stickslip.recommendation.recommendation import Recommendation
from stickslip.recommendation.separation import separate
from stickslip.verbs.recommendation import RecommendationResult

INERTIA = 4e-4
P_PI = {
    "gains": Cascade(60.0, 0.2, 20.0),
    "amplitude": 0.3,
    "frequency": 2.0,
    "encoder_counts": 1e6,
    "delay": 0.0,
}
"""A cascade with reset times as in textbooks, on an axis with little friction and a fine encoder."""


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One gain, so that a recommendation is quick."""
    monkeypatch.setattr(recommending, "GAINS", (0.9,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def stribeck(vs_known: bool) -> Identified:
    """A Stribeck axis whose velocity vs the record determines or not."""

    def estimate(name: str, unit: str, value: float, spread: float, known: bool = True) -> Estimate:
        low, high = value * math.exp(-1.96 * spread), value * math.exp(1.96 * spread)
        return Estimate(name, unit, name, value, spread * value, low, high, known)

    own = (
        estimate("inertia", "kg·m²", INERTIA, 0.01), estimate("fc", "N·m", 0.02, 0.01),
        estimate("vs", "rad/s", 0.1, 0.01 if vs_known else 1.0, vs_known),
        estimate("sigma2", "N·m·s/rad", 1e-4, 0.02),
    )  # fmt: skip
    law = Model("stribeck", k=1e3, fs=0.022, fc=0.02, vs=0.1, sigma2=1e-4)
    return Identified(Path("m.toml"), law, own, np.eye(4), {"inertia": INERTIA})


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("vs_known", [False, True])
def test_a_cascade_is_refused_for_its_reference_velocity_and_not_for_what_the_record_leaves_open(
    vs_known: bool,
) -> None:
    advice = recommend(stribeck(vs_known), Drive(**P_PI), axes=2, confirm=20)
    assert advice.chosen is None
    said = [note for note in advice.notes if note.startswith("No compensator is recommended: ")]
    assert said == [f"No compensator is recommended: {advice.why_none}."]
    found = re.search(
        r"is refused on (\d+) of 23 axes: .*they are (\d+) of the (\d+) axes whose drive forms its reference velocity "
        r"at the instant of the sample, and 0 of the \d+ others",
        advice.why_none,
    )
    assert found
    assert found[1] == found[2] == found[3]
    assert 'reference_velocity="difference"' in advice.why_none
    assert not any("determine" in note for note in advice.notes)
    with pytest.raises(InputError, match=r"^no compensator is recommended: the closest candidate"):
        _ = RecommendationResult(advice, stribeck(vs_known)).model


@pytest.mark.usefixtures("few")
def test_what_the_reason_advises_leads_to_a_recommendation() -> None:
    known = recommend(stribeck(False), Drive(**P_PI, reference_velocity="difference"), axes=2, confirm=4)
    assert known.chosen is not None
    assert known.chosen.setting.compensates
    assert known.why_none == ""


@pytest.mark.parametrize(
    ("refused", "name", "above"),
    [
        (lambda p: p.backward, "reference velocity", True),
        (lambda p: p.delay > 0.4, "delay", True),
        (lambda p: p.inertia < 0.95 * INERTIA, "inertia", False),
        (lambda p: p.friction.parameters.fc > 0.1, "fc", True),
    ],
)
def test_the_sampled_attribute_that_separates_the_refused_axes_is_named(refused, name, above) -> None:
    found = identified(0.1, 0.2)
    plants = list(plants_of(found, INERTIA, 45, 0))[1:]
    bad = [refused(p) for p in plants]
    split = separate(found, plants, bad)
    assert split is not None
    assert (split.attribute.name, split.above) == (name, above)
    assert split.refused == (sum(bad), 0)
    assert split.remedy


def test_two_axes_are_too_few_to_name_an_attribute_and_four_are_enough() -> None:
    found = identified(0.1, 0.2)
    plants = sorted(list(plants_of(found, INERTIA, 20, 0))[1:], key=lambda p: p.inertia)
    few, enough = ([i < count for i in range(20)] for count in (2, 4))
    assert separate(found, plants, few) is None
    split = separate(found, plants, enough)
    assert split is not None
    assert split.words.startswith("they are 4 of the 4 axes with inertia below ")


@pytest.mark.parametrize("seed", range(5))
def test_chance_names_no_attribute(seed: int) -> None:
    found = identified(0.1, 0.2)
    plants = list(plants_of(found, INERTIA, 45, 0))[1:]
    bad = np.random.default_rng(seed).uniform(size=len(plants)) < 0.3
    assert separate(found, plants, bad.tolist()) is None
    assert separate(found, plants, [False] * len(plants)) is None
    assert separate(found, plants, [True] * len(plants)) is None


@pytest.mark.usefixtures("few")
def test_what_fails_on_the_best_estimate_is_said_of_it_with_its_number() -> None:
    """Nothing that another record determines would change it."""
    drive = Drive(20.0, amplitude=0.5, frequency=2.0, torque_limit=3.0, encoder_counts=4096.0)
    advice = recommend(identified(0.004, 0.005), drive, axes=1, confirm=2, feed_inertia=False)
    assert advice.chosen is None
    assert re.search(r"the closest candidate \(.*\) is refused .*% of the error left", advice.why_none)
    assert "determine" not in advice.why_none
    (said,) = [note for note in advice.notes if note.startswith("No compensator is recommended")]
    assert said.count("No compensator") == 1


def test_the_error_left_names_the_attribute_that_it_depends_on() -> None:
    found = identified(0.1, 0.02)
    plants = list(plants_of(found, INERTIA, 39, 0))
    errors = (0.1, *(0.1 + 0.001 * i if p.backward else 0.4 for i, p in enumerate(plants[1:])))
    chosen = Candidate(Setting("coulomb", "feedforward", 0.8), errors, ())
    (said,) = by_attribute(found, chosen, plants)
    assert said.startswith("The error left depends most on reference velocity: 40 % on half")
    assert 'reference_velocity="difference"' in render(said)
    alike = Candidate(chosen.setting, (0.1,) * len(plants), ())
    assert not list(by_attribute(found, alike, plants))
    assert not list(by_attribute(found, None, plants))


def test_a_feedback_that_is_not_safe_is_named_by_its_law() -> None:
    chosen = Candidate(Setting("coulomb", "feedback", 1.0), (0.2, 0.3), ())
    other = Candidate(Setting("lugre", "feedback", 1.0), (0.2,), ("limit cycle at rest",))
    result = Recommendation(
        chosen, Model("coulomb", fc=0.1), {}, 0.1, math.nan, math.inf, (chosen, other), 2, drive=Drive(amplitude=1.0)
    )  # fmt: skip
    (said,) = [note for note in notes_on(identified(0.1, 0.02), result) if "at gain 1" in note]
    assert said == "Feedback at gain 1 is not safe for law 'lugre' (limit cycle at rest)."
