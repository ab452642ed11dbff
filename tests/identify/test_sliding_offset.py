"""The constant torque of levels in both directions: its interval holds, and nothing is seen where there is none."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError
from stickslip.identify.estimate import Identification
from stickslip.identify.model_file import model_data
from stickslip.identify.sliding.offset import constant_torque
from stickslip.identify.sliding.points import SlidingPoints

LAW = ss.Model("stribeck_plain", fs=0.335, fc=0.285, vs=0.05, delta_s=2.0, sigma2=0.018)
SPEEDS = np.array([0.1, 0.2, 0.5, 1.0, 2.0])


def steady(velocity: float) -> float:
    assert LAW.law.steady is not None
    return LAW.law.steady(velocity, LAW.parameters)


def levels(constant: float, noise: float, seed: int, *, std: bool = True) -> SlidingPoints:
    velocity = np.concatenate([SPEEDS, -SPEEDS])
    torque = np.array([steady(v) for v in velocity]) + constant
    torque += noise * np.random.default_rng(seed).standard_normal(velocity.size)
    return SlidingPoints(velocity, torque, np.full(velocity.size, noise) if std else None, absolute=std)


def record(constant: float) -> ss.Record:
    """Plateaus of 6 s in both directions with 10 mN·m of noise."""
    rng, dt, position = np.random.default_rng(7), 2e-3, 0.0
    rows: list[np.ndarray] = []
    for v in (v * side for v in SPEEDS for side in (1.0, -1.0)):
        k = np.arange(3000)
        torque = steady(v) + constant + 0.01 * rng.standard_normal(k.size)
        rows.append(np.column_stack([position + v * k * dt, torque]))
        position += v * k.size * dt
    table = np.concatenate(rows)
    return ss.Record(
        dt * np.arange(len(table)), {"position": table[:, 0], "motor_torque": table[:, 1]},
        {"position": "rad", "motor_torque": "N·m"},
    )  # fmt: skip


@pytest.mark.parametrize("std", [True, False])
def test_the_interval_holds(std: bool) -> None:
    found = [constant_torque(levels(0.04, 1e-3, seed, std=std)) for seed in range(100)]
    told = [e for e in found if e is not None]
    assert len(told) == 100
    assert sum(e.lower <= 0.04 <= e.upper for e in told) >= 90
    assert all(e.identified for e in told)


def test_without_a_constant_torque_none_is_seen() -> None:
    assert sum(constant_torque(levels(0.0, 1e-3, seed)) is not None for seed in range(100)) <= 10


def test_one_direction_or_two_speeds_tell_none() -> None:
    points = levels(0.04, 1e-3, 0)
    assert constant_torque(points.only(points.velocity > 0.0)) is None
    assert constant_torque(points.only(np.abs(points.velocity) < 0.3)) is None


def test_a_break_away_torque_is_no_level() -> None:
    points = levels(0.04, 1e-3, 0)
    still = SlidingPoints(np.zeros(2), np.array([0.5, -0.3]), np.full(2, 1e-3), absolute=True)
    alone, both = constant_torque(points), constant_torque(points + still)
    assert alone is not None
    assert both is not None
    assert both.value == pytest.approx(alone.value)


def test_what_is_known_badly_is_not_identified() -> None:
    (found,) = [e for e in [constant_torque(levels(0.3, 0.15, 3))] if e is not None]
    assert not found.identified
    assert "exceeds 10 % of friction" in found.verdict


def test_the_method_takes_it_off_and_writes_it_down() -> None:
    """Fc of the levels as they are would lie between both directions' anyway; the residual would not."""
    known, shifted = (
        ss.identify(record(c), method="sliding", law="coulomb").identification for c in (0.0, 0.04)
    )
    assert isinstance(shifted, Identification)
    assert "offset" not in {e.name for e in known.estimates}
    offset = shifted["offset"]
    assert offset.lower <= 0.04 <= offset.upper
    assert shifted["fc"].value == pytest.approx(known["fc"].value, rel=1e-3)
    assert shifted.misfit["rms_Nm"] == pytest.approx(known.misfit["rms_Nm"], rel=0.05)
    assert shifted.correlation.shape == (len(shifted.estimates),) * 2
    assert any("constant torque of 0.0" in note for note in shifted.notes)
    assert model_data(shifted, [])["axis"] == {"offset": pytest.approx(offset.value)}
    assert "axis" not in model_data(known, [])


def test_by_direction_a_law_takes_it_up() -> None:
    """Levels of its own for each direction differ by twice the constant torque, of which none is left."""
    found = ss.identify(record(0.04), method="sliding", law="coulomb", per_direction=True).identification
    assert "offset" not in {e.name for e in found.estimates}
    assert found["fc"].value - found["fc_negative"].value == pytest.approx(0.08, abs=2e-3)
    with pytest.raises(InputError, match="needs a law; name one"):
        ss.identify(record(0.04), method="sliding", per_direction=True)
