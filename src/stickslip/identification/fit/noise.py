"""The noise level, which decides what a fit can claim.

It is given, or estimated from repeats; the residual of the fit may raise it (a model that does not fit), and replaces
it only if there are enough points and the fit is not perfect: a perfect fit contains no information about the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError

Array = np.ndarray[Any, np.dtype[np.float64]]

PERFECT = 1e-9
"""Part of the data's size below which residuals are rounding, without information about the noise."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation of one residual, its source, and its degrees of freedom."""

    std: float
    source: str
    dof: float = math.inf

    @property
    def known(self) -> bool:
        """Whether the noise level is known."""
        return math.isfinite(self.std)


def noise_of_repeats(groups: Sequence[Sequence[float] | Array]) -> Noise | None:
    """Return the pooled standard deviation of repeated measurements; None without repeats."""
    arrays = [np.asarray(g, dtype=np.float64) for g in groups]
    dof = sum(a.size - 1 for a in arrays if a.size > 1)
    if dof == 0:
        return None
    squares = sum(float(np.sum((a - a.mean()) ** 2)) for a in arrays if a.size > 1)
    return Noise(math.sqrt(squares / dof), "repeats", float(dof))


def noise_of_fit(cost: float, n: int, p: int, known: Noise | None, size: float) -> Noise:
    """Return the noise level of a fit: the known one, raised by a residual that exceeds it.

    Without a known one it is the residual's, if that exceeds rounding and at least 3 degrees of freedom remain.
    """
    dof = n - p
    std = math.sqrt(cost / dof) if dof > 0 else math.nan
    if known is not None:
        if dof > 0 and std > known.std:
            return Noise(std, f"{known.source}, raised to the residual", float(dof))
        return known
    if dof < 3 or not std > PERFECT * size:
        return Noise(math.nan, "unknown")
    return Noise(std, "residual", float(dof))


def as_noise(level: Noise | float | None) -> Noise | None:
    """Convert a number to a given noise level.

    Raises
    ------
    InputError
        If it is not a positive number.
    """
    if level is None or isinstance(level, Noise):
        return level
    if not (level > 0.0 and math.isfinite(level)):
        raise InputError(f"noise = {level:g} must be greater than 0; leave it out where it is unknown")
    return Noise(float(level), "given")


def white_std(signal: Array) -> float:
    """Return the standard deviation of the white noise of equally spaced samples, in their unit, by differences.

    For a smooth signal the median of their size is that of the noise alone; a third difference multiplies the variance
    of white noise by 20.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(signal, 3)))) / math.sqrt(20.0)


def quantile(noise: Noise, dof: int = 1) -> float:
    """Return the 95 % quantile of the scaled rise of the sum of squares: chi-squared, or F for an estimated noise."""
    from scipy import special

    if math.isinf(noise.dof):
        return float(special.chdtri(dof, 0.05))
    return dof * float(special.fdtri(dof, noise.dof, 0.95))
