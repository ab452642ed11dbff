"""One setting of a compensator on one axis: along a slow sinusoid, and to a stop, as a drive runs it; and the linear
controller alone, which may ring by itself: a count of the encoder looks like kd count / sample time of speed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from stickslip.control.controller import Controller
from stickslip.errors import ParameterError, SimulationError
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Reference
from stickslip.simulation.closed_loop import simulate

__all__ = ["AT_REST", "Drive", "Trial", "dangers", "rings", "run"]

AT_REST = "limit cycle at rest"

BUSY = 1.0
"""Reversals per second beyond those of the linear controller alone from which an axis hunts."""
LIVELIER, ROUGH = 3.0, 0.1
"""Rough is a velocity above 50 Hz beyond so many times the linear controller's and this part of the reference's RMS."""
STARTS = (0.45, 1.4)
"""Counts from which the linear controller goes to rest half way between two counts, where a creeping axis ends up."""
HELD = 2.0
"""s, of which the second half is judged."""


@dataclass(frozen=True)
class Drive:
    """The drive that will run it, and the motion that matters.

    Attributes
    ----------
    bandwidth, damping : float
        Of the position loop's poles, Hz and -; the PD is placed with the model's inertia.
    sample_time : float
        s
    encoder_counts : float
        Per revolution (2 pi); 0 measures exactly.
    torque_limit : float
        N·m
    amplitude, frequency : float
        Of the slow sinusoid, rad and Hz; the way to the stop has the length of the amplitude.
    """

    bandwidth: float = 10.0
    damping: float = 1.0
    sample_time: float = 1e-3
    encoder_counts: float = 0.0
    torque_limit: float = math.inf
    amplitude: float = 0.1
    frequency: float = 0.5

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "sample_time", "torque_limit", "amplitude", "frequency"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"drive: {name} = {getattr(self, name):g} must be greater than 0")
        if not self.encoder_counts >= 0.0:
            raise ParameterError(f"drive: encoder_counts = {self.encoder_counts:g} must be 0 or greater")
        for name in ("bandwidth", "frequency"):
            if getattr(self, name) * self.sample_time > 0.1:
                raise ParameterError(
                    f"drive: {name} = {getattr(self, name):g} Hz is more than a tenth of the sample rate "
                    f"{1.0 / self.sample_time:g} Hz; take a lower one, or a shorter sample time"
                )

    def deadband(self, counts: float) -> float:
        """The velocity of so many counts of the encoder per sample time, rad/s; 0 where it measures exactly."""
        return counts * 2.0 * math.pi / self.encoder_counts / self.sample_time if self.encoder_counts else 0.0


@dataclass(frozen=True, eq=False)
class Trial:
    """Metrics of one axis under one controller: along the sinusoid, and to a stop."""

    moving: dict[str, float]
    stopping: dict[str, float]


def run(plant: RigidAxis, controller: Controller, drive: Drive) -> Trial | str:
    """Both motions; the reason where one cannot be run to its end."""
    way, speed = drive.amplitude, 2.0 * math.pi * drive.amplitude * drive.frequency
    slow = Reference("sine", amplitude=drive.amplitude, frequency=drive.frequency)
    stop = Reference("scurve", distance=way, velocity=speed, acceleration=10.0 * speed, jerk=400.0 * speed)
    travel = way / speed + 0.2
    try:
        out = [
            dict(simulate(plant, controller, reference, duration, time_step=min(5e-4, drive.sample_time), output=0.01)
                 .meta["metrics"])
            for reference, duration in ((slow, 2.0 / drive.frequency), (stop, 2.0 * travel + 1.0))
        ]  # fmt: skip
    except SimulationError as error:
        return str(error)
    return Trial(*out)


def rings(plant: RigidAxis, linear: Controller, drive: Drive, alone: Trial | str) -> str:
    """Where the linear controller alone rings on an axis, "at rest" or "in motion"; empty where it is calm.

    `alone` is its trial. Besides, it holds a position between two counts, from near it: whether it happens to stop
    there after a way is luck, and a compensator that leaves less error brings it there.
    """
    if isinstance(alone, str) or alone.stopping["second_half_reversals_per_s"] > BUSY:
        return "at rest"
    count = drive.deadband(1.0) * drive.sample_time
    middle = Reference("step", amplitude=0.5 * count)
    try:
        for start in STARTS if count > 0.0 else ():
            held = simulate(plant, linear, middle, HELD, time_step=min(5e-4, drive.sample_time), output=0.1,
                            initial=(start * count, 0.0))  # fmt: skip
            if held.meta["metrics"]["second_half_reversals_per_s"] > BUSY:
                return "at rest"
    except SimulationError:
        return "at rest"
    return "in motion" if alone.moving["reversals_beyond_reference_per_s"] > BUSY else ""


def dangers(before: Trial, after: Trial, drive: Drive) -> Iterator[str]:
    """What a compensator makes worse than the linear controller alone."""
    if after.stopping["second_half_reversals_per_s"] > before.stopping["second_half_reversals_per_s"] + BUSY:
        yield AT_REST
    name = "reversals_beyond_reference_per_s"
    if after.moving[name] > max(before.moving[name], 0.0) + BUSY:
        yield "oscillates in motion"
    rough = "velocity_above_50Hz_rms_rad_s"
    speed = 2.0 * math.pi * drive.frequency * drive.amplitude / math.sqrt(2.0)
    if after.moving[rough] > max(LIVELIER * before.moving[rough], ROUGH * speed):
        yield "rough motion"
    if after.moving["position_rms_rad"] > before.moving["position_rms_rad"]:
        yield "a larger error than without it"
