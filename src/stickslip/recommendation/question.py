"""Input of a recommendation: inertia, motion, and candidate laws."""

from __future__ import annotations

import math
from dataclasses import replace

from stickslip.core.errors import InputError
from stickslip.core.messages import name_file, name_option
from stickslip.identification.identified_file import Identified
from stickslip.identification.monte_carlo import with_values
from stickslip.models.friction_levels import line_beyond
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import Drive


def inertia_of(found: Identified, given: float | None) -> float:
    """Return the given inertia, else the model's, kg·m².

    Raises
    ------
    InputError
        If there is none, or it is not positive and finite.
    """
    j = given if given is not None else found.axis.get("inertia")
    unit = found.unit("kg·m²")
    if j is None:
        raise InputError(f"{name_file(found.path)} holds no inertia; give {name_option('inertia')} in {unit}")
    if not 0.0 < j < math.inf:
        raise InputError(
            f"inertia = {j:g} {unit} must be greater than 0 and finite; give another one with {name_option('inertia')}"
        )
    return float(j)


def with_motion(found: Identified, drive: Drive) -> Drive:
    """Return the drive, with the motion of the record unless it has its own.

    Raises
    ------
    InputError
        If there is none.
    """
    if drive.motion is not None or drive.amplitude is not None:
        return drive
    if found.trajectory is None:
        raise InputError(
            f"{name_file(found.path)} holds no motion ([trajectory]): identify the axis again, or give the "
            "motion to try a "
            f"setting along, {name_option('motion', 'FILE.csv')}, or the {name_option('amplitude')} of a slow "
            f"sinusoid in {found.unit('rad')}"
        )
    return replace(drive, motion=found.trajectory)


def cautious(found: Identified) -> Model:
    """Return the law for a feedforward: viscous friction that is not identified has the lower bound of its interval.

    Too much of it pushes at every speed; too little only leaves more to the loop.
    """
    least = {
        e.name: max(e.lower, 0.0) for e in found.estimates if e.name.startswith("sigma2") and not e.identified
    }
    return with_values(found.model, least)


def laws_of(model: Model) -> dict[str, Model]:
    """Return the law itself, and Coulomb with viscous friction from its sliding curve, which every drive can run."""
    laws = {model.law.name: model}
    if model.law.name == "coulomb" or not model.law.steady:
        return laws
    (level, slope), (back, falling) = (line_beyond(model, d) for d in (1.0, -1.0))
    if level <= 0.0 or back <= 0.0:
        return laws
    if model.law.odd:
        laws["coulomb"] = Model("coulomb", fc=level, sigma2=slope)
        return laws
    each = {"fc": level, "sigma2": slope, "fc_negative": back, "sigma2_negative": falling}
    laws["coulomb"] = Model("coulomb", {"symmetry": "asymmetric"}, **each)
    return laws
