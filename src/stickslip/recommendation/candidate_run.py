"""Simulate one setting of a compensator on one axis, as in the drive: along a motion and at rest after it; and the
linear controller alone, which may ring by itself, because one encoder count causes a torque of kd times count divided
by sample time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.control.linear import Cascade, Gains, place
from stickslip.control.own_loop import ReferenceVelocity
from stickslip.core.arguments import insist_on_own
from stickslip.core.errors import ParameterError
from stickslip.core.messages import render
from stickslip.identification.motion import HOLD, Motion, sinusoid
from stickslip.machines.machine import LONGEST_DELAY, Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.course import Course, course_of
from stickslip.recommendation.following import followed, simulated
from stickslip.recommendation.plant import Plant
from stickslip.recommendation.swings import above, repeats, reversals, turns

Array = np.ndarray[Any, np.dtype[np.float64]]

AT_REST = "limit cycle at rest"
IN_MOTION = "oscillates in motion"
ROUGH_MOTION = "rough motion"
LARGER = "a larger error than without it"
LEFT = "position or velocity exceeded all reasonable limits"

BUSY = 1.0
"""Reversals per second in addition to those of the linear controller alone above which an axis hunts."""
BOUNCES = 2.0
"""Swings that a compensating torque may cause at a stop or reversal, when the springs release the step."""
LIVELIER, ROUGH = 3.0, 0.1
"""Motion is rough if the velocity above 50 Hz exceeds this multiple of the linear controller's and this share of the
reference's RMS."""
KICKS = 0.5
"""The same for a feedforward, which excites the contact's springs at reversals but cannot ring with them."""
SWINGS = (2.0, 0.03)
"""Smallest swing, in counts and as a share of the linear controller's RMS error."""
TRIGGER = 1e-3
"""rad/s: slower reversals between two counts are not counted."""
FAST = 50.0
"""Hz"""
STARTS = (0.45, 1.4)
"""Start, in counts, from which the linear controller moves to a position half way between two counts, where a creeping
axis ends."""
SLOWEST = 0.01
"""Lowest bandwidth, relative to the motion's frequency."""
SMALLEST = 1e-12
"""Smallest amplitude of a motion, rad (m)."""
HELD = 2.0
"""Duration of the rest, s; the second half is evaluated."""


@dataclass(frozen=True)
class Drive:
    """The drive, and the motion to compensate for.

    Attributes
    ----------
    bandwidth, damping : float
        Of the position loop's poles, Hz and -; for pole placement with the model's inertia.
    sample_time : float
        s
    sample_time_from : str
        Source of the sample time, for people; empty if it need not be reported.
    encoder_counts : float
        Per revolution (2 pi); 0 measures exactly.
    encoder_from : str
        Source of the counts, for people; empty if it need not be reported.
    torque_limit : float
        N·m
    amplitude : float or None
        Of a slow sinusoid as motion, rad; None: `motion`, or that of the log.
    frequency : float
        Of that sinusoid, Hz.
    linear : str
        "PD", "PID" or "PR", placed by bandwidth and damping.
    gains : Gains, Cascade or None
        Gains of the existing loop; None: from pole placement.
    velocity_filter : float
        Corner of the first-order low-pass on the measured velocity, Hz; 0 for none.
    motion : Motion or None
        None: that of the log, or the sinusoid.
    controller : Controller or None
        The existing loop if it consists of control laws, without friction laws; gains, placement and filter are not
        used then, and its sample time is the drive's.
    machine : Machine or None
        The user's machine, with its resonances, encoder, amplifier and delay; None: rigid axes.
    delay : float or None
        Command delay, samples, without a machine; None: sampled, up to one sample.
    reference_velocity : {"difference", "instant"} or None
        How it forms its reference velocity; None: unknown. The best estimate then uses the difference, and the sampled
        axes either.
    """

    bandwidth: float = 10.0
    damping: float = 1.0
    sample_time: float = 1e-3
    encoder_counts: float = 0.0
    torque_limit: float = math.inf
    amplitude: float | None = None
    frequency: float = 0.5
    linear: str = "PD"
    gains: Gains | Cascade | None = None
    velocity_filter: float = 0.0
    motion: Motion | None = None
    controller: Controller | None = None
    machine: Machine | None = None
    sample_time_from: str = ""
    delay: float | None = None
    encoder_from: str = ""
    reference_velocity: ReferenceVelocity | None = None

    def __post_init__(self) -> None:
        insist_on_own(self, "drive")
        for name in ("sample_time_from", "encoder_from"):
            object.__setattr__(self, name, render(getattr(self, name)))
        for name in ("bandwidth", "damping", "sample_time", "torque_limit", "amplitude", "frequency"):
            value = getattr(self, name)
            endless = name == "torque_limit"
            if value is not None and not (value > 0.0 and (endless or math.isfinite(value))):
                said = "" if endless else " and finite"
                raise ParameterError(f"drive: {name} = {value:g} must be greater than 0{said}")
        for name in ("encoder_counts", "velocity_filter"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ParameterError(
                    f"drive: {name} = {getattr(self, name):g} must be 0 or greater, and finite"
                )
        if self.amplitude is not None and self.amplitude < SMALLEST:
            raise ParameterError(
                f"drive: amplitude = {self.amplitude:g} must be at least {SMALLEST:g} rad (m)"
            )
        for name in ("bandwidth", "frequency"):
            used = not self.given if name == "bandwidth" else self.amplitude is not None
            if used and getattr(self, name) * self.sample_time > 0.1:
                raise ParameterError(
                    f"drive: {name} = {getattr(self, name):g} Hz is more than a tenth of the sample rate "
                    f"{1.0 / self.sample_time:g} Hz; take a lower one, or a shorter sample time"
                )
        if self.delay is not None:
            self._refuse_delay(self.delay)
        if self.machine is not None:
            refuse_other(self.machine, self.sample_time, self.encoder_counts)
        if self.controller is not None:
            refuse_unfit(self.controller, self.sample_time)
        if not self.given and self.bandwidth < SLOWEST * self.frequency:
            raise ParameterError(
                f"drive: bandwidth = {self.bandwidth:g} Hz is less than {SLOWEST:g} of the motion's "
                f"{self.frequency:g} Hz, which the loop would not follow at all; give a higher one"
            )

    def _refuse_delay(self, delay: float) -> None:
        if self.machine is not None:
            raise ParameterError(
                f"drive: delay = {delay:g}, and the machine {self.machine.name} has its own ({self.machine.delay:g} "
                "samples); give one of them"
            )
        if not 0.0 <= delay <= LONGEST_DELAY:
            raise ParameterError(
                f"drive: delay = {delay:g} must be from 0 to {LONGEST_DELAY:g}, in samples (s over the sample time)"
            )

    @property
    def latest(self) -> float:
        """Command delay, samples, if known; else 0."""
        return self.machine.delay if self.machine is not None else self.delay or 0.0

    @property
    def steps(self) -> float:
        """Approximate number of steps for one axis: the motion, the rest after it, and holding at rest."""
        return (self.course.whole.duration + HOLD + len(STARTS) * HELD) / min(5e-4, self.sample_time)

    def deadband(self, counts: float) -> float:
        """Return the velocity of a number of encoder counts per sample time, rad/s; 0 for exact measurement."""
        return counts * 2.0 * math.pi / self.encoder_counts / self.sample_time if self.encoder_counts else 0.0

    @property
    def given(self) -> bool:
        """Whether the loop is given by the user, not by pole placement."""
        return self.gains is not None or self.controller is not None

    def loop(self, inertia: float) -> Controller:
        """Return the linear controller, or the one made of control laws, alone."""
        if self.controller is not None:
            limit = min(self.torque_limit, self.controller.torque_limit)
            return replace(
                self.controller, torque_limit=limit, encoder_counts=self.encoder_counts,
                reference_velocity=self.reference_velocity,
            )  # fmt: skip
        gains = self.gains or place(self.linear, inertia, self.bandwidth, self.damping)
        return Controller(
            gains, None, self.torque_limit, self.sample_time, self.encoder_counts, self.velocity_filter,
            reference_velocity=self.reference_velocity,
        )  # fmt: skip

    @cached_property
    def path(self) -> Motion:
        """The motion to evaluate: `motion`, or its part from rest to rest, or the sinusoid.

        Raises
        ------
        ParameterError
            If there is no motion.
        """
        return self.course.judged

    @cached_property
    def course(self) -> Course:
        """The motion with a run-up before it and braking after it.

        Raises
        ------
        ParameterError
            As for `path`.
        """
        if self.motion is not None:
            return course_of(self.motion)
        if self.amplitude is None:
            raise ParameterError(
                "drive: there is no motion for testing a setting; give a motion or an amplitude"
            )
        return course_of(sinusoid(self.amplitude, self.frequency))

    @cached_property
    def reference(self) -> Array:
        """Position, velocity and acceleration of the motion at every sample, shape (n, 3), with `HOLD` at rest after
        it."""
        return self.course.sampled(self.sample_time)

    @cached_property
    def reference_backward(self) -> Array:
        """The same, with the mean velocity over the previous sample."""
        return self.course.backward(self.reference, self.sample_time)

    @cached_property
    def stops(self) -> float:
        """Rate of stops and reversals of the motion, 1/s."""
        side = np.sign(np.diff(self.reference[:, 0]))
        return float(np.sum((side[:-1] != 0.0) & (side[1:] != side[:-1]))) / (side.size * self.sample_time)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        apart = ("gains", "motion", "controller", "machine")
        out = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in apart}
        path = self.path
        return out | {
            "gains": self.gains._asdict() if self.gains else None,
            "controller": self.controller.as_dict() if self.controller else None,
            "machine": self.machine.name if self.machine else None,
            "motion": {
                "source": path.source,
                "amplitude": path.amplitude,
                "duration": path.duration,
                "run_up": self.course.run_up,
                "braking": self.course.braking,
            },
        }


def refuse_other(machine: Machine, sample_time: float, counts: float) -> None:
    """Refuse a drive that contradicts the machine.

    Raises
    ------
    ParameterError
    """
    for name, given, own in (
        ("sample_time", sample_time, machine.sample_time),
        ("encoder_counts", counts, machine.encoder.counts),
    ):
        if given != own:
            raise ParameterError(
                f"drive: {name} = {given:g}, that of the machine {machine.name} is {own:g}; leave it out"
            )


def refuse_unfit(controller: Controller, sample_time: float) -> None:
    """Refuse a loop made of control laws that does not fit the drive.

    Raises
    ------
    ParameterError
    """
    if controller.sample_time != sample_time:
        raise ParameterError(
            f"drive: sample_time = {sample_time:g} s, the controller's is {controller.sample_time:g} s; give the same"
        )
    for part, block in controller.blocks.items():
        if block.friction is not None:
            raise ParameterError(
                f"drive: {part} = {block.law.name!r} contains a friction law, which is to be recommended; leave it out"
            )


@dataclass(frozen=True, eq=False)
class Trial:
    """Simulation of one axis with one controller: along the motion, and at rest after it.

    Attributes
    ----------
    moving : mapping of str to float
        Metrics of the motion: ``position_rms_rad``, ``velocity_above_50Hz_rms_rad_s``; ``speed_rms_rad_s`` of
        the reference.
    position, reference : array, shape (n,)
        Of the axis and its reference at every sample, rad.
    sample_time : float
        s
    learned : mapping
        Parameters learned by a controller of control laws at the end (`stickslip.control.learned.plain`).
    """

    moving: dict[str, float]
    position: Array
    reference: Array
    sample_time: float
    learned: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def restless(self, swing: float) -> tuple[float, float]:
        """Swings per second by more than `swing`, rad: in total in addition to those of the reference, and at rest
        after it."""
        beyond = turns(self.position, swing) - turns(self.reference, swing)
        resting = turns(self.late, swing) / (0.5 * HOLD)
        return beyond / (self.position.size * self.sample_time), resting

    @property
    def late(self) -> Array:
        """Positions in the second half of the rest after the motion, rad."""
        return self.position[-round(0.5 * HOLD / self.sample_time) :]

    def swing(self, drive: Drive) -> float:
        """Smallest swing that counts, rad: some counts, or a share of this trial's error."""
        count = drive.deadband(1.0) * drive.sample_time
        return max(SWINGS[0] * count, SWINGS[1] * self.moving["position_rms_rad"])


def run(plant: RigidAxis, controller: Controller, drive: Drive) -> Trial | str:
    """Simulate the motion and the rest after it; return the reason if it ends early."""
    backward = isinstance(plant, Plant) and plant.backward
    reference = drive.reference_backward if backward else drive.reference
    position, state = followed(plant, controller, reference)
    if position is None:
        return LEFT
    time = controller.sample_time
    judged = drive.course.rows_judged(len(reference), time)
    velocity = np.diff(position, append=position[-1]) / time
    return Trial(
        {
            "position_rms_rad": math.sqrt(float(np.mean((reference[judged, 0] - position[judged]) ** 2))),
            "velocity_above_50Hz_rms_rad_s": above(velocity, FAST, time),
            "speed_rms_rad_s": math.sqrt(float(np.mean(reference[judged, 1] ** 2))),
        },
        position, np.ascontiguousarray(reference[:, 0]), time, after(controller, state, time),
    )  # fmt: skip


def rings(plant: RigidAxis, linear: Controller, drive: Drive, alone: Trial | str) -> str:
    """Return "at rest" or "in motion" if the linear controller alone oscillates on an axis; empty if it is calm.

    `alone` is its trial. It is also tested at a position between two counts: whether a motion ends there is chance, and
    a compensator with a smaller error leads there.
    """
    if isinstance(alone, str):
        return "at rest"
    beyond, resting = alone.restless(alone.swing(drive))
    if resting > BUSY:
        return "at rest"
    for late in held_between_counts(plant, linear, drive):
        if late is None or reversals(np.diff(late) / drive.sample_time, TRIGGER) / (0.5 * HELD) > BUSY:
            return "at rest"
    return "in motion" if beyond > BUSY else ""


def held_between_counts(plant: RigidAxis, linear: Controller, drive: Drive) -> Iterator[Array | None]:
    """Return the late positions of an axis at rest between two counts, rad; None if it diverges."""
    count = drive.deadband(1.0) * drive.sample_time
    held = np.zeros((round(HELD / drive.sample_time), 3))
    held[:, 0] = 0.5 * count
    for start in STARTS if count > 0.0 else ():
        position = simulated(plant, linear, held, start * count)
        yield None if position is None else position[position.size // 2 :]


def dangers(before: Trial, after: Trial, drive: Drive, feedforward: bool = False) -> Iterator[str]:
    """Return the properties in which a compensator is worse than the linear controller alone.

    At rest a feedforward's torque is constant, so only the linear controller can ring there.
    """
    swing = before.swing(drive)
    (was, rested), (now, resting) = before.restless(swing), after.restless(swing)
    if resting > rested + BUSY and repeats(after.late, swing) and not feedforward:
        yield AT_REST
    if now > max(was, 0.0) + BUSY + BOUNCES * drive.stops:
        yield IN_MOTION
    rough = "velocity_above_50Hz_rms_rad_s"
    bearable = (KICKS if feedforward else ROUGH) * after.moving["speed_rms_rad_s"]
    if after.moving[rough] > max(LIVELIER * before.moving[rough], bearable):
        yield ROUGH_MOTION
    if after.moving["position_rms_rad"] > before.moving["position_rms_rad"]:
        yield LARGER
