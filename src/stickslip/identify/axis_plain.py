"""The plain inverse dynamics as an identification of its own: ``--inverse``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.identify.axis_agreed import SAME
from stickslip.identify.axis_inverse import InverseDynamics
from stickslip.identify.axis_trial import Trial
from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.force_error import plain_error_on
from stickslip.identify.gravity import hanging
from stickslip.identify.regression import QUANTILE, Regression
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.simulation.driven import Mechanics

__all__ = ["inverse_identification"]


def inverse_identification(
    found: InverseDynamics,
    axis: ServoAxis,
    sliding: Regression | None = None,
    validation: Sequence[Trial] = (),
) -> Identification:
    """The inverse dynamics as an `Identification`, its friction as the law ``coulomb``.

    Per direction the law is asymmetric, unless a constant torque above the friction acts along: then it has the mean of
    both directions, and the constant torque half of their difference. Intervals are widened to hold what certain
    sliding says (`stickslip.identify.regression`) where both contradict each other; `validation` records give the
    held-out error.
    """
    estimates: list[Estimate] = []
    notes: list[str] = []
    for name, unit, value, std in zip(found.names, found.units, found.values, found.robust_std, strict=True):
        low, high = float(value - 1.96 * std), float(value + 1.96 * std)
        own = {"fv": "sigma2"}.get(name, name)
        if sliding is not None and own in ("inertia", "fc", "sigma2", "offset"):
            other, half = sliding.numbers[own].value, QUANTILE * sliding.numbers[own].std
            apart = abs(other - value) > math.hypot(half, 0.5 * (high - low))
            if apart and abs(other - value) > SAME * max(
                abs(value), abs(found.coulomb) if own == "offset" else 0.0
            ):
                low, high = min(low, other), max(high, other)
                notes.append(
                    f"{name}: {float(value):.4g} here, {other:.4g} {unit} where the axis slides for certain "
                    "(reversals, stops and the hold of the torque left out); the interval holds both."
                )
        signed = not name.startswith(("inertia", "fc", "fv"))
        if signed:
            good = bool(0.5 * (high - low) <= 0.05 * abs(found.coulomb))
        else:
            good = low > 0.0 and high <= 2.0 * low
        why = "" if good else "its interval is too wide"
        estimates.append(Estimate(name, unit, name, float(value), float(std), low, high, good, why))
    std = np.sqrt(np.diag(found.covariance))
    model, mechanics = parts_of(found)
    misfit = {"inverse_dynamics_relative": found.relative_error}
    if validation:
        misfit["held_out_inverse_dynamics_relative"] = plain_error_on(validation, axis, found)
    return Identification(
        "inverse dynamics", model, tuple(estimates), found.covariance / np.outer(std, std),
        misfit,
        (f"Position filtered at {found.cutoff:.4g} Hz, decimated to {found.band:.4g} Hz; intervals allow for the "
         "correlation of the residuals.", *notes),
        details={"inverse": found, "axis": axis, "mechanics": mechanics,
                 "classic_std": dict(zip(found.names, found.std.tolist()))},
    )  # fmt: skip


def parts_of(found: InverseDynamics) -> tuple[Model, Mechanics]:
    """Friction and what is beside it: inertia, constant torque, gravity."""
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
        sine, cosine = found["gravity_sin"], found["gravity_cos"]
        size, angle = hanging(sine, cosine, found.position)
        mechanics = replace(mechanics, gravity=size, gravity_angle=angle)
    return model, mechanics
