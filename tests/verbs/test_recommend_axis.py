"""`recommend` for an axis or a law that nobody identified, along a reference: does my loop hunt, and what helps?"""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError

LAW = {"sigma0": 3.5e3, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
AXIS = ss.RigidAxis(4e-4, ss.Model("lugre", **LAW))
SLOW = ss.Reference("sine", amplitude=0.01, frequency=0.4)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One gain, so that a recommendation is quick."""
    for name, values in (("GAINS", (0.8,)), ("LEADS", (0.0,)), ("BEYOND", ())):
        monkeypatch.setattr(f"stickslip.recommendation.recommend.{name}", values)


@pytest.mark.usefixtures("few")
def test_an_axis_and_a_reference_are_simulated_as_they_are() -> None:
    advice = ss.recommend(AXIS, bandwidth=20.0, motion=SLOW)
    assert advice.chosen is not None
    assert advice.confidence == 0.0
    assert "no interval" in str(advice)
    (best,) = advice.recommendation.comparisons
    assert best.before.reference.max() == pytest.approx(0.02, rel=1e-6)
    same = ss.recommend(AXIS.friction, inertia=AXIS.inertia, bandwidth=20.0, motion=SLOW, duration=5.0)
    assert same.as_dict()["candidates"] == advice.as_dict()["candidates"]


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("ki", [5.0, 20.0])
def test_an_integral_that_takes_its_time_to_break_away_is_found_to_hunt(ki: float) -> None:
    """A weak integral takes longer for a cycle than the 20 s for which others are watched; 600 s show both."""
    gains = {"kp": 2.0, "ki": ki, "kd": 0.05, "kr": 0.05, "limit": 3.0}
    advice = ss.recommend(AXIS, loop=gains, sample_time=1e-3, motion=SLOW)
    loop = ss.Controller(advice.loop.gains, sample_time=1e-3, torque_limit=3.0)
    held = ss.Reference.table([0.0, 0.5, 600.0], [0.0, 0.02, 0.02])
    late = ss.simulate(AXIS, loop, held, 600.0, output=0.05)["position"][6000:]
    assert np.ptp(late) > 1e-3
    assert "hunts against the friction at rest" in advice.recommendation.rings
    assert advice.recommendation.hunting == "the loop alone hunts on the best estimate"


@pytest.mark.usefixtures("few")
def test_a_loop_without_an_integral_cannot_hunt() -> None:
    advice = ss.recommend(AXIS, bandwidth=20.0, motion=SLOW)
    assert "the loop alone has no integral part and cannot hunt" in str(advice)


@pytest.mark.parametrize(
    ("axis", "given", "words"),
    [
        (AXIS.friction, {"motion": SLOW}, "a Model has no inertia; give inertia in kg·m²"),
        (AXIS, {}, r'give the motion, such as motion=Reference\("sine"'),
        (AXIS, {"motion": SLOW, "duration": -1.0}, "duration = -1 s must be greater than 0"),
        (AXIS, {"duration": 2.0}, "duration = 2 s is that of a Reference"),
        (AXIS, {"motion": ss.Reference("ramp", velocity=0.1)}, "neither repeats nor comes to rest; give its duration"),
        (ss.RigidAxis(4e-4, AXIS.friction, load=2.0), {"motion": SLOW}, "load = 2 .* holds at load 1"),
        (5, {"motion": SLOW}, "recommend: model = 5 must be"),
    ],
)  # fmt: skip
def test_what_is_missing_is_named(axis: object, given: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        ss.recommend(axis, **given)
