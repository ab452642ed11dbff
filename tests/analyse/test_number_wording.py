"""Intervals as people read them."""

import math

import pytest

from stickslip.analyse.wording import ends


@pytest.mark.parametrize(
    ("value", "lower", "upper", "shown"),
    [
        (0.3, 0.2, 0.4, ("0.2", "0.4")),
        (50.0, 9.585, 267.8, ("9.585", "267.8")),
        (0.3, 0.0, 1.08e306, ("0", "no limit")),
        (0.3, 0.0, math.inf, ("0", "no limit")),
        (0.3, -math.inf, math.inf, ("no limit", "no limit")),
        (0.0, 0.0, 1.08e306, ("0", "no limit")),
        (0.0, -0.1, 0.1, ("-0.1", "0.1")),
        (1e-9, -0.01, 0.01, ("-0.01", "0.01")),
    ],
)
def test_an_end_that_bounds_nothing_is_said_so(value, lower, upper, shown):
    assert ends(value, lower, upper) == shown
