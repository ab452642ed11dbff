"""Transfer of the known sliding curve to another law, whose pre-sliding parameters are then identified."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.rebinding import NEGATIVE
from stickslip.models import plugins
from stickslip.models.friction_levels import end_of_slope, levels_of, static_level
from stickslip.models.model import Model

SLIDING = ("curve", "viscous", "symmetry", "position_dependence")
"""Choices of a law that belong to sliding, and that a record of position and torque can determine."""
FROM, TO, POINTS = 1e-3, 1e2, 60
"""Range of a sampled curve, relative to the Stribeck velocity, and number of its points."""


def transfer_curve(law: str, curve: Model, **own: Any) -> Model:
    """Return a law with the sliding curve of another one: its shape, its viscous part and its directions.

    Parameters
    ----------
    law : str
        A law with the choice ``curve``, such as "lugre" or "gms".
    curve : Model
        Any law with a torque at constant velocity. A curve that is not a choice of laws is sampled as a table.
    **own
        Parameters of `law` that do not act at constant velocity.

    Raises
    ------
    InputError
        If `curve` has no torque at constant velocity, or has no friction at rest.
    """
    if curve.law.steady is None:
        raise InputError(
            f"law {curve.law.name!r} has no torque at constant velocity; identify a sliding curve with "
            f"{name_option('method', 'sliding')}"
        )
    if not min(static_levels(curve)) > 0.0:
        raise InputError(
            f"law {curve.law.name!r} has no friction at rest and so no pre-sliding; give another law"
        )
    chosen = _options(curve, SLIDING)
    values: dict[str, Any] = curve.parameters._asdict()
    if "curve" not in chosen:
        chosen |= {"curve": "table", "symmetry": "symmetric" if curve.law.odd else "asymmetric"}
        values |= _sampled(curve, 1.0) | ({} if curve.law.odd else _sampled(curve, -1.0))
    made = plugins.law(law).having(**chosen)
    return Model(made, **({f.name: values[f.name] for f in made.fields if f.name in values} | own))


def static_levels(model: Model) -> tuple[float, float]:
    """Return the torque that a law withstands at rest in the positive and in the negative direction, N·m."""
    return static_level(model, 1.0), static_level(model, -1.0)


def describe_unused(curve: Model, made: Model) -> tuple[str, ...]:
    """Return notes on the parts of its model that a law from `transfer_curve` lacks.

    Parameters
    ----------
    curve : Model
    made : Model
        With the sliding curve of `curve`.
    """
    notes: list[str] = []
    if curve.law.option_of("curve"):
        there = {f.name for f in made.law.fields}
        unused = [f.name for f in curve.law.fields if f.name not in there]
        if unused:
            notes.append(f"Of the model only its sliding curve is used, not {', '.join(unused)}.")
    else:
        notes.append(
            f"The sliding curve of law {curve.law.name!r} is used as a table of {POINTS + 1} points."
        )
    given = _options(curve, tuple(c.name for c in curve.law.choices if c.name.endswith("_dependence")))
    left = [name for name, option in given.items() if option != made.law.option_of(name)]
    if left:
        names = ", ".join(name.removesuffix("_dependence") for name in left)
        notes.append(f"Friction of the model depends on {names}; its values at the reference are used.")
    return tuple(notes)


def _options(model: Model, names: tuple[str, ...]) -> dict[str, str]:
    """Return the options in force of those choices that the law has."""
    return {name: option for name in names if (option := model.law.option_of(name))}


def _sampled(curve: Model, direction: float) -> dict[str, Any]:
    """Return points of a sliding curve in one direction, and its viscous slope if the law has no viscous part."""
    levels, ending = levels_of(curve, direction), "" if direction > 0.0 else NEGATIVE
    # Below the end of a steep slope through rest the contact would creep; the level at rest applies instead.
    slowest = max(FROM * levels.vs, end_of_slope(curve))
    speeds = np.geomspace(slowest, max(TO * levels.vs, 10.0 * slowest), POINTS)
    viscous = _viscous_part(curve, levels.sigma2, ending)
    torque = direction * (
        curve.sliding_torque(direction * speeds) - viscous.sliding_torque(direction * speeds)
    )
    points = {
        "curve_velocity": [0.0, *speeds.tolist()], "curve_torque": [levels.fs, *torque.tolist()],
        "sigma2": levels.sigma2,
    }  # fmt: skip
    if curve.law.option_of("viscous"):
        del points["sigma2"]
    return {f"{name}{ending}": value for name, value in points.items()}


def _viscous_part(curve: Model, slope: float, ending: str) -> Model:
    """Return the viscous part of a law; if it has none of its own, one of this slope (N·m·s/rad)."""
    chosen = _options(curve, ("viscous", "symmetry"))
    if "viscous" not in chosen:
        return Model("viscous", sigma2=slope)
    law = plugins.law("viscous").having(**chosen)
    return Model(law, **{f.name: getattr(curve.parameters, f.name) for f in law.fields})
