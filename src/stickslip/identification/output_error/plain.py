"""The plain inverse dynamics as an identification: ``--inverse``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.gravity import hanging
from stickslip.identification.regression.force_error import plain_error_on
from stickslip.identification.regression.inverse import InverseDynamics, inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

POSITIVE = ("inertia", "fc", "sigma2", "gravity")
"""Starts of the names of positive numbers, except the angle of a pendulum."""


OTHER_CORNERS = (0.5, 0.7, 1.4)
"""Factors on the low-pass corner at which the equations are solved again: the change of a value measures its dependence
on ramps and reversals."""


def at_other_corners(
    found: InverseDynamics, experiments: Sequence[Experiment], axis: ServoAxis, harmonics: int = 0
) -> list[InverseDynamics]:
    """Return the inverse dynamics with the low-pass at other corners, where the records allow it."""
    out: list[InverseDynamics] = []
    for times in OTHER_CORNERS:
        try:
            out.append(inverse_dynamics(
                experiments, axis, per_direction=found.has("fc_plus"), cutoff=times * found.cutoff, harmonics=harmonics,
            ))  # fmt: skip
        except InputError:
            continue
    return out


def inverse_identification(
    found: InverseDynamics,
    axis: ServoAxis,
    validation: Sequence[Experiment] = (),
    others: Sequence[InverseDynamics] = (),
) -> Identification:
    """Return the inverse dynamics as an `Identification` with friction as the law ``coulomb``.

    Per direction the law is asymmetric, unless a constant torque above friction acts: then it has the mean of both
    directions, and the constant torque is half of their difference. Intervals include the correlation of the residuals
    and the change of the values with the low-pass corner (`others`, from `at_other_corners`) as between-fit variance
    (DerSimonian and Laird 1986). `validation` records give the held-out error."""
    model, mechanics = parts_of(found)
    names, units, values, covariance = of_the_model(found, model)
    for other in others:
        apart = of_the_model(other, model)[2] - values
        covariance = covariance + np.outer(apart, apart) / len(others)
    std = np.sqrt(np.diag(covariance))
    estimates: list[Estimate] = []
    for name, unit, value, spread in zip(names, units, values.tolist(), std.tolist(), strict=True):
        low, high = value - 1.96 * spread, value + 1.96 * spread
        if name.startswith(POSITIVE) and name != "gravity_angle":
            good = low > 0.0 and high <= 2.0 * low
        else:
            good = 0.5 * (high - low) <= 0.05 * (1.0 if unit == "rad" else max(found.coulomb, 0.0))
        why = "" if good else "its interval is too wide"
        estimates.append(Estimate(name, unit, name, value, spread, low, high, good, why))
    misfit = {"inverse_dynamics_relative": found.relative_error}
    if validation:
        misfit["held_out_inverse_dynamics_relative"] = plain_error_on(validation, axis, found)
    return Identification(
        "inverse dynamics", model, tuple(estimates), covariance / np.outer(std, std),
        misfit,
        (f"Position filtered at {found.cutoff:.4g} Hz, decimated to {found.band:.4g} Hz; intervals allow for the "
         "correlation of the residuals and for the choice of that corner.",),
        details={"inverse": found, "axis": axis, "mechanics": mechanics,
                 "classic_std": dict(zip(found.names, found.std.tolist()))},
    )  # fmt: skip


def of_the_model(
    found: InverseDynamics, model: Model
) -> tuple[list[str], list[str], Array, Array]:  # fmt: skip
    """Return names, units, values and covariance of the numbers as the model defines them.

    ``sigma2`` stands for ``fv``, of one or both directions; gravity is an amplitude and the angle at which the pendulum
    hangs.
    """
    row = dict(zip(found.names, np.eye(len(found.names)), strict=True))
    own: dict[str, Array] = {"inertia": row["inertia"]}
    if not found.has("fc_plus"):
        own |= {"sigma2": row["fv"], "fc": row["fc"], "offset": row["offset"]}
    elif "fc_negative" in {f.name for f in model.law.fields}:
        own |= {"sigma2": row["fv_plus"], "fc": row["fc_plus"]}
        own |= {"sigma2_negative": row["fv_minus"], "fc_negative": row["fc_minus"]}
    else:
        own |= {
            "sigma2": 0.5 * (row["fv_plus"] + row["fv_minus"]),
            "fc": 0.5 * (row["fc_plus"] + row["fc_minus"]),
        }
        own |= {"offset": 0.5 * (row["fc_plus"] - row["fc_minus"])}
    if found.has("gravity_sin"):
        # The values are not linear in these, but small changes are.
        s, c = found["gravity_sin"], found["gravity_cos"]
        size = max(math.hypot(s, c), 1e-300)
        own["gravity"] = (s * row["gravity_sin"] + c * row["gravity_cos"]) / size
        own["gravity_angle"] = (c * row["gravity_sin"] - s * row["gravity_cos"]) / size**2
    own |= {n: row[n] for n in found.names if n.startswith(("cos[", "sin["))}
    names, weights = list(own), np.array(list(own.values()))
    values = np.asarray(weights @ found.values, dtype=np.float64)
    if "gravity_angle" in names:
        values[names.index("gravity_angle")] = pendulum_of(found)[1]
    of = dict(zip(found.names, found.units, strict=True))
    torque, damping = (of.get(n, of.get(f"{n}_plus", "")) for n in ("fc", "fv"))
    units = {"inertia": of["inertia"], "sigma2": damping, "sigma2_negative": damping, "gravity_angle": "rad"}
    return names, [units.get(n, torque) for n in names], values, weights @ found.covariance @ weights.T


def pendulum_of(found: InverseDynamics) -> tuple[float, float]:
    """Return the amplitude of gravity, N·m, and the angle at which the pendulum hangs, rad."""
    return hanging(found["gravity_sin"], found["gravity_cos"], found.position)


def parts_of(found: InverseDynamics) -> tuple[Model, Mechanics]:
    """Return the friction law and the mechanics: inertia, constant torque, gravity."""
    each = [found[n] for n in ("fc_plus", "fc_minus")] if found.has("fc_plus") else []
    offset = found.offset
    if each and min(each) >= 0.0:
        offset = 0.0
        slopes = {"sigma2": max(found["fv_plus"], 0.0), "sigma2_negative": max(found["fv_minus"], 0.0)}
        model = Model("coulomb", {"symmetry": "asymmetric"}, fc=each[0], fc_negative=each[1], **slopes)
    else:
        model = Model("coulomb", fc=max(found.coulomb, 0.0), sigma2=max(found.viscous, 0.0))
    mechanics = Mechanics(max(found["inertia"], 0.0), offset=offset)
    if found.has("gravity_sin"):
        size, angle = pendulum_of(found)
        mechanics = replace(mechanics, gravity=size, gravity_angle=angle)
    return model, mechanics
