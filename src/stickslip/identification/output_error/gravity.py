"""The angle at which a pendulum hangs is determined up to whole turns: the one nearest to the motion is reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.identification.estimate import Estimate

Array = np.ndarray[Any, np.dtype[np.float64]]

TURN = 2.0 * math.pi


def nearest(angle: float, position: Array) -> float:
    """Return the angle, shifted by whole turns to the middle of the positions.

    It is within half a turn of 0 if the positions span more than a turn.
    """
    low, high = float(np.min(position)), float(np.max(position))
    middle = 0.5 * (low + high) if high - low < TURN else 0.0
    return angle + TURN * round((middle - angle) / TURN)


def hanging(sine: float, cosine: float, position: Array) -> tuple[float, float]:
    """Return amplitude and angle of sine · sin(q) + cosine · cos(q) = amplitude · sin(q - angle)."""
    return math.hypot(sine, cosine), nearest(math.atan2(-cosine, sine), position)


def within_a_turn(estimates: Sequence[Estimate], position: Array) -> tuple[Estimate, ...]:
    """Return the estimates with ``gravity_angle`` near the positions; wider than a turn it is not identified."""
    out: list[Estimate] = []
    for e in estimates:
        if e.name == "gravity_angle" and math.isfinite(e.value):
            value = nearest(e.value, position)
            lower, upper = e.lower + value - e.value, e.upper + value - e.value
            e = replace(e, value=value, lower=lower, upper=upper)
            if not (upper - value < 0.5 * TURN and value - lower < 0.5 * TURN):
                why = "any angle fits: gravity is not determined"
                lower, upper = value - 0.5 * TURN, value + 0.5 * TURN
                e = replace(e, lower=lower, upper=upper, identified=False, verdict=why)
        out.append(e)
    return tuple(out)
