"""What every specialisation of `many.simd_step` supplies: its sizes, its numbers and its sliding curves.

`many.simd_source` writes these names at the top of the specialised text, in place of this file; here they say what
each means. ``z`` holds `LANES` cases, row after row; ``c`` the numbers that all cases share; ``lane`` is the case.
"""

from __future__ import annotations

from typing import Any

LANES: int = 1
"""Cases side by side."""
ELEMENTS: int = 1
FIRST_1: int = 1
"""Elements of finite stiffness of both laws; the first one of the compensator's."""
KIND_0: int = 0
KIND_1: int = -1
"""How what slips behaves: `RELAXES`, `FOLLOWS`, `BENDS`; -1: there is no law."""
VARIED: int = 0
"""Numbers that vary from case to case."""
RIGID_0: bool = False
RIGID_1: bool = False
"""Whether a share of the curve is held rigidly: it jumps with the sign of the velocity."""
METERED: bool = True
"""Whether everything is measured, or the position error alone."""


def inertia(c: Any, z: Any, lane: int) -> float:
    """kg·m²."""
    raise NotImplementedError


def kp(c: Any, z: Any, lane: int) -> float:
    """N·m/rad."""
    raise NotImplementedError


kd = kr = ki = gain = inertia
"""Of the controller, in the same way."""


def attraction(c: Any, z: Any, lane: int, side: int) -> float:
    """Attraction parameter C of a side, N·m/s; where it bends, the stiffness of its bristle, N·m/rad."""
    raise NotImplementedError


viscous = lag = rigid = attraction
"""Viscous friction, N·m·s/rad; damping over stiffness of the bristle, s; share that is held rigidly."""


def stiffness(c: Any, z: Any, lane: int, i: int) -> float:
    """Stiffness of element i, N·m/rad."""
    raise NotImplementedError


share = stiffness
"""Its share of the curve."""


def curve(v: float, c: Any, z: Any, lane: int, side: int) -> float:
    """The sliding curve of a side's law, N·m."""
    raise NotImplementedError
