"""Break-away torque from ramps."""

import numpy as np
import pytest

from stickslip import Model, Record
from stickslip.errors import InputError
from stickslip.identify.breakaway import find_breaks, identify_breakaway
from stickslip.simulation.driven import Drive, Loop, Mechanics, drive_axis


def ramps(rates: list[float], rng: np.random.Generator, per_decade: float = 0.0, held: float = 0.0) -> Record:
    """A contact that breaks at 0.3 + 0.02 sin(angle) N·m, other in the negative direction, ten degrees apart; the
    torque rises from `held`."""
    step = 2e-3
    position, torque = [], []
    angle = 0.0
    for k, rate in enumerate(rates):
        side = 1.0 if k % 4 < 2 else -1.0
        limit = (0.3 if side > 0.0 else 0.26) + 0.02 * np.sin(angle) + per_decade * np.log10(rate)
        load = np.arange(held, limit + rate * step, rate * step)
        moved = np.radians(10.0) * np.clip(np.arange(60) / 50.0, 0.0, 1.0)
        position += [*np.full(load.size, angle), *(angle + side * moved)]
        torque += [*(side * load), *np.full(60, side * load[-1])]
        angle += side * np.radians(10.0)
        position += [angle] * 100
        torque += [side * held] * 100
    x = np.array(position) * 1.0
    channels = {"position": x + rng.normal(0.0, 1e-7, x.size), "motor_torque": np.array(torque)}
    return Record(step * np.arange(x.size), channels, {"position": "rad", "motor_torque": "N·m"})


def test_every_break_is_found_with_its_angle_direction_and_rate() -> None:
    breaks = find_breaks(ramps([0.1] * 36, np.random.default_rng(0)))
    assert len(breaks) == 36
    assert [b.direction for b in breaks] == [1, 1, -1, -1] * 9
    assert np.degrees([b.angle for b in breaks[:4]]) == pytest.approx([0.0, 10.0, 20.0, 10.0], abs=0.2)
    truth = [(0.3 if b.direction > 0 else 0.26) + 0.02 * np.sin(b.angle) for b in breaks]
    assert [b.torque for b in breaks] == pytest.approx(truth, abs=1e-3)
    assert [b.rate for b in breaks] == pytest.approx([0.1] * 36, rel=0.05)


def test_mean_interval_and_spread_per_direction() -> None:
    result = identify_breakaway(ramps([0.1] * 36, np.random.default_rng(0)))
    assert result["fs_positive"].value == pytest.approx(0.3 + 0.01 * np.sin(np.radians(10.0)), abs=1e-3)
    assert result["fs_negative"].value == pytest.approx(0.26 + 0.005, abs=1e-3)
    assert result["fs_positive"].lower < result["fs_positive"].value < result["fs_positive"].upper
    assert result.not_identified == ()
    assert [t.kind for t in result.pictures[0].traces[:2]] == ["points", "open points"]


def test_dependence_on_the_ramp_rate_is_found() -> None:
    rates = list(np.random.default_rng(3).choice([0.02, 0.05, 0.2, 0.5], 40))
    result = identify_breakaway(ramps(rates, np.random.default_rng(1), per_decade=-0.06))
    assert result["rate_effect"].lower < -0.06 < result["rate_effect"].upper < 0.0
    flat = identify_breakaway(ramps(rates, np.random.default_rng(2)))
    assert not any("depends on the ramp rate" in note for note in flat.notes)


def test_a_tracking_record_is_no_break_away_record() -> None:
    # Slow motion that sticks and slips: it moves off often, from torques that hardly rose.
    time = 1e-3 * np.arange(20_000)
    drive = Drive(time, 0.05 * time, "feedback", Loop(kp=6.0, kd=0.05), max_step=2e-4)
    friction = Model("stribeck", fs=0.3, fc=0.2, vs=0.05, sigma2=0.01, k=500.0)
    out = drive_axis(Mechanics(5e-3), friction, drive)
    channels = {"position": out[:, 0], "motor_torque": out[:, 2]}
    record = Record(time, channels, {"position": "rad", "motor_torque": "N·m"})
    assert len(find_breaks(record)) > 5
    found = identify_breakaway(record)
    assert not any(e.identified for e in found.estimates)
    (said,) = (note for note in found.notes if "is it the record of a motion?" in note)
    assert "--method axis" in said
    # Ramps beside it: what is no ramp is said.
    few = Record(time[:4000], {k: v[:4000] for k, v in channels.items()}, record.units)
    found = identify_breakaway([ramps([0.1] * 36, np.random.default_rng(0)), few])
    assert any("followed no torque ramp" in note for note in found.notes)
    assert all(b.ramped for b in find_breaks(ramps([0.1] * 36, np.random.default_rng(0))))


@pytest.mark.parametrize("held", [0.1, 0.13])
def test_ramps_from_a_held_torque_are_no_error(held: float) -> None:
    found = identify_breakaway(ramps([0.1] * 36, np.random.default_rng(0), held=held))
    assert found["fs_positive"].value == pytest.approx(0.3 + 0.01 * np.sin(np.radians(10.0)), abs=1e-3)
    assert not found["fs_positive"].identified
    assert any("less than 30% of the break-away torque is to be held" in note for note in found.notes)


def test_creep_by_counts_of_a_coarse_encoder_is_left_out_by_the_threshold_that_is_named() -> None:
    time = 1e-3 * np.arange(20_000)
    phase, side = time % 5.0, np.where((time // 5.0) % 2 == 0, 1.0, -1.0)
    torque = side * np.where(phase < 4.0, np.minimum(0.1 * phase, 0.36), 0.0)
    friction = Model("lugre", sigma0=50.0, sigma1=0.3, fs=0.3, fc=0.2, vs=0.05, sigma2=0.05)
    position = drive_axis(Mechanics(5e-3), friction, Drive(time, torque, "held"))[:, 0]
    count = 2.0 * np.pi / 4096
    channels = {
        "position": count * np.round(position / count),
        "motor_torque": torque + np.random.default_rng(0).normal(0.0, 5e-3, time.size),
    }
    record = Record(time, channels, {"position": "rad", "motor_torque": "N·m"})
    crept = identify_breakaway(record)
    assert crept["fs_positive"].value < 0.2
    (said,) = (note for note in crept.notes if "--threshold" in note)
    named = float(said.rpartition("--threshold ")[2].rstrip("."))
    found = identify_breakaway(record, threshold=named)
    assert len(found.details["breaks"]) == 4
    exact = Record(time, {"position": position, "motor_torque": torque}, record.units)
    truth = identify_breakaway(exact, threshold=named)
    for name in ("fs_positive", "fs_negative"):
        assert found[name].value == pytest.approx(truth[name].value, abs=0.01)
    assert not any("--threshold" in note for note in found.notes)


def test_an_axis_that_never_moves_is_one_clear_error() -> None:
    time = np.linspace(0.0, 1.0, 300)
    still = Record(
        time, {"position": 0.0 * time, "motor_torque": time}, {"position": "rad", "motor_torque": "N·m"}
    )
    with pytest.raises(InputError, match="never breaks away"):
        identify_breakaway(still)
