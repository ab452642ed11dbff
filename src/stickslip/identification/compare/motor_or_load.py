"""Conversion of an identified model to the other side of the gear: the same axis seen from the motor or the load."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_file, name_option
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model


def on_one_side(first: Identified, second: Identified) -> tuple[Identified, str]:
    """Return the second model on the first one's side of the gear, and a note if that changes it.

    Raises
    ------
    InputError
        If they are on different sides and neither file states the gear ratio, or the ratios differ, or the unit of a
        law's parameter does not show how it transforms through a gear.
    """
    sides = [str(m.axis.get("seen_from", "load")) for m in (first, second)]
    ratios = [float(m.axis.get("gear_ratio", 1.0) or 1.0) for m in (first, second)]
    if sides[0] == sides[1] or ratios == [1.0, 1.0]:
        return second, ""
    known = [r for r in ratios if r != 1.0]
    if max(known) > 1.0001 * min(known):
        raise InputError(
            f"{first.path} has a gear ratio of {ratios[0]:g} and {second.path} one of {ratios[1]:g}: they are not "
            f"about one axis; identify them with the same {name_option('gear_ratio')}"
        )
    n = known[0] if sides[1] == "load" else 1.0 / known[0]
    note = (
        f"{second.path.name} is about the {sides[1]}'s side of the gear of {known[0]:g} and was brought to the "
        f"{sides[0]}'s, that of {first.path.name}."
    )
    return through_gear(second, n), note


def through_gear(found: Identified, n: float) -> Identified:
    """Return the model at a shaft that turns `n` times as fast: torques are divided by n."""
    units = {f.name: f.par.unit for f in found.model.law.fields}
    values: dict[str, Any] = {}
    parameters: dict[str, Any] = found.model.parameters._asdict()
    for name, value in parameters.items():
        factor = _factor(units[name], n, f"{name_file(found.path)}: {name}")
        values[name] = factor * value if isinstance(value, float) else [factor * v for v in value]
    estimates = tuple(
        replace(e, **{k: getattr(e, k) * _factor(units.get(e.name.partition("[")[0], e.unit), n, e.name)
                      for k in ("value", "std", "lower", "upper")})
        for e in found.estimates
    )  # fmt: skip
    axis = dict(found.axis)
    for name, unit in (("inertia", "kg·m²"), ("offset", "N·m"), ("gravity", "N·m"), ("gravity_angle", "rad")):
        if isinstance(axis.get(name), (int, float)):
            axis[name] = float(axis[name]) * _factor(unit, n, name)
    speeds = {side: n * np.asarray(v) for side, v in found.speeds.items()}
    return replace(
        found, model=Model(found.model.law, **values), estimates=estimates, axis=axis, speeds=speeds
    )


def _factor(unit: str, n: float, what: str) -> float:
    """Return the factor of a quantity with this unit at a shaft that turns n times as fast."""
    if unit in ("", "-", "s", "1/s"):
        return 1.0
    if unit == "kg·m²":
        return n**-2.0
    if re.sub(r"N·m|rad|s|1|[·/()²]", "", unit):
        raise InputError(
            f"{what}: a unit of {unit} does not show how it transforms through a gear; give both files one side"
        )
    above, _, below = unit.partition("/")
    torque = above.count("N·m") - below.count("N·m")
    angle = _angles(above) - _angles(below)
    return n ** float(angle - torque)


def _angles(text: str) -> int:
    """Return the power of rad."""
    return sum(2 if square else 1 for square in re.findall(r"rad(²?)", text))
