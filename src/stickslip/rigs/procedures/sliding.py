"""Sliding: the velocities of thesis (4.1) and (4.3) in descending order, 380 degrees each, in both directions.

A PID keeps each velocity as a ramp of the position (the thesis used an H-infinity controller). The torque of a
revolution is averaged by `stickslip.identification.steady_friction.segments`; the first 20 degrees are its transient.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.record import Record, encoder_step
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, brake, holder, now, uniform
from stickslip.rigs.procedures.resting import RESTING, resting
from stickslip.rigs.rig import Rig, setpoints

DRY = (1.4, 1.2, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.08, 0.06, 0.04, 0.02)
"""rad/s, thesis eq. 4.1"""
ROWS, LONGEST = 2000, 0.02
"""Approximate number of rows for each velocity, and longest duration of a row, s: sticking must be visible in them."""
SHORT = 0.5
"""Rest before the way back, s."""


@dataclass(frozen=True)
class Sliding(Procedure):
    """Options of the procedure.

    ``velocities`` in rad/s, ``degrees`` of each run, ``inertia`` in kg·m² and ``bandwidth`` in Hz of the loop, ``rest``
    in s before each velocity.
    """

    name: ClassVar[str] = "sliding"
    title: ClassVar[str] = "friction at constant velocities, both directions (4.3.1.1.2)"
    signed: ClassVar[tuple[str, ...]] = ("velocities",)
    longest: ClassVar[float] = LONGEST

    velocities: tuple[float, ...] = DRY
    degrees: float = 380.0
    inertia: float = 4.3e-4
    bandwidth: float = 10.0
    rest: float = 0.5

    @property
    def speeds(self) -> tuple[float, ...]:
        """Velocities in descending order, rad/s."""
        return tuple(sorted((abs(v) for v in self.velocities), reverse=True))

    def plan(self, rig: Rig) -> Plan:
        """Plan every velocity in both directions."""
        travel = math.radians(self.degrees + 3.0)
        rise = [max(v * self.inertia / (0.15 * rig.limits.torque), 0.1) for v in self.speeds]
        total = 2.0 * sum(travel / v + 2.0 * r + 0.3 for v, r in zip(self.speeds, rise, strict=True))
        return Plan(
            total, travel + max(v * r for v, r in zip(self.speeds, rise, strict=True)), max(self.speeds),
            ROOM * rig.limits.torque,
            (
                f"{len(self.speeds)} velocities from {max(self.speeds):g} to {min(self.speeds):g} rad/s, "
                f"{self.degrees:g} degrees in each direction",
            ),
            (self.rest + SHORT) * len(self.speeds),
            # Memory: one velocity at a time, and the averaged rows of all.
            travel / min(self.speeds) + max(rise) + total * min(1.0, rig.sample_time / self.longest),
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps: each velocity in both directions."""
        loop = holder(rig, self.inertia, self.bandwidth)
        # Slightly more, so the averaged rows after the transient still contain a whole revolution.
        travel = math.radians(self.degrees + 3.0)
        for speed in self.speeds:
            for direction in (1.0, -1.0):
                rows = yield Step(setpoints(2), pause=self.rest if direction > 0.0 else SHORT)
                begin, v = float(rows[-1, POSITION]), direction * speed
                ramp, level, _ = uniform(rig, begin, v, travel, self.inertia)
                yield Step(ramp, loop)
                most = max(1, round(self.longest / rig.sample_time))
                rows = yield Step(
                    level,
                    loop,
                    keep=True,
                    average=min(max(1, len(level) // ROWS), most),
                    label=f"{v:g} rad/s",
                )
                yield brake(rig, loop, float(level[-1, 0]), v, self.inertia)
        yield now(rig)

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the mean speed of the last revolution is within 1 %, and report its ripple."""
        out: list[Check] = []
        reference = record["velocity_reference"]
        edges = np.flatnonzero(np.abs(np.diff(reference)) > 1e-9 * np.abs(reference[:-1])) + 1
        parts = [p for p in np.split(np.arange(len(record)), edges) if p.size > 2]
        for rows in parts:
            out.append(self._held(record, rows, rig.sample_time))
        return tuple(out)

    def _held(self, record: Record, rows: np.ndarray, sample_time: float) -> Check:  # type: ignore[type-arg]
        time, position, reference = (
            record.time[rows],
            record["position"][rows],
            record["velocity_reference"][rows],
        )
        far = np.abs(position - position[0]) >= math.radians(max(self.degrees - 360.0, 0.0))
        t, x, v = time[far], position[far], float(reference[0])
        if t.size < 3:
            return Check(f"{v:g} rad/s", False, "the axis did not travel a revolution")
        mean = float((x[-1] - x[0]) / (t[-1] - t[0]))
        speed = np.diff(x) / np.diff(t)
        # A row is the mean of some samples: its smallest step is a count divided by their number.
        count = round(float(np.median(np.diff(t))) / sample_time) * encoder_step(position)
        ripple, still = float(np.std(speed)), resting(t, x, v, count)
        words = (
            f"; it sticks and slips, {100.0 * still:.2g} % of the time nearly at rest"
            if still > RESTING
            else ""
        )
        return Check(
            f"{v:g} rad/s", abs(mean / v - 1.0) <= 0.01,
            f"mean speed of a revolution {mean:.5g} rad/s, ripple {ripple:.2g} rad/s RMS over "
            f"{1e3 * float(np.median(np.diff(t))):.3g} ms{words}",
        )  # fmt: skip


PROCEDURE = Sliding
