"""What an observer must correct: the torque that a simulated axis lacks, whitened, outliers weighed.

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
"""Hz up to which corrections count, where the sample rate allows it."""
ORDER = 16
"""Order of the autoregression."""
FIRST = np.array([1.0, -0.9])
"""The whitening filter before the corrections are known."""
FREEDOM = 10.0
"""Degrees of freedom of Student's distribution that weighs outliers."""
BLOCK = 0.25
"""s of a segment that is left out: some correlation times of the disturbance."""
REACH = 3.0
"""Coordinates (factors of e) by which what the data leave open may lie elsewhere."""
DRAWS = 16
"""Times that the corrections are perturbed."""
MEMORY = 0.15
"""s over which they are perturbed alike."""
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


DELAY = "skew"
"""Name of the number in the vector by which the torque's column lies behind the torque that acted, s."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known beside the motion: a normal distribution of some numbers.

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
    prior : Prior, optional
        Of some of the vector's numbers.
    rough : float
        N·m, about the scale of the noise, by which the prior counts beside plain squares.
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
        """Plain squares behind the first filter: for the search."""
        return Criterion(records, law, vector, mechanics, FIRST, prior=prior, rough=rough)

    def corrections(self, u: Array) -> list[Array]:
        """Torque that the model lacks on every record; not a number where the law refuses the parameters."""
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return [r.nothing() for r in self.records]
        named = self.vector.named(u)
        axis = self.mechanics(named)
        return [r.correction(axis, parameters, self.late(named, r)) for r in self.records]

    def late(self, named: Mapping[str, float], record: Prepared) -> float:
        """Seconds by which a record's torque acted before it is taken to act, from its row to the next."""
        if DELAY not in named:
            return 0.0
        time = record.course.drive.time
        return named[DELAY] + 0.5 * float(time[1] - time[0])

    def white(self, u: Array) -> Array:
        """The corrections behind the filter, shape (n,)."""
        return np.concatenate([whitened(self.whitening, e) for e in self.corrections(u)])

    def residuals(self, u: Array) -> Array:
        """Numbers whose squares add up to the criterion: twice the negative logarithm of the likelihood."""
        r = self.white(u)
        if not math.isinf(self.scale):
            n = self.freedom
            r = np.copysign(np.sqrt((n + 1.0) * np.log1p((r / self.scale) ** 2 / n)), r)
        if self.prior is None:
            return r
        known = self.prior.root @ (self.prior_seen(u) - self.prior.mean)
        return np.concatenate([r, known * self.rough if math.isinf(self.scale) else known])

    def prior_seen(self, u: Array) -> Array:
        """The numbers that the prior is about, shape (k,); not numbers where the law refuses the parameters."""
        assert self.prior is not None
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return np.full(self.prior.mean.size, math.nan)
        return self.prior.seen(self.vector.named(u), parameters)

    def cost(self, u: Array) -> float:
        """Sum of squares, infinite where it cannot be had."""
        r = self.residuals(u)
        return float(r @ r) if np.all(np.isfinite(r)) else math.inf

    def blocks(self, seconds: float) -> Array:
        """Number of the stretch of time, so many seconds long, that every whitened correction lies in, shape (n,)."""
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


# ---- how sure a minimum is ------------------------------------------------------------------------------------------


def ridge_of(r: Array, size: int) -> Array:
    """A coordinate that the data leave open is held within `REACH` of where it is, shape (p, p)."""
    variance = float(r @ r) / max(r.size - size, 1)
    return variance / REACH**2 * np.eye(size)


def perturbed_steps(criterion: Criterion, optimum: Optimum, rng: np.random.Generator, held: Array) -> Array:
    """Mean square of the steps of Gauss and Newton from the minimum on records with the corrections as noise.

    `held`, shape (p, p), is the information that is there beside the records.

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
    """A smooth Gaussian series of unit variance that forgets within `MEMORY`, shape (n,)."""
    samples = 0.5 * MEMORY / float(time[1] - time[0])
    smooth = np.exp(-2.0 * (math.pi * samples * np.fft.rfftfreq(time.size)) ** 2)
    x = np.fft.irfft(smooth * np.fft.rfft(rng.standard_normal(time.size)), time.size)
    return x / math.sqrt(float(np.mean(x * x)))


def weighted(criterion: Criterion, optimum: Optimum) -> tuple[Array, Array]:
    """Residuals and their Jacobian, each row times the square root of its weight at the minimum."""
    n = criterion.freedom
    x = criterion.white(optimum.u) / criterion.scale
    # From the Jacobian of the transformed residuals back to that of the plain ones.
    slope = np.full(x.shape, math.sqrt((n + 1.0) / n))
    far = np.abs(x) > 1e-6
    transformed = np.sqrt((n + 1.0) * np.log1p(x[far] ** 2 / n))
    slope[far] = student_weight(x[far], n) * np.abs(x[far]) / transformed
    root = np.sqrt(student_weight(x, n))
    return root * x, optimum.jacobian * (root / slope)[:, None]
