"""An axis with Coulomb friction in plain Python, on whose answers tests put their faults."""

from __future__ import annotations

import math
from collections.abc import Callable

from stickslip.rigs.rig import Capabilities, Limits, Measurement, Watchdog

LIMITS = Limits(torque=1.0, speed=40.0)
Change = Callable[[Measurement, int], Measurement]


def unchanged(measured: Measurement, _: int) -> Measurement:
    return measured


class CoulombRig:
    """Inertia 1e-3 kg·m², friction `friction` (N·m), an encoder of `counts` per turn.

    `change` alters what is measured, by the number of the sample; `acts` says which torque acts.
    """

    name = "coulomb"
    sample_time = 1e-3
    inertia = 1e-3

    def __init__(
        self, change: Change = unchanged, *, friction: float = 0.2, counts: float = 1e5, real: bool = False,
        limits: Limits = LIMITS, acts: Callable[[float], float] = lambda torque: torque,
    ) -> None:  # fmt: skip
        self.limits, self.change, self.acts = limits, change, acts
        self.capabilities = Capabilities(Watchdog(0.05, "its own timer"), real_clock=real, torque_sensor=True)
        self.friction, self.count = friction, 2.0 * math.pi / counts
        self.time = self.position = self.velocity = self.torque = 0.0
        self.torques: list[float] = []
        self.closed = 0

    def open(self) -> Measurement:
        return self.measured()

    def exchange(self, torque: float) -> Measurement:
        self.torques.append(torque)
        self.torque = self.acts(torque)
        self.move()
        return self.change(self.measured(), len(self.torques))

    def move(self) -> None:
        """One sample."""
        self.time += self.sample_time
        free = self.velocity + self.sample_time * self.torque / self.inertia
        lost = self.sample_time * self.friction / self.inertia
        self.velocity = math.copysign(max(0.0, abs(free) - lost), free)
        self.position += self.sample_time * self.velocity

    def pause(self, seconds: float) -> Measurement:
        self.velocity = 0.0
        self.time += seconds
        return self.measured()

    def close(self) -> None:
        self.torque = 0.0
        self.closed += 1

    def measured(self) -> Measurement:
        shown = self.count * math.floor(self.position / self.count)
        friction = math.copysign(self.friction, self.velocity) if self.velocity else 0.0
        return Measurement(self.time, shown, self.torque, friction)
