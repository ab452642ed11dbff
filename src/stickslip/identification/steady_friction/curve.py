"""The sliding curve: friction at constant velocity, fitted by any law, with a verdict on each parameter.

Thesis 3.1.3.1 (eq. 2.6 through the velocities 3.18, figure 3.8), 4.3.1.1.2 (break-away torque included at zero
velocity) and 4.3.2.1.2 (eqs. 4.4 and 4.5). At the lowest velocities the Stribeck parameters are interchangeable:
without a point on the falling part, many curves fit equally well, whatever the residual.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Identification
from stickslip.identification.evidence import bend_limits, bounded_verdicts, within_speeds
from stickslip.identification.fit.multistart import separable_starts
from stickslip.identification.fit.noise import Noise, as_noise, noise_of_repeats
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.fit.selection import criteria
from stickslip.identification.fit.uncertainty import Fit, fit
from stickslip.identification.steady_friction.curve_pictures import curve_picture, listed, residual_picture
from stickslip.identification.steady_friction.offset import (
    apart_from_friction,
    details_of,
    with_unknown_offset,
)
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.torques import Torques, steady_vector, tied_to_offset, vector_of
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

BELOW, ABOVE = 0.5, 2.0
"""Factors on the lowest and the highest measured velocity, between which one more point is searched."""
OWN = "spread within each segment"
"""Source of a noise level from the points themselves."""
BEYOND = 10.0
"""Greatest level of friction in the search, relative to the largest torque of the points. A level at rest is
extrapolated and may exceed every torque at constant velocity; its interval shows the uncertainty."""


def default_noise(points: SlidingPoints, noise: Noise | float | None) -> Noise | None:
    """Return the given noise, else that of the repeats or of the points themselves, whichever is greater."""
    if noise is not None:
        return as_noise(noise)
    repeats = noise_of_repeats(points.repeats())
    if not points.absolute or points.std is None:
        return repeats
    own = Noise(1.0 / math.sqrt(float(np.mean(points.std**-2.0))), OWN)
    return own if repeats is None or own.std > repeats.std else repeats


def untouched_parameters(template: Model, frozen: Iterable[str], vector: Vector) -> list[str]:
    """Return the parameters that are not frozen and do not act at these velocities, each element's under one name."""
    free = Vector(template, frozen=frozen).names
    idle = [name.partition("[")[0] for name in free if name not in vector.names]
    return list(dict.fromkeys(idle))


def fit_sliding(
    points: SlidingPoints, template: Model, noise: Noise | None, frozen: Iterable[str], starts: int, profiles: bool,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> Fit:  # fmt: skip
    """Fit the torque of a law and a constant torque at constant velocity by weighted least squares, from many starts.

    ``limits`` are further bounds of the search, by name.
    """
    vector = steady_vector(points, template, frozen)
    # A table of points is fitted without these bounds; the slow levels of a record are less certain.
    bends = bend_limits(vector, np.abs(points.velocity)) if points.absolute else {}
    levels = level_bounds(points, vector)
    vector = vector_of(points, template, free=vector.names, limits={**levels, **bends, **(limits or {})})
    if not vector.free:
        raise InputError(f"{template.law.name}: no free parameter acts at constant velocity")
    torques, weight = Torques(vector, points.velocity, points.side), points.weight
    target = points.torque * weight

    def model(values: Array) -> Array:
        return weight * torques.at_values(values)

    def residuals(u: Array) -> Array:
        return weight * torques.at(u) - target

    def at_all(several: Array) -> Array:
        return weight * torques.at_all(several) - target

    first = separable_starts(model, target, vector, starts)
    fc = float(np.median(np.abs(points.torque)))
    fast = float(np.max(np.abs(points.velocity)))
    scales = {
        p.name: fc if p.par.unit == "N·m" else fc / fast if "s/rad" in p.par.unit else fc for p in vector.free
    }
    found = fit(
        residuals, vector, noise=noise, size=float(np.max(np.abs(points.torque))), signed_scale=scales,
        starts=first, profiles=profiles, at_all=at_all,
    )  # fmt: skip
    bounded = bounded_verdicts(found.estimates, {**levels, **bends}, "the range that was searched")
    judged = within_speeds(bounded, vector, found.u, np.abs(points.velocity), points.unit[0])
    return replace(found, estimates=judged)


def level_bounds(points: SlidingPoints, vector: Vector) -> dict[str, tuple[float, float]]:
    """Return the search bounds of the levels of friction, by name, N·m."""
    most = BEYOND * float(np.max(np.abs(points.torque)))
    return {p.name: (0.0, most) for p in vector.free if p.par.unit == "N·m" and p.par.positive}


def identify_sliding(
    points: SlidingPoints,
    template: Model,
    *,
    noise: Noise | float | None = None,
    frozen: Sequence[str] = (),
    starts: int = 40,
    fastest: float = math.inf,
) -> Identification:
    """Fit a law's curve to torques at constant velocity (thesis 3.1.3.1), and a constant torque if it is not known.

    Parameters
    ----------
    points : SlidingPoints
        With the break-away torque at zero velocity if it was measured.
    template : Model
        The law with its choices (``curve``); its values are the start of the search. Parameters that do not act at
        constant velocity keep their values.
    noise : Noise or float, optional
        Standard deviation of a point, N·m. Without it, that of repeated velocities.
    frozen : sequence of str
        Parameters that are held at the template's values.
    starts : int
        Number of random starts of the search.
    fastest : float
        Highest velocity of the axis, rad/s: no point above it is requested.

    Returns
    -------
    Identification
        ``details["family"]``: parameters of equally good curves, shape (m, free parameters);
        ``details["next_velocity"]``: velocity at which one more point would distinguish them best, rad/s (None if all
        are determined); ``details["speeds"]``: the slowest and the fastest speed, rad/s; ``details["untouched"]``:
        parameters that do not act at these velocities, whose values in `model` are those of the template;
        ``details["constant_torque"]``: the constant torque, N·m, if there is one.

    Raises
    ------
    InputError
        If there are fewer points than parameters, or nothing is free.
    """
    level = default_noise(points, noise)
    count = steady_vector(points, template, frozen).size
    if len(points) < count:
        raise InputError(
            f"{template.law.name}: {count} parameters need at least {count} points, there are {len(points)}; "
            "measure at more velocities or freeze parameters"
        )
    if len(points) == count and level is not None and level.source == OWN:
        level = None  # The residual of a curve through every point contains no information.
    found = fit_sliding(points, template, level, frozen, starts, profiles=True)
    if "offset" in found.vector.names:
        found = apart_from_friction(found, points)
    elif points.offset is None:
        found = with_unknown_offset(found, tied_to_offset(points, template, frozen), points)
    unknown = [e.name for e in found.estimates if not e.identified]
    settling = next_velocity(points, found, fastest) if unknown and found.noise.known else None
    model, notes = model_of(found)
    untouched = untouched_parameters(template, frozen, found.vector)
    constant, said = details_of(found, points)
    notes += said + _noise_notes(found) + _open_notes(unknown if found.noise.known else [], untouched)
    return Identification(
        "sliding", model, found.estimates, found.correlation, _misfit(points, found), tuple(notes),
        _measure_next(points, found, settling),
        (curve_picture(points, found, settling), residual_picture(points, found)),
        {
            "free": found.vector.names,
            "family": np.array([found.vector.values(u) for u in found.family]),
            "untouched": untouched, "next_velocity": settling, "speeds": span_of(points),
            "noise_Nm": found.noise.std, "noise_source": found.noise.source, **constant,
        },
    )  # fmt: skip


def span_of(points: SlidingPoints) -> tuple[float, float]:
    """Return the slowest and the fastest speed of the points, rad/s."""
    moving = np.abs(points.velocity[points.velocity != 0.0])
    return (float(np.min(moving)), float(np.max(moving))) if moving.size else (math.nan, math.nan)


def next_velocity(points: SlidingPoints, found: Fit, fastest: float = math.inf) -> float | None:
    """Return the velocity of the most informative next point, rad/s: half the lowest measured to twice the highest.

    Each of the equally good curves is assumed to be true in turn; a point is most informative if the parameters of the
    curves that still agree with it, within the noise, span the least. None if no point is informative.
    """
    fast = np.abs(points.velocity[points.velocity != 0.0])
    if fast.size == 0:
        return None
    grid: Array = np.array(
        np.geomspace(BELOW * float(np.min(fast)), ABOVE * min(float(np.max(fast)), fastest / ABOVE), 200),
        dtype=np.float64,
    )
    if points.offset is None:  # then the other direction may determine more
        grid = np.concatenate([grid, -grid])
    curves = Torques(found.vector, grid, np.sign(grid)).at_all(found.family)
    usable = np.all(np.isfinite(curves), axis=1)
    curves, family = curves[usable], found.family[usable]
    if family.shape[0] < 3:
        return None
    span = np.ptp(family, axis=0)
    place = family[:, span > 0.0] / span[span > 0.0]
    distance = np.max(np.abs(place[:, None, :] - place[None, :, :]), axis=2)
    left: list[float] = []
    for k in range(grid.size):
        agrees = np.abs(curves[:, None, k] - curves[None, :, k]) <= 3.0 * found.noise.std
        remaining: Array = distance * agrees
        left.append(float(remaining.max(axis=1).mean()))
    best = left.index(min(left))
    return float(grid.tolist()[best]) if left[best] < 0.9 * max(left) else None


# ---- notes on it ---------------------------------------------------------------------------------------------


def model_of(found: Fit) -> tuple[Model | None, list[str]]:
    """Return the law that was found, or a note on why no law accepts these values."""
    try:
        return found.vector.model(found.u), []
    except ParameterError as error:
        return None, [f"No law of this package holds these values together: {error}."]


def _noise_notes(found: Fit) -> list[str]:
    if not found.noise.known:
        return [
            "The noise level is unknown, so that nothing can be reported as identified; give it or repeat velocities."
        ]
    return [f"Noise of a point: {found.noise.std:.3g} {axis_unit('N·m')} ({found.noise.source})."]


def _open_notes(unknown: Sequence[str], untouched: Sequence[str]) -> list[str]:
    """Return notes on the parameters that these points do not determine."""
    notes: list[str] = []
    if untouched:
        notes.append(
            f"These data do not determine {listed(untouched)}: without effect at these velocities, they keep their "
            "start values."
        )
    if unknown:
        notes.append(f"The data do not determine {listed(unknown)}: equally good curves differ in them.")
    return notes


def _measure_next(points: SlidingPoints, found: Fit, settling: float | None) -> tuple[str, ...]:
    """Return the measurement that would determine more."""
    if settling is not None:
        return (f"Measure the torque at a constant velocity of {settling:.3g} {axis_unit(points.unit[0])}.",)
    return () if found.noise.known else ("Repeat some velocities, so that the noise level is known.",)


def _misfit(points: SlidingPoints, found: Fit) -> dict[str, float]:
    weighted = found.optimum.residuals
    scores = criteria(found.optimum.cost, len(points), found.vector.size, found.noise)
    out = {
        "rms_Nm": found.rms, "worst_Nm": float(np.max(np.abs(weighted / points.weight))), "aicc": scores.aicc,
        "bic": scores.bic, "points": float(len(points)), "parameters": float(found.vector.size),
    }  # fmt: skip
    return {name: x for name, x in out.items() if math.isfinite(x)}  # too few points have no criterion
