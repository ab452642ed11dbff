"""Least squares within bounds are SciPy's, and never below what it finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize

from stickslip.identify.fit.bounded import within_bounds


def drawn(seed: int, n: int, m: int, alike: bool):
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((n, m)) * np.exp(rng.normal(0.0, 2.0, m))
    if alike and m > 1:
        columns[:, 1] = columns[:, 0] + 1e-3 * rng.standard_normal(n)
    lower = np.where(rng.random(m) < 0.3, -np.inf, rng.normal(-0.3, 0.5, m))
    width = rng.exponential(0.5, m) + 1e-9
    upper = np.where(rng.random(m) < 0.3, np.inf, np.maximum(lower, -5.0) + width)
    return columns, 5.0 * rng.standard_normal(n), lower, upper


@given(seed=st.integers(0, 10**6), n=st.integers(7, 40), m=st.integers(1, 6), alike=st.booleans())
def test_the_least_squares_within_bounds_are_those_of_scipy(seed: int, n: int, m: int, alike: bool):
    columns, target, lower, upper = drawn(seed, n, m, alike)
    found = within_bounds(columns, target, lower, upper)
    expected = optimize.lsq_linear(columns, target, (lower, upper), method="bvls", tol=1e-14)
    assert np.all((lower <= found) & (found <= upper))
    misfit = float(np.sum((columns @ found - target) ** 2))
    assert misfit <= 2.0 * expected.cost * (1.0 + 1e-9) + 1e-12
    if not alike:
        assert found == pytest.approx(expected.x, rel=1e-6, abs=1e-6)


def test_bounds_that_leave_no_room_hold():
    columns, target = np.eye(3), np.array([1.0, 2.0, 3.0])
    lower = np.array([0.5, 2.5, -1.0])
    found = within_bounds(columns, target, lower, np.nextafter(lower, np.inf))
    assert found == pytest.approx(lower)
