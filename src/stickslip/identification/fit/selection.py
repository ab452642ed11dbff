"""Model selection: information criteria and cross-validation. Burnham and Anderson (2002)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.identification.fit.noise import Noise

Array = np.ndarray[Any, np.dtype[np.float64]]
Indices = np.ndarray[Any, np.dtype[np.intp]]


@dataclass(frozen=True, slots=True)
class Criteria:
    """Akaike's criterion corrected for few points, and the Bayesian one; smaller is better."""

    aicc: float
    bic: float


def criteria(cost: float, n: int, p: int, noise: Noise | None = None) -> Criteria:
    """Return AICc and BIC of a fit with p parameters to n points: Burnham and Anderson 2002, eqs. 2.4 and 6.

    If the noise level does not come from the residual, the likelihood is that of known noise.
    """
    if noise is not None and noise.known and noise.source in ("given", "repeats"):
        fitted, count = cost / noise.std**2, p
    else:
        fitted, count = n * math.log(max(cost, 1e-300) / n), p + 1
    correction = 2.0 * count * (count + 1) / (n - count - 1) if n > count + 1 else math.inf
    return Criteria(fitted + 2.0 * count + correction, fitted + count * math.log(n))


def cross_validate(
    error: Callable[[Indices, Indices], Array], n: int, folds: int = 10, together: Indices | None = None
) -> float:
    """Return the root mean square of errors on points left out.

    Parameters
    ----------
    error : callable
        ``error(fitted, left_out)``: errors at the points `left_out` of a fit to the points `fitted` (indices).
    n, folds : int
        Number of points, and of groups that are left out in turn; `folds` = `n` leaves out one point at a time.
    together : array, shape (n,), optional
        Labels 0, 1, ...: points of the same label are left out together, since related points would reveal each other.
    """
    label = np.arange(n) if together is None else together
    count = int(np.max(label)) + 1
    order = np.random.default_rng(0).permutation(count)
    parts = [np.flatnonzero(np.isin(label, order[i :: min(folds, count)])) for i in range(min(folds, count))]
    squares = [error(np.setdiff1d(np.arange(n), part), part) ** 2 for part in parts]
    return math.sqrt(float(np.mean(np.concatenate(squares))))
