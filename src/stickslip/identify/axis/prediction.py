"""Prediction error of a whole axis: from records with torque and position to any law, with honest intervals."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.axis.problem import mechanics_of
from stickslip.identify.axis.search import Asked, Extras, laid_out, starting_models
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.axis_start import steady_fits
from stickslip.identify.fit.broyden import Secants
from stickslip.identify.fit.levenberg_marquardt import cost_of
from stickslip.identify.fit.parallel import mapped
from stickslip.identify.fit.parameter_vector import Vector
from stickslip.identify.observer.innovations import BAND, Criterion
from stickslip.identify.observer.observer import ROUGH, Motion, Prepared, prepare
from stickslip.identify.observer.prediction_error import PredictionError, prediction_error
from stickslip.identify.regression.inverse import InverseDynamics, inverse_dynamics, uniform
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.record import encoder_step
from stickslip.spec import Law

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOWER = (0.02, 0.1, 0.5)
"""Parts of the usual speed at which a Stribeck effect is looked for."""
WORSE = 1.1
BEST, SPREAD = 4, 4
"""Starts that are followed: those of the lowest sums of squares, and some of all others, since a stiffness that is far
off hides how right the rest of a start is."""
ROUNDS = ((BEST + SPREAD, 20), (3, 50))
"""Descents, the best so far, that go on until they have taken so many simulations."""
HOPS, EVALUATIONS = 3, 60
"""Hops from the best of them; simulations that each may take."""
NEARBY = 30
"""Simulations that a rival of the minimum may take."""
SETTLED = 1e-3
"""Relative decrease of the sum of squares below which a descent ends."""
ALIKE = 0.03
"""Coordinates by which two descents differ at least."""
HOP = 0.4
"""Standard deviation of a hop in the law's coordinates; a tenth of it in the others."""
RESTING, SLOWEST = 0.02, 1e-3
"""s of rest after which a torque counts as withstood; and the part of the usual speed that counts as creeping."""
LEVELS = 24
"""Groups of speeds, from slow to fast, in which friction is averaged to start from."""


def axis_prediction(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    law: Law,
    *,
    first: InverseDynamics | None = None,
    values: Mapping[str, Any] | None = None,
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    extras: Extras = Extras(),  # noqa: B008 (frozen)
    seed: int = 0,
) -> PredictionError:
    """Identify an axis by what an observer has to correct (`stickslip.identify.observer.prediction_error`).

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal.
    axis : ServoAxis
    law : Law
    first : InverseDynamics, optional
        Where the search starts; found here where it is not given.
    values, free, frozen, extras
        As in `stickslip.identify.axis.output.output_error`.
    seed : int
        Of the search's hops and of the noise that intervals come from.

    Returns
    -------
    PredictionError

    Raises
    ------
    InputError
        If a record has no drive signal, moves too little, the axis has backlash, or no simulation from the starting
        values succeeds.
    """
    asked = Asked(free, frozen, values or {}, extras)
    seen = watched(experiments, axis, asked)
    start = first or inverse_dynamics(experiments, axis)
    criterion, u = searched(experiments, axis, law, seen, start, asked, seed=seed)
    vector, level = criterion.vector, abs(start.coulomb)
    return prediction_error(
        seen.motions, law, vector, criterion.mechanics, inertia=vector.named(u)["inertia"], friction=level, start=u,
        signed_scale=vector.signed_scale(start.coulomb), band=seen.band, seed=seed,
    )  # fmt: skip


class Rival(NamedTuple):
    """The same law with another value of what it holds fixed."""

    better: float
    """Twice the logarithm of its likelihood over that of the law as it was; below 0 where it explains less."""
    values: dict[str, float]
    """Its free parameters, by name."""


def rival(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, first: InverseDynamics, asked: Asked,
    found: PredictionError, fixed: Mapping[str, float], start: Mapping[str, float],
) -> Rival:  # fmt: skip
    """A prediction error's result beside what the same records say with other fixed values of the law.

    `start` are values that it begins with in place of those found.

    Raises
    ------
    InputError
        If it cannot be simulated with them.
    """
    seen = watched(experiments, axis, asked)
    named = found.vector.named(found.u)
    records = [prepare(m, law, named["inertia"], abs(first.coulomb), seen.band) for m in seen.motions]
    own = {f.name for f in law.fields}
    beside = {k: v for k, v in named.items() if k.partition("[")[0] not in own}
    known: dict[str, Any] = {**found.model.parameters._asdict(), **start, **fixed}
    model = Model(law, **known)
    vector, _ = laid_out(
        experiments, axis, law, first, model, replace(asked, values={**asked.values, **beside, **fixed})
    )
    mechanics = functools.partial(mechanics_of, harmonic_period=asked.extras.harmonic_period)
    criterion = Criterion.first(records, law, found.vector, mechanics).adapted(found.u)
    search = replace(criterion, vector=vector).search(vector.start)
    search.run(NEARBY, SETTLED)
    better = cost_of(criterion.residuals(found.u)) - search.cost
    return Rival(better, dict(zip(vector.names, vector.values(search.u).tolist(), strict=True)))


class Watched(NamedTuple):
    """What the observer follows."""

    motions: list[Motion]
    band: float
    """Hz up to which its corrections count"""


def watched(experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked) -> Watched:
    """The experiments as the observer sees them; refuses what it cannot follow."""
    for t in experiments:
        if t.drive is None:
            raise InputError(f"{t.name}: the drive's signal is missing; this method needs it")
    if asked.values.get("backlash", axis.backlash) > 0.0 or "backlash" in asked.free:
        raise InputError(
            "its observer takes the measured velocity for the axis's own, which backlash forbids"
        )
    return Watched([motion_of(t) for t in experiments], min(BAND, *(0.1 / t.period for t in experiments)))


def searched(
    experiments: Sequence[Experiment], axis: ServoAxis, law: Law, seen: Watched, start: InverseDynamics, asked: Asked,
    *, seed: int = 0, hops: int = HOPS, tolerance: float = SETTLED,
) -> tuple[Criterion, Array]:  # fmt: skip
    """The criterion of the best minimum met under the firm observer, and its coordinates.

    Descents end where a step lowers the sum of squares by less than this part of it.
    """
    records: list[Prepared] = []
    criteria: list[Criterion] = []
    mechanics = functools.partial(mechanics_of, harmonic_period=asked.extras.harmonic_period)
    for model in starting_points(experiments, axis, law, start, asked.values):
        vector, inertia = laid_out(experiments, axis, law, start, model, asked)
        # All start from one inertia.
        records = records or [
            prepare(m, law, inertia, abs(start.coulomb), seen.band, rounding=ROUGH) for m in seen.motions
        ]
        criteria.append(Criterion.first(records, law, vector, mechanics))
    costs = mapped(lambda c: cost_of(c.residuals(c.vector.start)), criteria)
    # Several ways lead to one start: it counts once.
    tried = {float(f"{cost:.6g}"): criterion for cost, criterion in zip(costs, criteria, strict=True)}
    tried.pop(math.inf, None)
    if not tried:
        raise InputError(
            f"{law.name}: no simulation from the starting values succeeds; give others with --set NAME=VALUE (values)"
        )
    ranked = [tried[cost] for cost in sorted(tried)]
    others = ranked[BEST:]
    ranked = ranked[:BEST] + [others[i] for i in spread(len(others), SPREAD)]
    running = mapped(lambda c: (c, c.search(c.vector.start)), ranked)
    for count, evaluations in ROUNDS:
        going = [search for _, search in running[:count]]
        mapped(operator.methodcaller("run", evaluations, tolerance), going)
        running = apart(sorted(running[:count], key=lambda entry: entry[1].cost))
    criterion, search = running[0]
    # Outliers would choose among hops by plain squares: from here on the likelihood that weighs them decides.
    adapted = criterion.adapted(search.u)
    best = descended(adapted, search.u, tolerance)
    rng, own = np.random.default_rng(seed), {f.name for f in law.fields}
    others = [hop(adapted.vector, best[1], own, rng) for _ in range(hops)]
    reached = mapped(lambda u: descended(adapted, u, tolerance), others)
    return adapted, min([best, *reached], key=lambda entry: entry[0])[1]


def spread(count: int, most: int) -> list[int]:
    """At most so many places, evenly among that many, the last among them."""
    taken = min(most, count)
    return [(i + 1) * count // taken - 1 for i in range(taken)]


def apart(running: Sequence[tuple[Criterion, Secants]]) -> list[tuple[Criterion, Secants]]:
    """Those that reached another place than every better one: several starts may lead to one minimum."""
    kept: list[tuple[Criterion, Secants]] = []
    for criterion, search in running:
        if all(float(np.max(np.abs(search.u - k.u))) > ALIKE for _, k in kept):
            kept.append((criterion, search))
    return kept


def descended(criterion: Criterion, start: Array, tolerance: float) -> tuple[float, Array]:
    """Sum of squares and coordinates that a few steps from a start reach; infinite where it cannot be simulated."""
    try:
        search = criterion.search(start)
    except InputError:
        return math.inf, start
    search.run(EVALUATIONS, tolerance)
    return search.cost, search.u


def hop(vector: Vector, u: Array, law: set[str], rng: np.random.Generator) -> Array:
    """Somewhere near, mostly in the law's parameters: a static torque and velocity may hide behind a ridge."""
    own = np.array(
        [p.name.partition("[")[0] in law for p in vector.free if vector.coordinate_of(p.name) is not None]
    )
    own = np.concatenate([own, np.ones(u.size - own.size, dtype=np.bool_)])
    there = u + HOP * np.where(own, 1.0, 0.1) * rng.standard_normal(u.size)
    return np.clip(there, vector.lower, vector.upper)


def motion_of(experiment: Experiment) -> Motion:
    """The experiment on a regular grid, its drive's signal as it acts."""
    t, q, u, _ = uniform(experiment)
    supply = 1.0 if experiment.supply is None else np.interp(t, experiment.time, experiment.supply)
    return Motion(t, q, supply * u, encoder_step(q))


def starting_points(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    law: Law,
    first: InverseDynamics,
    given: Mapping[str, Any],
) -> list[Model]:
    """Examples on this axis's scales, as they are and with their steady torque fitted to the measured levels.

    The levels of a motion that sticks and slips mislead: there the torque that was withstood at rest takes the place
    of the slowest. The simulation decides.
    """
    held = [f.name for f in law.fields if f.name in given]
    slower = [replace(first, velocity=part * first.velocity) for part in SLOWER]
    examples = [m for f in slower for m in starting_models(experiments, law, f, given)]
    speed, torque = levels_of(first)
    fitted = steady_fits(examples, speed, torque, held)
    misfits = [misfit_of(m, speed, torque) for m in fitted]
    near = [m for m, misfit in zip(fitted, misfits, strict=True) if misfit <= WORSE * min(misfits)]
    held_at = held_torque(experiments, axis, first)
    if held_at <= first.coulomb:
        return examples + near
    slow = max(1, LEVELS // 8)
    speed[:slow], torque[:slow] = SLOWEST * first.usual_speed, held_at
    return examples + near + steady_fits(examples, speed, torque, held)


def held_torque(experiments: Sequence[Experiment], axis: ServoAxis, first: InverseDynamics) -> float:
    """Torque that the contact withstood at rest, N·m: where the position stays within two counts for a while."""
    level = 0.0
    for experiment in experiments:
        motion = motion_of(experiment)
        reach = max(1, round(RESTING / float(motion.time[1] - motion.time[0])))
        moved = np.abs(motion.position[reach:] - motion.position[:-reach])
        still = moved <= max(2.0 * motion.count, RESTING * SLOWEST * first.usual_speed)
        gain, _ = axis.drive_gains(experiment.quantity)
        if np.any(still):
            torque = np.abs(gain * motion.torque[reach:][still] - first.offset)
            level = max(level, float(np.quantile(torque, 0.98)))
    return level


def levels_of(first: InverseDynamics) -> tuple[Array, Array]:
    """Speeds, from slow to fast, and the friction that the inverse dynamics leaves there, N·m."""
    v = first.velocity
    friction = first.residual + np.sign(v) * first.coulomb + first.viscous * v
    groups = [g for g in np.array_split(np.argsort(np.abs(v)), LEVELS) if g.size]
    speed = np.array([float(np.median(np.abs(v[g]))) for g in groups])
    return speed, np.array([float(np.median(np.sign(v[g]) * friction[g])) for g in groups])


def misfit_of(model: Model, speed: Array, torque: Array) -> float:
    """Sum of absolute differences of the steady torque from that at the levels, N·m; 1 for a law without one."""
    steady = model.law.steady
    if steady is None:
        return 1.0
    return sum(abs(steady(float(x), model.parameters) - y) for x, y in zip(speed, torque, strict=True))
