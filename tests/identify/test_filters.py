"""The compiled zero-phase filter is SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from stickslip.identify.filters import ZeroPhase
from stickslip.identify.side_by_side import mapped


@settings(deadline=None)  # the first call compiles
@given(
    order=st.sampled_from([2, 4, 6]), corner=st.floats(5.0, 400.0), n=st.integers(60, 400),
    seed=st.integers(0, 100),
)  # fmt: skip
def test_the_filter_is_that_of_scipy(order: int, corner: float, n: int, seed: int):
    x = np.cumsum(np.random.default_rng(seed).standard_normal(n))
    filtered = ZeroPhase(order, corner, 1000.0)
    expected = signal.sosfiltfilt(signal.butter(order, corner, fs=1000.0, output="sos"), x)
    assert filtered(x) == pytest.approx(expected, rel=1e-9, abs=1e-9 * float(np.max(np.abs(x))))


def test_side_by_side_keeps_the_order_and_hands_errors_on():
    assert mapped(lambda i: mapped(lambda j: 10 * i + j, range(3)), range(4)) == [
        [10 * i + j for j in range(3)] for i in range(4)
    ]
    with pytest.raises(ZeroDivisionError):
        mapped(lambda i: 1 / i, [1, 0, 2])
