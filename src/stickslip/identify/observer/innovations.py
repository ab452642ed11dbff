"""What an observer must correct: the torque that a simulated axis lacks, whitened, outliers weighed.

See `stickslip.identify.observer.prediction_error` for the method that minimises it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.identify.fit.axis_start import feasible
from stickslip.identify.fit.broyden import Secants
from stickslip.identify.fit.levenberg_marquardt import Optimum, Squares, descend
from stickslip.identify.fit.parallel import mapped
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.observer.observer import Prepared
from stickslip.simulation.recorded_input.simulation import Mechanics
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]
MakeMechanics = Callable[[Mapping[str, float]], Mechanics]

BAND = 40.0
"""Hz up to which corrections count, where the sample rate allows it."""
ORDER = 16
"""Order of the autoregression."""
FIRST = np.array([1.0, -0.9])
"""The whitening filter before the corrections are known."""
FREEDOM = 10.0
"""Degrees of freedom of Student's distribution that weighs outliers."""
DIFFERENCE = 5e-3
"""Of coordinates, for Jacobians: a contact that breaks away a sample later makes the residuals rough below it."""


# ---- noise -----------------------------------------------------------------------------------------------------


def autoregression(e: Sequence[Array], order: int) -> Array:
    """Coefficients (1, a_1 ... a_p) of the filter that whitens the series: Yule and Walker's equations.

    What lies beyond 4 standard deviations (robust) counts as if it lay there.
    """
    border = 4.0 * robust_std(np.concatenate(list(e)))
    r = np.zeros(order + 1)
    for x in e:
        spectrum = np.abs(np.fft.rfft(np.clip(x, -border, border), 2 * x.size)) ** 2
        r += np.fft.irfft(spectrum)[: order + 1]
    r[0] = r[0] * (1.0 + 1e-8) or 1.0
    return np.array([1.0, *(-x for x in durbin(r.tolist()))])


def durbin(r: Sequence[float]) -> list[float]:
    """Weights of a series' last values, the latest first, for its next one (Durbin's recursion).

    ``r`` are its autocovariances from 0 on, one more than weights. Written out: `scipy.linalg` takes long to load.
    """
    x = [r[1] / r[0]]
    for m in range(1, len(r) - 1):
        above, below = -r[m + 1], -r[0]
        for j in range(m):
            above += r[m - j] * x[j]
            below += r[m - j] * x[m - j - 1]
        k = above / below
        x = [*(x[j] - k * x[m - j - 1] for j in range(m)), k]
    return x


def whitened(filter_: Array, e: Array) -> Array:
    """The series behind the filter, without the values that its start spoils."""
    return np.convolve(e, filter_, "valid")


def robust_std(r: Array) -> float:
    """Standard deviation from the median of the sizes; not that of a series of which more than half is 0."""
    middle = 1.4826 * float(np.median(np.abs(r)))
    return middle if middle > 0.0 else max(float(np.std(r)), 1e-300)


def student_scale(r: Array, freedom: float) -> float:
    """Scale of Student's distribution that fits the residuals best (a few steps of expectation-maximisation)."""
    s = robust_std(r)
    for _ in range(8):
        s = math.sqrt(float(np.mean(student_weight(r / s, freedom) * r * r)))
    return s


def student_weight(x: Array, freedom: float) -> Array:
    """Weight of the square of each residual, in scales, in the likelihood's gradient."""
    return (freedom + 1.0) / (freedom + x * x)


@dataclass(frozen=True, eq=False)
class Criterion:
    """What is minimised: the records' corrections behind a whitening filter, outliers weighed.

    Attributes
    ----------
    records : sequence of Prepared
    whitening : array
        Coefficients of the filter.
    scale : float
        Of Student's distribution, N·m; infinite for plain squares.
    freedom : float
        Its degrees of freedom.
    """

    records: Sequence[Prepared]
    law: Law
    vector: Vector
    mechanics: MakeMechanics
    whitening: Array
    scale: float = math.inf
    freedom: float = FREEDOM

    @staticmethod
    def first(
        records: Sequence[Prepared], law: Law, vector: Vector, mechanics: MakeMechanics
    ) -> Criterion:  # fmt: skip
        """Plain squares behind the first filter: for the search."""
        return Criterion(records, law, vector, mechanics, FIRST)

    def corrections(self, u: Array) -> list[Array]:
        """Torque that the model lacks on every record; not a number where the law refuses the parameters."""
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return [r.nothing() for r in self.records]
        axis = self.mechanics(self.vector.named(u))
        return [r.correction(axis, parameters) for r in self.records]

    def white(self, u: Array) -> Array:
        """The corrections behind the filter, shape (n,)."""
        return np.concatenate([whitened(self.whitening, e) for e in self.corrections(u)])

    def residuals(self, u: Array) -> Array:
        """Numbers whose squares add up to the criterion: twice the negative logarithm of the likelihood."""
        r = self.white(u)
        if math.isinf(self.scale):
            return r
        n = self.freedom
        return np.copysign(np.sqrt((n + 1.0) * np.log1p((r / self.scale) ** 2 / n)), r)

    def squares(self) -> Squares:
        """The residuals between the bounds of the vector."""
        return Squares(self.residuals, self.vector.lower, self.vector.upper, DIFFERENCE, mapped)

    def search(self, u: Array) -> Secants:
        """A descent that stands at u."""
        return Secants(self.squares(), u)

    def descend(self, u: Array, iterations: int, tolerance: float, jacobian_there: bool = True) -> Optimum:
        """The minimum reached from u."""
        return descend(
            self.squares(), u, iterations=iterations, tolerance=tolerance, jacobian_there=jacobian_there
        )

    def adapted(self, u: Array) -> Criterion:
        """The same with filter and scale that the corrections at u suggest."""
        new = replace(self, whitening=autoregression(self.corrections(u), ORDER))
        return replace(new, scale=student_scale(new.white(u), self.freedom))

    def weighed(self, u: Array) -> Array:
        """The corrections behind the filter in scales, times the square root of their weight, shape (n,)."""
        x = self.white(u) / self.scale
        return np.sqrt(student_weight(x, self.freedom)) * x
