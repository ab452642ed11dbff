"""Attraction: a velocity that varies without reversing, around the bend of the sliding curve (thesis 3.1.3.2.4.2).

The motion repeats over one turn from the same angle, so effects of the angle can be distinguished from lag behind the
velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.record import Record
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, brake, holder, now, samples, speed_up
from stickslip.rigs.rig import Rig, setpoints


@dataclass(frozen=True)
class Attraction(Procedure):
    """Options of the procedure.

    Velocity ``mean`` + ``swing`` sin (rad/s) at ``frequency`` (Hz) for ``cycles``; ``inertia`` (kg·m²) and
    ``bandwidth`` (Hz) of the loop.
    """

    name: ClassVar[str] = "attraction"
    title: ClassVar[str] = "a velocity that varies without reversing (3.1.3.2.4.2)"

    mean: float = 0.05
    swing: float = 0.03
    frequency: float = 1.0
    cycles: float = 20.0
    inertia: float = 4.3e-4
    bandwidth: float = 10.0

    def plan(self, rig: Rig) -> Plan:
        """Plan the cycles."""
        seconds = self.cycles / self.frequency
        return Plan(
            seconds + 3.0, self.mean * (seconds + 2.0), self.mean + self.swing, ROOM * rig.limits.torque,
            (
                f"{self.cycles:g} cycles of {self.mean:g} + {self.swing:g} sin rad/s at {self.frequency:g} Hz",
            ),
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Speed up to the mean, vary, stop."""
        loop, dt = holder(rig, self.inertia, self.bandwidth), rig.sample_time
        rows = yield now(rig)
        running, end = speed_up(rig, loop, float(rows[-1, POSITION]), self.mean, self.inertia)
        yield running
        count = samples(rig, self.cycles / self.frequency)
        t, w = dt * np.arange(1, count + 1), 2.0 * math.pi * self.frequency
        position = end + self.mean * t + self.swing / w * (1.0 - np.cos(w * t))
        velocity = self.mean + self.swing * np.sin(w * t)
        yield Step(
            setpoints(count, position=position, velocity=velocity, closed=1.0), loop, keep=True, average=5,
            label=f"{self.mean:g} rad/s",
        )  # fmt: skip
        yield brake(rig, loop, float(position[-1]), float(velocity[-1]), self.inertia)

    def finished(self, record: Record) -> Record:
        """Add a velocity: the slope of the position over 20 ms."""
        time, position = record.time, record["position"]
        k = max(1, round(0.01 / float(np.median(np.diff(time)))))
        velocity = np.gradient(position, time)
        velocity[k:-k] = (position[2 * k :] - position[: -2 * k]) / (time[2 * k :] - time[: -2 * k])
        return Record(
            time,
            {**record.channels, "velocity": velocity},
            {**record.units, "velocity": "rad/s"},
            record.meta,
        )

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the velocity did not reverse."""
        least = float(np.min(record["velocity"][5:-5]))
        return (
            Check("reversal", least > 0.0, f"the velocity fell to {least:.3g} rad/s; it must stay above 0"),
        )


PROCEDURE = Attraction
