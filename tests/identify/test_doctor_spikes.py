"""Spikes and clipped values are found; peaks that a motion has are not taken for them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip import Record
from stickslip.cli import main
from stickslip.identification.doctor import examine
from stickslip.identification.doctor.spikes import spike_rows

FC, J, SIZE = 2.0, 0.01, 20_000
UNITS = {"position": "rad", "motor_torque": "N·m"}


def motion(seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, position and torque of an axis moved to and fro, its torque up to 2.5 N·m."""
    t = np.arange(SIZE) * 1e-3
    v = 9.0 * np.sin(2.0 * np.pi * 0.9 * t) + 5.0 * np.sin(2.0 * np.pi * 0.23 * t)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(SIZE)
    return t, np.cumsum(v) * 1e-3, J * np.gradient(v, t) + FC * np.tanh(v / 0.05) + noise


def record(torque: np.ndarray, position: np.ndarray | None = None) -> Record:
    t, q, _ = motion()
    return Record(t, {"position": q if position is None else position, "motor_torque": torque}, UNITS)


def codes(r: Record) -> dict[str, str]:
    return {f.code: f.line() for f in examine(r).findings}


def test_spikes_in_the_torque_are_counted_with_their_rows():
    _, _, torque = motion()
    rows = np.random.default_rng(2).choice(np.arange(10, SIZE - 10), 30, replace=False)
    torque[rows] = 50.0 * np.where(rows % 2, 1.0, -1.0)
    found = codes(record(torque))
    assert "30 spikes of up to" in found["spikes"]
    assert "50 N·m" in found["spikes"]
    assert 'leave_out=["spikes"]' in found["spikes"]
    assert np.array_equal(spike_rows(record(torque)), np.sort(rows) + 1)


def test_a_single_row_within_the_range_is_a_spike_and_named():
    _, _, torque = motion()
    torque[5000] += 3.0
    said = codes(record(torque))["spikes"]
    assert "by their rows: 5001" in said
    assert "1 spike of up to" in said


def test_a_spike_below_what_is_usual_is_told_by_its_neighbours():
    """ "1 spikes of up to -6830 N, where 1.338e+04 is usual" """
    _, _, torque = motion()
    row = int(np.argmax(torque))
    torque[row] = -0.9 * torque[row]
    said = codes(record(torque))["spikes"]
    assert "has 1 spike, up to " in said
    torque = motion()[2]
    torque[row : row + 2] *= -0.9
    two = codes(record(torque)).get("spikes", "")
    assert "up to 0 " not in two
    assert "away from the rows before and after" in said


def test_a_spike_of_the_position_is_no_wrap():
    _, q, torque = motion()
    q[7000] += 2.0 * np.pi
    found = codes(record(torque, q))
    assert "row 7001" in found["spikes"]
    assert "position-wrap" not in found


@pytest.mark.parametrize("kind", ["noise", "pulses", "steps", "still"])
def test_what_a_motion_has_is_no_spike(kind):
    t, q, torque = motion()
    if kind == "noise":
        torque += np.random.default_rng(3).standard_t(5, SIZE)
    if kind == "pulses":  # impacts that ring
        for k in range(500, SIZE - 200, 1700):
            torque[k : k + 80] += 8.0 * np.exp(-np.arange(80) / 6.0) * np.sin(np.arange(80) / 2.0)
    if kind == "steps":
        torque = 2.5 * np.sign(torque)
    if kind == "still":
        q, torque = np.where(t < 18.0, q[0], q - q[18_000]), np.where(t < 18.0, 0.0, torque)
        q = np.round(q / 1e-4) * 1e-4
    assert "spikes" not in codes(record(torque, q))


def steps_of_velocity(seed: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, position and torque at 250 Hz of a loop that reaches each speed within a row: a peak of torque there."""
    rng, dt = np.random.default_rng(seed), 4e-3
    v = np.repeat(rng.choice([-4.0, -2.0, 2.0, 4.0], 40), 60)
    v = np.convolve(v, [0.0, 0.7, 0.3])[: v.size]
    q = np.round(np.cumsum(v) * dt / 1e-4) * 1e-4
    torque = J * np.diff(v, append=v[-1]) / dt + 0.3 * np.sign(v) + 0.01 * rng.standard_normal(v.size)
    return np.arange(v.size) * dt, q, torque


@pytest.mark.parametrize("late", [0, 1])
def test_a_peak_of_torque_that_the_axis_follows_is_no_spike(late: int):
    t, q, torque = steps_of_velocity()
    torque = np.roll(torque, late)
    driven = Record(t, {"position": q, "motor_torque": torque}, UNITS)
    assert float(np.max(np.abs(torque))) > 20.0 * float(np.median(np.abs(torque)))
    assert "spikes" not in codes(driven)
    rows = np.array([100, 717, 1234, 1888])
    torque[rows] += [5.0, -5.0, 5.0, 5.0]
    torque[718] -= 5.0
    spiked = Record(t, {"position": q, "motor_torque": torque}, UNITS)
    assert np.array_equal(spike_rows(spiked), [101, 718, 719, 1235, 1889])
    by_velocity = {"velocity": np.gradient(q, t), "motor_torque": torque}
    units = {"velocity": "rad/s", "motor_torque": "N·m"}
    assert np.array_equal(spike_rows(Record(t, by_velocity, units)), [101, 718, 719, 1235, 1889])


def test_a_kick_that_starts_or_stops_a_jog_is_no_spike() -> None:
    """Of another program's jogs those were spikes at which the torque beside them changes most."""
    jog = np.concatenate([np.zeros(100), np.full(100, 4.0), np.zeros(100), np.full(100, -4.0)])
    v = np.concatenate([np.tile(jog, 4), np.zeros(50)])
    friction = 0.04 * np.sign(v)
    # While it stands, half of friction is held, and the loop's integral part builds up to break loose.
    for first in range(0, v.size, 200):
        last = min(first + 100, v.size - 1)
        friction[first:last] = np.linspace(
            0.5 * friction[first - 1] if first else 0.0, friction[last], last - first
        )
    torque = friction + 0.05 / 4.0 * np.diff(v, prepend=0.0)
    torque += 1e-4 * np.random.default_rng(0).standard_normal(v.size)
    channels = {"position": np.cumsum(v) * 4e-3, "motor_torque": torque}
    assert "spikes" not in codes(Record(4e-3 * np.arange(v.size), channels, UNITS))


def test_a_torque_that_stays_where_it_jumps_is_no_spike():
    t, q, _ = motion()
    # Break-away of an axis that sticks: one row above, then another level.
    torque = np.repeat(np.random.default_rng(5).uniform(-0.1, 0.1, 100), 200) + 0.002 * np.sin(300.0 * t)
    torque[::200] += 0.6 * np.diff(torque[::200], prepend=0.0)
    torque[200:400] += 2.0
    torque[200] += 1.5
    assert "spikes" not in codes(Record(t, {"position": 1e-4 * q, "motor_torque": torque}, UNITS))


def test_identify_without_spikes_gives_the_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    t, q, torque = motion()
    torque[np.random.default_rng(2).choice(np.arange(10, SIZE - 10), 30, replace=False)] = 50.0
    path = tmp_path / "log.csv"
    head = "time [s],position [rad],motor_torque [N·m]"
    np.savetxt(path, np.stack([t, q, torque], axis=1), "%.9f", ",", header=head, comments="")
    given = ["identify", str(path), "--inverse", "--no-report", "--json", "--out", str(tmp_path / "m.toml")]
    error = []
    for options in ([], ["--leave-out", "spikes"]):
        assert main([*given, *options]) == 0
        found = {e["name"]: e["value"] for e in json.loads(capsys.readouterr().out)["estimates"]}
        error.append(abs(found["fc"] / FC - 1.0))
    assert error[1] < 0.02 < error[0]


@pytest.mark.parametrize("kind", ["plain", "held", "brief", "rounded"])
def test_clipped_torques_are_found(kind):
    _, _, torque = motion()
    if kind == "held":  # the drive writes its torque every fourth row
        torque = np.repeat(torque[::4], 4)
    if kind == "rounded":
        torque = 0.01 * np.round(torque / 0.01)
    level = 2.45 if kind == "brief" else 2.2
    clipped = np.clip(torque, -level, level)
    assert "saturation" not in codes(record(torque))
    assert f"{level:g}" in codes(record(clipped))["saturation"]


def limited(bursts: int, count: int = 6000) -> Record:
    """A motion whose torque is cut off in so many bursts of 150 rows each, in the first part of the record."""
    t = 1e-3 * np.arange(count)
    torque = np.sin(2.0 * np.pi * 1.7 * t) + 0.01 * np.random.default_rng(3).standard_normal(count)
    for k in range(bursts):
        torque[100 + 400 * k : 250 + 400 * k] = 2.2
    return Record(t, {"position": np.sin(2.0 * np.pi * 1.7 * t), "motor_torque": torque}, UNITS)


def test_of_a_torque_at_its_limit_throughout_no_rows_are_to_be_left_out():
    """All of them were."""
    t = 1e-3 * np.arange(6000)
    position = np.sin(2.0 * np.pi * 1.7 * t)
    relay = np.where(np.cos(2.0 * np.pi * 1.7 * t) > 0.0, 2.2, -2.2)
    assert "saturation" not in codes(Record(t, {"position": position, "motor_torque": 0.0 * t + 0.01}, UNITS))
    found = examine(Record(t, {"position": position, "motor_torque": relay}, UNITS)).findings
    assert not any("leave_out" in f.remedy for f in found if f.code == "saturation")


@pytest.mark.parametrize(
    ("bursts", "count", "what", "remedy"),
    [
        (
            1,
            6000,
            "150 rows in one stretch of rows 101:250",
            'or leave these rows out with leave_out=["101:250"]',
        ),
        (
            2,
            6000,
            "300 rows in 2 stretches of rows 101:250, 501:650",
            'leave_out=["101:250", "501:650"]',
        ),
        (
            5,
            6000,
            "750 rows in 5 stretches, first 101:250",
            'or use the longest part without, rows="1851:6000"',
        ),
        (
            15,
            6000,
            "2250 rows in 15 stretches, first 101:250",
            "or a higher limit: too little is left between",
        ),
    ],
)
def test_what_helps_where_a_torque_is_cut_off(bursts, count, what, remedy):
    """The first row of hundreds was named, and all were to be left out by hand."""
    (found,) = [f for f in examine(limited(bursts, count)).findings if f.code == "saturation"]
    assert what in found.message
    assert found.remedy.startswith("what was cut off is lost: record again with gentler accelerations")
    assert remedy in found.remedy


def coarse(limit: float) -> Record:
    """Moves with rests whose torque a drive writes down in 60 steps, as a controller's that a coarse encoder holds
    still from row to row; cut off at a limit."""
    t, _, _ = motion()
    v = np.interp(
        t % 4.0, [0.0, 0.2, 1.2, 1.4, 2.0, 2.2, 3.2, 3.4], [0.0, 4.0, 4.0, 0.0, 0.0, -4.0, -4.0, 0.0]
    )
    ripple = 0.3 * np.repeat(np.random.default_rng(6).standard_normal(t.size // 10), 10) * (v != 0.0)
    torque = 0.1 * np.gradient(v, t) + 1.2 * np.tanh(v / 0.05) + ripple
    torque = np.clip(0.05 * np.round(torque / 0.05), -limit, limit)
    return Record(t, {"position": np.cumsum(v) * 1e-3, "motor_torque": torque}, UNITS)


@pytest.mark.parametrize("limit", [1.5, 2.0, 2.5])
def test_a_limit_is_found_in_a_coarse_torque_that_stands_still_elsewhere_too(limit: float):
    assert "saturation" not in codes(coarse(9.0))
    assert f"-{limit:g} and {limit:g} N·m" in codes(coarse(limit))["saturation"]


def test_the_rounded_top_of_a_sine_is_no_limit():
    t, q, _ = motion()
    torque = 0.0052 * np.round(1.645 * np.sin(2.0 * np.pi * 0.3 * t) / 0.0052)
    assert "saturation" not in codes(record(torque, q))


def test_a_plateau_of_the_velocity_is_no_limit_unless_the_position_outruns_it():
    t, _, torque = motion()
    sine = 8.0 * np.sin(2.0 * np.pi * 0.3 * t)
    v: np.ndarray = np.clip(sine, -4.0, 4.0)
    units = {**UNITS, "velocity": "rad/s"}
    for top, said in ((9.0, False), (3.5, True)):
        channels = {
            "position": np.cumsum(v) * 1e-3,
            "velocity": np.clip(v, -top, top),
            "motor_torque": torque,
        }
        assert ("saturation" in codes(Record(t, channels, units))) is said


@pytest.mark.parametrize(
    ("seed", "column", "rate", "imperfection"),
    [(11071, "commanded", 1000, "backlash"), (11059, "held", 250, "asymmetry")],
)
def test_answers_to_tuning_steps_are_no_spikes(
    logs: Any, seed: int, column: str, rate: int, imperfection: str
) -> None:
    """66 and 42 of them were, as play and a late column hide the inertia that they move."""
    log = logs.draw(seed, column, rate, "feedforward", "steps", imperfection)
    assert "spikes" not in codes(
        Record(log.time, {"position": log.position, "motor_torque": log.torque}, UNITS)
    )


def test_a_position_that_overshoots_within_rows_has_no_spike_and_no_jump():
    t = np.arange(12_000) * 1e-3
    counts, torque = np.zeros(t.size), 1e-3 * np.random.default_rng(8).standard_normal(t.size)
    way = np.array([7.0, 62.0, 55.0, 28.0, 20.0, 16.0, 14.0, 13.0])
    for k, row in enumerate(range(400, 11_500, 600)):
        side = -1.0 if k % 2 else 1.0
        counts[row : row + way.size] += side * way
        counts[row + way.size :] += 12.0 * side
        torque[row : row + 3] += side * np.array([0.5, 0.4, -0.9])
    torque += 0.05 * np.tanh(np.gradient(counts))
    found = codes(Record(t, {"position": 1e-4 * counts, "motor_torque": torque}, UNITS))
    assert "position" not in found.get("spikes", "")
    assert "position-jump" not in found


def test_what_a_current_shows_is_not_said_of_its_torque_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    t, q, torque = motion()
    torque[np.random.default_rng(2).choice(np.arange(10, SIZE - 10), 30, replace=False)] = 50.0
    path = tmp_path / "log.csv"
    np.savetxt(
        path,
        np.stack([t, q, torque / 0.2], axis=1),
        "%.9f",
        ",",
        header="time [s],position [rad],current [A]",
        comments="",
    )
    assert main(["doctor", str(path), "--torque-constant", "0.2"]) == 0
    assert capsys.readouterr().out.count("30 spikes") == 1
