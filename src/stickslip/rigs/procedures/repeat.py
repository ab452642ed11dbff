"""Repeat: the same tracking several times, minutes apart (thesis 4.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from stickslip.core.record import Record
from stickslip.rigs.procedures.base import Check, Plan, Steps
from stickslip.rigs.procedures.track import Track
from stickslip.rigs.rig import Rig


@dataclass(frozen=True)
class Repeat(Track):
    """Options of `track`; ``times``, and the ``interval`` between two starts in s."""

    name: ClassVar[str] = "repeat"
    title: ClassVar[str] = "the same tracking five times, ten minutes apart (4.4)"

    linear: str = "PID"
    times: int = 5
    interval: float = 600.0

    def plan(self, rig: Rig) -> Plan:
        """Plan every repetition."""
        one = Track.plan(self, rig)
        text = (*one.text, f"{self.times} times, {self.interval:g} s from one start to the next")
        return replace(
            one, duration=self.times * one.duration, text=text,
            pauses=self.wait + (self.times - 1) * max(self.interval - one.duration, 0.0),
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps of `Track`, with pauses in between."""
        rest = max(self.interval - Track.plan(self, rig).duration, 0.0)
        for i in range(self.times):
            yield from Track.steps(replace(self, wait=rest if i else self.wait), rig)

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Report the spread of the errors from run to run."""
        n = len(record) // self.times
        error = (record["position_reference"] - record["position"])[: n * self.times].reshape(self.times, n)
        each: Any = (error**2).mean(axis=1) ** 0.5
        spread = math.sqrt(float(np.var(error, axis=0, ddof=1).mean())) if self.times > 1 else 0.0
        return (
            Check(
                "repeatability", True,
                f"error {each.min():.4g} to {each.max():.4g} rad RMS; from run to run it spreads by {spread:.3g} rad",
            ),
        )  # fmt: skip


PROCEDURE = Repeat
