"""Starts of a search for a law's parameters, and the motion that its simulation follows.

Examples of the law are scaled to the axis, both as they are and with their steady torque fitted to the levels of
friction from plain least squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import encoder_step
from stickslip.core.spec import Law
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.axis_start import steady_fits
from stickslip.identification.observer.innovations import BAND
from stickslip.identification.observer.observer import Motion
from stickslip.identification.output_error.search import Asked, starting_models
from stickslip.identification.regression.inverse import InverseDynamics, uniform
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

SLOWER = (0.02, 0.1, 0.5)
"""Parts of the usual speed at which a Stribeck effect is assumed."""
WORSE = 1.1
"""Greatest misfit of a start to the measured levels, relative to the best, for it to be followed."""
RESTING, SLOWEST = 0.02, 1e-3
"""Time at rest after which a torque counts as withstood, s; greatest creep, part of the usual speed."""
LEVELS = 24
"""Groups of speeds, from slow to fast, over which friction is averaged for the start."""


class Watched(NamedTuple):
    """Input of the observer."""

    motions: list[Motion]
    band: float
    """Bandwidth of its corrections, Hz."""


def watched(experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked) -> Watched:
    """Prepare the experiments for the observer; refuse those that it cannot follow."""
    for t in experiments:
        if t.drive is None:
            raise InputError(f"{t.name}: the drive's signal is missing; this method needs it")
    if asked.values.get("backlash", axis.backlash) > 0.0 or "backlash" in asked.free:
        raise InputError(
            "its observer takes the measured velocity for the axis's own, which backlash forbids"
        )
    return Watched([motion_of(t) for t in experiments], min(BAND, *(0.1 / t.period for t in experiments)))


def motion_of(experiment: Experiment) -> Motion:
    """Return the experiment on a regular grid, with its drive's signal including the supply."""
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
    """Return examples on this axis's scales, as they are and with their steady torque fitted to the measured levels.

    In stick-slip motion the levels are misleading: the torque withstood at rest then replaces the slowest ones. The
    simulation decides between the starts.
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
    """Return the torque that the contact withstood at rest, N·m: while the position stays within two counts."""
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
    """Return speeds, from slow to fast, and friction there according to the inverse dynamics, N·m."""
    v = first.velocity
    friction = first.residual + np.sign(v) * first.coulomb + first.viscous * v
    groups = [g for g in np.array_split(np.argsort(np.abs(v)), LEVELS) if g.size]
    speed = np.array([float(np.median(np.abs(v[g]))) for g in groups])
    return speed, np.array([float(np.median(np.sign(v[g]) * friction[g])) for g in groups])


def misfit_of(model: Model, speed: Array, torque: Array) -> float:
    """Return the sum of absolute differences of the steady torque from the levels, N·m; 1 for a law without one."""
    steady = model.law.steady
    if steady is None:
        return 1.0
    return sum(abs(steady(float(x), model.parameters) - y) for x, y in zip(speed, torque, strict=True))
