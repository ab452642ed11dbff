"""The zero-phase filters against scipy.signal."""

import numpy as np
import pytest
from scipy import signal

from stickslip.identify.filters import cross_spectrum, decimated, low_pass, spectrum


@pytest.mark.parametrize(("order", "corner"), [(4, 100.0), (4, 3.0), (2, 40.0), (2, 480.0)])
def test_low_pass_is_that_of_scipy(order: int, corner: float) -> None:
    x = np.cumsum(np.random.default_rng(3).standard_normal(3000)) + 7.0
    sections = signal.butter(order, corner, fs=1000.0, output="sos")
    np.testing.assert_allclose(low_pass(x, corner, 1000.0, order), signal.sosfiltfilt(sections, x), atol=1e-9)


@pytest.mark.parametrize("factor", [2, 7, 30])
def test_decimation_is_that_of_scipy(factor: int) -> None:
    x = np.cumsum(np.random.default_rng(4).standard_normal(3000)) - 2.0
    sections = signal.cheby1(4, 0.05, 0.8 / factor, output="sos")
    np.testing.assert_allclose(decimated(x, factor), signal.sosfiltfilt(sections, x)[::factor], atol=1e-9)


def test_a_signal_too_short_is_refused() -> None:
    with pytest.raises(ValueError, match="16"):
        low_pass(np.zeros(15), 10.0, 100.0)


@pytest.mark.parametrize("length", [256, 301, 3000])
def test_spectra_are_those_of_scipy(length: int) -> None:
    rng = np.random.default_rng(5)
    x, y = rng.standard_normal(3000) + 1.0, rng.standard_normal(3000)
    f, power = signal.welch(x, 1000.0, window="hann", nperseg=length)
    ours = spectrum(x, 1000.0, length)
    np.testing.assert_allclose(ours[0], f, rtol=1e-12)
    np.testing.assert_allclose(ours[1], power, rtol=1e-9)
    _, cross = signal.csd(x, y, 1000.0, window="hann", nperseg=length)
    np.testing.assert_allclose(cross_spectrum(x, y, 1000.0, length), cross, rtol=1e-9)
