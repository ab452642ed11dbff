"""A load behind a spring, or a filter in the torque's column: the second derivative of the acceleration.

A motor with a load behind a spring requires T = J a - Jl²/k a'' + ..., a column with the lag of a current loop or a
filter J a + lag²/2 J a'' (both Taylor series about low frequencies).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]


def second(rows: SlidingRows) -> Array:
    """Return the second derivative of the acceleration; a coefficient of 1 is a mean over one row."""
    return (rows.snap * rows.period**2 / 12.0)[:, None]


def fourth(rows: SlidingRows) -> Array:
    """Return the second and the fourth derivative of the acceleration."""
    return np.column_stack([second(rows)[:, 0], rows.pop * rows.period**4 / 144.0])


ALTERNATIVES = (
    Alternative(
        "elasticity", second, "inertia", absent=0.5, present=(100.0,), odds=0.2, compliant=True,
        cause="a load behind a spring, or a filter in the torque column",
        remedy="record gentler accelerations, and the torque unfiltered",
    ),
    Alternative(
        "elasticity of higher order", fourth, "inertia", absent=0.1, present=(200.0,), odds=0.02, compliant=True,
        cause="a load that swings", remedy="record gentler accelerations",
    ),
)  # fmt: skip
