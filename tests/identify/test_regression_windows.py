"""Windows through which a regression sees a record: exact derivatives, damping, lateness, reach, noise, blocks,
and a torque that acts over a row."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.smooth import Window, seen
from stickslip.identify.regression.regression import regress_axis
from stickslip.identify.regression.sliding_rows import Logged, Signals, SlidingRows
from stickslip.machines.servo import ServoAxis


@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_derivatives_are_exact_for_the_power_of_their_order(derivative: int) -> None:
    t = np.arange(400) * 1e-3
    window = Window(4e-3, 1e-3)
    (there,) = seen(t**derivative, window.weights(derivative))
    inside = slice(window.reach, -window.reach)
    assert there[inside] == pytest.approx(math.factorial(derivative), rel=1e-6)


def test_a_sine_is_seen_as_the_window_damps_it() -> None:
    t = np.arange(4000) * 1e-3
    rate = 2.0 * math.pi * 12.0
    window = Window(5e-3, 1e-3)
    damped = math.exp(-0.5 * (rate * window.width) ** 2)
    value, slope = seen(np.sin(rate * t), window.weights(0), window.weights(1))
    inside = slice(window.reach, -window.reach)
    assert value[inside] == pytest.approx(damped * np.sin(rate * t)[inside], abs=2e-4)
    assert slope[inside] == pytest.approx(damped * rate * np.cos(rate * t)[inside], abs=5e-3 * rate)


def test_a_late_window_is_a_shifted_record() -> None:
    t = np.arange(3000) * 1e-3
    window = Window(4e-3, 1e-3)
    here, late = seen(np.sin(9.0 * t), window.weights(0), window.weights(0, late=3.7e-4))
    there = np.interp(t + 3.7e-4, t, here)
    inside = slice(50, -50)
    assert late[inside] == pytest.approx(there[inside], abs=1e-5)


def test_what_is_seen_depends_on_the_rows_within_reach_alone() -> None:
    window = Window(3e-3, 1e-3)
    quiet = np.zeros(300)
    loud = quiet.copy()
    loud[100] = 1e6
    (there,) = seen(loud, window.weights(2))
    assert np.max(np.abs(there[100 + window.reach + 1 :])) < 1e-3
    assert np.max(np.abs(there[: 100 - window.reach])) < 1e-3


def test_noise_is_what_its_weights_make_of_it() -> None:
    rng = np.random.default_rng(1)
    window = Window(4e-3, 1e-3)
    (there,) = seen(rng.standard_normal(40_000), window.weights(2))
    assert np.std(there[100:-100]) == pytest.approx(window.noise(2), rel=0.05)


def test_a_long_series_is_seen_in_blocks_as_in_one_piece() -> None:
    series = np.cumsum(np.random.default_rng(3).standard_normal(300_000))
    window = Window(0.02, 1e-3)
    whole, slope = seen(series, window.weights(0), window.weights(1))
    reach = window.reach
    for at in (0, 5, 16_383, 150_000, 299_999):
        rows = np.pad(series, reach, mode="edge")[at : at + 2 * reach + 1]
        assert whole[at] == pytest.approx(rows @ window.weights(0), rel=1e-9)
        assert slope[at] == pytest.approx(rows @ window.weights(1), rel=1e-6, abs=1e-6)


# ---- a row's torque acts over a row -----------------------------------------------------------------------------

ROW, FINE = 4e-3, 200  # s from row to row, and steps of a row
AXIS = ServoAxis(drive_side="load")


def seen_rows(drive: np.ndarray, width: float) -> SlidingRows:
    """Every tenth row of a torque column, seen through one window."""
    none = np.zeros(0)
    time = np.arange(drive.size) * ROW
    signals = Signals(
        time, none, drive, 0.0, np.ones(drive.size, dtype=np.bool_), 0.0, 0.0, Logged(time, none, drive)
    )
    places = np.arange(100, drive.size - 100, 10)
    speed = np.zeros(places.size)
    return SlidingRows(time[places], none, speed, none, none, none, none, places, signals, Window(width, ROW), places,
                       none, none)  # fmt: skip


@pytest.mark.parametrize(("held", "skew"), [(True, -0.5 * ROW), (False, 0.5 * ROW)])
def test_a_torque_held_after_its_row_or_averaged_before_it_is_seen_as_it_acted(
    held: bool, skew: float
) -> None:
    """A wave of 22 Hz in rows of 4 ms: taken for the torque at its row it is 1.3 % too large, or too small."""
    fine = np.arange(2000 * FINE) * ROW / FINE
    wave = np.sin(2.0 * np.pi * 22.0 * fine)
    if held:
        column = wave[::FINE]
        acted = np.repeat(column, FINE)
    else:
        column, acted = np.concatenate([[0.0], wave.reshape(-1, FINE).mean(axis=1)[:-1]]), wave
    rows = seen_rows(column, 1.6 * ROW)
    near = np.arange(-12 * FINE, 12 * FINE + 1)
    bell = np.exp(-0.5 * (near / (1.6 * FINE)) ** 2)
    true = np.array([bell @ acted[k * FINE + near] for k in rows.places]) / bell.sum()
    size = float(np.max(np.abs(true)))
    assert rows.torque(skew) == pytest.approx(true, abs=2e-3 * size)
    plain, *_ = seen(column, rows.window.weights(0, late=skew))
    assert np.max(np.abs(plain[rows.places] - true)) > 1e-2 * size


def test_a_delay_of_many_rows_says_nothing_of_a_spread() -> None:
    rows = seen_rows(np.zeros(300), 1.6 * ROW)
    assert rows.spread(-0.5 * ROW) == pytest.approx(ROW**2 / 12.0)
    assert rows.spread(0.5 * ROW) == pytest.approx(-(ROW**2) / 12.0)
    assert rows.spread(0.0) == rows.spread(3.0 * ROW) == rows.spread(-3.0 * ROW) == 0.0


def test_inertia_is_right_where_the_column_is_a_mean_over_slow_rows() -> None:
    """A shake of 24 Hz on a slow motion, rows of 4 ms: inertia was 2 % too small."""
    t = np.arange(-1, 6000) * ROW
    rates, sizes = (1.5, 2.0 * np.pi * 24.0), (3.0, 0.01)
    q = sum(a * np.sin(w * t) for a, w in zip(sizes, rates, strict=True))
    v = sum(a * w * np.cos(w * t) for a, w in zip(sizes, rates, strict=True))
    torque = (0.01 * np.diff(v) + 0.02 * np.diff(q)) / ROW + 0.3 * np.sign(v[1:]) + 0.05
    torque += 1e-3 * np.random.default_rng(2).standard_normal(torque.size)
    found = regress_axis([Experiment("mean", t[1:] - t[1], q[1:], torque)], AXIS)
    assert found.numbers["inertia"].value == pytest.approx(0.01, rel=8e-3)
    low, high = found.interval("inertia")
    assert low <= 0.01 <= high
