"""From a map of a torque over the angle to the control law that gives it."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from stickslip.control.block import ControlBlock
from stickslip.core.errors import ParameterError
from stickslip.machines.position_map import PositionMap

NEVER = 1e-9
"""Turns by which an order may miss a whole number."""


def position_feedforward(
    found: PositionMap,
    *,
    angle: Literal["measured", "reference"] = "measured",
    lead: float = 0.0,
    gain: float = 1.0,
    points: int = 0,
) -> ControlBlock:
    """The block ``position_feedforward`` with the even part of a map.

    Parameters
    ----------
    found : PositionMap
        In N·m; its mean is left to the loop, its odd part to the friction law (``position_dependence = "spectrum"``).
    angle : {"measured", "reference"}
    lead : float
        Time that passes until a torque acts, s.
    gain : float
        Factor on the map.
    points : int
        Points of a table over a turn instead of harmonics; 0 keeps the map's own form.

    Returns
    -------
    ControlBlock

    Raises
    ------
    ParameterError
        If the map holds nothing, is not a torque, or covers less than a turn.
    """
    if found.unit != "N·m":
        raise ParameterError(
            f"position_feedforward: the map is in {found.unit}; multiply it by the torque constant, "
            f'found.scaled(K_t, "N·m")'
        )
    if not found.table and not found.even.order:
        raise ParameterError("position_feedforward: the map holds no order; nothing is to be compensated")
    if found.upper - found.lower < 0.999 * 2.0 * math.pi:
        raise ParameterError(
            f"position_feedforward: the map holds from {found.lower:.4g} to {found.upper:.4g} rad only; "
            "identify a whole turn"
        )
    common: dict[str, Any] = {"gain": gain, "lead": lead}
    if points or found.table:
        values = found.sampled(points) if points else np.array(found.table)
        return ControlBlock(
            "position_feedforward", None, {"form": "table", "angle": angle}, table=values.tolist(), **common
        )
    for n in found.even.order:
        if abs(n - round(n)) > NEVER:
            raise ParameterError(
                f"position_feedforward: order {n:g} is no whole number a turn; give the angle of the slowest shaft"
            )
    waves = {k: list(getattr(found.even, k)) for k in ("order", "cosine", "sine")}
    return ControlBlock("position_feedforward", None, {"angle": angle}, **waves, **common)
