"""A recommendation for motor and load on a belt, as the log told them."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import stickslip as ss
from stickslip.core.errors import InputError
from stickslip.identification.identified_file import Identified, read_identified
from stickslip.recommendation.axes import plants_of
from support.belt import LOAD, MOTOR, coulomb, driven, followed

BELT = 16.0
WAYS: dict[str, Any] = {"sample_time": 1e-3, "amplitude": 3.0, "frequency": 0.5, "axes": 2, "confirm": 9}


@pytest.fixture(scope="module")
def told() -> ss.IdentificationResult:
    log = driven(BELT, coulomb)
    record = ss.Record(
        log.time,
        {"position": log.position, "motor_torque": log.drive},
        {"position": "rad", "motor_torque": "N·m"},
        {},
    )
    return ss.identify(record, law="coulomb")


@pytest.fixture(scope="module")
def belt(told: ss.IdentificationResult, tmp_path_factory: pytest.TempPathFactory) -> Identified:
    path = tmp_path_factory.mktemp("belt") / "model.toml"
    told.save(path)
    return read_identified(path)


def test_the_result_is_a_machine_with_motor_and_load(told: ss.IdentificationResult, tmp_path: Path) -> None:
    own = told.machine
    assert own.inertia == pytest.approx(told.parameters["inertia"].value)
    assert own.flexible is not None
    resonance = BELT / math.sqrt(MOTOR / (MOTOR + LOAD))
    assert own.flexible.modes[1] == pytest.approx(resonance, rel=0.05)
    own.write(tmp_path / "machine.toml")
    assert ss.load_machine(tmp_path / "machine.toml").flexible == own.flexible
    controller = ss.Controller(ss.place("PD", own.inertia, 4.0), sample_time=1e-3)
    slow = ss.Reference("sine", amplitude=1.0, frequency=0.5)
    run = ss.simulate(own, controller, slow, 1.0)
    rigid = ss.simulate(told.axis, controller, slow, 1.0)
    assert 0.0 < abs(run["position"][-1] - rigid["position"][-1]) < 0.1


def test_the_model_holds_motor_and_load(belt: Identified) -> None:
    train = belt.train
    assert train is not None
    assert train.antiresonance_interval[0] < BELT < train.antiresonance_interval[1]
    assert train.motor_share_interval[0] < MOTOR / (MOTOR + LOAD) < train.motor_share_interval[1]
    assert train.from_dict(train.as_dict()) == train
    axis = train.axis(1e-3, 0.02)
    assert axis.inertia == pytest.approx(1e-3)
    assert axis.modes[1] == pytest.approx(train.resonance, rel=1e-3)
    assert axis.antiresonance == pytest.approx(train.antiresonance, rel=1e-3)


def test_axes_are_drawn_with_motor_and_load_of_the_intervals(belt: Identified) -> None:
    assert belt.train is not None
    first, *drawn = plants_of(belt, MOTOR + LOAD, 20, 1)
    assert first.flexible is not None
    assert first.flexible.modes[1] == pytest.approx(belt.train.resonance, rel=1e-3)
    (low, high), (least, most) = belt.train.antiresonance_interval, belt.train.motor_share_interval
    trains = [p.flexible for p in drawn if p.flexible is not None]
    held = [f.antiresonance for f in trains]
    assert len(held) == 20
    assert low < min(held) < max(held) < high
    assert all(least < f.motor / f.inertia < most for f in trains)
    assert len({f.damping for f in trains}) == 20
    assert all(p.flexible is None for p in plants_of(replace(belt, train=None), MOTOR + LOAD, 3, 1))


@pytest.mark.parametrize("at_load", [True, False])
def test_what_is_promised_on_the_belt_holds_in_plain_steps(belt: Identified, at_load: bool) -> None:
    """At least the lower end: friction at the motor leaves less than friction at the load, which is simulated."""
    found = ss.recommend(belt, bandwidth=4.0, **WAYS).recommendation
    assert found.chosen is not None
    assert found.model is not None
    assert any(re.search("they resonate at 2[67]", n) and "friction at the load" in n for n in found.notes)
    own: Any = found.model.parameters
    setting, gains = found.chosen.setting, (found.gains["kp"], found.gains["kd"])

    def fed(speed: float, rise: float) -> float:
        friction = math.copysign(own.fc, speed) * (speed != 0.0) + own.sigma2 * speed
        return setting.gain * friction + setting.inertia_feedforward * rise

    alone = followed(BELT, gains, lambda speed, rise: 0.0, at_load)
    left = followed(BELT, gains, fed, at_load) / alone
    low, high = found.reduction
    assert low < 1.0 - left
    assert not at_load or 1.0 - left < high


def test_a_loop_that_the_belt_does_not_bear_gets_no_compensator(belt: Identified) -> None:
    """30 Hz on a belt that resonates at 26 Hz: on a rigid axis all is safe."""
    found = ss.recommend(belt, bandwidth=30.0, **WAYS).recommendation
    assert found.chosen is None
    assert "it diverges" in found.rings
    assert "inf" not in found.rings
    assert ss.recommend(replace(belt, train=None), bandwidth=30.0, **WAYS).recommendation.chosen is not None


def test_a_comparison_says_whether_the_spring_has_changed(belt: Identified) -> None:
    train = belt.train
    assert train is not None
    low, high = train.antiresonance_interval
    slack = replace(
        train, antiresonance=0.8 * train.antiresonance, antiresonance_interval=(0.8 * low, 0.8 * high)
    )
    notes = ss.compare(belt, replace(belt, train=slack)).notes
    (said,) = [note for note in notes if "antiresonance" in note]
    assert "-20 % [-27, -13]" in said
    assert "softer" in said
    (same,) = [note for note in ss.compare(belt, belt).notes if "antiresonance" in note]
    assert "no change of the spring shows" in same
    (one,) = [note for note in ss.compare(replace(belt, train=None), belt).notes if "spring" in note]
    assert one.startswith("Only model.toml tells")
    assert not [n for n in ss.compare(*[replace(belt, train=None)] * 2).notes if "spring" in n]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        ("motor_share = 2.0", "motor_share = 2"),
        ('motor_share = "half"', "cannot be read"),
        ("", "lacks 'motor_share'"),
    ],
)
def test_a_damaged_drivetrain_is_named(tmp_path: Path, damage: str, said: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        'law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n[axis]\ninertia = 4e-4\n[drivetrain]\n'
        "antiresonance = 11.0\nantiresonance_interval = [10.0, 12.0]\nmotor_share_interval = [0.2, 0.4]\n"
        + damage
    )
    with pytest.raises(InputError, match=said) as caught:
        read_identified(path)
    assert "m.toml" in str(caught.value)
