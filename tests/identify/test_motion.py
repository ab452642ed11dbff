"""The motion of a log as a setting is tried along it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.motion import HOLD, LONGEST, Motion, motion_in, motion_of, sinusoid, speeds_of

T = 1e-3


def record(position: np.ndarray, **channels: np.ndarray) -> Record:
    return Record(
        T * np.arange(position.size),
        {"position": position, **channels},
        dict.fromkeys(("position", *channels), "rad"),
    )


def moves(seconds: float, at: float = 0.0, way: float = 2.0) -> np.ndarray:
    """Smooth moves to and fro of a second each with dwells between, from `at` on for 4 s; slow creep elsewhere."""
    t = T * np.arange(round(seconds / T))
    s = np.clip((t - at) % 2.0, 0.0, 1.0)
    x = way * (s - np.sin(2.0 * math.pi * s) / (2.0 * math.pi))
    x = np.where((t - at) % 4.0 >= 2.0, way - x, x)
    return np.where((t >= at) & (t < at + 4.0), x, 0.0)


def test_the_reference_of_a_log_is_kept_to_a_thousandth() -> None:
    wanted = moves(4.0)
    motion = motion_of(record(0.9 * wanted, position_reference=wanted), "log.csv")
    assert motion.source == "reference of log.csv, 0 to 3.999 s"
    samples = motion.sampled(T)
    assert samples.shape == (round((3.999 + HOLD) / T), 3)
    np.testing.assert_allclose(samples[:3999, 0], wanted[:3999], atol=2e-3)
    np.testing.assert_allclose(samples[:3999, 1], np.gradient(wanted, T)[:3999], atol=2e-2)
    assert np.all(samples[4000:, 1:] == 0.0)
    again = motion_in({"trajectory": motion.table()}, "model.toml")
    assert again is not None
    np.testing.assert_allclose(again.sampled(T)[:, 0], samples[:, 0], atol=1e-5)


def brisk(dwell: int = 300) -> np.ndarray:
    """Moves to and fro of 12 rad/s with dwells, that reach 800 rad/s² within 15 ms."""
    move = np.concatenate(
        [np.full(n, a) for n, a in ((15, 1.0), (15, -1.0), (200, 0.0), (15, -1.0), (15, 1.0))]
    )
    pause = np.zeros(dwell)
    jerk = 800.0 / 0.015 * np.concatenate([pause, move, pause, -move, pause] * 4)
    velocity = np.cumsum(np.cumsum(jerk) * T) * T
    velocity[np.abs(velocity) < 1e-9] = 0.0
    return np.cumsum(velocity) * T


def test_a_kept_motion_goes_back_nowhere_but_where_the_reference_does() -> None:
    wanted = brisk()
    samples = motion_of(record(wanted, position_reference=wanted), "log.csv").sampled(T)
    sides = np.sign(samples[:, 1])
    assert not np.any(sides[1:] * sides[:-1] < 0.0)  # Between two moves it rests.
    assert np.min(samples[:, 0]) >= -1e-9
    assert np.max(samples[:, 0]) <= np.max(wanted) + 1e-9


def test_a_turn_between_two_points_stays_where_it_is() -> None:
    t, w = np.asarray(0.01 * np.arange(401) + 0.005, dtype=np.float64), math.pi
    samples = Motion(t, -0.1 * np.cos(w * t), 0.1 * w * np.sin(w * t)).sampled(T)
    assert np.max(np.abs(samples[200:3900, 2])) == pytest.approx(0.1 * w * w, rel=1e-3)


def test_of_a_long_log_the_seconds_with_most_motion_are_kept() -> None:
    motion = motion_of(record(moves(60.0, at=30.0)))
    assert motion.duration == pytest.approx(LONGEST, abs=0.05)
    assert motion.amplitude == pytest.approx(1.0, rel=0.02)
    assert motion.top_speed == pytest.approx(4.0, rel=0.05)


def test_a_motion_under_way_is_brought_from_rest_and_to_rest() -> None:
    t = np.linspace(0.0, 1.0, 11)
    samples = Motion(t, 5.0 + 2.0 * t, np.full(11, 2.0)).sampled(T)
    assert samples[0].tolist()[:2] == [0.0, 0.0]
    assert samples[-1, 0] == pytest.approx(2.2)
    np.testing.assert_allclose(np.diff(samples[:, 0]) / T, samples[:-1, 1], atol=0.05)


def test_speeds_are_told_by_direction_and_rest_is_none() -> None:
    t = T * np.arange(4000)
    found = speeds_of([record(np.where(t < 1.0, 3.0 * t, np.where(t < 2.0, 3.0, 3.0 - 0.5 * (t - 2.0))))])
    assert found["positive"][1:] == pytest.approx([3.0] * 10, rel=0.02)
    assert found["negative"][1:-1] == pytest.approx([0.5] * 9, rel=0.02)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: motion_of(record(np.zeros(100))), "stands still"),
        (lambda: Motion(np.array([0.0, 0.0]), np.array([0.0, 1.0]), np.zeros(2)), "do not ascend"),
        (lambda: Motion(np.array([0.0, 1.0]), np.array([0.0, math.nan]), np.zeros(2)), "not finite"),
        (lambda: Motion(np.zeros(3), np.zeros(2), np.zeros(3)), "3 times, 2 positions"),
        (lambda: motion_in({"trajectory": {"time": [0, 1]}}, str(Path("m.toml"))), r"m.toml: its table \[trajectory\]"),
    ],
)  # fmt: skip
def test_what_is_no_motion_is_refused(make, message) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_a_model_without_a_motion_has_none() -> None:
    assert motion_in({}, "m.toml") is None
    assert sinusoid(0.1, 0.5).top_speed == pytest.approx(0.1 * math.pi)
