"""Cogging: slow rotations of two revolutions each way, for `stickslip identify --method cogging`.

Slow, since a rotor's inertia carries the cogging of a fast one, so that the motor's torque does not show it, but not so
slow that the axis jumps from well to well: an order must pass below the loop's bandwidth, and the loop must hold the
axis against it. Several speeds, so that what depends on velocity comes apart from the level of friction. Every row of
1 ms is kept: means over more would smooth high orders away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from stickslip.rigs.procedures.sliding import Sliding

SLOW = (0.6, 0.4, 0.25)
"""rad/s"""
BELOW = 5.0
"""Times the frequency at which the highest order passes: the loop's bandwidth, at least."""


@dataclass(frozen=True)
class Cogging(Sliding):
    """Options of the procedure: those of `stickslip.rigs.procedures.sliding.Sliding`.

    ``velocities`` in rad/s, ``degrees`` of each run, ``inertia`` in kg·m² and ``bandwidth`` in Hz of the loop, ``rest``
    in s before each velocity. ``order``: the highest that is to be seen, periods a turn of the motor (0: not known),
    and ``gear``, turns of the motor for one of the axis, at which the position is measured: the velocities are lowered
    together until that order passes at a fifth of the bandwidth.
    """

    name: ClassVar[str] = "cogging"
    longest: ClassVar[float] = 0.001
    title: ClassVar[str] = "torque over the angle: slow rotations, both directions"

    velocities: tuple[float, ...] = SLOW
    degrees: float = 740.0
    order: float = 0.0
    gear: float = 1.0

    @property
    def speeds(self) -> tuple[float, ...]:
        """From the greatest, rad/s, so that the highest order is seen."""
        given = super().speeds
        passing = self.order * self.gear * max(given) / (2.0 * math.pi)
        slower = max(1.0, BELOW * passing / self.bandwidth) if self.bandwidth > 0.0 else 1.0
        return tuple(v / slower for v in given)


PROCEDURE = Cogging
