"""Honest intervals for an axis: what an observer must correct, whitened, with a spread that leaves segments out.

The simulated axis is driven by the recorded torque and held to the measured motion
(`stickslip.identify.observer.observer`).
What that takes is the torque that the model lacks: disturbance, noise of the torque, rounding of the encoder. An
autoregression of it gives the weights (prediction-error method: Ljung 1999, chapters 7 and 9). It needs no
knowledge of the controller. Three things keep the truth near the minimum:

- Torque and position enter as they were recorded. A filter would round the corners at which a contact breaks away.
- At rest no rounding pulls: positions within half a count are alike.
- Where the disturbance decides whether the contact sticks, measured and simulated motion part for a while. Such
  outliers are few and large; Student's distribution weighs them (Lange, Little and Taylor 1989).

The residuals are correlated and uneven for the same reason, so that the covariance comes from leaving segments of
time out (`stickslip.identify.fit.jackknife`), and the quantile from the degrees of freedom that this has. What the
linearisation does not see, contacts that stick or slip by chance, shows in the steps that the estimate takes when
the corrections are given to the torque once more as noise (dependent wild bootstrap: Shao 2010). Both say how far
the same noise moves the estimate: of the two the larger counts, not the sum. Added is what a slower observer, one
that is firm in slow motion and a stricter view of outliers would have found: none is better founded than the others.
The search (`stickslip.identify.axis.prediction`) takes the firm one, under which the true
parameters are a minimum also where the soft one parts from a contact that sticks by chance.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.identify.estimate import Estimate
from stickslip.identify.fit.axis_start import feasible
from stickslip.identify.fit.jackknife import BlockCovariance, leave_blocks_out
from stickslip.identify.fit.levenberg_marquardt import Optimum
from stickslip.identify.fit.noise import Noise
from stickslip.identify.fit.parallel import mapped
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.fit.sample_rate_limit import of_slow_motion, unseen_refused
from stickslip.identify.fit.student import student_quantile
from stickslip.identify.fit.uncertainty import interval_of, verdict_on
from stickslip.identify.observer.innovations import BAND, Criterion, MakeMechanics, student_weight
from stickslip.identify.observer.observer import EXACT, GRASP, ROUGH, Motion, Prepared, prepare
from stickslip.model import Model
from stickslip.simulation.recorded_input.simulation import Mechanics
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOWER, STRICTER = 0.5, 3.0
"""Other choices that would do as well: an observer this much slower, degrees of freedom this few."""
TOLERANCE = 1e-4
"""Relative decrease of the sum of squares at which the last descent ends."""
EVALUATIONS = 60
"""Simulations by which a round ends, the last step downhill apart."""
BLOCK = 0.25
"""s of a segment that is left out: some correlation times of the disturbance."""
REACH = 3.0
"""Coordinates (factors of e) by which what the data leave open may lie elsewhere."""
DRAWS = 16
"""Times that the corrections are perturbed."""
MEMORY = 0.15
"""s over which they are perturbed alike."""
ALIKE = ("offset",)
"""What every observer finds alike, but for its noise: the mean of the torque. With what the others find added, its
intervals held in 99.0 % of 397 verdicts (seeds 16000 to 16199 and 30000 to 30199)."""
CAUTION = 1.35
"""Factor on the spread of what only slow motion tells: what an observer does to a contact that sticks is in none of the
parts. Without it the intervals of vs, sigma0 and C held in 84, 89 and 82 % (coverage study, seeds 16000 to 16199)."""


@dataclass(frozen=True, eq=False)
class PredictionError:
    """What the method found.

    Attributes
    ----------
    vector : Vector
    u : array, shape (p,)
        Coordinates of the estimate.
    model : Model
    mechanics : Mechanics
        Law and axis there.
    cost : float
        Sum of squares at it, outliers weighed.
    spread : BlockCovariance
        Of the coordinates, by leaving segments out.
    perturbed : array, shape (p, p)
        The same from noise; of the two the larger counts.
    beside : array, shape (p, p)
        What is added: from other choices that would do as well.
    estimates : tuple of Estimate
    corrections : tuple of array
        Per motion the torque that the model lacks, N·m, in the band.
    """

    vector: Vector
    u: Array
    model: Model
    mechanics: Mechanics
    cost: float
    spread: BlockCovariance
    perturbed: Array
    beside: Array
    estimates: tuple[Estimate, ...]
    corrections: tuple[Array, ...]

    def correlation(self) -> Array:
        """Of the estimates, in their order, shape (free parameters, free parameters)."""
        change = self.vector.jacobian(self.u)
        within = 0.5 * (self.spread.covariance + self.perturbed)
        covariance = change @ (within + self.beside) @ change.T
        std = np.sqrt(np.diag(covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return covariance / np.outer(std, std)


# ---- the method ------------------------------------------------------------------------------------------------


def prediction_error(
    motions: Sequence[Motion],
    law: Law,
    vector: Vector,
    mechanics: MakeMechanics,
    *,
    inertia: float,
    friction: float,
    start: Array | None = None,
    signed_scale: float | Mapping[str, float] = math.nan,
    band: float = BAND,
    seed: int = 0,
) -> PredictionError:
    """Estimate mechanics and law from torque and motion, with intervals that hold for coloured noise.

    Parameters
    ----------
    motions : sequence of Motion
    law : Law
    vector : Vector
        Free and frozen parameters; the search starts at its values.
    mechanics : callable
        Makes the axis of all parameters by name.
    inertia : float
        About that of the axis, kg·m²: it sets the observer's stiffness.
    friction : float
        About the Coulomb torque, N·m: what the observer may do to a velocity that the encoder hardly shows.
    start : array, shape (p,), optional
        Coordinates at which the search starts.
    signed_scale : float or mapping
        As in `stickslip.identify.fit.uncertainty.fit`.
    band : float
        Hz up to which corrections count.
    seed : int
        Of the noise with which the corrections are perturbed.

    Returns
    -------
    PredictionError

    Raises
    ------
    InputError
        If a motion is too short for the band, or the model gives no finite values at the start.
    """

    def observed(speed: float = 1.0, grasp: float = math.inf, rounding: float = EXACT) -> list[Prepared]:
        return [prepare(m, law, inertia, friction, band, speed, grasp, rounding) for m in motions]

    criterion = Criterion.first(observed(), law, vector, mechanics)
    u = vector.start if start is None else start
    # Weights and parameters in turn; behind the last the minimum is found to a tenth of their tolerance.
    for _ in range(2):
        criterion = criterion.adapted(u)
        # Along a valley a Jacobian kept by secants gets as far as a fresh one, at a step for each sixteen.
        search = criterion.search(u)
        search.run(EVALUATIONS, 10.0 * TOLERANCE)
        u = search.u
    optimum = criterion.descend(u, 12, TOLERANCE)
    u = optimum.u
    spread = spread_of(criterion, optimum)
    perturbed = perturbed_steps(criterion, optimum, np.random.default_rng(seed))
    others = [
        replace(criterion, freedom=STRICTER),
        replace(criterion, records=observed(grasp=GRASP, rounding=ROUGH)),
        replace(criterion, records=observed(speed=SLOWER, rounding=ROUGH)),
    ]
    moved = mapped(lambda c: c.adapted(u).descend(u, 6, 10.0 * TOLERANCE, jacobian_there=False).u - u, others)
    beside = sum((np.outer(d, d) for d in moved), np.zeros_like(perturbed))
    accepted, named = feasible(law, vector.law_parameters(u)), vector.named(u)
    assert accepted is not None
    highest = max(float(np.max(np.abs(m.seen.velocity))) for m in motions)
    slow = {p.name for p in vector.free if of_slow_motion(law, accepted, p.name, highest, vector.names)}
    estimates = estimates_of(vector, u, spread, perturbed, beside, signed_scale, slow)
    estimates = unseen_refused(
        estimates, law, accepted, named["inertia"], highest, max(m.period for m in motions)
    )
    return PredictionError(
        vector, u, Model(law, **accepted._asdict()), mechanics(named), optimum.cost, spread, perturbed, beside,
        estimates, tuple(criterion.corrections(u)),
    )  # fmt: skip


def spread_of(criterion: Criterion, optimum: Optimum) -> BlockCovariance:
    """How far the estimate moves when a segment of a record is left out."""
    rows: list[Any] = []
    first = 0
    for record in criterion.records:
        n = record.nothing().size - criterion.whitening.size + 1
        dt = float(record.course.drive.time[1] - record.course.drive.time[0]) * record.stride
        count = max(2, round(n * dt / BLOCK))
        rows.append(first + (np.arange(n) * count) // n)
        first += count
    r, jacobian = weighted(criterion, optimum)
    return leave_blocks_out(jacobian, r, np.concatenate(rows), ridge_of(r, optimum.u.size))


def ridge_of(r: Array, size: int) -> Array:
    """A coordinate that the data leave open is held within `REACH` of where it is, shape (p, p)."""
    variance = float(r @ r) / max(r.size - size, 1)
    return variance / REACH**2 * np.eye(size)


def perturbed_steps(criterion: Criterion, optimum: Optimum, rng: np.random.Generator) -> Array:
    """Mean square of the steps of Gauss and Newton from the minimum on records with the corrections as noise.

    Returns
    -------
    array, shape (p, p)
    """
    u, vector = optimum.u, criterion.vector
    r, jacobian = weighted(criterion, optimum)
    newton = -np.linalg.solve(jacobian.T @ jacobian + ridge_of(r, u.size), jacobian.T)
    parameters, axis = feasible(criterion.law, vector.law_parameters(u)), criterion.mechanics(vector.named(u))
    lacking = [x.raw(axis, parameters) for x in criterion.records]
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


def estimates_of(
    vector: Vector,
    u: Array,
    spread: BlockCovariance,
    perturbed: Array,
    beside: Array,
    signed_scale: float | Mapping[str, float],
    slow: Container[str],
) -> tuple[Estimate, ...]:
    """Estimates with 95 % intervals from Student's quantile, in coordinates, and verdicts.

    `slow` names what only slow motion tells.
    """
    values = vector.values(u)
    change = vector.jacobian(u)
    out: list[Estimate] = []
    for k, p in enumerate(vector.free):
        within = max(float(change[k] @ c @ change[k]) for c in (spread.covariance, perturbed))
        variance = within + (0.0 if p.name in ALIKE else float(change[k] @ beside @ change[k]))
        std = math.sqrt(variance) if variance >= 0.0 else math.inf
        std *= CAUTION if p.name in slow else 1.0
        dof = max(spread.freedom(change[k]) - 1.0, 1.0)
        width = student_quantile(dof)
        low, high = interval_of(p, float(values[k]), width * std, None)
        scale = signed_scale.get(p.name, math.nan) if isinstance(signed_scale, Mapping) else signed_scale
        why = verdict_on(p, float(values[k]), low, high, Noise(1.0, "residual", dof), scale)
        out.append(Estimate(p.name, p.par.unit, p.par.symbol, float(values[k]), std, low, high, not why, why))
    return tuple(out)
