"""What an observer must correct: the torque that a simulated axis lacks, whitened, outliers weighed.

See `stickslip.identify.prediction_error` for the method that minimises it.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.axis_start import feasible
from stickslip.identify.optimum import Optimum, descend
from stickslip.identify.vector import Vector
from stickslip.simulation.driven import Course, Drive, Mechanics
from stickslip.spec import Law

__all__ = [
    "BAND",
    "DIFFERENCE",
    "Criterion",
    "MakeMechanics",
    "Motion",
    "Prepared",
    "prepare",
    "student_weight",
]

Array = np.ndarray[Any, np.dtype[np.float64]]
MakeMechanics = Callable[[Mapping[str, float]], Mechanics]

BAND = 40.0
"""Hz up to which corrections count, where the sample rate allows it."""
LAG = 4.0
"""Corner of the low-pass behind which the observer damps, in bands."""
LONGEST = 1e-3
"""Longest step of the simulation, s."""
ORDER = 16
"""Order of the autoregression."""
FIRST = np.array([1.0, -0.9])
"""The whitening filter before the corrections are known."""
FREEDOM = 10.0
"""Degrees of freedom of Student's distribution that weighs outliers."""
DIFFERENCE = 5e-3
"""Of coordinates, for Jacobians: a contact that breaks away a sample later makes the residuals rough below it."""
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


# ---- one motion ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Prepared:
    """A motion with its observer and the filter of its corrections."""

    course: Course
    low_pass: Any
    stride: int
    edge: int

    def correction(self, mechanics: Mechanics, parameters: Any) -> Array:
        """Torque that the model lacks, N·m, in the band, shape (m,)."""
        signal: Any = importlib.import_module("scipy.signal")  # it carries no types

        raw = self.course.run(mechanics, parameters)[:, 3]
        if not np.all(np.isfinite(raw)):
            return self.nothing()
        return signal.sosfiltfilt(self.low_pass, raw)[self.edge : -self.edge : self.stride]

    def nothing(self) -> Array:
        """Not a number, as many as there are corrections."""
        return np.full(self.course.drive.time[self.edge : -self.edge : self.stride].shape, math.nan)


def prepare(motion: Motion, law: Law, inertia: float, band: float, speed: float = 1.0) -> Prepared:
    """Lay the observer out; `speed` is its natural frequency in bands."""
    signal: Any = importlib.import_module("scipy.signal")  # it carries no types

    checked(motion, band)
    dt = float(np.median(np.diff(motion.time)))
    omega = 2.0 * math.pi * speed * band
    velocity = np.diff(motion.position, prepend=motion.position[0]) / dt
    drive = Drive(
        motion.time, motion.torque, "held", start=(float(motion.position[0]), 0.0), position=motion.position,
        velocity=velocity, pull=(inertia * omega**2, 2.0 * inertia * omega), slack=0.5 * motion.count,
        forgets=-math.expm1(-LAG * omega * dt), max_step=min(dt, LONGEST),
    )  # fmt: skip
    low_pass = signal.butter(4, band, fs=1.0 / dt, output="sos")
    stride = max(1, int(1.0 / (3.0 * band * dt)))
    return Prepared(Course(law, drive), low_pass, stride, max(1, int(EDGE / dt)))


def checked(motion: Motion, band: float) -> None:
    """Refuse what the filters cannot work on."""
    steps = np.diff(motion.time)
    if motion.time.size < 200 or np.ptp(steps) > 1e-3 * float(np.median(steps)):
        raise InputError(
            f"{motion.time.size} samples between {steps.min():.3g} and {steps.max():.3g} s apart: this method needs at "
            "least 200 that are equally spaced; resample the record"
        )
    if 1.0 / float(np.median(steps)) < 3.0 * band:
        raise InputError(f"a band of {band:g} Hz needs a sample rate of {3.0 * band:g} Hz; give a lower band")


# ---- noise -----------------------------------------------------------------------------------------------------


def autoregression(e: Sequence[Array], order: int) -> Array:
    """Coefficients (1, a_1 ... a_p) of the filter that whitens the series: Yule and Walker's equations.

    What lies beyond 4 standard deviations (robust) counts as if it lay there.
    """
    linalg: Any = importlib.import_module("scipy.linalg")  # it carries no types

    border = 4.0 * robust_std(np.concatenate(list(e)))
    r = np.zeros(order + 1)
    for x in e:
        spectrum = np.abs(np.fft.rfft(np.clip(x, -border, border), 2 * x.size)) ** 2
        r += np.fft.irfft(spectrum)[: order + 1]
    r[0] = r[0] * (1.0 + 1e-8) or 1.0
    return np.concatenate([[1.0], -linalg.solve_toeplitz(r[:order], r[1:])])


def whitened(filter_: Array, e: Array) -> Array:
    """The series behind the filter, without the values that its start spoils."""
    signal: Any = importlib.import_module("scipy.signal")  # it carries no types

    return signal.lfilter(filter_, [1.0], e)[filter_.size - 1 :]


def robust_std(r: Array) -> float:
    """Standard deviation from the median of the sizes; not that of a series of which more than half is 0."""
    middle = 1.4826 * float(np.median(np.abs(r)))
    return middle if middle > 0.0 else max(float(np.std(r)), 1e-300)


def student_scale(r: Array, freedom: float) -> float:
    """Scale of Student's distribution that fits the residuals best (a few steps of expectation-maximisation)."""
    s = robust_std(r)
    for _ in range(8):
        s = math.sqrt(float(np.mean(student_weight(r / s, freedom) * r * r)))
    return s


def student_weight(x: Array, freedom: float) -> Array:
    """Weight of the square of each residual, in scales, in the likelihood's gradient."""
    return (freedom + 1.0) / (freedom + x * x)


@dataclass(frozen=True, eq=False)
class Criterion:
    """What is minimised: the records' corrections behind a whitening filter, outliers weighed.

    Attributes
    ----------
    records : sequence of Prepared
    whitening : array
        Coefficients of the filter.
    scale : float
        Of Student's distribution, N·m; infinite for plain squares.
    freedom : float
        Its degrees of freedom.
    """

    records: Sequence[Prepared]
    law: Law
    vector: Vector
    mechanics: MakeMechanics
    whitening: Array
    scale: float = math.inf
    freedom: float = FREEDOM

    @staticmethod
    def first(
        motions: Sequence[Motion], law: Law, vector: Vector, mechanics: MakeMechanics, inertia: float, band: float
    ) -> Criterion:  # fmt: skip
        """Plain squares behind the first filter: for the search."""
        records = [prepare(m, law, inertia, band) for m in motions]
        return Criterion(records, law, vector, mechanics, FIRST)

    def corrections(self, u: Array) -> list[Array]:
        """Torque that the model lacks on every record; not a number where the law refuses the parameters."""
        parameters = feasible(self.law, self.vector.law_parameters(u))
        if parameters is None:
            return [r.nothing() for r in self.records]
        axis = self.mechanics(self.vector.named(u))
        return [r.correction(axis, parameters) for r in self.records]

    def white(self, u: Array) -> Array:
        """The corrections behind the filter, shape (n,)."""
        return np.concatenate([whitened(self.whitening, e) for e in self.corrections(u)])

    def residuals(self, u: Array) -> Array:
        """Numbers whose squares add up to the criterion: twice the negative logarithm of the likelihood."""
        r = self.white(u)
        if math.isinf(self.scale):
            return r
        n = self.freedom
        return np.copysign(np.sqrt((n + 1.0) * np.log1p((r / self.scale) ** 2 / n)), r)

    def descend(self, u: Array, iterations: int, tolerance: float) -> Optimum:
        """The minimum reached from u."""
        return descend(
            self.residuals, u, self.vector.lower, self.vector.upper, iterations=iterations, tolerance=tolerance,
            difference=DIFFERENCE,
        )  # fmt: skip

    def adapted(self, u: Array) -> Criterion:
        """The same with filter and scale that the corrections at u suggest."""
        new = replace(self, whitening=autoregression(self.corrections(u), ORDER))
        return replace(new, scale=student_scale(new.white(u), self.freedom))

    def weighed(self, u: Array) -> Array:
        """The corrections behind the filter in scales, times the square root of their weight, shape (n,)."""
        x = self.white(u) / self.scale
        return np.sqrt(student_weight(x, self.freedom)) * x
