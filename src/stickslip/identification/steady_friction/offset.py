"""The constant torque (weight, offset) of a sliding curve: its verdicts and notes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit, name_frozen
from stickslip.identification.estimate import Estimate
from stickslip.identification.fit.uncertainty import Fit
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.torques import OFFSET

LEVEL = f"or give {name_frozen('offset', 0)} if nothing but friction acts (a level axis)"
BOTH = f"move in both directions, {LEVEL}"


def with_unknown_offset(found: Fit, tied: Sequence[str], points: SlidingPoints) -> Fit:
    """Return a fit that held the constant torque at 0, with the verdict that it is not known.

    Parameters
    ----------
    found : Fit
    tied : sequence of str
        Parameters of which only the sum with the constant torque is determined.
    points : SlidingPoints
    """
    unit = points.unit[1]
    remedy = BOTH if points.one_way else LEVEL.removeprefix("or ")
    why = f"it cannot be distinguished from {' and '.join(tied)}; {remedy}"
    unknown = Estimate("offset", unit, OFFSET.symbol, 0.0, math.nan, -math.inf, math.inf, False, why)
    judged = [replace(e, lower=0.0, upper=math.inf, std=math.nan, identified=False,
                      verdict=f"{_sum(e, points)}; {remedy}") if e.name in tied else e
              for e in found.estimates]  # fmt: skip
    correlation = np.eye(len(judged) + 1)
    correlation[:-1, :-1] = found.correlation
    return replace(found, estimates=(*judged, unknown), correlation=correlation)


def apart_from_friction(found: Fit, points: SlidingPoints) -> Fit:
    """Return a fit with the verdict that one direction does not determine the constant torque.

    A law without Coulomb friction represents that friction as a constant torque.
    """
    if not points.one_way:
        return found
    why = f"cannot be distinguished from Coulomb friction in one direction; {BOTH}"
    judged = [replace(e, identified=False, verdict=why) if e.name == "offset" else e for e in found.estimates]
    return replace(found, estimates=tuple(judged))


def _sum(e: Estimate, points: SlidingPoints) -> str:
    """State which sum of a level and the constant torque is determined."""
    if not points.one_way:
        return "it cannot be distinguished from a constant torque (offset)"
    sign = "+" if points.side[0] > 0.0 else "-"
    limits = f" [{e.lower:.4g}, {e.upper:.4g}]" if math.isfinite(e.lower) and math.isfinite(e.upper) else ""
    return f"one direction determines only {e.name} {sign} offset, {e.value:.4g}{limits} {axis_unit(e.unit)}"


def details_of(found: Fit, points: SlidingPoints) -> tuple[Mapping[str, Any], list[str]]:
    """Return the constant torque for the model's file, and a note, if there is one that differs from 0."""
    if points.offset is not None:
        return ({"constant_torque": points.offset} if points.offset else {}), []
    offset = next(e for e in found.estimates if e.name == "offset")
    if points.one_way or offset.lower <= 0.0 <= offset.upper:
        return {}, []
    note = (
        f"A constant torque of {offset.value:.3g} {axis_unit(offset.unit)} acts against positive motion. "
        "Friction that differs by "
        "direction looks alike."
    )
    return {"constant_torque": offset.value}, [note]
