"""Choice of the sliding curve: the classical combinations and thesis eqs. 2.6, 4.4 and 4.5, by points left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit
from stickslip.core.rebinding import NEGATIVE
from stickslip.identification.estimate import Identification, silent
from stickslip.identification.fit.noise import Noise
from stickslip.identification.fit.selection import Indices, criteria, cross_validate
from stickslip.identification.steady_friction.curve import (
    SlidingPoints,
    default_noise,
    fit_sliding,
    identify_sliding,
    model_of,
)
from stickslip.identification.steady_friction.torques import Torques, steady_vector
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

COULOMB = "Coulomb with viscous"
"""Name of the candidate that describes any contact at least."""
FOLD_REACH = 10.0
"""Greatest factor of a parameter between a fit to a part of the points and the fit to all."""
FOLD_EXPONENT = 2.0
"""Greatest factor of an exponent between these: tenfold exponents exceed every scale at the next faster point."""
SPARE = 2
"""Fewest points in excess of the parameters for a curve to be compared with others."""
ALIKE = 0.01
"""Difference in AICc below which two laws fit equally well."""


def candidates(velocity: Array, torque: Array, known: Mapping[str, float] | None = None) -> dict[str, Model]:
    """Return laws without a pre-sliding part, on the scales of a sliding curve, from few parameters to many.

    All their parameters act at constant velocity, so none stays at a guessed value.

    Parameters
    ----------
    velocity, torque : array, shape (n,)
        rad/s and N·m, of either sign; at least one velocity other than 0.
    known : mapping of str to float, optional
        Starting values, used by every curve that has the parameter.

    Returns
    -------
    dict of str to Model
        By the curve's common name with its equation: viscous (2.3), Coulomb with viscous, Stribeck (2.6), and the sums
        of two exponentials (4.4, the power of the second viscous term free) and of two Stribeck curves (4.5).
    """
    level, fast = float(np.median(np.abs(torque))), float(np.max(np.abs(velocity)))
    stribeck = {"fs": 1.2 * level, "fc": level, "vs": 0.05 * fast}
    linear = {"sigma2": 0.1 * level / fast}
    power = {"sigma2": 0.01 * level / fast, "fv2": 0.1 * level / fast**0.5, "delta_v": 0.5}
    two = {"v1": 0.01 * fast, "v2": 0.05 * fast}
    exponentials = {"alpha0": 0.5 * level, "alpha1": 0.3 * level, "alpha2": 0.3 * level, **two}
    stribecks = {
        "beta0": 0.5 * level,
        "beta1": 0.3 * level,
        "beta2": 0.3 * level,
        "beta3": 1.0,
        "beta4": 1.0,
        **two,
    }
    shapes: dict[str, tuple[str, dict[str, str], dict[str, float]]] = {
        "viscous (eq. 2.3)": ("viscous", {}, linear),
        COULOMB: ("coulomb", {}, {"fc": level, **linear}),
        "Stribeck (eq. 2.6)": ("stribeck_plain", {}, {**stribeck, "delta_s": 1.5, **linear}),
        "two exponentials (eq. 4.4)": (
            "stribeck_plain", {"curve": "double_exponential", "viscous": "power"}, {**exponentials, **power},
        ),
        "two Stribeck curves (eq. 4.5)": (
            "stribeck_plain", {"curve": "double_stribeck", "viscous": "power"}, {**stribecks, **power},
        ),
    }  # fmt: skip
    given = known or {}
    return {
        name: Model(law, choices, **{n: given.get(n, value) for n, value in values.items()})
        for name, (law, choices, values) in shapes.items()
    }


def each_direction(model: Model) -> Model:
    """Return a model with separate parameters for the negative direction, equal to those of the positive one."""
    law, values = model.law.having(symmetry="asymmetric"), model.parameters._asdict()
    return Model(law, {}, **{f.name: values[f.name.removesuffix(NEGATIVE)] for f in law.fields})


def comparable(points: SlidingPoints, templates: Mapping[str, Model]) -> dict[str, Model]:
    """Return the candidates; only Coulomb friction if the points are too few to compare it with others."""
    count = steady_vector(points, templates[COULOMB], ()).size
    return {COULOMB: templates[COULOMB]} if len(points) < count + SPARE else dict(templates)


def choose_sliding(
    points: SlidingPoints,
    templates: Mapping[str, Model] | None = None,
    *,
    noise: Noise | float | None = None,
    frozen: Sequence[str] = (),
    starts: int = 40,
    progress: Callable[[str], None] = silent,
) -> tuple[str, Identification, dict[str, dict[str, float]]]:
    """Fit several curves and choose the one with the fewest parameters whose error on points left out is not worse.

    Points at the same speed, in either direction, are left out together. Among the curves within one standard error of
    the least cross-validated error (Breiman et al. 1984), the one with the least AICc is chosen.

    Parameters
    ----------
    points, noise, starts
        As for `identify_sliding`.
    templates : mapping of str to Model, optional
        Candidate laws; None for `candidates`.
    frozen : sequence of str
        Parameters that are held at the template's values, in every template that has them.
    progress : callable
        Called with a short description of each step as it starts.

    Returns
    -------
    name : str
        Name of the chosen template.
    result : Identification
        Its fit; its notes list the candidates, ``details["comparison"]`` is the table of all.
    table : dict
        Per template: parameters, rms_Nm, aicc, bic, cross_validated_Nm. Templates with too many parameters for the
        points are left out.
    """
    level, whole = default_noise(points, noise), points
    if points.offset is None and points.one_way:
        # A constant torque would replace Coulomb friction, and a law without a level would be chosen.
        points = replace(points, offset=0.0)
    laws = candidates(points.velocity, points.torque) if templates is None else templates
    kept = {name: [n for n in frozen if n in t.parameters._fields] for name, t in laws.items()}
    table: dict[str, dict[str, float]] = {}
    for number, (name, template) in enumerate(laws.items(), 1):
        progress(f"{name}: curve {number} of {len(laws)}")
        count = steady_vector(points, template, kept[name]).size
        if count == 0 or len(points) < count + SPARE:
            continue
        found = fit_sliding(points, template, level, kept[name], starts, profiles=False)
        scores = criteria(found.optimum.cost, len(points), count, level)

        begin = model_of(found)[0] or template

        def error(
            fitted: Indices, left_out: Indices, template: Model = begin, frozen: Sequence[str] = kept[name]
        ) -> Array:
            return left_out_error(points, template, fitted, left_out, frozen)

        table[name] = {
            "parameters": count, "rms_Nm": found.rms, "aicc": scores.aicc, "bic": scores.bic,
            "cross_validated_Nm": cross_validate(error, len(points), together=points.speeds()),
        }  # fmt: skip
    if not table:
        raise InputError(
            f"{len(points)} points are too few for any of the curves; measure at more velocities"
        )
    chosen = _best(table, len(points), laws)
    progress(f"{chosen}: intervals")
    result = identify_sliding(whole, laws[chosen], noise=level, frozen=kept[chosen], starts=starts)
    details = {**result.details, "chosen": chosen, "comparison": table}
    return (
        chosen,
        replace(result, details=details, notes=(*result.notes, *_choice_notes(chosen, table, laws))),
        table,
    )


def _choice_notes(chosen: str, table: Mapping[str, Mapping[str, float]], laws: Iterable[str]) -> list[str]:
    errors = "; ".join(f"{name} {row['cross_validated_Nm']:.3g}" for name, row in table.items())
    notes = [f"Chosen: {chosen}. Error at points left out, {axis_unit('N·m')}: {errors}."]
    few = [name for name in laws if name not in table]
    if few:
        notes.append(f"Not tried, nothing free or too few points for the parameters: {', '.join(few)}.")
    return notes


def left_out_error(
    points: SlidingPoints, template: Model, fitted: Indices, left_out: Indices, frozen: Sequence[str] = ()
) -> Array:
    """Return weighted errors at some points of the curve fitted to the others."""
    # Fewer points may leave a parameter undetermined: it must not diverge and dominate the error.
    limits: dict[str, tuple[float, float]] = {}
    for p in steady_vector(points, template, frozen).free:
        reach = FOLD_EXPONENT if p.par.unit == "-" else FOLD_REACH
        if p.logarithmic and p.value > 0.0:
            limits[p.name] = (p.value / reach, p.value * reach)
    found = fit_sliding(points.only(fitted), template, None, frozen, 2, profiles=False, limits=limits)
    rest = points.only(left_out)
    torques = Torques(found.vector, rest.velocity, rest.side)
    return points.weight[left_out] * (torques.at(found.u) - rest.torque)


def _best(table: Mapping[str, Mapping[str, float]], n: int, laws: Mapping[str, Model]) -> str:
    least = min(row["cross_validated_Nm"] for row in table.values())
    room = least * (1.0 + 1.0 / math.sqrt(2.0 * n))  # one standard error of a root mean square of n errors
    near = [name for name, row in table.items() if row["cross_validated_Nm"] <= room]
    lowest = min(table[name]["aicc"] for name in near)
    # Laws with a common curve differ by rounding here: the one with the fewest other parameters is chosen.
    alike = [name for name in near if table[name]["aicc"] <= lowest + ALIKE]
    return min(alike, key=lambda name: len(laws[name].law.fields))
