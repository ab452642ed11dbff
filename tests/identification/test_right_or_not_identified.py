"""Axes and records of many kinds: every number is right or not identified, never identified and wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identification.axis import FALLS, identify_axis
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import Experiment
from stickslip.machines.servo import ServoAxis
from support.analytic_records import FC_BACK, TRUTH, record

AXIS = ServoAxis(drive_side="load")
PENDULUM = replace(AXIS, gravity="pendulum")


def assert_right(found: Identification, truth: Mapping[str, float], identified: Sequence[str] = ()) -> None:
    """No identified interval is without the truth; those named are identified."""
    by_name = {e.name: e for e in found.estimates}
    wrong = {
        n: (by_name[n].lower, truth[n], by_name[n].upper) for n in truth
        if n in by_name and by_name[n].identified and not by_name[n].lower <= truth[n] <= by_name[n].upper
    }  # fmt: skip
    assert wrong == {}
    assert [n for n in identified if not by_name[n].identified] == []


ALL = tuple(TRUTH)


def rounded(experiment: Experiment, count: float = 0.0, torque: float = 0.0) -> Experiment:
    """Return the record with position and torque in steps of these sizes."""
    position, drive = experiment.position, experiment.signal()
    return replace(
        experiment,
        position=count * np.round(position / count) if count else position,
        drive=torque * np.round(drive / torque) if torque else drive,
    )


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0], ids=["none", "less than friction", "more than friction"])
def test_a_constant_weight_is_the_constant_torque(weight: float) -> None:
    found = identify_axis([record(offset=weight)], AXIS, ["coulomb"])
    assert_right(found, TRUTH | {"offset": weight}, ("inertia", "fc", "sigma2"))


def test_gravity_of_a_pendulum_is_separated_from_friction() -> None:
    swung = record(lambda t, q, v, a: 0.5 * np.sin(q - 0.2), offset=0.0)
    found = identify_axis([swung], PENDULUM, ["coulomb"], frozen=["offset"], values={"offset": 0.0})
    truth = TRUTH | {"offset": 0.0, "gravity": 0.5, "gravity_angle": 0.2}
    assert_right(found, truth, ("inertia", "fc", "gravity", "gravity_angle"))


def test_friction_per_direction_is_right() -> None:
    """The constant torque is the half difference of both levels."""
    apart = record(lambda t, q, v, a: np.where(v < 0.0, TRUTH["fc"] - FC_BACK, 0.0), offset=0.0)
    found = identify_axis([apart], AXIS, ["coulomb"], per_direction=True)
    truth = {
        "inertia": TRUTH["inertia"], "fc": TRUTH["fc"], "fc_negative": FC_BACK,
        "sigma2": TRUTH["sigma2"], "sigma2_negative": TRUTH["sigma2"],
    }  # fmt: skip
    assert_right(found, truth, ("inertia", "fc", "fc_negative"))
    assert "offset" not in {e.name for e in found.estimates}


def test_a_linear_axis_is_right() -> None:
    turning = record()
    metres = replace(turning, position=0.1 * turning.position, drive=10.0 * turning.signal())
    found = identify_axis([metres], ServoAxis(motion="linear"), ["coulomb"])
    truth = {"inertia": 100.0 * TRUTH["inertia"], "fc": 10.0 * TRUTH["fc"], "sigma2": 100.0 * TRUTH["sigma2"]}
    assert_right(found, truth, tuple(truth))
    assert {e.name: e.unit for e in found.estimates}["inertia"] == "kg"


@pytest.mark.parametrize("name", ALL)
def test_beside_a_known_value_the_others_are_right(name: str) -> None:
    found = identify_axis([record()], AXIS, ["coulomb"], frozen=(name,), values={name: TRUTH[name]})
    assert {e.name for e in found.estimates} == {*ALL} - {name}
    assert_right(found, TRUTH, [n for n in ALL if n != name])


def test_records_with_a_constant_torque_each_share_inertia_and_friction() -> None:
    several = [record(seed=k, seconds=6.0, offset=offset) for k, offset in enumerate((0.05, -0.1, 0.2))]
    found = identify_axis(several, AXIS, ["coulomb"])
    assert_right(found, {n: TRUTH[n] for n in ("inertia", "fc", "sigma2")}, ("inertia",))


RECORDS: Mapping[str, Any] = {
    "irregular times": lambda: record(
        time=np.cumsum(1e-3 * (1.0 + 0.4 * np.random.default_rng(5).uniform(-1.0, 1.0, 12_000)))
    ),
    "times rounded to microseconds": lambda: record(
        time=471.74491 + 1e-3 * np.arange(12_000) - 1e-6 * (np.arange(12_000) % 2)
    ),
    "encoder of 1024 counts": lambda: rounded(record(), count=2.0 * math.pi / 1024),
    "torque in steps of 7 % of friction": lambda: rounded(record(), torque=0.02),
    "both coarse": lambda: rounded(record(), count=2.0 * math.pi / 1024, torque=0.02),
    "much noise": lambda: record(noise=0.1),
    "late torque": lambda: record(delay=2.6e-3),
}  # fmt: skip


@pytest.mark.parametrize("kind", RECORDS)
def test_records_of_poor_quality_are_right_or_not_identified(kind: str) -> None:
    found = identify_axis([RECORDS[kind]()], AXIS, ["coulomb"])
    assert_right(found, TRUTH, ("fc",) if kind != "much noise" else ())


EFFECTS: Mapping[str, Any] = {
    "friction with load": lambda t, q, v, a: 0.3 * np.sign(v) * np.abs(TRUTH["inertia"] * a + TRUTH["offset"]),
    "torque constant that falls": lambda t, q, v, a: 0.1 * (
        TRUTH["inertia"] * a + TRUTH["fc"] * np.sign(v) + TRUTH["sigma2"] * v + TRUTH["offset"]
    ) ** 3,
    "drag": lambda t, q, v, a: 0.05 * v * np.abs(v) / 7.3,
    "tight spot": lambda t, q, v, a: 0.06 * np.sign(v) * np.exp(-((q - 1.0) ** 2) / 0.1),
    "inertia while braking": lambda t, q, v, a: 0.1 * TRUTH["inertia"] * a * (a * v < 0.0),
}  # fmt: skip


@pytest.mark.parametrize(
    "effect",
    EFFECTS,
)
def test_an_effect_that_the_model_lacks_makes_no_identified_number_wrong(effect: str) -> None:
    found = identify_axis([record(EFFECTS[effect])], AXIS, ["coulomb"])
    known = ("sigma2",) if effect != "drag" else ()
    assert_right(found, {n: TRUTH[n] for n in ("fc", *known)})


def test_a_fall_of_friction_is_seen_where_there_is_one_and_made_up_nowhere() -> None:
    plain = identify_axis([record()], AXIS, ["coulomb"]).details["sliding"]
    assert plain.falls < FALLS
    fall = record(lambda t, q, v, a: 0.15 * np.sign(v) * np.exp(-((v / 0.4) ** 2)))
    found = identify_axis([fall], AXIS, ["coulomb"]).details["sliding"]
    assert found.falls >= FALLS
    low, high = found.interval("vs")
    assert low <= 0.4 <= high
    low, high = found.interval("fc")
    assert low <= TRUTH["fc"] <= high
