"""Windows through which a regression sees a record: exact derivatives, damping, lateness, reach, noise, blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.identify.fit.smooth import Window, seen


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
