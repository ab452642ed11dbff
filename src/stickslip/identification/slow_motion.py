"""Estimation of a law from reversals, break-away and slow motion, by simulation along the measured motion.

The simulated axis is driven by the recorded torque and follows the measured motion through an observer
(`stickslip.identification.observer.observer`); the torque that this requires is the misfit, whitened by an
autoregression, with Student weights against outliers (prediction-error method: Ljung 1999, chapters 7 and 9). The
torque's delay is included: the simulated axis receives the torque when it acted.

Inertia, constant torque, gravity and delay are those of gross sliding, which assumes less, without feedback to them (a
cut posterior: Plummer 2015). Sliding also gives a prior of the law's steady friction at its speeds; if the simulation
contradicts it, the intervals widen (Birge 1932). Level and slope are then sliding's own; friction at rest and its
velocity, which both determine, are combined by their precision (DerSimonian and Laird 1986).
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_parameter
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.spec import Law, Par
from stickslip.identification.estimate import Estimate
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import feasible
from stickslip.identification.fit.jackknife import leave_blocks_out
from stickslip.identification.fit.noise import Noise
from stickslip.identification.fit.parallel import mapped
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.fit.sample_rate_limit import (
    of_presliding,
    stiffness_at_rest,
    unresolved_refused,
    unseen_refused,
)
from stickslip.identification.fit.student import student_quantile
from stickslip.identification.fit.uncertainty import interval_of, verdict_on
from stickslip.identification.observer.innovations import (
    BLOCK,
    DELAY,
    Criterion,
    Prior,
    perturbed_steps,
    ridge_of,
    weighted,
)
from stickslip.identification.observer.observer import EXACT, ROUGH, prepare
from stickslip.identification.output_error.gravity import hanging
from stickslip.identification.output_error.problem import mechanics_of
from stickslip.identification.output_error.search import Asked, laid_out
from stickslip.identification.output_error.starts import Watched, starting_points, watched
from stickslip.identification.posterior import log_sum
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.identification.sliding import QUANTILE, SlidingPosterior, quantiles
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

STARTS, FIRST_STEPS, STEPS = 4, 30, 60
"""Starts that are followed; most simulations of each at first, and of a later descent."""
SETTLED = 1e-3
"""Relative decrease of the sum of squares at which a search stops."""
TOLERANCE = 1e-4
"""Relative decrease of the sum of squares at which the last descent stops."""
UNMODELLED = 3.0
"""Factor on the simulation's standard deviations, for effects that it does not describe (torque between rows, ringing,
the observer): calibrated by coverage on simulated logs (`benchmarks/ordinary_logs.py`)."""
DELAY_PRIOR = 0.6
"""Prior standard deviation of the delay, rows, as in sliding: used if no sliding determines the delay."""
SERIES = 0.1
"""Greatest contact stiffness as a part of the train's least: the two in series are then softer by a tenth."""
SURE = 0.95
"""Probability from which on friction is taken to fall with velocity."""
ALIKE = 1e-3
"""Relative error of any law's steady torque."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Results that a law's simulation builds on.

    Attributes
    ----------
    experiments : sequence of Experiment
        Without the torque over position and time that sliding found.
    axis : ServoAxis
    start : InverseDynamics
        Plain least squares: starting point of searches.
    sliding : SlidingPosterior or None
    """

    experiments: Sequence[Experiment]
    axis: ServoAxis
    start: InverseDynamics
    sliding: SlidingPosterior | None

    def given_exponent(self, exponent: float) -> Evidence:
        """Return the evidence given one exponent of friction's fall in sliding."""
        return replace(self, sliding=self.sliding and self.sliding.given_exponent(exponent))


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to slow motion, given the results of sliding.

    Attributes
    ----------
    vector : Vector
        Its free parameters are the law's, and the axis's own if no sliding determines them.
    u : array, shape (p,)
    covariance : array, shape (p, p)
        Covariance of the coordinates.
    model : Model
    estimates : tuple of Estimate
        Estimates of the free parameters except the delay.
    contradiction : float
        RMS deviation of the simulation's own steady friction from sliding's, standard deviations.
    corrections : tuple of array
        Torque that the model lacks, N·m (N), in the observer's band.
    level : float
        Level of friction, N·m (N), to which torques are compared.
    exponents : mapping of float to float
        Probability of every exponent ``delta_s`` that was fitted; empty if one is given.
    """

    vector: Vector
    u: Array
    covariance: Array
    model: Model
    estimates: tuple[Estimate, ...]
    contradiction: float
    corrections: tuple[Array, ...]
    level: float
    exponents: Mapping[float, float] = field(default_factory=dict[float, float])

    def combinations(self) -> list[str]:
        """Return products of parameters that are determined although no single one is, in a sentence each."""
        untold = {e.name for e in self.estimates if not e.identified and e.value > 0.0}
        free = [p for p in self.vector.free if p.name in untold and p.logarithmic]
        places = [i for p in free if (i := self.vector.coordinate_of(p.name)) is not None]
        if len(places) < 2:
            return []
        inner = self.covariance[np.ix_(places, places)]
        if not np.all(np.isfinite(inner)):
            return []
        sizes, ways = np.linalg.eigh(inner)
        names = [
            self.vector.free[i].name for i in range(len(self.vector.free)) if self.vector.free[i] in free
        ]
        out = list[str]()
        for size, way in zip(sizes, ways.T, strict=True):
            part = way * np.sign(way[np.argmax(np.abs(way))])
            named = [f"{x:.2g} log {n}" for x, n in zip(part, names, strict=True) if abs(x) > TAKES_PART]
            if math.sqrt(max(size, 0.0)) <= DETERMINED and len(named) > 1:
                out.append(
                    f"Of what is not identified, {' + '.join(named).replace('+ -', '- ')} is determined."
                )
        return out

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, shape (n, n)."""
        kept = [i for i, n in enumerate(self.vector.names) if n != DELAY]
        change = self.vector.jacobian(self.u)[kept]
        return correlation_of(change @ self.covariance @ change.T)


EXPONENT_NAMES = ("delta_s", f"delta_s{NEGATIVE}")
"""Exponents of friction's fall, also of a law with parameters for each direction."""
DETERMINED = math.log(2.0) / (2.0 * QUANTILE)
"""Standard deviation of a logarithm whose 95 % interval spans a factor of two: the limit of identified."""
TAKES_PART = 0.3
"""Coefficient from which on a parameter is named in a combination."""


def correlation_of(covariance: Array) -> Array:
    """Return the correlation of a covariance; NaN where a variance is 0."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(covariance / np.outer(std, std))


# ---- the search -----------------------------------------------------------------------------------------------------


def known_mechanics(sliding: SlidingPosterior) -> dict[str, float]:
    """Return inertia, constant torque, gravity and delay from sliding."""
    value = {n: x.value for n, x in sliding.numbers.items()}
    known = {n: value[n] for n in ("inertia", "offset", DELAY)}
    known["inertia"] = max(known["inertia"], 1e-3 * sliding.fits[0].level.inertia)
    if "gravity_sin" in value:
        size, angle = hanging(value["gravity_sin"], value["gravity_cos"], sliding.rows.position)
        known |= {"gravity": size, "gravity_angle": angle}
    return known


def curve_seen(law: Law, speeds: Array) -> Any:
    """Return a function of named numbers and parameters: steady torque forward and backward at some speeds."""
    velocity = np.concatenate([speeds, -speeds])
    steady = Steady(law, velocity, np.sign(velocity))

    def seen(named: Mapping[str, float], parameters: Any) -> Array:
        return np.asarray(steady.torque(np.array(law.pack(parameters))) + named["offset"])

    return seen


def curve_places(sliding: SlidingPosterior) -> list[int]:
    """Return the indices of the steady torques among the numbers of sliding."""
    return [k for k, n in enumerate(sliding.names) if n.startswith(("forward[", "backward["))]


def curve_prior(law: Law, sliding: SlidingPosterior | None) -> Prior | None:
    """Return sliding's prior of a law's steady friction; None for a law without steady friction."""
    if sliding is None or law.steady is None:
        return None
    mean, covariance = moments(sliding, curve_places(sliding))
    root: Array = np.asarray(
        np.linalg.inv(np.linalg.cholesky(covariance + form_of(sliding))), dtype=np.float64
    )
    return Prior(mean, root, curve_seen(law, sliding.speeds))


def form_of(sliding: SlidingPosterior) -> Array:
    """Return the covariance of steady torques from a law's form, which real friction never follows exactly."""
    return (ALIKE * sliding.friction) ** 2 * np.eye(2 * sliding.speeds.size)


def moments(sliding: SlidingPosterior, places: Sequence[int]) -> tuple[Array, Array]:
    """Return mean and covariance of some numbers of the mixture, as wide as its intervals."""
    w = sliding.weights
    means = np.array([m.mean[places] for m in sliding.members])
    mean = w @ means
    inner = np.einsum(
        "m,mij->ij", w, np.array([m.covariance[np.ix_(places, places)] for m in sliding.members])
    )
    apart = means - mean
    return mean, (sliding.width / QUANTILE) ** 2 * inner + (apart * w[:, None]).T @ apart


def laid_out_with_delay(
    evidence: Evidence, law: Law, first: InverseDynamics, model: Model, asked: Asked
) -> Vector:
    """Return the vector of fitted parameters and the delay; the axis's own are held if sliding determines them."""
    sliding, period = evidence.sliding, max(t.period for t in evidence.experiments)
    late = 0.0
    if sliding is not None:
        known = known_mechanics(sliding)
        late = known.pop(DELAY)
        given = {n: x for n, x in known.items() if n not in asked.frozen}
        asked = replace(asked, values={**asked.values, **given}, frozen=(*asked.frozen, *given))
    vector, _ = laid_out(evidence.experiments, evidence.axis, law, first, model, asked)
    own = {f.name for f in law.fields}
    beside = [p for p in vector.parameters if p.name.partition("[")[0] not in own]
    held = [p.name for p in vector.parameters if not p.free]
    delay = Parameter(DELAY, Par("s", "t_s", "delay of the torque's column"), late, scale=period)
    return type(vector)(
        vector.base, frozen=[*held, *([DELAY] if sliding is not None else [])], extra=[*beside, delay]
    )


def search_law(
    evidence: Evidence, law: Law, asked: Asked, seen: Watched, steps: int = STEPS
) -> tuple[Criterion, Array]:  # fmt: skip
    """Find the best minimum from several starts, weights adapted once; return its criterion and coordinates.

    Raises
    ------
    InputError
        If no simulation from a start succeeds.
    """
    first = start_beside(evidence)
    prior, level = curve_prior(law, evidence.sliding), abs(first.coulomb)
    period = max(t.period for t in evidence.experiments)
    if evidence.sliding is None:
        prior = Prior(
            np.zeros(1), np.eye(1) / (DELAY_PRIOR * period), lambda named, _: np.array([named[DELAY]])
        )
    mechanics = functools.partial(mechanics_of, harmonic_period=asked.extras.harmonic_period)
    criteria = list[Criterion]()
    records: Any = None
    for model in starting_points(evidence.experiments, evidence.axis, law, first, asked.values):
        vector = laid_out_with_delay(evidence, law, first, model, asked)
        inertia = vector.named(vector.start)["inertia"]
        # All starts share one inertia.
        records = records or [
            prepare(m, law, inertia, level, seen.band, rounding=ROUGH) for m in seen.motions
        ]
        criteria.append(Criterion.first(records, law, vector, mechanics))
    plain = mapped(lambda c: float(np.median(np.abs(c.white(c.vector.start)))), criteria)
    rough = 1.4826 * min((x for x in plain if math.isfinite(x)), default=math.inf)
    criteria = [replace(c, prior=prior, rough=rough) for c in criteria]
    costs = mapped(lambda c: c.cost(c.vector.start), criteria)
    ranked = [c for _, c in sorted(zip(costs, criteria, strict=True), key=lambda x: x[0]) if math.isfinite(_)]
    if not ranked:
        raise InputError(
            f"{law.name}: no simulation from the starting values succeeds; give others with "
            f"{name_parameter('NAME', 'VALUE')}"
        )
    running = mapped(lambda c: (c, c.search(c.vector.start)), ranked[:STARTS])
    mapped(operator.methodcaller("run", min(steps, FIRST_STEPS), SETTLED), [s for _, s in running])
    criterion, search = min(running, key=lambda x: x[1].cost)
    criterion = criterion.adapted(search.u)
    search = criterion.search(search.u)
    search.run(steps, SETTLED)
    return criterion, search.u


def start_beside(evidence: Evidence) -> InverseDynamics:
    """Return plain least squares with its values replaced by those of sliding."""
    start, sliding = evidence.start, evidence.sliding
    if sliding is None or not start.has("fc"):
        return start
    named = {"inertia": "inertia", "fc": "fc", "sigma2": "fv", "offset": "offset"}
    values = start.values.copy()
    for own, plain in named.items():
        values[start.names.index(plain)] = sliding.numbers[own].value
    return replace(start, values=values)


# ---- the fit --------------------------------------------------------------------------------------------------------


def fit_law(
    evidence: Evidence, law: Law, asked: Asked, start: Mapping[str, Any] | None = None,
    exponents: Mapping[float, float] | None = None,
) -> LawFit:  # fmt: skip
    """Fit a law to slow motion, given what gross sliding determines.

    Parameters
    ----------
    evidence : Evidence
    law : Law
    asked : Asked
        Values that the user holds, frees and gives.
    start : mapping, optional
        Starting values of the law; several starts are tried if None.
    exponents : mapping of float to float, optional
        Exponents ``delta_s`` of friction's fall with their probabilities from sliding. The law is fitted with each; the
        likeliest gives the values, and the intervals are those of the mixture (Hoeting et al. 1999).

    Raises
    ------
    InputError
        If a record has no drive signal, the axis has backlash, or no simulation succeeds.
    """
    if not exponents:
        return fit_minimum(evidence, law, asked, start or {}).law_fit
    likeliest, *others = exponents

    def fit(exponent: float, values: Mapping[str, Any]) -> Minimum:
        own = {**values, **{n: exponent for n in EXPONENT_NAMES if n in names}}
        return fit_minimum(evidence.given_exponent(exponent), law, asked, own)

    names = {f.name for f in law.fields}
    first = fit(likeliest, start or {})
    minima, weights = [first], [exponents[likeliest]]
    for exponent in others:
        try:
            minima.append(fit(exponent, first.law_fit.model.parameters._asdict()))
        except InputError:
            # No simulation with this exponent succeeds.
            continue
        weights.append(exponents[exponent])
    best = min(minima, key=first.cost_of)
    if best is not first:
        # The search is local: the minimum with another exponent may be a better start for this one.
        again = fit(likeliest, best.law_fit.model.parameters._asdict())
        minima[0] = min(first, again, key=first.cost_of)
    return mix_minima(minima, weights)


@dataclass(frozen=True, eq=False)
class Minimum:
    """A law fitted with one exponent, its criterion and the coordinates of the minimum."""

    law_fit: LawFit
    criterion: Criterion
    u: Array

    def squares_of(self, other: Minimum) -> Array:
        """Return the squares of another minimum, whitened and weighed as this one, shape (n,)."""
        return replace(self.criterion, vector=other.criterion.vector, prior=None).residuals(other.u) ** 2

    def prior_of(self, other: Minimum) -> float:
        """Return the sum of squares by which another minimum contradicts the steady friction of sliding."""
        prior = other.criterion.prior
        own = replace(self.criterion, vector=other.criterion.vector, prior=prior)
        return (
            0.0
            if prior is None
            else float(np.sum((prior.root @ (own.prior_seen(other.u) - prior.mean)) ** 2))
        )

    def cost_of(self, other: Minimum) -> float:
        """Return the sum of squares of another minimum under this one's weights."""
        cost = float(np.sum(self.squares_of(other))) + self.prior_of(other)
        return cost if math.isfinite(cost) else math.inf

    def log_odds(self, other: Minimum, prior: float) -> float:
        """Return the log odds of another minimum against this one, after `prior` log odds.

        The uncertainty of the difference of both log likelihoods follows from its scatter over segments of time (Vuong
        1989); the odds are averaged over it (MacKay 1992).
        """
        if math.isinf(self.cost_of(other)):
            return -math.inf
        apart = 0.5 * (self.squares_of(self) - self.squares_of(other))
        segments = np.bincount(self.criterion.blocks(BLOCK), apart)
        variance = segments.size * float(np.var(segments, ddof=1))
        known = 0.5 * (self.prior_of(self) - self.prior_of(other))
        return (prior + known + float(np.sum(segments))) / math.sqrt(1.0 + math.pi * variance / 8.0)


def fit_minimum(evidence: Evidence, law: Law, asked: Asked, start: Mapping[str, Any]) -> Minimum:
    """Fit a law to slow motion from a start."""
    seen = watched(evidence.experiments, evidence.axis, asked)
    criterion, u = search_law(evidence, law, replace(asked, values={**asked.values, **start}), seen)
    inertia = criterion.vector.named(u)["inertia"]
    level = abs(start_beside(evidence).coulomb)
    exact = [prepare(m, law, inertia, level, seen.band, 1.0, math.inf, EXACT) for m in seen.motions]
    criterion = replace(criterion, records=exact).adapted(u)
    search = criterion.search(u)
    search.run(STEPS, SETTLED)
    optimum = criterion.descend(search.u, 12, TOLERANCE)
    vector, u = criterion.vector, optimum.u
    covariance, contradiction = spread_of(criterion, optimum, evidence)
    model = model_at(law, vector, u)
    found = [own_estimate(vector, k, u, covariance, level) for k in range(len(vector.free))]
    if evidence.sliding is not None and means_the_same(model, evidence.sliding.speeds):
        found = [
            beside_sliding(e, p, evidence.sliding, level) for e, p in zip(found, vector.free, strict=True)
        ]
        u = vector.coordinates({e.name: e.value for e in found})
        model = model_at(law, vector, u)
    highest = max(float(np.max(np.abs(m.seen.velocity))) for m in seen.motions)
    period, own = max(m.period for m in seen.motions), model.parameters
    estimates: Sequence[Estimate] = [e for e in found if e.name != DELAY]
    estimates = unseen_refused(estimates, law, own, vector.named(u)["inertia"], highest, period)
    estimates = unresolved_refused(estimates, law, own, evidence.experiments, level)
    if evidence.sliding is not None:
        estimates = compliant_refused(estimates, model, evidence.sliding)
    corrections = tuple(criterion.corrections(u))
    fit = LawFit(vector, u, covariance, model, tuple(estimates), contradiction, corrections, level)
    return Minimum(fit, criterion, optimum.u)


def mix_minima(minima: Sequence[Minimum], probabilities: Sequence[float]) -> LawFit:
    """Return the likeliest fit with the intervals of the mixture over all of them."""
    prior = np.log(np.array(probabilities) / probabilities[0])
    log_weight = np.array([minima[0].log_odds(m, x) for m, x in zip(minima, prior.tolist(), strict=True)])
    share = np.exp(log_weight - log_sum(log_weight))
    best = minima[int(np.argmax(share))].law_fit
    parameters = {p.name: p for p in best.vector.free}
    found = list[Estimate]()
    for e in best.estimates:
        same = [next(x for x in m.law_fit.estimates if x.name == e.name) for m in minima]
        ends = np.array([x.interval for x in same])
        if not np.all(np.isfinite(ends)):
            found.append(e)
            continue
        # A positive number's interval is mixed in its logarithm.
        positive = bool(np.all(ends > 0.0))
        ends = np.log(ends) if positive else ends
        _, low, high = quantiles(ends.mean(axis=1), 0.5 * (ends[:, 1] - ends[:, 0]), share)
        low, high = (math.exp(low), math.exp(high)) if positive else (low, high)
        mixed = judged(parameters[e.name], e.value, low, high, best.level)
        found.append(mixed if e.identified else replace(mixed, identified=False, verdict=e.verdict))
    exponents = [m.law_fit.model.parameters.delta_s for m in minima]
    return replace(best, estimates=tuple(found), exponents=dict(zip(exponents, share.tolist(), strict=True)))


def compliant_refused(
    estimates: Sequence[Estimate], model: Model, sliding: SlidingPosterior
) -> list[Estimate]:
    """Return the estimates; those of pre-sliding become not identified if a train may yield as much as the contact."""
    law, p = model.law, model.parameters
    stiffness, cause = stiffness_at_rest(law, p), sliding.compliance
    if cause:
        why = f"and there {sliding.alternatives[cause].cause} yields as well"
    elif stiffness > SERIES * sliding.stiffness_bound:
        why = (
            f"and a train of {sliding.stiffness_bound:.2g} or more, as soft as sliding allows, may yield there beside "
            f"the contact of {stiffness:.2g}"
        )
    else:
        return list(estimates)
    why = f"determined by reversals only, {why}; record slow reversals with a sensor at the load"
    return [
        replace(e, identified=False, verdict=why, cause=cause)
        if e.identified and of_presliding(law, p, e.name, sliding.speeds) else e for e in estimates
    ]  # fmt: skip


def model_at(law: Law, vector: Vector, u: Array) -> Model:
    """Return the law at some coordinates, or the nearest parameters that it accepts."""
    accepted = feasible(law, vector.law_parameters(u))
    assert accepted is not None
    return Model(law, **accepted._asdict())


def spread_of(criterion: Criterion, optimum: Any, evidence: Evidence) -> tuple[Array, float]:
    """Return the covariance of the coordinates, and the simulation's contradiction to sliding in standard deviations.

    It is the larger of leaving segments of time out and of adding the corrections back as noise, with the prior and the
    uncertainty of the axis's own numbers in sliding. A contradiction widens all of it (Birge 1932).
    """
    free = replace(criterion, prior=None)
    known = 0 if criterion.prior is None else criterion.prior.mean.size
    rows = optimum.residuals.size - known
    own = replace(optimum, residuals=optimum.residuals[:rows], jacobian=optimum.jacobian[:rows])
    apart: Array = optimum.residuals[rows:]
    pull: Array = optimum.jacobian[rows:]
    contradiction = math.sqrt(float(np.mean(apart**2))) if known else 0.0
    r, jacobian = weighted(free, own)
    ridge = ridge_of(r, optimum.u.size)
    centred = r - jacobian @ np.linalg.solve(jacobian.T @ jacobian + ridge, jacobian.T @ r)
    held = ridge + pull.T @ pull
    spread = leave_blocks_out(jacobian, centred, free.blocks(BLOCK), held)
    noise = perturbed_steps(free, own, np.random.default_rng(0), held)
    variance = np.maximum(np.diag(spread.covariance), np.diag(noise))
    freedom = [max(spread.freedom(e) - 1.0, 1.0) for e in np.eye(optimum.u.size)]
    wider = UNMODELLED * max(contradiction, 1.0) * np.array([student_quantile(f) / QUANTILE for f in freedom])
    size = wider * np.sqrt(variance / np.diag(spread.covariance))
    covariance = spread.covariance * np.outer(size, size)
    if evidence.sliding is not None:
        information = jacobian.T @ jacobian + held
        covariance = covariance + of_the_axis(free, optimum.u, evidence.sliding, information, jacobian)
    return covariance, contradiction


def of_the_axis(
    criterion: Criterion, u: Array, sliding: SlidingPosterior, information: Array, jacobian: Array
) -> Array:
    """Return the law's covariance due to sliding's uncertainty of inertia, constant torque and delay."""
    names = [n for n in ("inertia", "offset", DELAY) if n in sliding.names]
    _, spread = moments(sliding, [sliding.names.index(n) for n in names])
    base, held = criterion.weighed(u), {p.name: p.value for p in criterion.vector.parameters if not p.free}
    columns = list[Array]()
    for k, name in enumerate(names):
        # Not a small difference: a contact that breaks away a sample later makes the corrections rough.
        change = 0.3 * math.sqrt(spread[k, k])
        if name not in held or change == 0.0:
            columns.append(np.zeros(base.size))
            continue
        moved = held_elsewhere(criterion.vector, name, held[name] + change)
        columns.append((replace(criterion, vector=moved).weighed(u) - base) / change)
    if not np.all(np.isfinite(columns)):
        return np.zeros((u.size, u.size))
    told = -np.linalg.solve(information, jacobian.T @ np.column_stack(columns))
    return np.asarray(told @ spread @ told.T)


def held_elsewhere(vector: Vector, name: str, value: float) -> Vector:
    """Return the vector with another value of a held parameter."""
    assert vector.base is not None
    own = {f.name for f in vector.base.law.fields}
    beside = [
        replace(p, value=value) if p.name == name else p
        for p in vector.parameters
        if p.name.partition("[")[0] not in own
    ]
    return type(vector)(vector.base, frozen=[p.name for p in vector.parameters if not p.free], extra=beside)


# ---- combination with sliding ---------------------------------------------------------------------------------------


def own_estimate(vector: Vector, place: int, u: Array, covariance: Array, level: float) -> Estimate:
    """Return the simulation's own estimate of a free parameter."""
    p, value, change = vector.free[place], float(vector.values(u)[place]), vector.jacobian(u)[place]
    std = math.sqrt(max(float(change @ covariance @ change), 0.0))
    return judged(p, value, *interval_of(p, value, QUANTILE * std, None), level)


def judged(p: Parameter, value: float, low: float, high: float, level: float) -> Estimate:
    """Return an estimate with its verdict; torques are compared to friction's level."""
    scale = 1.0 if p.par.unit == "rad" else level
    why = verdict_on(p, value, low, high, Noise(1.0, "residual", math.inf), scale)
    std = (high - low) / (2.0 * QUANTILE)
    return Estimate(p.name, p.par.unit, p.par.symbol, value, std, low, high, not why, why)


def beside_sliding(e: Estimate, p: Parameter, sliding: SlidingPosterior, level: float) -> Estimate:
    """Return level and slope from sliding; combine friction at rest and its velocity from both sources.

    Each source counts by its precision, in logarithms; if they contradict each other, the variance between them is
    added to both (DerSimonian and Laird 1986).
    """
    both_ways = f"fc{NEGATIVE}" in sliding.law_names
    name = sliding.law_names.get(p.name, "")
    if name:
        x = sliding.numbers[name]
        low, high = max(x.lower, p.par.lower), min(x.upper, p.par.upper)
        return judged(p, min(max(x.value, low), max(high, low)), low, max(high, low), level)
    if p.name not in ("fs", "vs") or both_ways or "vs" not in sliding.numbers:
        return e
    other = sliding.numbers[p.name]
    if not (e.value > 0.0 and e.lower > 0.0 and other.value > 0.0 and other.lower > 0.0):
        return e
    if sliding.compliance:
        # Reversals then show the spring or the gap as well.
        found = judged(p, other.value, other.lower, other.upper, level)
        if sliding.falls >= SURE:
            return found
        why = f"friction falls with velocity within the recorded speeds with a probability of {sliding.falls:.2g} only"
        return replace(found, identified=False, verdict=why)
    own = math.log(e.upper / e.lower) / (2.0 * QUANTILE)
    theirs = math.log(other.upper / other.lower) / (2.0 * QUANTILE)
    # The less probable a fall, the less precise its velocity.
    theirs /= sliding.falls if p.name == "vs" else 1.0
    apart = math.log(other.value / e.value)
    between = max(0.0, 0.5 * (apart**2 - own**2 - theirs**2))
    weights = 1.0 / (own**2 + between), 1.0 / (theirs**2 + between)
    value = e.value * math.exp(apart * weights[1] / sum(weights))
    half = QUANTILE / math.sqrt(sum(weights))
    return judged(p, value, value * math.exp(-half), value * math.exp(half), level)


OTHERWISE = {"fc": 1.3, "fs": 1.6, "vs": 3.0, "sigma2": 2.0}
"""Factors of a second set of values at which the curves must agree: their form is compared, not their values."""


def means_the_same(model: Model, speeds: Array) -> bool:
    """Return whether a law's ``fc``, ``fs``, ``vs`` and ``sigma2`` are level, fall and slope of sliding's curve.

    A user's law may give these names other meanings: its parameters then come from the simulation, constrained by
    sliding's steady friction, as under any other names. The upper half of sliding's speeds is compared: on a steep
    slope through zero a contact only creeps.
    """
    law, p = model.law, model.parameters
    if law.steady is None or not hasattr(p, "fc"):
        return False
    v = speeds[speeds.size // 2 :]
    for factors in ({}, OTHERWISE):
        q = p._replace(**{n: f * getattr(p, n) for n, f in factors.items() if hasattr(p, n)})
        usual = float(q.fc) + float(getattr(q, "sigma2", 0.0)) * v
        if hasattr(q, "fs") and hasattr(q, "vs"):
            usual = usual + (float(q.fs) - float(q.fc)) * np.exp(
                -((v / float(q.vs)) ** float(getattr(q, "delta_s", 2.0)))
            )
        torque = Steady(law, v, np.ones(v.size)).torque(np.array(law.pack(q)))
        if np.any(np.abs(torque - usual) > ALIKE * abs(q.fc)):
            return False
    return True
