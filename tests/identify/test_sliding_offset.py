"""A constant torque (weight, offset) beside the sliding curve: fitted with it, and never taken for friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError
from stickslip.identification.model_file import model_data
from stickslip.identification.steady_friction.curve import identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints

LAW = ss.Model("stribeck_plain", fs=0.335, fc=0.285, vs=0.05, delta_s=2.0, sigma2=0.018)
COULOMB = ss.Model("coulomb", fc=0.2, sigma2=0.01)
SPEEDS = np.array([0.1, 0.2, 0.5, 1.0, 2.0])


def steady(velocity: float) -> float:
    assert LAW.law.steady is not None
    return LAW.law.steady(velocity, LAW.parameters)


def record(constant: float, ways: tuple[float, ...] = (1.0, -1.0)) -> ss.Record:
    """Plateaus of 6 s with 10 mN·m of noise."""
    rng, dt, position = np.random.default_rng(7), 2e-3, 0.0
    rows: list[np.ndarray] = []
    for v in (v * side for v in SPEEDS for side in ways):
        k = np.arange(3000)
        torque = steady(v) + constant + 0.01 * rng.standard_normal(k.size)
        rows.append(np.column_stack([position + v * k * dt, torque]))
        position += v * k.size * dt
    table = np.concatenate(rows)
    return ss.Record(
        dt * np.arange(len(table)), {"position": table[:, 0], "motor_torque": table[:, 1]},
        {"position": "rad", "motor_torque": "N·m"},
    )  # fmt: skip


def points(weight: float, seed: int, speeds: tuple[float, ...], *, std: bool = True) -> SlidingPoints:
    """Coulomb friction of 0.08 N·m and a weight on a drum, 1 mN·m of noise."""
    velocity = np.array(speeds)
    torque = 0.08 * np.sign(velocity) + 2e-4 * velocity + weight
    torque += 1e-3 * np.random.default_rng(seed).standard_normal(velocity.size)
    own = np.full(velocity.size, 1e-3) if std else None
    return SlidingPoints(velocity, torque, own, absolute=std, offset=None)


BOTH_WAYS = (6.0, 12.0, 24.0, -6.0, -12.0, -24.0)


@pytest.mark.parametrize("std", [True, False])
def test_the_intervals_contain_friction_and_weight(std: bool) -> None:
    held = {"fc": 0, "offset": 0}
    for seed in range(20):
        found = identify_sliding(points(0.19, seed, BOTH_WAYS, std=std), COULOMB, starts=4)
        for name, true in (("fc", 0.08), ("offset", 0.19)):
            held[name] += found[name].lower <= true <= found[name].upper
            assert found[name].identified
    assert min(held.values()) >= 17


def test_without_a_weight_the_offset_contains_zero() -> None:
    none = [identify_sliding(points(0.0, seed, BOTH_WAYS), COULOMB, starts=4)["offset"] for seed in range(20)]
    assert sum(e.lower <= 0.0 <= e.upper for e in none) >= 17


def test_two_speeds_each_way_determine_the_weight() -> None:
    found = identify_sliding(points(0.19, 1, (12.0, 24.0, -12.0, -24.0)), COULOMB)
    assert found["fc"].value == pytest.approx(0.08, abs=3e-3)
    assert found["offset"].value == pytest.approx(0.19, abs=3e-3)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_one_direction_determines_the_sum_only(way: float) -> None:
    found = identify_sliding(points(0.19, 2, tuple(way * v for v in (6.0, 12.0, 18.0, 24.0))), COULOMB)
    assert not found["fc"].identified
    assert not found["offset"].identified
    assert found["sigma2"].value == pytest.approx(2e-4, abs=2e-4)
    assert f"only fc {'+' if way > 0.0 else '-'} offset" in found["fc"].verdict
    assert 'frozen=["offset"], values={"offset": 0}' in found["fc"].verdict
    assert found["fc"].upper == np.inf


def test_one_direction_determines_how_far_break_away_exceeds_sliding() -> None:
    """Both levels contain the constant torque; where the curve bends they do not matter."""
    velocity = np.geomspace(0.005, 2.0, 15)
    torque = np.array([steady(v) for v in velocity]) + 0.1
    some = SlidingPoints(velocity, torque, np.full(15, 1e-4), absolute=True, offset=None)
    found = identify_sliding(some, LAW)
    assert {e.name for e in found.estimates if not e.identified} >= {"fs", "fc", "offset"}
    assert found["vs"].identified
    assert found["vs"].value == pytest.approx(0.05, rel=0.02)


def test_a_law_without_a_level_does_not_turn_friction_into_a_weight() -> None:
    found = identify_sliding(points(0.19, 2, (6.0, 12.0, 18.0, 24.0)), ss.Model("viscous", sigma2=0.01))
    assert not found["offset"].identified


def test_the_method_fits_it_and_writes_it_down() -> None:
    known, shifted = (
        ss.identify(record(c), method="sliding", law="coulomb").identification for c in (0.0, 0.04)
    )
    offset = shifted["offset"]
    assert offset.identified
    assert offset.lower <= 0.04 <= offset.upper
    assert shifted["fc"].value == pytest.approx(known["fc"].value, rel=1e-3)
    assert shifted.misfit["rms_Nm"] == pytest.approx(known.misfit["rms_Nm"], rel=0.05)
    assert shifted.correlation.shape == (len(shifted.estimates),) * 2
    assert any("constant torque of 0.04 N·m acts" in note for note in shifted.notes)
    assert model_data(shifted, [])["axis"] == {"offset": pytest.approx(offset.value)}
    assert "axis" not in model_data(known, [])


def test_one_direction_gives_a_model_that_nothing_is_built_on(tmp_path: Path) -> None:
    found = ss.identify(record(0.2, (1.0,)), method="sliding", law="coulomb")
    assert not found["fc"].identified
    file = found.save(tmp_path)
    with pytest.raises(InputError, match="does not determine the friction level"):
        ss.recommend(file, inertia=1e-3, bandwidth=5.0, sample_time=1e-3)
    assert not any("export" in step.command or "recommend" in step.command for step in found.answers.steps)


def test_a_known_constant_torque_determines_friction_in_one_direction() -> None:
    one_way = record(0.2, (1.0,))
    found = ss.identify(one_way, method="sliding", law="coulomb", frozen=["offset"], values={"offset": 0.2})
    assert found["fc"].identified
    assert found["fc"].value == pytest.approx(0.29, abs=0.02)
    assert dict(found.given) == {"offset": 0.2}
    with pytest.raises(InputError, match=r'offset cannot be held without a value; give values=\{"offset"'):
        ss.identify(one_way, method="sliding", law="coulomb", frozen=["offset"])


def test_few_points_are_fitted_by_coulomb_friction() -> None:
    """A curve without a level, the only one left to compare, took friction for a constant torque."""
    still = record(0.2, (1.0, -1.0))
    rows = still.time < 24.0  # two speeds each way
    few = ss.Record(still.time[rows], {k: v[rows] for k, v in still.channels.items()}, still.units)
    found = ss.identify(few, method="sliding")
    assert found.model.law.name == "coulomb"
    assert any("too few to choose" in note for note in found.notes)


def test_by_direction_a_law_takes_it_up() -> None:
    """Levels of its own for each direction differ by twice the constant torque, which is held at 0."""
    found = ss.identify(record(0.04), method="sliding", law="coulomb", per_direction=True)
    assert "offset" not in found.parameters
    assert found["fc"].value - found["fc_negative"].value == pytest.approx(0.08, abs=2e-3)
    assert any("holds offset at 0" in note for note in found.notes)
    with pytest.raises(InputError, match="both directions, and the record has one"):
        ss.identify(record(0.04, (1.0,)), method="sliding", law="coulomb", per_direction=True)


def test_a_criterion_that_too_few_points_do_not_have_is_left_out() -> None:
    found = identify_sliding(points(0.0, 1, (6.0, 12.0, -6.0, -12.0), std=False), COULOMB, starts=4)
    assert "aicc" not in found.misfit
    assert np.isfinite(list(found.misfit.values())).all()


def test_a_curve_is_chosen_for_each_direction() -> None:
    """Without a law, --per-direction was refused: no curve of both directions for the methods that need one."""
    both = ss.Model("stribeck_plain", {"symmetry": "asymmetric"}, **LAW.parameters._asdict(), fs_negative=0.30,
                    fc_negative=0.24, vs_negative=0.08, delta_s_negative=2.0, sigma2_negative=0.03)  # fmt: skip
    speeds = np.geomspace(0.01, 2.0, 12)
    velocity = np.concatenate([speeds, -speeds])
    table = {"velocity": velocity, "motor_torque": both.sliding_torque(velocity)}
    found = ss.identify(table, method="sliding", per_direction=True, noise=1e-4).identification
    assert found.model is not None
    assert found.model.law.option_of("symmetry") == "asymmetric"
    assert found.details["chosen"] == "Stribeck (eq. 2.6)"
    for name, value in both.parameters._asdict().items():
        assert found[name].value == pytest.approx(value, rel=1e-3)
