"""Prediction error of a whole axis: from records with torque and position to any law, with honest intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.axis_inverse import InverseDynamics, inverse_dynamics, uniform
from stickslip.identify.axis_output import Extras, laid_out, starting_models
from stickslip.identify.axis_problem import Problem
from stickslip.identify.axis_start import steady_fit
from stickslip.identify.axis_trial import Trial
from stickslip.identify.prediction_error import (
    BAND,
    Motion,
    PredictionError,
    explored,
    prediction_error,
)
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.spec import Law

__all__ = ["axis_prediction", "encoder_resolution"]

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOWER = (0.02, 0.1, 0.5)
"""Parts of the usual speed at which a Stribeck effect is looked for."""
WORSE = 1.1
DESCENTS, STEPS = 2, 6
"""Starts from which a few steps are taken, and how many."""
LEVELS = 24
"""Groups of speeds, from slow to fast, in which friction is averaged to start from."""


def axis_prediction(
    trials: Sequence[Trial],
    axis: ServoAxis,
    law: Law,
    *,
    first: InverseDynamics | None = None,
    values: Mapping[str, Any] | None = None,
    free: Sequence[str] = (),
    frozen: Sequence[str] = (),
    extras: Extras = Extras(),  # noqa: B008 (frozen)
    draws: int = 12,
    seed: int = 0,
) -> PredictionError:
    """Identify an axis by what an observer has to correct (`stickslip.identify.prediction_error`).

    Parameters
    ----------
    trials : sequence of Trial
        With the drive's signal.
    axis : ServoAxis
    law : Law
    first : InverseDynamics, optional
        Where the search starts; found here where it is not given.
    values, free, frozen, extras
        As in `stickslip.identify.axis_output.output_error`.
    draws, seed : int
        Imitated records for the intervals, and the seed of their noise.

    Returns
    -------
    PredictionError

    Raises
    ------
    InputError
        If a record has no drive signal, moves too little, or no simulation from the starting values succeeds.
    """
    for t in trials:
        if t.drive is None:
            raise InputError(f"{t.name}: the drive's signal is missing; this method needs it")
    start = first or inverse_dynamics(trials, axis)
    given = dict(values or {})
    band = min(BAND, *(0.1 / t.period for t in trials))
    motions = [motion_of(t) for t in trials]
    tried: list[tuple[float, Problem, float]] = []
    for model in starting_points(trials, law, start, given):
        vector, inertia = laid_out(trials, axis, law, start, model, given, free, frozen, extras)
        problem = Problem.of(
            trials, axis, law, vector, inertia=inertia, harmonic_period=extras.harmonic_period
        )
        _, cost = explored(motions, law, vector, problem.mechanics, inertia=inertia, band=band, iterations=0)
        if math.isfinite(cost):
            tried.append((cost, problem, inertia))
    if not tried:
        raise InputError(
            f"{law.name}: no simulation from the starting values succeeds; give others by `values`"
        )
    tried.sort(key=lambda entry: entry[0])
    best: tuple[float, Array, Problem, float] | None = None
    for _, problem, inertia in tried[:DESCENTS]:
        u, cost = explored(
            motions, law, problem.vector, problem.mechanics, inertia=inertia, band=band, iterations=STEPS
        )
        if best is None or cost < best[0]:
            best = cost, u, problem, inertia
    assert best is not None
    _, u, problem, inertia = best
    return prediction_error(
        motions, law, problem.vector, problem.mechanics, inertia=inertia, start=u, signed_scale=abs(start.coulomb),
        band=band, draws=draws, seed=seed,
    )  # fmt: skip


def motion_of(trial: Trial) -> Motion:
    """The trial on a regular grid, its drive's signal as it acts."""
    t, q, u, rate = uniform(trial)
    supply = 1.0 if trial.supply is None else np.interp(t, trial.time, trial.supply)
    return Motion(t, q, supply * u, encoder_resolution(q), 0.5 / rate)


def encoder_resolution(position: Array) -> float:
    """The step of which the position's changes are whole multiples, rad (m); 0 where there is none."""
    changes = np.abs(np.diff(position))
    changes = changes[changes > 1e-12 * float(np.max(np.abs(position), initial=1e-300))]
    if changes.size < 20:
        return 0.0
    step = float(np.min(changes))
    step = float(np.mean(changes[changes < 1.5 * step]))
    multiples = changes[changes < 50.0 * step] / step
    return step if float(np.mean(np.abs(multiples - np.round(multiples)) < 0.02)) > 0.95 else 0.0


def starting_points(
    trials: Sequence[Trial], law: Law, first: InverseDynamics, given: Mapping[str, Any]
) -> list[Model]:
    """Examples on this axis's scales, as they are and with their steady torque fitted to the measured levels.

    The levels of a motion that sticks and slips mislead; the simulation decides.
    """
    held = [f.name for f in law.fields if f.name in given]
    slower = [replace(first, velocity=part * first.velocity) for part in SLOWER]
    examples = [m for f in slower for m in starting_models(trials, law, f, given)]
    fitted = [fitted_to_levels(m, first, held) for m in examples]
    least = min(misfit for _, misfit in fitted)
    return examples + [m for m, misfit in fitted if misfit <= WORSE * least]


def fitted_to_levels(model: Model, first: InverseDynamics, held: Sequence[str]) -> tuple[Model, float]:
    """The model with its steady torque fitted to the friction that the inverse dynamics leaves at every speed.

    Returns it with the sum of absolute differences, N·m.
    """
    v = first.velocity
    friction = first.residual + np.sign(v) * first.coulomb + first.viscous * v
    order = np.argsort(np.abs(v))
    groups = [g for g in np.array_split(order, LEVELS) if g.size]
    speed = np.array([float(np.median(np.abs(v[g]))) for g in groups])
    torque = np.array([float(np.median(np.sign(v[g]) * friction[g])) for g in groups])
    out = steady_fit(model, speed, torque, held)
    steady = model.law.steady
    if steady is None:
        return out, 1.0
    return out, sum(abs(steady(float(x), out.parameters) - y) for x, y in zip(speed, torque, strict=True))
