"""Resonance: white torque noise while the axis runs and while it sticks, for the response of the drive's own loop.

Modes limit the bandwidth of a position loop, and they differ between a sticking and a sliding contact. Therefore both
are excited: at a running speed that never reverses, kept by a slow loop, and at rest far below break-away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import ROOM, brake, holder, now, samples, speed_up
from stickslip.rigs.rig import Rig, setpoints

Array = np.ndarray[Any, np.dtype[np.float64]]
REFERENCE = COLUMNS.index("position_reference")
HOLD = 4.0
"""Bandwidth of the loop that keeps the running speed, Hz."""
CREST = 3.0
"""Largest value of the noise over its RMS."""
SHARE = 0.08
"""Largest RMS of the noise, as a share of the torque limit."""


@dataclass(frozen=True)
class Resonance(Procedure):
    """Options of the procedure.

    ``speed`` of the running part in rad/s, ``inertia`` in kg·m², ``stuck`` the RMS torque at rest in N·m, ``lowest``
    frequency in Hz, ``highest`` as a part of the sample rate, ``duration`` of each part in s.
    """

    name: ClassVar[str] = "resonance"
    title: ClassVar[str] = "modes while it slides and while it sticks, from torque noise (4.5)"
    signed: ClassVar[tuple[str, ...]] = ("speed",)

    speed: float = 5.0
    inertia: float = 4.3e-4
    stuck: float = 0.03
    lowest: float = 5.0
    highest: float = 0.45
    duration: float = 20.0
    seed: int = 2

    def running(self, rig: Rig) -> float:
        """Return the RMS torque of the running part: its speed ripple may be a quarter of the speed."""
        band = self.highest / rig.sample_time - self.lowest
        own = 2.0 * math.pi * self.inertia * math.sqrt(band * self.lowest)
        return min(SHARE * rig.limits.torque, 0.25 * abs(self.speed) * own)

    def plan(self, rig: Rig) -> Plan:
        """Plan both parts."""
        top = CREST * max(self.running(rig), self.stuck)
        return Plan(
            2.0 * self.duration + 5.0, abs(self.speed) * (self.duration + 2.0), 1.5 * abs(self.speed),
            min(max(ROOM * rig.limits.torque, top), rig.limits.torque),
            (
                f"torque noise of {self.running(rig):.2g} N·m RMS up to {self.highest / rig.sample_time:.3g} Hz over "
                f"{self.speed:g} rad/s, {self.duration:g} s",
                f"torque noise of {self.stuck:.2g} N·m RMS at rest, {self.duration:g} s",
            ),
            2.0,
        )  # fmt: skip

    def steps(self, rig: Rig) -> Steps:
        """Generate the steps: run and excite, stop, rest and excite."""
        loop, v = holder(rig, self.inertia, HOLD), self.speed
        rows = yield Step(setpoints(2), pause=1.0)
        running, end = speed_up(rig, loop, float(rows[-1, POSITION]), v, self.inertia)
        yield running
        count = samples(rig, self.duration)
        t = rig.sample_time * np.arange(1, count + 1)
        sent = setpoints(
            count, position=end + v * t, velocity=v, torque=self.noise(rig, self.running(rig), 0), closed=1.0
        )
        rows = yield Step(sent, loop, keep=True, label="sliding")
        yield brake(rig, loop, float(rows[-1, REFERENCE]), v, self.inertia)
        yield now(rig, 0.5)
        still = setpoints(count, torque=self.noise(rig, self.stuck, 1))
        yield Step(still, keep=True, label="sticking", pause=1.0)
        yield now(rig)

    def noise(self, rig: Rig, rms: float, place: int) -> Array:
        """Return white noise from the lowest to the highest frequency, with peaks of at most `CREST` times RMS."""
        count = samples(rig, self.duration)
        f = np.fft.rfftfreq(count, rig.sample_time)
        inside = (f >= self.lowest) & (f <= self.highest / rig.sample_time)
        if not np.any(inside):
            raise InputError(
                f"resonance: duration = {self.duration:g} s has no frequency from lowest = {self.lowest:g} Hz to "
                f"{self.highest / rig.sample_time:g} Hz; record for longer, or widen the band"
            )
        rng = np.random.default_rng((self.seed, place))
        noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(count)) * inside, count)
        noise /= float(np.sqrt(np.mean(noise**2)))
        return rms * np.clip(noise, -CREST, CREST)

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the running part never reversed, and the other never broke away."""
        closed = record["velocity_reference"] != 0.0
        count = max(2, round(0.02 / rig.sample_time))
        run, still = record["position"][closed], record["position"][~closed]
        slowest = float(np.min(np.sign(self.speed) * (run[count:] - run[:-count]))) / (
            count * rig.sample_time
        )
        moved = float(np.ptp(still))
        running = f"the lowest speed over 20 ms was {slowest:.3g} rad/s; it must stay above 0: raise speed"
        return (
            Check("sliding", slowest > 0.0, running),
            Check("sticking", moved < 0.01, f"moved by {moved:.2g} rad at rest; it must stick: lower stuck"),
        )


PROCEDURE = Resonance
