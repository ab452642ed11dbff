"""Deviation of a model's torque from the measured torque: the criterion by which identifications are compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.experiment import Experiment
from stickslip.identification.regression.inverse import InverseDynamics, inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]


def force_error(inverse: InverseDynamics, model: Model, axis_values: Mapping[str, float]) -> float:
    """Return the norm of the measured torque that a model does not explain, over the norm of the torque.

    Parameters
    ----------
    inverse : InverseDynamics
        The record's filtered and decimated torque and motion (Janot, Gautier and Brunot 2019, relative error).
    model : Model
        A law with a torque at constant velocity.
    axis_values : mapping
        ``inertia``, ``offset``; of a pendulum ``gravity``, ``gravity_angle``.

    Returns
    -------
    float
        NaN for a law without a steady torque.
    """
    if model.law.steady is None:
        return math.nan
    torque = model_torque(inverse, model, axis_values)
    return float(np.linalg.norm(inverse.torque - torque) / np.linalg.norm(inverse.torque))


def model_torque(inverse: InverseDynamics, model: Model, axis_values: Mapping[str, float]) -> Array:
    """Return the torque of a model along the motion of the inverse dynamics, N·m (N), shape (n,).

    The arguments are those of `force_error`; the law must have a torque at constant velocity.
    """
    assert model.law.steady is not None
    torque = np.zeros(inverse.torque.size)
    gravity, hangs = axis_values.get("gravity", 0.0), axis_values.get("gravity_angle", 0.0)
    effects = {
        "inertia": axis_values["inertia"], "offset": axis_values.get("offset", 0.0),
        "gravity_sin": gravity * math.cos(hangs), "gravity_cos": -gravity * math.sin(hangs),
    }  # fmt: skip
    for name, value in effects.items():
        if inverse.has(name):
            torque += value * inverse.matrix[:, inverse.names.index(name)]
    # Level and slope after the decimation filter; the curve's other parts are taken at the velocity itself.
    sliding = inverse.matrix[:, inverse.names.index("fc")]
    steady = np.array([model.law.steady(float(x), model.parameters) for x in inverse.velocity])
    level = getattr(model.parameters, "fc", inverse.coulomb)
    return torque + steady + level * (sliding - np.sign(inverse.velocity))


def force_error_on(
    experiments: Sequence[Experiment], axis: ServoAxis, model: Model, axis_values: Mapping[str, float],
    cutoff: float | None = None,
) -> float:  # fmt: skip
    """Return the force error on records; NaN if they contain too little motion.

    `cutoff`, Hz, is that of another inverse dynamics to which this error is compared: errors in different bands are not
    comparable.
    """
    try:
        return force_error(inverse_dynamics(experiments, axis, cutoff=cutoff), model, axis_values)
    except InputError:
        return math.nan


def plain_error_on(experiments: Sequence[Experiment], axis: ServoAxis, found: InverseDynamics) -> float:
    """Return the relative error of the plain inverse dynamics on records not fitted; NaN if these are too short."""
    try:
        there = inverse_dynamics(experiments, axis, per_direction=found.has("fc_plus"), cutoff=found.cutoff)
    except InputError:
        return math.nan
    shared = [n for n in there.names if found.has(n)]
    columns = there.matrix[:, [there.names.index(n) for n in shared]]
    left = there.torque - columns @ np.array([found[n] for n in shared])
    return float(np.linalg.norm(left) / np.linalg.norm(there.torque))
