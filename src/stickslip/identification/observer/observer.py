"""The observer of an axis: it makes a simulated axis follow the measured motion and returns the torque required.

In fast motion a spring and a damper act, slow enough that the axis moves by its model and not by the encoder's noise.
In slow motion and at rest that is insufficient: if friction falls with velocity faster than the damping rises, a
contact may stick or slip at the same torque, and simulated and measured motion would diverge even with the true
parameters. There a damper within the implicit step takes over, as firm as the encoder's velocity allows.
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
"""Corner of the slow damper's low-pass, in natural frequencies of the observer."""
SLOW = 0.15
"""Part of the usual (RMS) speed below which the firm damper takes over."""
CREEP = 0.01
"""Part of the usual speed below which a contact may not slide far enough to lose its memory."""
GRASP = 0.6
"""Samples within which the simulation reaches the measured velocity."""
RETURNS = 0.5
"""Rate at which the firm damper corrects the position, in natural frequencies."""
TOLERATED = 3e-3
"""Greatest torque due to a wrong velocity, part of friction."""
LONGEST = 1e-3
"""Longest step of the simulation, s, apart from the tolerance of equally spaced samples."""
FINELY = 8.0
"""Steps per row that suffice for long rows, whose band is low."""
FORGOTTEN = (8.0, 4.0)
"""Periods of the observer's natural frequency after which its initial state is nearly forgotten in sliding; the second
applies if the first gives a segment longer than `SHORT`. Within an encoder's count no spring acts, so many are
required."""
SHORT = 0.25
"""Longest segment that is acceptable, part of a record."""
EXACT, ROUGH = 1e-8, 1e-6
"""Rounding of the steps for corrections accurate to a hundred-thousandth (results) and to a thousandth (searches, which
are faster with it)."""
FEWEST = 32
"""Fewest corrections of a motion."""
REMEMBERED = 64
"""Corrections that are cached for repeated values."""
EDGE = 0.15
"""Time at both ends affected by filters, s."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A record of equally spaced samples.

    Attributes
    ----------
    time, position, torque : array, shape (n,)
        s, rad, N·m (m, N), the torque held until the next sample; a signal that the axis's ``drive_gain`` converts to
        torque is also allowed.
    count : float
        Resolution of the position, rad (m); 0 for none.
    """

    time: Array
    position: Array
    torque: Array
    count: float = 0.0

    @property
    def period(self) -> float:
        """Sample period, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def seen(self) -> SeenVelocity:
        """Velocity from the encoder, with its uncertainty."""
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
        """Return the torque that the model lacks, N·m, in the band, shape (m,); recent results are cached.

        `late` is the time by which the torque acted before its row, s, without half a row of a held command.
        """
        # A search starts where the one before stopped, and requests the same values after another filter.
        values = mechanics, late, *self.course.law.pack(parameters)
        if (found := self.known.get(values)) is None:
            found = self.shifted(late, mechanics).simulated(mechanics, parameters)
            found.setflags(write=False)
            while len(self.known) >= REMEMBERED:
                self.known.pop(next(iter(self.known)), None)
            self.known[values] = found
        return found

    def simulated(self, mechanics: Mechanics, parameters: Any) -> Array:
        """Simulate the correction."""
        raw = self.raw(mechanics, parameters)
        if not np.all(np.isfinite(raw)):
            return self.nothing()
        return np.array(self.low_pass(raw)[self.edge : -self.edge : self.stride])

    def raw(self, mechanics: Mechanics, parameters: Any) -> Array:
        """Return the torque that the observer adds at every sample, N·m, shape (n,)."""
        found = self.segments.corrections(mechanics, parameters)
        return self.course.run(mechanics, parameters)[:, 3] if found is None else found

    def shifted(self, late: float, mechanics: Mechanics) -> Prepared:
        """Return the same motion with the drive's signal `late` s earlier."""
        if late == 0.0:
            return self
        drive = self.course.drive
        moved = np.interp(drive.time + late, drive.time, drive.signal) - drive.signal
        before = 0.0 if drive.disturbance is None else drive.disturbance
        return self.perturbed(before + mechanics.drive_gain * moved)

    def perturbed(self, torque: Array) -> Prepared:
        """Return the same motion with this torque on the axis, N·m, shape (n,)."""
        course = Course(self.course.law, replace(self.course.drive, disturbance=torque))
        return replace(self, course=course, segments=self.segments.perturbed(torque))

    def nothing(self) -> Array:
        """Return an array of NaN with the shape of the corrections."""
        return np.full(self.course.drive.time[self.edge : -self.edge : self.stride].shape, math.nan)


def prepare(
    motion: Motion, law: Law, inertia: float, friction: float, band: float, speed: float = 1.0, grasp: float = GRASP,
    rounding: float = EXACT,
) -> Prepared:  # fmt: skip
    """Prepare the observer for a motion.

    Parameters
    ----------
    motion : Motion
    law : Law
    inertia, friction : float
        Approximate values of the axis: kg·m², and the Coulomb torque, N·m.
    band : float
        Bandwidth of the corrections, Hz.
    speed : float
        Natural frequency of the observer, in bands.
    grasp : float
        Samples within which its firm damper reaches the measured velocity; infinite for an observer without one.
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
    """Return the motion in segments; `period` is that of the observer's natural frequency, in rows."""
    found: list[Segments] = []
    for periods in FORGOTTEN:
        warm = math.ceil(periods * period)
        found.append(Segments(law, drive, cut(forgotten(way, warm), warm), warm, rounding))
        if found[0].longest <= SHORT:
            break
    return min(found, key=lambda s: s.longest)


def firmness(seen: SeenVelocity, firm: float, least: float, friction: float) -> Array:
    """Return the firm damper's damping, N·m·s/rad; 0 in fast motion, or if the velocity is too uncertain."""
    allowed = TOLERATED * friction / np.maximum(seen.doubt, 1e-300)
    damping = np.where(seen.doubt > 0.0, np.minimum(allowed, firm), firm)
    return np.where(slow(seen) & (damping > least), damping, 0.0)


def slow(seen: SeenVelocity) -> Any:
    """Return a mask of rows in which the axis is slower than `SLOW` of its usual speed, shape (n,)."""
    return np.abs(seen.velocity) < SLOW * float(np.sqrt(np.mean(seen.velocity**2)))


def sliding(seen: SeenVelocity, firm: Array) -> Array:
    """Return the direction in which the contact slides and loses memory, +1 or -1, shape (n,); 0 where it may stick.

    A soft observer may diverge from slow motion; a firm one follows all but a creep.
    """
    creeps = np.abs(seen.velocity) < CREEP * float(np.sqrt(np.mean(seen.velocity**2)))
    return np.where(creeps | (slow(seen) & (firm == 0.0)), 0.0, np.sign(seen.velocity))


def forgotten(way: Array, warm: int) -> Any:
    """Return a mask of rows preceded by `warm` rows of sliding in one direction, shape (n,)."""
    slid = np.concatenate([[0.0], np.cumsum(way)])
    out = np.zeros(way.size, dtype=np.bool_)
    out[warm:] = np.abs(slid[warm:-1] - slid[: -warm - 1]) == warm
    return out


def checked(motion: Motion, band: float) -> None:
    """Refuse a motion that the filters cannot process."""
    steps = np.diff(motion.time)
    if motion.time.size < 200 or not evenly_spaced(motion.time):
        raise InputError(
            f"{motion.time.size} samples between {steps.min():.3g} and {steps.max():.3g} s apart: this method needs at "
            "least 200 that are equally spaced; resample the record"
        )
    if 1.0 / float(np.median(steps)) < 3.0 * band:
        raise InputError(f"a band of {band:g} Hz needs a sample rate of {3.0 * band:g} Hz; give a lower band")
