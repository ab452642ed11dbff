"""Cogging: slow rotations of two revolutions in each direction, for `stickslip identify --method cogging`.

They are slow, because the inertia of a fast rotor carries it through the cogging, which then does not appear in the
motor torque; but not so slow that the axis jumps from one stable position to the next: an order must pass below the
loop's bandwidth, and the loop must hold the axis against it. Several speeds separate effects of the velocity from the
level of friction. Every row of 1 ms is recorded, because averaging would remove high orders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from stickslip.rigs.procedures.sliding import Sliding

SLOW = (0.6, 0.4, 0.25)
"""rad/s"""
BELOW = 5.0
"""Smallest bandwidth of the loop, in multiples of the frequency at which the highest order passes."""


@dataclass(frozen=True)
class Cogging(Sliding):
    """Options of the procedure: those of `stickslip.rigs.procedures.sliding.Sliding`.

    ``velocities`` in rad/s, ``degrees`` of each run, ``inertia`` in kg·m² and ``bandwidth`` in Hz of the loop, ``rest``
    in s before each velocity. ``order``: the highest order of interest, periods per motor revolution (0: unknown), and
    ``gear``, motor revolutions per revolution of the axis, where the position is measured: all velocities are lowered
    until that order passes at a fifth of the bandwidth.
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
        """Velocities in descending order, rad/s, low enough for the highest order."""
        given = super().speeds
        passing = self.order * self.gear * max(given) / (2.0 * math.pi)
        slower = max(1.0, BELOW * passing / self.bandwidth) if self.bandwidth > 0.0 else 1.0
        return tuple(v / slower for v in given)


PROCEDURE = Cogging
