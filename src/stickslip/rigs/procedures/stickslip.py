"""Stick-slip: a sinusoidal torque that breaks away in both directions, open loop (thesis 4.3.1.1.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.record import Record
from stickslip.rigs.procedures.base import Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import now, samples
from stickslip.rigs.rig import Rig, setpoints


@dataclass(frozen=True)
class Stickslip(Procedure):
    """Options: ``amplitude`` in N·m (thesis: 0.45 dry, 0.35 greased), ``frequency`` in Hz, ``cycles``.

    ``average`` is the number of samples per row: single counts would look like alternating motion and rest.
    """

    name: ClassVar[str] = "stickslip"
    title: ClassVar[str] = "open-loop response that sticks and slips (4.3.1.1.4)"

    amplitude: float = 0.45
    frequency: float = 1.0
    cycles: float = 5.0
    average: int = 4

    def plan(self, rig: Rig) -> Plan:
        """Plan the cycles; the speed depends on friction and is not known in advance."""
        seconds = self.cycles / self.frequency
        return Plan(
            seconds + 1.0, 0.5 * rig.limits.speed * seconds, 0.0, self.amplitude,
            (f"{self.cycles:g} cycles of {self.amplitude:g} N·m at {self.frequency:g} Hz, open loop",), 1.0,
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps: from rest, open loop."""
        yield now(rig)
        count = samples(rig, self.cycles / self.frequency)
        t = rig.sample_time * np.arange(count)
        torque = self.amplitude * np.sin(2.0 * math.pi * self.frequency * t)
        yield Step(
            setpoints(count, torque=torque),
            keep=True,
            average=self.average,
            pause=1.0,
            label=f"{self.amplitude:g} N·m",
        )
        yield Step(setpoints(round(0.5 / rig.sample_time)))

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that it slipped in both directions, and stuck in between."""
        position = record["position"]
        width = max(1, self.average) * rig.sample_time
        k = max(1, round(0.02 / width))
        speed = (position[k:] - position[:-k]) / (k * width)
        stuck = float(np.mean(np.abs(speed) < 0.01))
        return (
            Check(
                "slipped", bool(np.max(speed) > 0.05 and np.min(speed) < -0.05),
                f"speeds from {np.min(speed):.3g} to {np.max(speed):.3g} rad/s; both directions must slip, else "
                "raise amplitude",
            ),
            Check("stuck", stuck > 0.05, f"stuck for {100 * stuck:.3g} % of the time"),
        )  # fmt: skip


PROCEDURE = Stickslip
