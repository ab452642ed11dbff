"""The observer of an axis: it holds a simulated axis to the measured motion, and tells what torque that takes.

In fast motion a spring and a damper pull, slow enough that the axis moves by its model and not by the encoder's noise.
In slow motion and at rest that would not do: where friction falls with velocity faster than the damping rises, a
contact may stick or slip at one torque, and simulated and measured motion would part even under the true parameters.
There a damper takes over that is part of the implicit step, as firm as the encoder knows the velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.spec import Law
from stickslip.identification.experiment import evenly_spaced
from stickslip.identification.fit.filters import ZeroPhase, butterworth_poles
from stickslip.identification.observer.encoder_edges import SeenVelocity, seen_velocity
from stickslip.simulation.recorded_input.segments import Segments, cut
from stickslip.simulation.recorded_input.simulation import Course, Drive, Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

LAG = 4.0
"""Corner of the low-pass behind which the slow damper damps, in natural frequencies of the observer."""
SLOW = 0.15
"""Part of the usual (RMS) speed below which the firm damper takes over."""
CREEP = 0.01
"""Part of it below which a contact may not slide far enough to forget how it was before."""
GRASP = 0.6
"""Samples within which it takes the measured velocity."""
RETURNS = 0.5
"""Rate at which the position is led back there, in natural frequencies."""
TOLERATED = 3e-3
"""Part of friction that a wrong velocity may make it add."""
LONGEST = 1e-3
"""Longest step of the simulation, s, but for what equally spaced samples may differ by."""
FINELY = 8.0
"""Steps of a row that are enough where rows are long: no band of theirs is seen finer."""
FORGOTTEN = (8.0, 4.0)
"""Periods of the observer's natural frequency after which little is left of how it began, where the axis slides; the
second where the first leaves a segment longer than `SHORT`. Within an encoder's count nothing pulls: it takes many."""
SHORT = 0.25
"""Part of a record."""
EXACT, ROUGH = 1e-8, 1e-6
"""Roundings that leave a hundred-thousandth and a thousandth of the corrections: for results, and for searches, which
take a fifth less time with it."""
FEWEST = 32
"""Corrections that a motion must leave."""
REMEMBERED = 64
"""Corrections that are kept for who asks for the same values again."""
EDGE = 0.15
"""s at both ends that filters spoil."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A record of equally spaced samples.

    Attributes
    ----------
    time, position, torque : array, shape (n,)
        s, rad, N·m (m, N), the torque held until the next sample; a signal that the axis's ``drive_gain`` turns into
        torque will do.
    count : float
        Resolution of the position, rad (m); 0 for none.
    """

    time: Array
    position: Array
    torque: Array
    count: float = 0.0

    @property
    def period(self) -> float:
        """Time between samples, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def seen(self) -> SeenVelocity:
        """Its velocity, as far as the encoder shows it."""
        return seen_velocity(self.time, self.position, self.count)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A motion with its observer and the filter of its corrections."""

    course: Course
    segments: Segments
    low_pass: ZeroPhase
    stride: int
    edge: int
    known: dict[Any, Array] = field(default_factory=dict[Any, Array], init=False, repr=False)

    def correction(self, mechanics: Mechanics, parameters: Any, late: float = 0.0) -> Array:
        """Torque that the model lacks, N·m, in the band, shape (m,); of the last few values it is remembered.

        `late` are the seconds by which the torque acted before its row, half a row of a held command not counted.
        """
        # A search stands where the one before ended, and another filter behind it asks for the same.
        values = mechanics, late, *self.course.law.pack(parameters)
        if (found := self.known.get(values)) is None:
            found = self.shifted(late, mechanics).simulated(mechanics, parameters)
            found.setflags(write=False)
            while len(self.known) >= REMEMBERED:
                self.known.pop(next(iter(self.known)), None)
            self.known[values] = found
        return found

    def simulated(self, mechanics: Mechanics, parameters: Any) -> Array:
        """The same, simulated."""
        raw = self.raw(mechanics, parameters)
        if not np.all(np.isfinite(raw)):
            return self.nothing()
        return np.array(self.low_pass(raw)[self.edge : -self.edge : self.stride])

    def raw(self, mechanics: Mechanics, parameters: Any) -> Array:
        """Torque that the observer adds at every sample, N·m, shape (n,)."""
        found = self.segments.corrections(mechanics, parameters)
        return self.course.run(mechanics, parameters)[:, 3] if found is None else found

    def shifted(self, late: float, mechanics: Mechanics) -> Prepared:
        """The same with the drive's signal so many seconds earlier."""
        if late == 0.0:
            return self
        drive = self.course.drive
        moved = np.interp(drive.time + late, drive.time, drive.signal) - drive.signal
        before = 0.0 if drive.disturbance is None else drive.disturbance
        return self.perturbed(before + mechanics.drive_gain * moved)

    def perturbed(self, torque: Array) -> Prepared:
        """The same with this torque on the axis, N·m, shape (n,)."""
        course = Course(self.course.law, replace(self.course.drive, disturbance=torque))
        return replace(self, course=course, segments=self.segments.perturbed(torque))

    def nothing(self) -> Array:
        """Not a number, as many as there are corrections."""
        return np.full(self.course.drive.time[self.edge : -self.edge : self.stride].shape, math.nan)


def prepare(
    motion: Motion, law: Law, inertia: float, friction: float, band: float, speed: float = 1.0, grasp: float = GRASP,
    rounding: float = EXACT,
) -> Prepared:  # fmt: skip
    """Lay the observer out.

    Parameters
    ----------
    motion : Motion
    law : Law
    inertia, friction : float
        About those of the axis: kg·m², and the Coulomb torque, N·m.
    band : float
        Hz up to which corrections count.
    speed : float
        Its natural frequency in bands.
    grasp : float
        Samples within which its firm damper takes the measured velocity; infinite for an observer without one.
    rounding : float
        Part of the velocity, above 0.01 rad/s, to which its steps are solved.

    Raises
    ------
    InputError
        If the record is too short, or its samples too few or not equally spaced.
    """
    checked(motion, band)
    dt, seen = motion.period, motion.seen
    omega = 2.0 * math.pi * speed * band
    firm = firmness(seen, inertia / (grasp * dt), 2.0 * RETURNS * inertia * omega, friction)
    drive = Drive(
        motion.time, motion.torque, "held", start=(float(motion.position[0]), 0.0), position=motion.position,
        spring=inertia * omega**2, damping=np.where(firm > 0.0, firm, 2.0 * inertia * omega),
        goal=np.where(firm > 0.0, seen.velocity, np.append(np.diff(motion.position) / dt, 0.0)), firm=firm > 0.0,
        forgets=-math.expm1(-LAG * omega * dt), returns=RETURNS * omega, slack=0.5 * motion.count,
        max_step=1.001 * min(dt, max(LONGEST, dt / FINELY)),
    )  # fmt: skip
    low_pass = ZeroPhase(butterworth_poles(4), band, 1.0 / dt)
    stride = max(1, int(1.0 / (3.0 * band * dt)))
    edge = max(1, int(EDGE / dt))
    if (motion.time.size - 2 * edge) // stride < FEWEST:
        raise InputError(
            f"{motion.time.size * dt:.3g} s are too short for a band of {band:g} Hz; give a longer record"
        )
    return Prepared(
        Course(law, drive),
        in_segments(law, drive, sliding(seen, firm), 1.0 / (speed * band * dt), rounding),
        low_pass,
        stride,
        edge,
    )


def in_segments(law: Law, drive: Drive, way: Array, period: float, rounding: float) -> Segments:
    """The same followed in segments; `period` is that of the observer's natural frequency, in rows."""
    found: list[Segments] = []
    for periods in FORGOTTEN:
        warm = math.ceil(periods * period)
        found.append(Segments(law, drive, cut(forgotten(way, warm), warm), warm, rounding))
        if found[0].longest <= SHORT:
            break
    return min(found, key=lambda s: s.longest)


def firmness(seen: SeenVelocity, firm: float, least: float, friction: float) -> Array:
    """Damping of the firm damper, N·m·s/rad; 0 where the axis is fast, or its velocity too unsure for one."""
    allowed = TOLERATED * friction / np.maximum(seen.doubt, 1e-300)
    damping = np.where(seen.doubt > 0.0, np.minimum(allowed, firm), firm)
    return np.where(slow(seen) & (damping > least), damping, 0.0)


def slow(seen: SeenVelocity) -> Any:
    """Where the axis is slower than `SLOW` of its usual speed, shape (n,)."""
    return np.abs(seen.velocity) < SLOW * float(np.sqrt(np.mean(seen.velocity**2)))


def sliding(seen: SeenVelocity, firm: Array) -> Array:
    """Which way the contact slides and forgets, +1 or -1, shape (n,); 0 where it may stick.

    A soft observer may part from the motion where the axis is slow, a firm one holds it to all but a creep.
    """
    creeps = np.abs(seen.velocity) < CREEP * float(np.sqrt(np.mean(seen.velocity**2)))
    return np.where(creeps | (slow(seen) & (firm == 0.0)), 0.0, np.sign(seen.velocity))


def forgotten(way: Array, warm: int) -> Any:
    """Rows before which the axis has slid one way for so many rows, shape (n,)."""
    slid = np.concatenate([[0.0], np.cumsum(way)])
    out = np.zeros(way.size, dtype=np.bool_)
    out[warm:] = np.abs(slid[warm:-1] - slid[: -warm - 1]) == warm
    return out


def checked(motion: Motion, band: float) -> None:
    """Refuse what the filters cannot work on."""
    steps = np.diff(motion.time)
    if motion.time.size < 200 or not evenly_spaced(motion.time):
        raise InputError(
            f"{motion.time.size} samples between {steps.min():.3g} and {steps.max():.3g} s apart: this method needs at "
            "least 200 that are equally spaced; resample the record"
        )
    if 1.0 / float(np.median(steps)) < 3.0 * band:
        raise InputError(f"a band of {band:g} Hz needs a sample rate of {3.0 * band:g} Hz; give a lower band")
