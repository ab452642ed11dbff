"""Honest intervals for an axis: what an observer must correct, whitened, and what the method itself gets wrong.

The simulated axis is pulled towards the measured position by a spring and damper (an observer); the pull is the
torque that the model lacks. Its spectrum is that of the disturbance, of the torque's noise and of the encoder, so
that an autoregression of it gives the weights (prediction-error method: Ljung 1999, chapters 7 and 9). It needs no
knowledge of the controller.

The filter that makes a velocity of counted positions rounds the corners where a contact breaks away, which draws
static and Coulomb torque down in proportion to its length. Two lengths, one twice the other, tell how much, and the
estimate is extrapolated to none (Richardson). The intervals come from the same estimate on records whose truth is
known: the fitted axis itself, moved as measured, with the encoder's counts and with the corrections again as noise,
their signs drawn anew (dependent wild bootstrap: Shao 2010; Efron and Tibshirani 1993, chapter 6).
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
from stickslip.identify.estimate import Estimate
from stickslip.identify.noise import Noise
from stickslip.identify.optimum import descend
from stickslip.identify.uncertainty import interval_of, verdict_on
from stickslip.identify.vector import Vector
from stickslip.simulation.driven import Course, Drive, Mechanics
from stickslip.spec import Law

__all__ = ["Motion", "PredictionError", "explored", "prediction_error"]

Array = np.ndarray[Any, np.dtype[np.float64]]
MakeMechanics = Callable[[Mapping[str, float]], Mechanics]

BAND = 40.0
"""Hz up to which corrections count, where the sample rate allows it."""
SMOOTHING = (5.0, 2.5)
"""Corners of the filters on position and torque, in bands: the sharper one, and that which tells its error."""
STEPS = 5.0
"""Simulated steps per period of that corner."""
ORDER = 16
"""Order of the autoregression."""
FIRST = np.array([1.0, -0.9])
"""The whitening filter before the corrections are known."""
MEMORY = 0.15
"""s over which the bootstrap's signs stay alike."""
REACH = 3.0
"""Coordinates (factors of e) by which what the data leave open may lie elsewhere."""
EDGE = 0.15
"""s at both ends that filters spoil."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A record of equally spaced samples.

    Attributes
    ----------
    time, position, torque : array, shape (n,)
        s, rad, N·m (m, N); a signal that the axis's ``drive_gain`` turns into torque will do.
    count : float
        Resolution of the position, rad (m); 0 for none.
    delay : float
        s from a sample's time to the middle of the torque's action: half a sample for a command that is held.
    """

    time: Array
    position: Array
    torque: Array
    count: float = 0.0
    delay: float = 0.0


@dataclass(frozen=True, eq=False)
class PredictionError:
    """What the method found.

    Attributes
    ----------
    u : array, shape (p,)
        Coordinates of the estimate, the method's own error taken off.
    spread : array, shape (p, p)
        Covariance of the coordinates.
    bias : array, shape (p,)
        The filter's error, taken off.
    remaining : array, shape (p,)
        Mean error of the imitated estimates.
    estimates : tuple of Estimate
    corrections : tuple of array
        Per motion the torque that the model lacks, N·m, in the band.
    """

    vector: Vector
    u: Array
    spread: Array
    bias: Array
    remaining: Array
    estimates: tuple[Estimate, ...]
    corrections: tuple[Array, ...]


# ---- one motion ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Prepared:
    """A motion behind the filter, its observer and the filter of its corrections."""

    motion: Motion
    course: Course
    drive: Drive
    position: Array
    velocity: Array
    low_pass: Any
    stride: int
    edge: int

    def correction(self, mechanics: Mechanics, parameters: Any) -> Array:
        """Torque that the model lacks, N·m, in the band, shape (m,)."""
        signal: Any = importlib.import_module("scipy.signal")  # it carries no types

        raw = self.course.run(mechanics, parameters)[:, 3]
        if not np.all(np.isfinite(raw)):
            return np.full(raw[self.edge : -self.edge : self.stride].shape, math.nan)
        return signal.sosfiltfilt(self.low_pass, raw)[self.edge : -self.edge : self.stride]


def prepare(motion: Motion, law: Law, inertia: float, band: float, smoothing: float) -> Prepared:
    """Filter position and torque alike, and lay the observer out."""
    signal: Any = importlib.import_module("scipy.signal")  # it carries no types

    dt = float(np.median(np.diff(motion.time)))
    rate = 1.0 / dt
    corner = min(smoothing * band, 0.08 * smoothing * rate)
    smooth = signal.butter(4, corner, fs=rate, output="sos")
    q: Array = signal.sosfiltfilt(smooth, motion.position)
    torque: Array = signal.sosfiltfilt(smooth, motion.torque)
    v = np.gradient(q, dt)
    skip = max(1, int(rate / (STEPS * SMOOTHING[0] / smoothing * corner)))
    t = motion.time[::skip]
    torque = np.asarray(np.interp(t - motion.delay, motion.time, torque), dtype=np.float64)
    omega = 2.0 * math.pi * band
    q, v, step = q[::skip], v[::skip], skip * dt
    drive = Drive(
        t, torque, "linear", start=(float(q[0]), float(v[0])), position=q, velocity=v,
        pull=(inertia * omega**2, 2.0 * inertia * omega), max_step=step,
    )  # fmt: skip
    low_pass = signal.butter(4, band, fs=1.0 / step, output="sos")
    stride = max(1, int(1.0 / (3.0 * band * step)))
    return Prepared(motion, Course(law, drive), drive, q, v, low_pass, stride, max(1, int(EDGE / step)))


def imitation(
    prepared: Prepared, law: Law, mechanics: Mechanics, parameters: Any, noise: Array
) -> tuple[Motion, Array]:
    """A record of the model itself that moves as the measured one, and the noise-free torque it needs.

    The observer's pull is part of the torque that moves it: the motion is exactly the model's.
    """
    m = prepared.motion
    pulled = Drive(
        m.time, m.torque, "held", position=np.interp(m.time, prepared.drive.time, prepared.position),
        velocity=np.interp(m.time, prepared.drive.time, prepared.velocity), pull=prepared.drive.pull,
        start=prepared.drive.start, max_step=float(m.time[1] - m.time[0]),
    )  # fmt: skip
    out = Course(law, pulled).run(mechanics, parameters)
    position = m.count * np.floor(out[:, 0] / m.count + 0.5) if m.count > 0.0 else out[:, 0]
    needed = m.torque + out[:, 3] / mechanics.drive_gain
    return replace(
        m,
        position=position,
        torque=needed + noise / mechanics.drive_gain,
        delay=0.5 * (m.time[1] - m.time[0]),
    ), out[:, 3]


# ---- noise -----------------------------------------------------------------------------------------------------


def autoregression(e: Sequence[Array], order: int) -> Array:
    """Coefficients (1, a_1 ... a_p) of the filter that whitens the series: Yule and Walker's equations."""
    linalg: Any = importlib.import_module("scipy.linalg")  # it carries no types

    r = np.zeros(order + 1)
    for x in e:
        spectrum = np.abs(np.fft.rfft(x, 2 * x.size)) ** 2
        r += np.fft.irfft(spectrum)[: order + 1]
    r[0] *= 1.0 + 1e-8
    return np.concatenate([[1.0], -linalg.solve_toeplitz(r[:order], r[1:])])


def whitened(filter_: Array, e: Array) -> Array:
    """The series behind the filter, without the values that its start spoils."""
    signal: Any = importlib.import_module("scipy.signal")  # it carries no types

    return signal.lfilter(filter_, [1.0], e)[filter_.size - 1 :]


def random_signs(rng: np.random.Generator, n: int, memory: float) -> Array:
    """A smooth Gaussian series of unit variance that forgets within `memory` samples, shape (n,)."""
    ndimage: Any = importlib.import_module("scipy.ndimage")  # it carries no types

    x: Array = ndimage.gaussian_filter1d(rng.standard_normal(n), memory / 2.0, mode="wrap")
    return x / math.sqrt(float(np.mean(x * x)))


# ---- the method ------------------------------------------------------------------------------------------------


def prediction_error(
    motions: Sequence[Motion],
    law: Law,
    vector: Vector,
    mechanics: MakeMechanics,
    *,
    inertia: float,
    start: Array | None = None,
    signed_scale: float | Mapping[str, float] = math.nan,
    band: float = BAND,
    draws: int = 12,
    rounds: int = 3,
    seed: int = 0,
) -> PredictionError:
    """Estimate mechanics and law from torque and motion, with intervals that hold for coloured noise.

    Parameters
    ----------
    motions : sequence of Motion
    law : Law
    vector : Vector
        Free and frozen parameters; the search starts at its values.
    mechanics : callable
        Makes the axis of all parameters by name.
    inertia : float
        About that of the axis, kg·m²: it sets the observer's stiffness.
    start : array, shape (p,), optional
        Coordinates at which the search starts.
    signed_scale : float or mapping
        As in `stickslip.identify.uncertainty.fit`.
    band : float
        Hz up to which corrections count.
    draws : int
        Imitated records for error and spread.
    rounds : int
        Times that weights and parameters are found in turn.
    seed : int
        Of the imitated noise.

    Returns
    -------
    PredictionError

    Raises
    ------
    InputError
        If a motion is too short for the band, or the model gives no finite values at the start.
    """
    prepared, blurred = (
        [prepare(checked(m, band), law, inertia, band, smoothing) for m in motions] for smoothing in SMOOTHING
    )

    def corrections(u: Array, records: Sequence[Prepared]) -> list[Array]:
        return corrected(records, law, vector, mechanics, u)

    u, weights = vector.start if start is None else start, FIRST
    optimum = None
    for turn in range(rounds):

        def residuals(x: Array, weights: Array = weights) -> Array:
            return np.concatenate([whitened(weights, e) for e in corrections(x, prepared)])

        last = turn == rounds - 1
        optimum = descend(
            residuals, u, vector.lower, vector.upper, iterations=25, tolerance=1e-6 if last else 1e-3
        )
        u = optimum.u
        if not last:
            weights = autoregression(corrections(u, prepared), ORDER)
    assert optimum is not None
    # A coordinate that the data leave open is held within REACH of where it is, so that no step runs away with it.
    variance = optimum.cost / max(optimum.residuals.size - u.size, 1)
    ridge = variance / REACH**2
    inverse = np.linalg.inv(optimum.jacobian.T @ optimum.jacobian + ridge * np.eye(u.size))
    newton = -inverse @ optimum.jacobian.T

    def step(records: Sequence[Prepared]) -> Array:
        """How far these records would move the estimate: one step of Gauss and Newton."""
        return newton @ np.concatenate([whitened(weights, e) for e in corrections(u, records)])

    rng = np.random.default_rng(seed)
    parameters, axis = feasible(law, vector.law_parameters(u)), mechanics(vector.named(u))
    lacking = [imitation(r, law, axis, parameters, np.zeros(r.motion.time.size))[1] for r in prepared]
    errors: list[Array] = []
    for _ in range(draws):
        copies: list[Motion] = []
        for r, missing in zip(prepared, lacking, strict=True):
            dt = float(r.motion.time[1] - r.motion.time[0])
            noise = missing * random_signs(rng, missing.size, MEMORY / dt)
            copies.append(imitation(r, law, axis, parameters, noise)[0])
        sharp, blunt = (step([prepare(m, law, inertia, band, s) for m in copies]) for s in SMOOTHING)
        errors.append(2.0 * sharp - blunt)
    found = np.array(errors)
    bias = step(blurred) - step(prepared)
    own = found.mean(axis=0)
    spread = np.cov(found, rowvar=False).reshape(u.size, u.size) * (1.0 + 1.0 / draws)
    spread = spread + ridge * variance * inverse @ inverse
    # What is taken off is itself uncertain: half of the filter's error; of the imitations' all, for these follow
    # the filtered motion and show only part of it, and half of it is taken off.
    spread = spread + 0.25 * np.outer(bias, bias) + np.outer(own, own)
    better = np.clip(u - bias - 0.5 * own, vector.lower, vector.upper)
    estimates = estimates_of(vector, better, spread, draws, signed_scale)
    return PredictionError(vector, better, spread, bias, own, estimates, tuple(corrections(u, prepared)))


def corrected(
    records: Sequence[Prepared], law: Law, vector: Vector, mechanics: MakeMechanics, u: Array
) -> list[Array]:
    """Torque that the model lacks on every record; not a number where the law refuses the parameters."""
    parameters = feasible(law, vector.law_parameters(u))
    if parameters is None:
        return [np.full(r.drive.time[r.edge : -r.edge : r.stride].shape, math.nan) for r in records]
    return [r.correction(mechanics(vector.named(u)), parameters) for r in records]


def explored(
    motions: Sequence[Motion], law: Law, vector: Vector, mechanics: MakeMechanics, *, inertia: float, band: float,
    iterations: int,
) -> tuple[Array, float]:  # fmt: skip
    """Coordinates and sum of squares after a few steps from the vector's start: for choosing among starts."""
    records = [prepare(checked(m, band), law, inertia, band, SMOOTHING[0]) for m in motions]

    def residuals(u: Array) -> Array:
        return np.concatenate([whitened(FIRST, e) for e in corrected(records, law, vector, mechanics, u)])

    if iterations == 0:
        r = residuals(vector.start)
        return vector.start, float(r @ r)
    found = descend(
        residuals, vector.start, vector.lower, vector.upper, iterations=iterations, tolerance=1e-3
    )
    return found.u, found.cost


def checked(motion: Motion, band: float) -> Motion:
    """Refuse what the filters cannot work on."""
    steps = np.diff(motion.time)
    if motion.time.size < 200 or np.ptp(steps) > 1e-3 * float(np.median(steps)):
        raise InputError(
            f"{motion.time.size} samples between {steps.min():.3g} and {steps.max():.3g} s apart: this method needs at "
            "least 200 that are equally spaced; resample the record"
        )
    if 1.0 / float(np.median(steps)) < 3.0 * band:
        raise InputError(f"a band of {band:g} Hz needs a sample rate of {3.0 * band:g} Hz; give a lower band")
    return motion


def estimates_of(
    vector: Vector, u: Array, spread: Array, draws: int, signed_scale: float | Mapping[str, float]
) -> tuple[Estimate, ...]:
    """Estimates with 95 % intervals from Student's quantile, in coordinates, and verdicts."""
    from scipy import special

    width = float(special.stdtrit(max(draws - 1, 1), 0.975))
    values = vector.values(u)
    noise = Noise(1.0, "residual", float(draws - 1))
    change = vector.jacobian(u)
    out: list[Estimate] = []
    for k, p in enumerate(vector.free):
        used = change[k] != 0.0
        variance = float(change[k, used] @ spread[np.ix_(used, used)] @ change[k, used])
        std = math.sqrt(variance) if variance >= 0.0 else math.inf
        low, high = interval_of(p, float(values[k]), width * std, None)
        scale = signed_scale.get(p.name, math.nan) if isinstance(signed_scale, Mapping) else signed_scale
        why = verdict_on(p, float(values[k]), low, high, noise, scale)
        out.append(Estimate(p.name, p.par.unit, p.par.symbol, float(values[k]), std, low, high, not why, why))
    return tuple(out)
