"""Corrections of the observer: the torque that a simulated axis lacks, whitened, with outliers weighted down.

See `stickslip.identification.observer.prediction_error` for the method that minimises it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.spec import Law
from stickslip.identification.fit.axis_start import feasible
from stickslip.identification.fit.broyden import Secants
from stickslip.identification.fit.levenberg_marquardt import Optimum, Squares, descend
from stickslip.identification.fit.parallel import mapped
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.observer.observer import Prepared
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]
MakeMechanics = Callable[[Mapping[str, float]], Mechanics]

BAND = 40.0
"""Bandwidth of the corrections, Hz, if the sample rate allows it."""
ORDER = 16
"""Order of the autoregression."""
FIRST = np.array([1.0, -0.9])
"""The whitening filter before the corrections are known."""
FREEDOM = 10.0
"""Degrees of freedom of Student's distribution against outliers."""
BLOCK = 0.25
"""Length of a segment that is left out, s: some correlation times of the disturbance."""
REACH = 3.0
"""Prior standard deviation of undetermined coordinates (factors of e)."""
DRAWS = 16
"""Number of perturbations of the corrections."""
MEMORY = 0.15
"""Correlation time of a perturbation, s."""
DIFFERENCE = 5e-3
"""Step of the coordinates for Jacobians: residuals are rough below it, since a contact may break away a sample
later."""


# ---- noise -----------------------------------------------------------------------------------------------------


def autoregression(e: Sequence[Array], order: int) -> Array:
    """Return the coefficients (1, a_1 ... a_p) of the filter that whitens the series, by the Yule-Walker equations.

    Values beyond 4 (robust) standard deviations are clipped.
    """
    border = 4.0 * robust_std(np.concatenate(list(e)))
    r = np.zeros(order + 1)
    for x in e:
        spectrum = np.abs(np.fft.rfft(np.clip(x, -border, border), 2 * x.size)) ** 2
        r += np.fft.irfft(spectrum)[: order + 1]
    r[0] = r[0] * (1.0 + 1e-8) or 1.0
    return np.array([1.0, *(-x for x in durbin(r.tolist()))])


def durbin(r: Sequence[float]) -> list[float]:
    """Return the weights of a series' last values, the latest first, for its next one (Durbin's recursion).

    ``r`` are its autocovariances from lag 0, one more than weights. It replaces `scipy.linalg`, whose import is slow.
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
    """Return the filtered series without the values affected by its start."""
    return np.convolve(e, filter_, "valid")


def robust_std(r: Array) -> float:
    """Return the standard deviation from the median magnitude; the plain one if more than half of the values are 0."""
    middle = 1.4826 * float(np.median(np.abs(r)))
    return middle if middle > 0.0 else max(float(np.std(r)), 1e-300)


def student_scale(r: Array, freedom: float) -> float:
    """Return the scale of Student's distribution that fits the residuals best (some expectation-maximisation steps)."""
    s = robust_std(r)
    for _ in range(8):
        s = math.sqrt(float(np.mean(student_weight(r / s, freedom) * r * r)))
    return s


def student_weight(x: Array, freedom: float) -> Array:
    """Return the weight of the square of each residual, in scales, in the likelihood's gradient."""
    return (freedom + 1.0) / (freedom + x * x)


DELAY = "skew"
"""Name of the vector's number for the delay of the torque's column relative to the torque that acted, s."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior knowledge besides the motion: a normal distribution of some numbers.

    Attributes
    ----------
    mean : array, shape (k,)
    root : array, shape (k, k)
        ``root.T @ root`` is the inverse of their covariance.
    seen : callable
        ``seen(named, parameters)``, shape (k,): the numbers of the vector's named values and the law's parameters.
    """

    mean: Array
    root: Array
    seen: Callable[[Mapping[str, float], Any], Array]


@dataclass(frozen=True, eq=False)
class Criterion:
    """The criterion to minimise: the records' corrections after a whitening filter, with outliers weighted down.

    Attributes
    ----------
    records : sequence of Prepared
    whitening : array
        Coefficients of the filter.
    scale : float
        Scale of Student's distribution, N·m; infinite for plain squares.
    freedom : float
        Its degrees of freedom.
    prior : Prior, optional
        Prior of some of the vector's numbers.
    rough : float
        Approximate scale of the noise, N·m, that weights the prior against plain squares.
    """

    records: Sequence[Prepared]
    law: Law
    vector: Vector
    mechanics: MakeMechanics
    whitening: Array
    scale: float = math.inf
    freedom: float = FREEDOM
    prior: Prior | None = None
    rough: float = 1.0

    @staticmethod
    def first(
        records: Sequence[Prepared], law: Law, vector: Vector, mechanics: MakeMechanics, prior: Prior | None = None,
        rough: float = 1.0,
    ) -> Criterion:  # fmt: skip
        """Return plain squares after the first filter, for the search."""
        return Criterion(records, law, vector, mechanics, FIRST, prior=prior, rough=rough)

    def corrections(self, u: Array) -> list[Array]:
        """Return the torque that the model lacks on every record; NaN if the law refuses the parameters."""
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return [r.nothing() for r in self.records]
        named = self.vector.named(u)
        axis = self.mechanics(named)
        return [r.correction(axis, parameters, self.late(named, r)) for r in self.records]

    def late(self, named: Mapping[str, float], record: Prepared) -> float:
        """Return the seconds by which a record's torque acted before its assumed time, from its row to the next."""
        if DELAY not in named:
            return 0.0
        time = record.course.drive.time
        return named[DELAY] + 0.5 * float(time[1] - time[0])

    def white(self, u: Array) -> Array:
        """Return the filtered corrections, shape (n,)."""
        return np.concatenate([whitened(self.whitening, e) for e in self.corrections(u)])

    def residuals(self, u: Array) -> Array:
        """Return the numbers whose squares add up to the criterion: twice the negative log likelihood."""
        r = self.white(u)
        if not math.isinf(self.scale):
            n = self.freedom
            r = np.copysign(np.sqrt((n + 1.0) * np.log1p((r / self.scale) ** 2 / n)), r)
        if self.prior is None:
            return r
        known = self.prior.root @ (self.prior_seen(u) - self.prior.mean)
        return np.concatenate([r, known * self.rough if math.isinf(self.scale) else known])

    def prior_seen(self, u: Array) -> Array:
        """Return the numbers of the prior, shape (k,); NaN if the law refuses the parameters."""
        assert self.prior is not None
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return np.full(self.prior.mean.size, math.nan)
        return self.prior.seen(self.vector.named(u), parameters)

    def cost(self, u: Array) -> float:
        """Return the sum of squares, infinite if it is undefined."""
        r = self.residuals(u)
        return float(r @ r) if np.all(np.isfinite(r)) else math.inf

    def blocks(self, seconds: float) -> Array:
        """Return the index of every whitened correction's segment of time with this length, shape (n,)."""
        rows: list[Any] = []
        first = 0
        for record in self.records:
            n = record.nothing().size - self.whitening.size + 1
            time = record.course.drive.time
            count = max(2, round(n * float(time[1] - time[0]) * record.stride / seconds))
            rows.append(first + (np.arange(n) * count) // n)
            first += count
        return np.concatenate(rows)

    def squares(self) -> Squares:
        """Return the residuals with the bounds of the vector."""
        return Squares(self.residuals, self.vector.lower, self.vector.upper, DIFFERENCE, mapped)

    def search(self, u: Array) -> Secants:
        """Return a descent that starts at u."""
        return Secants(self.squares(), u)

    def descend(self, u: Array, iterations: int, tolerance: float, jacobian_there: bool = True) -> Optimum:
        """Return the minimum reached from u."""
        return descend(
            self.squares(), u, iterations=iterations, tolerance=tolerance, jacobian_there=jacobian_there
        )

    def adapted(self, u: Array) -> Criterion:
        """Return the criterion with the filter and scale estimated from the corrections at u."""
        new = replace(self, whitening=autoregression(self.corrections(u), ORDER))
        return replace(new, scale=student_scale(new.white(u), self.freedom))

    def weighed(self, u: Array) -> Array:
        """Return the filtered corrections in scales, times the square root of their weight, shape (n,)."""
        x = self.white(u) / self.scale
        return np.sqrt(student_weight(x, self.freedom)) * x


# ---- uncertainty of a minimum ---------------------------------------------------------------------------------------


def ridge_of(r: Array, size: int) -> Array:
    """Return the prior information that bounds undetermined coordinates to about `REACH`, shape (p, p)."""
    variance = float(r @ r) / max(r.size - size, 1)
    return variance / REACH**2 * np.eye(size)


def perturbed_steps(criterion: Criterion, optimum: Optimum, rng: np.random.Generator, held: Array) -> Array:
    """Return the mean square of Gauss-Newton steps from the minimum on records with the corrections as noise.

    `held`, shape (p, p), is the information in addition to the records.

    Returns
    -------
    array, shape (p, p)
    """
    u, vector = optimum.u, criterion.vector
    r, jacobian = weighted(criterion, optimum)
    newton = -np.linalg.solve(jacobian.T @ jacobian + held, jacobian.T)
    named = vector.named(u)
    parameters, axis = feasible(criterion.law, vector.law_parameters(u)), criterion.mechanics(named)
    lacking = [x.shifted(criterion.late(named, x), axis).raw(axis, parameters) for x in criterion.records]
    signs = [[random_signs(rng, x.course.drive.time) for x in criterion.records] for _ in range(DRAWS)]

    def step(draw: list[Array]) -> Array:
        records = [x.perturbed(e * s) for x, e, s in zip(criterion.records, lacking, draw, strict=True)]
        return newton @ (replace(criterion, records=records).weighed(u) - r)

    steps = [s for s in mapped(step, signs) if np.all(np.isfinite(s))]
    found = np.array(steps).reshape(-1, u.size)
    return found.T @ found / max(len(steps), 1)


def random_signs(rng: np.random.Generator, time: Array) -> Array:
    """Return a smooth Gaussian series of unit variance and correlation time `MEMORY`, shape (n,)."""
    samples = 0.5 * MEMORY / float(time[1] - time[0])
    smooth = np.exp(-2.0 * (math.pi * samples * np.fft.rfftfreq(time.size)) ** 2)
    x = np.fft.irfft(smooth * np.fft.rfft(rng.standard_normal(time.size)), time.size)
    return x / math.sqrt(float(np.mean(x * x)))


def weighted(criterion: Criterion, optimum: Optimum) -> tuple[Array, Array]:
    """Return the residuals and their Jacobian, each row times the square root of its weight at the minimum."""
    n = criterion.freedom
    x = criterion.white(optimum.u) / criterion.scale
    # From the Jacobian of the transformed residuals back to that of the plain ones.
    slope = np.full(x.shape, math.sqrt((n + 1.0) / n))
    far = np.abs(x) > 1e-6
    transformed = np.sqrt((n + 1.0) * np.log1p(x[far] ** 2 / n))
    slope[far] = student_weight(x[far], n) * np.abs(x[far]) / transformed
    root = np.sqrt(student_weight(x, n))
    return root * x, optimum.jacobian * (root / slope)[:, None]
