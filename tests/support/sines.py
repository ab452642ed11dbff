"""A prescribed motion as a sum of sines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def sines(
    t: np.ndarray, waves: Sequence[tuple[float, float, float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of waves of (amplitude, Hz, phase)."""
    orders = (
        [size * (2.0 * np.pi * rate) ** n * np.sin(2.0 * np.pi * rate * t + phase + n * np.pi / 2.0)
         for size, rate, phase in waves]
        for n in range(3)
    )  # fmt: skip
    q, v, a = (np.sum(parts, axis=0) for parts in orders)
    return q, v, a
