"""Windowed derivatives, and the weak form of the equation of motion without noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.identification.experiment import Experiment
from stickslip.identification.sliding import estimate_sliding
from stickslip.identification.windows import apply_at, unblurred_weights, window_weights
from stickslip.machines.servo import ServoAxis
from support.analytic_records import TRUTH, record

AXIS = ServoAxis(drive_side="load")
PERIOD = 1e-3


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4, 6])
@pytest.mark.parametrize("late", [0.0, 0.3e-3, -1.7e-3])
def test_derivatives_are_exact_on_polynomials(order: int, late: float) -> None:
    half = 12.5 * PERIOD
    time = PERIOD * np.arange(-30, 31)
    x = (time - late) / half
    weights = window_weights(half, PERIOD, (order,), late)
    for degree in range(order + 2):
        expected = math.factorial(order) / half**order if degree == order else 0.0
        found = apply_at(x**degree, np.array([30]), weights)[0, 0]
        assert found == pytest.approx(expected, abs=1e-7 * math.factorial(order) / half**order)


def test_velocity_and_acceleration_are_not_blurred_by_the_window() -> None:
    """Without the correction a window of 20 ms damps the acceleration of 8 Hz by more than 1 %."""
    rate = 2.0 * math.pi * 8.0
    time = PERIOD * np.arange(-40, 41)
    wave = np.sin(rate * time + 0.4)
    found = apply_at(wave, np.array([40]), unblurred_weights(0.02, PERIOD))[0]
    assert found[0] == pytest.approx(rate * math.cos(0.4), rel=2e-3)
    assert found[1] == pytest.approx(-(rate**2) * math.sin(0.4), rel=2e-3)
    plain = apply_at(wave, np.array([40]), window_weights(0.02, PERIOD, (2,)))[0, 0]
    assert abs(plain / found[1] - 1.0) > 0.01


def test_a_late_window_sees_a_shifted_signal() -> None:
    time = PERIOD * np.arange(200)
    late = 2.4e-3
    signals = (np.sin(40.0 * time), np.sin(40.0 * (time + late)))
    first = apply_at(signals[0], np.array([100]), window_weights(0.02, PERIOD, (0,), late))
    second = apply_at(signals[1], np.array([100]), window_weights(0.02, PERIOD, (0,)))
    assert first == pytest.approx(second, abs=1e-6)


def test_the_weak_form_without_noise_reproduces_the_axis() -> None:
    found = estimate_sliding([record(noise=0.0)], AXIS)
    for name in ("inertia", "fc", "sigma2", "offset"):
        assert found.numbers[name].value == pytest.approx(TRUTH[name], rel=2e-3), name
    assert found.numbers["skew"].value == pytest.approx(0.0, abs=0.05 * PERIOD)


def test_an_axis_that_never_stops_accelerating_has_an_inertia() -> None:
    t = np.arange(4000) * PERIOD
    q, v, a = 3.0 * np.sin(9.0 * t), 27.0 * np.cos(9.0 * t), -243.0 * np.sin(9.0 * t)
    found = estimate_sliding([Experiment("fast", t, q, 0.01 * a + 1e-3 * v + 0.01 * np.sign(v))], AXIS)
    low, high = found.interval("inertia")
    assert low <= 0.01 <= high


def test_too_little_sliding_is_refused() -> None:
    t = np.arange(500) * PERIOD
    noise = 1e-4 * np.random.default_rng(5).standard_normal(t.size)
    with pytest.raises(InputError):
        estimate_sliding([Experiment("still", t, noise, np.sin(t))], AXIS)
