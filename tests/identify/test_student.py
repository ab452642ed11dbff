"""Quantiles of Student's distribution are SciPy's."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from stickslip.identification.fit.student import student_quantile


@given(freedom=st.floats(0.5, 1e5), probability=st.floats(0.55, 0.999))
def test_quantiles_are_those_of_scipy(freedom: float, probability: float):
    expected = float(special.stdtrit(freedom, probability))
    assert student_quantile(freedom, probability) == pytest.approx(expected, rel=1e-8)


def test_without_end_it_is_the_normal_distribution():
    assert student_quantile(math.inf) == pytest.approx(1.959963984540054, rel=1e-5)
    assert student_quantile(1e7) == pytest.approx(1.959963984540054, rel=1e-5)
    assert math.isnan(student_quantile(math.nan))
