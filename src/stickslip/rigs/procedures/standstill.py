"""Standstill map: hold the axis at places around the revolution, in both directions, for `identify --method cogging`.

The drive's torque at rest is cogging plus friction with the sign of the direction of approach. Nothing moves, so
inertia, viscous friction and speed ripple have no effect. It takes longer than rotations, and is meant for axes whose
cogging is too large for slow rotations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, holder, now, samples, smooth
from stickslip.rigs.rig import Rig, setpoints

ROWS = 4
"""Rows of each place; the first is dropped, because the loop settles in it."""
HELD = 0.95
"""Share of the places that must be held within a spacing."""


@dataclass(frozen=True)
class Standstill(Procedure):
    """Options of the procedure.

    ``places`` per revolution, ``degrees`` travelled in each direction (slightly more than a revolution, because rows
    after a reversal are left out), ``hold`` in s at a place and ``go`` in s from one to the next, ``inertia`` in kg·m²
    and ``bandwidth`` in Hz of the loop.
    """

    name: ClassVar[str] = "standstill"
    title: ClassVar[str] = "torque over the angle: held at places around the revolution, both directions"

    places: int = 720
    degrees: float = 370.0
    hold: float = 0.4
    go: float = 0.1
    inertia: float = 4.3e-4
    bandwidth: float = 10.0

    @property
    def spacing(self) -> float:
        """Distance between two places, rad."""
        if self.places < 8:
            raise InputError(f"standstill: places = {self.places} resolve no order; give 8 or more")
        return 2.0 * math.pi / self.places

    @property
    def count(self) -> int:
        """Number of places in one direction."""
        return max(2, round(math.radians(self.degrees) / self.spacing))

    def plan(self, rig: Rig) -> Plan:
        """Plan all places in both directions."""
        return Plan(
            2.0 * self.count * (self.hold + self.go) + 1.0, self.count * self.spacing,
            1.9 * self.spacing / self.go, ROOM * rig.limits.torque,
            (
                f"{self.count} places, {math.degrees(self.spacing):.3g} degrees apart, in both directions: "
                f"move there in {self.go:g} s, hold for {self.hold:g} s",
            ),
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps: once around in each direction."""
        loop = holder(rig, self.inertia, self.bandwidth)
        rows = yield now(rig)
        here = float(rows[-1, POSITION])
        going = samples(rig, self.go)
        block = max(1, samples(rig, self.hold) // ROWS)
        for direction in (1.0, -1.0):
            for _ in range(self.count):
                there = here + direction * self.spacing
                position, velocity = smooth(here, there, going, rig.sample_time)
                yield Step(setpoints(going, position=position, velocity=velocity, closed=1.0), loop)
                yield Step(setpoints(block, position=there, closed=1.0), loop)
                held = setpoints((ROWS - 1) * block, position=there, closed=1.0)
                yield Step(held, loop, keep=True, average=block)
                here = there
        yield now(rig)

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the places were held."""
        off = np.abs(record["position"] - record["position_reference"])
        share = float(np.mean(off < self.spacing))
        return (
            Check(
                "held", share >= HELD,
                f"{100.0 * share:.3g} % of the rows within a spacing of their place, {1e3 * float(np.median(off)):.2g} "
                "mrad off in the middle",
            ),
        )  # fmt: skip


PROCEDURE = Standstill
