"""Inertia: a random current of two amplitudes superposed on a running speed (thesis 4.2).

The thesis excites the axis from rest, and its responses differ at low frequencies, because friction changes sign. Here
the axis runs, so the sign stays: a damping loop keeps the mean speed, and a run below the least speed is refused. The
power grows with the frequency up to the end of the band, which changes the speed less than white noise. If the rig's
torque or speed does not allow the requested currents, all are reduced by the same factor.

``about = "rest"`` repeats the thesis's experiment, white noise without a loop: friction then sticks and changes its
sign, and the responses to the two currents differ at low frequencies (figure 4.4).
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.core.errors import InputError, RigError
from stickslip.core.record import Record
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.procedures.base import POSITION, Check, Plan, Procedure, Step, Steps
from stickslip.rigs.procedures.moves import (
    ROOM,
    brake,
    holder,
    now,
    rough_inertia,
    samples,
    speed_up,
    uniform,
)
from stickslip.rigs.rig import Rig, setpoints

Array = np.ndarray[Any, np.dtype[np.float64]]
TORQUE = COLUMNS.index("motor_torque")
SLOW = 0.02
"""Window of the speed for detecting a reversal, s."""
DAMPING = 20.0
"""Frequency at which damping loop and inertia have equal impedance, Hz."""
BIAS = 0.6
"""Share of the torque limit for the running speed; if it needs more, it runs slower."""
ABOUT = ("speed", "rest")
LEAST_MOTION = 0.01
"""Least motion about rest, rad: beyond pre-sliding, which takes about a milliradian."""
CREST = 2.2
"""Largest value of the noise over its RMS."""


@dataclass(frozen=True)
class Inertia(Procedure):
    """Options of the procedure.

    ``current`` in A RMS, one part of the record each, ``torque_constant`` in N·m/A, ``band`` in Hz, ``speed`` the mean
    and ``least`` the least speed in rad/s (speed 0: automatic, at most half of the rig's limit), ``duration`` of each
    part in s, ``about`` "speed" or "rest".
    """

    name: ClassVar[str] = "inertia"
    title: ClassVar[str] = "inertia from random currents over a running speed (4.2)"

    current: tuple[float, ...] = (0.8, 1.6)
    torque_constant: float = 0.22
    band: float = 50.0
    lowest: float = 0.4
    speed: float = 0.0
    least: float = 2.0
    duration: float = 120.0
    seed: int = 1
    about: str = "speed"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.about not in ABOUT:
            raise InputError(f"inertia: about = {self.about!r} must be {' or '.join(ABOUT)}")

    def plan(self, rig: Rig) -> Plan:
        """Plan all parts one after the other."""
        if self.about == "rest":
            return self._plan_at_rest(rig)
        v = self.speed or 0.5 * rig.limits.speed
        total = len(self.current) * (self.duration + 12.0) + 12.0
        each = ", ".join(f"{c:g}" for c in self.current)
        return Plan(
            total, v * total, 2.0 * v if not self.speed else min(2.0 * v, rig.limits.speed),
            ROOM * rig.limits.torque,
            (
                "ramp the torque until the axis moves, push it and let it coast: a first estimate of the inertia",
                f"random currents of {each} A RMS, or as much as the limits allow, up to {self.band:g} Hz "
                f"over at most {v:.3g} rad/s, {self.duration:g} s each",
            ),
            3.0 * len(self.current),
        )  # fmt: skip

    def _plan_at_rest(self, rig: Rig) -> Plan:
        """Noise without a loop; how far it moves the axis is for friction to say, and the rig's limits end it."""
        each = ", ".join(f"{c:g}" for c in self.current)
        text = (
            f"random currents of {each} A RMS up to {self.band:g} Hz, {self.duration:g} s each, the loop open"
        )
        most = CREST * max(self.current) * self.torque_constant
        return Plan(
            len(self.current) * (self.duration + 1.0), 0.0, 0.0, most, (text,), float(len(self.current))
        )

    def steps(self, rig: Rig) -> Steps:
        """Estimate roughly, then speed up, excite and stop for each current; about rest, excite alone."""
        if self.about == "rest":
            yield from self._excited_at_rest(rig)
            return
        inertia, _ = yield from rough_inertia(rig)
        follow = holder(rig, inertia, 8.0)
        speed, bias = yield from self._running(rig, follow, inertia)
        for place, current in enumerate(self.current):
            yield from self._part(rig, follow, inertia, speed, bias, place, current)

    def _excited_at_rest(self, rig: Rig) -> Steps:
        yield now(rig)
        count = samples(rig, self.duration)
        for place, current in enumerate(self.current):
            torque = self.noise(count, rig.sample_time, current * self.torque_constant, place)
            yield Step(setpoints(count, torque=torque), keep=True, label=f"{current:.3g} A RMS", pause=1.0)
            yield Step(setpoints(round(0.5 / rig.sample_time)))

    def _running(
        self, rig: Rig, follow: Controller, inertia: float
    ) -> Generator[Step, Array, tuple[float, float]]:
        """Return the running speed and its torque: the fastest that leaves torque for the noise."""
        found: tuple[float, float] | None = None
        speed = self.speed or 2.0 * self.least
        while True:
            rows = yield now(rig)
            ramp, level, end = uniform(rig, float(rows[-1, POSITION]), speed, speed, inertia)
            yield Step(ramp, follow)
            rows = yield Step(level, follow)
            bias = float(np.mean(rows[len(rows) // 2 :, TORQUE]))
            yield brake(rig, follow, end, speed, inertia)
            yield Step(setpoints(round(0.2 / rig.sample_time)), pause=0.5)
            if self.speed or (bias > BIAS * ROOM * rig.limits.torque and found is None):
                return speed, bias
            if bias > BIAS * ROOM * rig.limits.torque:
                assert found is not None
                return found
            found = speed, bias
            if speed >= 0.5 * rig.limits.speed:
                return found
            speed = min(1.5 * speed, 0.5 * rig.limits.speed)

    def _part(
        self, rig: Rig, follow: Controller, inertia: float, v: float, bias: float, place: int, current: float
    ) -> Steps:
        dt = rig.sample_time
        room = ROOM * rig.limits.torque - bias
        if room <= 0.0:
            raise RigError(
                f"{rig.name}: running at {v:.3g} rad/s takes all of its torque; give a lower speed"
            )
        kd = inertia * 2.0 * math.pi * DAMPING
        rms = self._applied(room, inertia, kd, v) * current / max(self.current)
        damp = Controller(Gains(2.0 * kd, 0.0, kd, kd), None, 0.4 * room, dt)
        rows = yield Step(setpoints(round(0.05 / dt)), pause=1.0)
        running, end = speed_up(rig, follow, float(rows[-1, POSITION]), v, inertia)
        yield running
        count = samples(rig, self.duration)
        t = dt * np.arange(1, count + 1)
        sent = setpoints(
            count,
            position=end + v * t,
            velocity=v,
            torque=bias + self.noise(count, dt, rms, place),
            closed=1.0,
        )
        rows = yield Step(sent, damp, keep=True, label=f"{rms / self.torque_constant:.3g} A RMS")
        yield brake(rig, follow, float(rows[-1, POSITION]), v, inertia)
        yield Step(setpoints(round(0.2 / dt)))

    def _applied(self, room: float, inertia: float, kd: float, v: float) -> float:
        """Return the largest RMS torque: as requested, within 0.6 of the available torque, with speeds above the
        least."""
        corner = inertia * 2.0 * math.pi * self.band
        # Variance of the speed of an inertia with damping kd under noise whose power grows with the frequency.
        spread = math.log1p((corner / kd) ** 2) / corner**2
        slowest = (v - self.least) / 4.0 / math.sqrt(spread)
        return min(max(self.current) * self.torque_constant, 0.6 * room / CREST, slowest)

    def noise(self, count: int, dt: float, rms: float, place: int) -> Array:
        """Return noise up to the end of the band, with peaks of at most `CREST` times RMS.

        Over a running speed its power grows with the frequency.
        """
        rng = np.random.default_rng((self.seed, place))
        f = np.fft.rfftfreq(count, dt)
        inside = (f <= self.band) & (f >= 0.5 * self.lowest)
        shape = np.sqrt(f) * inside if self.about == "speed" else 1.0 * inside
        noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(count)) * shape, count)
        for _ in range(20):
            noise /= float(np.sqrt(np.mean(noise**2)))
            noise = np.fft.irfft(np.fft.rfft(np.clip(noise, -0.9 * CREST, 0.9 * CREST)) * inside, count)
        noise /= float(np.sqrt(np.mean(noise**2)))
        return rms * np.clip(noise, -CREST, CREST)

    def finished(self, record: Record) -> Record:
        """Shift the measured current, which belongs to the sample that ended, to the row of its start."""
        channels = dict(record.channels)
        for name in ("motor_torque", "sensor_torque"):
            if name in channels:
                moved = channels[name].copy()
                moved[:-1] = channels[name][1:]
                channels[name] = moved
        return Record(
            record.time, channels, record.units, {**record.meta, "torque": "held from each row's time on"}
        )

    def checks(self, record: Record, rig: Rig) -> tuple[Check, ...]:
        """Check that the speed stayed above the least, or that the axis left its rest, and report the current."""
        excited = record["torque_setpoint"]
        parts = np.array_split(excited, len(self.current))
        applied = ", ".join(f"{float(np.std(p)) / self.torque_constant:.3g}" for p in parts)
        asked = ", ".join(f"{c:g}" for c in self.current)
        current_check = Check("current", True, f"{applied} A RMS applied of {asked} requested")
        if self.about == "rest":
            moved = float(np.ptp(record["position"]))
            text = f"the axis moved within {moved:.3g} rad; if it did not, raise the current"
            return Check("moved", moved > LEAST_MOTION, text), current_check
        lowest = float(np.min(slopes(record, SLOW)))
        return (
            Check(
                "reversal", lowest >= self.least,
                f"the lowest speed over {1e3 * SLOW:g} ms was {lowest:.3g} rad/s, at least {self.least:g} is needed so "
                "that friction keeps its sign; if it fails, raise speed or lower current",
            ),
            current_check,
        )  # fmt: skip


def slopes(record: Record, window: float) -> Array:
    """Return the speed over a window, rad/s, in each segment without a gap."""
    time, position = record.time, record["position"]
    dt = float(np.median(np.diff(time)))
    k = max(1, round(window / dt))
    width = time[k:] - time[:-k]
    return ((position[k:] - position[:-k]) / width)[width < 1.5 * k * dt]


PROCEDURE = Inertia
