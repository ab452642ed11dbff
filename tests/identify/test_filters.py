"""The filters and spectra are SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg, signal

from stickslip.core.errors import InputError
from stickslip.identification.fit.filters import (
    RIPPLE,
    ZeroPhase,
    butterworth_poles,
    cross_spectrum,
    decimated,
    low_pass,
    spectrum,
)
from stickslip.identification.fit.parallel import mapped
from stickslip.identification.observer.innovations import durbin


def wandering(n: int, seed: int):
    return np.cumsum(np.random.default_rng(seed).standard_normal(n))


def assert_alike(found, expected, scale):
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * float(np.max(np.abs(scale))))


@given(
    order=st.sampled_from([2, 4, 6]), corner=st.floats(5.0, 400.0), n=st.integers(60, 400),
    seed=st.integers(0, 100),
)  # fmt: skip
def test_the_low_pass_is_that_of_scipy(order: int, corner: float, n: int, seed: int):
    x = wandering(n, seed)
    expected = signal.sosfiltfilt(signal.butter(order, corner, fs=1000.0, output="sos"), x)
    assert_alike(low_pass(x, corner, 1000.0, order), expected, x)


@pytest.mark.parametrize("corner", [0.0, -5.0, 500.0, 600.0, float("nan")])
def test_a_corner_beyond_half_the_rate_is_refused(corner: float):
    with pytest.raises(InputError, match=r"corner .* Hz of a low-pass must be above 0 and below 500 Hz"):
        low_pass(wandering(100, 1), corner, 1000.0)
    with pytest.raises(InputError, match=r"order 3 .* even"):
        low_pass(wandering(100, 1), 5.0, 1000.0, order=3)


@pytest.mark.parametrize(("reach", "n"), [(30, 400), (30, 30)])
def test_a_series_is_continued_as_far_as_it_goes(reach: int, n: int):
    x = wandering(n, 3)
    expected = signal.sosfiltfilt(signal.butter(2, 0.08, output="sos"), x, padlen=min(reach, n - 1))
    assert_alike(ZeroPhase(butterworth_poles(2), 0.08, 2.0, reach)(x), expected, x)


@given(factor=st.integers(2, 40), n=st.integers(100, 900), seed=st.integers(0, 100))
def test_decimation_is_that_of_scipy_but_for_the_gain_at_rest(factor: int, n: int, seed: int):
    x = wandering(n, seed)
    sos = signal.cheby1(4, RIPPLE, 0.8 / factor, output="sos")
    at_rest = 10.0 ** (-RIPPLE / 20.0)
    assert_alike(decimated(x, factor), signal.sosfiltfilt(sos, x)[::factor] / at_rest**2, x)


@given(n=st.integers(40, 700), length=st.integers(16, 128), seed=st.integers(0, 100))
def test_spectra_are_those_of_scipy(n: int, length: int, seed: int):
    length = min(length, n)
    x, y = wandering(n, seed), wandering(n, seed + 1)
    f, power = spectrum(x, 250.0, length)
    f_scipy, expected = signal.welch(x, 250.0, window="hann", nperseg=length)
    assert f == pytest.approx(f_scipy)
    assert_alike(power, expected, expected)
    expected = signal.csd(x, y, 250.0, window="hann", nperseg=length)[1]
    found = cross_spectrum(x, y, 250.0, length)
    assert_alike(found.real, expected.real, expected)
    assert_alike(found.imag, expected.imag, expected)


def test_side_by_side_keeps_the_order_and_hands_errors_on():
    assert mapped(lambda i: mapped(lambda j: 10 * i + j, range(3)), range(4)) == [
        [10 * i + j for j in range(3)] for i in range(4)
    ]
    with pytest.raises(ZeroDivisionError):
        mapped(lambda i: 1 / i, [1, 0, 2])


@given(seed=st.integers(0, 1000), order=st.integers(1, 16))
def test_the_weights_of_last_values_are_those_of_scipy(seed: int, order: int):
    """Yule and Walker's equations are Toeplitz's; SciPy's solver takes a quarter of a second to load."""
    x = wandering(400, seed)
    r = np.array([x[: x.size - k] @ x[k:] for k in range(order + 1)])
    expected = linalg.solve_toeplitz(r[:order], r[1:])
    assert durbin(r.tolist()) == pytest.approx(expected, rel=1e-9, abs=1e-9 * float(np.max(np.abs(expected))))
