"""Pre-sliding: a slow sinusoidal torque below break-away, three cycles (thesis 4.3.1.1.3, eqs. 4.2 and 4.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip.core.record import Record
from stickslip.rigs.procedures.base import Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import now, samples
from stickslip.rigs.rig import Rig, setpoints

LEAST = 200
"""Fewest rows of a cycle."""


@dataclass(frozen=True)
class Presliding(Procedure):
    """Options of the procedure.

    ``amplitude`` in N·m (thesis: 0.18 dry, 0.13 greased), ``frequency`` in Hz, ``cycles``, and ``average``, the samples
    of one row of the record: fewer if a cycle would have less than `LEAST` rows.
    """

    name: ClassVar[str] = "presliding"
    title: ClassVar[str] = "hysteresis of torque over displacement below break-away (4.3.1.1.3)"

    amplitude: float = 0.18
    frequency: float = 0.1
    cycles: float = 3.0
    average: int = 50
    farthest: float = 0.01

    def rows_of(self, rig: Rig) -> int:
        """Return the samples of one row."""
        return max(1, min(self.average, math.floor(1.0 / (LEAST * self.frequency * rig.sample_time))))

    def plan(self, rig: Rig) -> Plan:
        """Plan the cycles."""
        seconds = self.cycles / self.frequency
        return Plan(
            seconds + 1.0, self.farthest, 2.0 * math.pi * self.frequency * self.farthest, self.amplitude,
            (f"{self.cycles:g} cycles of {self.amplitude:g} N·m at {self.frequency:g} Hz, open loop",), 1.0,
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps: from rest, open loop."""
        yield now(rig)
        count = samples(rig, self.cycles / self.frequency)
        t = rig.sample_time * np.arange(1, count + 1)
        torque = self.amplitude * np.sin(2.0 * math.pi * self.frequency * t)
        # Beyond this travel the axis has broken away, and the step ends.
        yield Step(
            setpoints(count, torque=torque), keep=True, average=self.rows_of(rig), pause=1.0, travel=self.farthest,
            label=f"{self.amplitude:g} N·m",
        )  # fmt: skip
        yield Step(setpoints(round(0.2 / rig.sample_time)))

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that it moved by more than the encoder's noise, and did not break away."""
        moved = float(np.ptp(record["position"]))
        row = self.rows_of(rig) * rig.sample_time
        full = float(record.time[-1] - record.time[0]) + row >= 0.98 * self.cycles / self.frequency
        return (
            Check("moved", moved > 1e-5, f"moved by {moved:.3g} rad"),
            Check(
                "stuck", full and moved < self.farthest,
                f"moved by {moved:.3g} rad; {self.amplitude:g} N·m must stay below break-away: lower amplitude",
            ),
        )  # fmt: skip


PROCEDURE = Presliding
