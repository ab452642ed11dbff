"""Break-away torque from ramps."""

import numpy as np
import pytest

from stickslip import Model, Record
from stickslip.core.errors import InputError
from stickslip.identification.presliding.breakaway import find_breaks, identify_breakaway, mean_estimate
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis


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
    assert 'method="axis"' in said
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
    (said,) = (note for note in crept.notes if "threshold=" in note)
    named = float(said.rpartition("threshold=")[2].rstrip("."))
    found = identify_breakaway(record, threshold=named)
    assert len(found.details["breaks"]) == 4
    exact = Record(time, {"position": position, "motor_torque": torque}, record.units)
    truth = identify_breakaway(exact, threshold=named)
    for name in ("fs_positive", "fs_negative"):
        assert found[name].value == pytest.approx(truth[name].value, abs=0.01)
    assert not any("threshold=" in note for note in found.notes)


def test_an_axis_that_never_moves_is_one_clear_error() -> None:
    time = np.linspace(0.0, 1.0, 300)
    still = Record(
        time, {"position": 0.0 * time, "motor_torque": time}, {"position": "rad", "motor_torque": "N·m"}
    )
    with pytest.raises(InputError, match="never breaks away"):
        identify_breakaway(still)


def stick_slip_ramps(levels: list[tuple[float, ...]], step: float = 0.0) -> Record:
    """Torque ramps at 2 N·m/s that go on rising while the axis slips at each of the levels, then sticks again."""
    row, position, torque, angle = 2e-3, [0.0] * 100, [0.0] * 100, 0.0
    for number, breaks in enumerate(levels):
        side = 1.0 if number % 2 == 0 else -1.0
        load = np.arange(0.0, breaks[-1] + 0.5, 2.0 * row)
        moved = np.zeros(load.size)
        for level in breaks:
            moved += np.clip((load - level) / 0.2, 0.0, 1.0) * 0.05
        position += (angle + side * moved).tolist()
        torque += (side * load).tolist()
        angle += side * moved[-1]
        position += [angle] * 100
        torque += [0.0] * 100
    load = np.array(torque)
    load = step * np.round(load / step) if step else load
    channels = {"position": np.array(position), "motor_torque": load}
    return Record(row * np.arange(load.size), channels, {"position": "rad", "motor_torque": "N·m"})


def test_later_stick_slips_of_a_ramp_are_no_break_away() -> None:
    """The mean over all of them was 12.2 for first breaks at 10.4."""
    ramp = [(10.43, 12.0, 13.1, 14.2), (9.8, 11.5, 13.0)]
    shifted = [tuple(x + 0.1 for x in one) for one in ramp]
    found = identify_breakaway(stick_slip_ramps([*ramp, *shifted, *ramp]))
    assert [b.torque for b in found.details["breaks"]] == pytest.approx(
        [10.43, 9.8, 10.53, 9.9, 10.43, 9.8], abs=0.03
    )
    assert len(found.details["later"]) == 15
    assert found["fs_positive"].value == pytest.approx(10.463, abs=0.03)
    assert found["fs_positive"].identified
    assert any("15 more, where the axis stuck again" in note for note in found.notes)


def test_what_no_torque_brought_about_is_not_identified() -> None:
    """It printed fs_positive 0 [0, 0] identified."""
    record = stick_slip_ramps([(1.0,), (1.0,), (1.1,), (1.1,)])
    silent = Record(record.time, {**record.channels, "motor_torque": 0.0 * record.time}, record.units)
    turned = Record(record.time, {**record.channels, "motor_torque": -record["motor_torque"]}, record.units)
    for moved in (silent, turned):
        found = identify_breakaway(moved)
        for e in found.estimates:
            assert not e.identified
            assert e.value == e.lower == 0.0
    assert "does not act in its direction" in mean_estimate("fs_positive", np.zeros(4)).verdict


def test_an_interval_holds_what_rows_and_counts_hide() -> None:
    """Six ramps that read alike by a count of 0.1 N·m: repeats say nothing of the 0.05 that it may be off."""
    found = identify_breakaway(stick_slip_ramps([(1.04,), (1.04,)] * 3, step=0.1))
    assert len({round(b.torque, 6) for b in found.details["breaks"] if b.direction > 0}) == 1
    for name in ("fs_positive", "fs_negative"):
        assert found[name].lower <= 1.04 <= found[name].upper
        assert found[name].upper - found[name].lower > 0.1
