"""The exponential of a small matrix, by which a drivetrain's linear part moves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip.machines.drivetrain import exponential

J = 3.8623e-4


@pytest.mark.parametrize("time", [1e-5, 1e-3, 0.05])
def test_the_exponential_of_a_small_matrix_is_scipys(time):
    """Of a slipping axis, whose rates differ by decades."""
    rates = np.zeros((5, 5))
    rates[0, 1] = 1.0
    rates[1, 1:4] = -0.018 / J, -1.0 / J, 1.0 / J
    rates[2, 2], rates[2, 4] = -24.0 / 0.285, 24.0
    np.testing.assert_allclose(exponential(rates * time), expm(rates * time), rtol=1e-13, atol=1e-15)
