"""What every specialisation of `recorded_input.simd_batch` supplies: its sizes, and the law written as straight lines.

`stickslip.simulation.recorded_input.segments` writes these names at the top of the specialised text, in place of this
file.
"""

from __future__ import annotations

from typing import Any

LANES: int = 1
"""Segments of a record side by side."""
STATES: int = 0
"""States of the law."""
HOLDS: bool = False
"""Whether its torque jumps at rest."""


def law(w: Any, v: float, h: float, p: Any) -> float:
    """Torque after h at the velocity v from the states in ``BASE``, N·m; those after it go to ``TRIAL``."""
    raise NotImplementedError


def withstood(w: Any, direction: float, p: Any) -> float:
    """Torque that the contact withstands at rest, N·m."""
    raise NotImplementedError


def searched(w: Any, f: float, enough: float, rounding: float) -> float:
    """`stickslip.simulation.root.improve`: take f at ``x``; 1 where it is to be evaluated again."""
    raise NotImplementedError
