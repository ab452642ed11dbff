"""Break-away: torque ramps every few degrees around the revolution, in both directions (thesis 4.3.1.1.1,
4.3.2.1.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.record import Record
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, holder, move, now, samples
from stickslip.rigs.rig import Rig, setpoints


@dataclass(frozen=True)
class Breakaway(Procedure):
    """Options of the procedure.

    ``interval`` between the angles in degrees, ``rate`` of the ramps in N·m/s, ``highest`` torque of a ramp in N·m (0:
    nearly the rig's limit), ``travel`` in rad that ends a ramp, ``inertia`` in kg·m² of the loop that moves
    between the angles, ``bandwidth`` of that loop in Hz, ``wait`` in s at rest before a ramp.
    """

    name: ClassVar[str] = "breakaway"
    title: ClassVar[str] = "break-away torque around the revolution, both directions (4.3.1.1.1)"

    interval: float = 10.0
    rate: float = 0.2
    highest: float = 0.0
    travel: float = 0.02
    inertia: float = 4.3e-4
    bandwidth: float = 8.0
    wait: float = 0.5

    def top(self, rig: Rig) -> float:
        """N·m"""
        return self.highest or 0.9 * ROOM * rig.limits.torque

    @property
    def angles(self) -> int:
        """Number of angles per revolution."""
        return max(1, round(360.0 / self.interval))

    def plan(self, rig: Rig) -> Plan:
        """Plan for the longest run: every ramp reaches its top."""
        ramp = self.top(rig) / self.rate
        each = ramp + 1.5
        return Plan(
            2 * self.angles * each, 2.0 * math.pi + 1.0, 0.33 * rig.limits.speed, ROOM * rig.limits.torque,
            (
                f"{self.angles} angles, {self.interval:g} degrees apart: move there, rest {self.wait:g} s",
                f"ramp the torque with {self.rate:g} N·m/s until it has moved {self.travel:g} rad, at most to "
                f"{self.top(rig):.3g} N·m; once in each direction",
            ),
            2 * self.angles * self.wait,
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Go around once in each direction, so each ramp continues in the direction of the move before."""
        dt = rig.sample_time
        loop = holder(rig, self.inertia, self.bandwidth)
        rows = yield now(rig)
        origin = float(rows[-1, POSITION])
        count = samples(rig, self.top(rig) / self.rate)
        ramp = np.linspace(0.0, self.top(rig), count)
        step = math.radians(self.interval)
        for direction in (1.0, -1.0):
            for i in range(self.angles):
                place = i if direction > 0.0 else self.angles - i
                goal = origin + place * step
                here = float(rows[-1, POSITION])
                # A ramp starts with the contact loaded in the direction of the break-away.
                yield move(rig, loop, here, goal - 0.3 * direction * step, self.inertia)
                yield move(rig, loop, goal - 0.3 * direction * step, goal, self.inertia)
                rest = setpoints(round(0.2 / dt))
                yield Step(rest, pause=self.wait, keep=True, average=1, label="")
                rows = yield Step(
                    setpoints(count, torque=direction * ramp), travel=self.travel, keep=True,
                    label=f"{math.degrees(goal - origin):.0f} degrees {'+' if direction > 0 else '-'}",
                )  # fmt: skip
                # It springs back when the torque is removed, which is not a break-away: not recorded.
                rows = yield Step(setpoints(round(0.15 / dt)))

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that every ramp moved the axis."""
        torque = record["torque_setpoint"]
        starts = np.flatnonzero((torque[1:] != 0.0) & (torque[:-1] == 0.0)) + 1
        moved = 0
        for begin in starts:
            near = record.time <= record.time[begin] + 1.1 * self.top(rig) / self.rate
            rows = np.flatnonzero(near & (np.arange(len(record)) >= begin))
            moved += bool(np.ptp(record["position"][rows]) >= self.travel)
        wanted = 2 * self.angles
        return (
            Check(
                "moved", moved >= wanted, f"{moved} of {wanted} ramps moved the axis by {self.travel:g} rad"
            ),
        )


PROCEDURE = Breakaway
