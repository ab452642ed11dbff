"""Inverse dynamics: inertia, gravity and friction of an axis by linear least squares (IDIM-LS).

T = M dv/dt + Fv v + Fc sign(v) + offset (+ m g l sin(q - q0), + a Fourier series in the position), where velocity and
acceleration come from the position by a zero-phase Butterworth low-pass and central differences, and both sides pass
the same decimation filter: Gautier (1997), Janot, Gautier and Brunot (2019). With separate friction for each direction,
Fv+, Fc+, Fv-, Fc- replace Fv, Fc and the offset.

An irregular record is first resampled on a regular grid.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_frozen, name_option
from stickslip.identification.experiment import Experiment, evenly_spaced, insist_on_motion
from stickslip.identification.fit.filters import decimated, low_pass, spectrum
from stickslip.identification.fit.profile import inverse_information, long_run
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

HIGHEST_CUTOFF = 100.0  # Hz, of the position's low-pass, as published for EMPS
CUTOFF_PER_RATE = 0.1
BAND_PER_CUTOFF = 0.4  # part of the cutoff that is kept after decimation
HIGHEST_PER_RATE = 0.25  # corner of a short record's low-pass, part of the sample rate
MOST_ENDS = 1.0 / 3.0  # greatest part of a record that the filters may use at both ends together
TAPER = 10.0  # periods of the cutoff left out at both ends, where the filters have not settled
NOISE_SHARE = 0.01  # largest share of noise in the acceleration's power
SPARSE = 100.0  # greatest ratio of rows on a regular grid to samples
DEAD_ZONE = 3.0  # standard deviations of the velocity's noise, below which its sign is meaningless
OTHERS = 7  # approximate number of parameters besides those of harmonics
SECONDS = 6e-6  # s per sample and squared number of parameters of a fit by simulation
MOST_HOURS = 24.0
MOST_BYTES = 8e9  # most memory of the equations


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """Result of the inverse dynamics.

    Attributes
    ----------
    names, units : tuple of str
        ``inertia``, ``fv``, ``fc``, ``offset``; per direction ``fv_plus``, ``fc_plus``, ``fv_minus``, ``fc_minus``;
        with a pendulum ``gravity_sin``, ``gravity_cos``; with harmonics ``cos[i]``, ``sin[i]``.
    values : array, shape (p,)
    std : array, shape (p,)
        Classic standard deviations, for independent residuals: what IDIM-LS publishes.
    robust_std : array, shape (p,)
        With the correlation of the residuals (Newey and West 1987).
    covariance : array, shape (p, p)
        The robust covariance.
    relative_error : float
        Norm of the residual torque over the norm of the torque.
    cutoff, band : float
        Cutoff of the low-pass and band after decimation, Hz.
    matrix, torque, residual, time, velocity, position : array
        The decimated system, with its times, velocities and positions.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    std: Array
    robust_std: Array
    covariance: Array
    relative_error: float
    cutoff: float
    band: float
    matrix: Array
    torque: Array
    residual: Array
    time: Array
    velocity: Array
    position: Array

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def numbers(self) -> dict[str, float]:
        """Return inertia, slope, level, offset and a pendulum's gravity by their names in gross sliding."""
        gravity = {n: self[n] for n in ("gravity_sin", "gravity_cos") if self.has(n)}
        own = {"inertia": self["inertia"], "sigma2": self.viscous, "fc": self.coulomb, "offset": self.offset}
        return own | gravity

    def has(self, name: str) -> bool:
        """Return whether that parameter was estimated."""
        return name in self.names

    @property
    def coulomb(self) -> float:
        """Fc, or the mean of both directions."""
        return self["fc"] if self.has("fc") else 0.5 * (self["fc_plus"] + self["fc_minus"])

    @property
    def viscous(self) -> float:
        """Fv, or the mean of both directions."""
        return self["fv"] if self.has("fv") else 0.5 * (self["fv_plus"] + self["fv_minus"])

    @property
    def usual_speed(self) -> float:
        """Root mean square of the velocity, rad/s (m/s)."""
        return float(np.sqrt(np.mean(self.velocity**2)))

    @property
    def offset(self) -> float:
        """The constant torque against positive motion."""
        return self["offset"] if self.has("offset") else 0.5 * (self["fc_plus"] - self["fc_minus"])


def inverse_dynamics(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    *,
    per_direction: bool = False,
    cutoff: float | None = None,
    harmonics: int = 0,
    harmonic_period: float = 2.0 * math.pi,
    held: Mapping[str, float] | None = None,
) -> InverseDynamics:
    """Identify an axis by linear least squares on its inverse dynamics.

    Parameters
    ----------
    experiments : sequence of Experiment
    axis : ServoAxis
    per_direction : bool
        Whether friction has separate parameters for each direction of motion.
    cutoff : float, optional
        Corner of the position's low-pass, Hz. If None, the lowest of 100 Hz, a tenth of the sample rate, and the corner
        at which noise would be 1 % of the acceleration's power.
    harmonics : int
        Number of harmonics of a torque that depends on the position.
    harmonic_period : float
        Period of the harmonics, rad (m).
    held : mapping of str to float, optional
        Values of parameters, by name, that are known and not fitted; their variance is 0.

    Returns
    -------
    InverseDynamics

    Raises
    ------
    InputError
        If the records move too little to distinguish the parameters.
    """
    insist_on_motion(experiments)
    refuse_harmonics(experiments, harmonics)
    if cutoff is not None and not cutoff > 0.0:
        raise InputError(f"cutoff = {cutoff:g} Hz must be greater than 0")
    corner = min(max(suitable_cutoff(t), least_cutoff(t)) for t in experiments) if cutoff is None else cutoff
    columns = [_columns(t, axis, corner, per_direction, harmonics, harmonic_period) for t in experiments]
    names, units = _names(axis, per_direction, harmonics)
    w = np.concatenate([c.matrix for c in columns])
    y = np.concatenate([c.torque for c in columns])
    known = {n: x for n, x in (held or {}).items() if n in names}
    fitted = [i for i, n in enumerate(names) if n not in known]
    if y.size < 3 * len(fitted):
        raise InputError(
            f"{sum(t.time.size for t in experiments)} samples hold {y.size} independent ones in motion (the filters "
            f"take {TAPER / corner:.2g} s at both ends of a record), too few for {len(fitted)} parameters; give a "
            "longer record with more motion, or one with rows more often"
        )
    free = w[:, fitted]
    size = np.linalg.norm(free, axis=0)
    rank = np.linalg.matrix_rank(free / np.where(size > 0.0, size, 1.0), tol=1e-8)
    if rank < len(fitted):
        tied = _undetermined([names[i] for i in fitted], free, size)
        raise InputError(
            f"inverse dynamics: {tied} in this motion; record both directions and several speeds{_level(tied)}"
        )
    values: Array = np.array([known.get(n, 0.0) for n in names], dtype=np.float64)
    values[fitted] = np.linalg.lstsq(free, y - w @ values, rcond=None)[0]
    residual = y - w @ values
    inverse, robust = np.zeros((len(names), len(names))), np.zeros((len(names), len(names)))
    block = np.ix_(fitted, fitted)
    own, _ = inverse_information(free)
    variance = float(residual @ residual) / (y.size - len(fitted))
    lags = correlation_lags(residual)
    inverse[block] = own
    robust[block] = own @ long_run(free * residual[:, None], lags) @ own
    return InverseDynamics(
        names, units, values, np.sqrt(variance * np.diag(inverse)), np.sqrt(np.diag(robust)), robust,
        float(np.linalg.norm(residual) / np.linalg.norm(y)), corner, BAND_PER_CUTOFF * corner, w, y, residual,
        np.concatenate([c.time for c in columns]), np.concatenate([c.velocity for c in columns]),
        np.concatenate([c.position for c in columns]),
    )  # fmt: skip


def _undetermined(names: Sequence[str], w: Array, size: Array) -> str:
    """Return as text what the rank-deficient rows `w` do not determine; `size` are the norms of the columns."""
    still = [n for n, s in zip(names, size, strict=True) if s == 0.0]
    if still:
        return f"nothing excites {', '.join(still)}"
    without = np.abs(np.linalg.svd(w / size, full_matrices=False)[2][-1])
    tied = [n for n, part in zip(names, without, strict=True) if part > 0.1 * without.max()]
    return f"the effects of {', '.join(tied[:-1])} and {tied[-1]} cannot be distinguished"


def _level(tied: str) -> str:
    """Return the other way to separate friction from a constant torque, to end an error on both; else an empty text."""
    return (
        f", or give {name_frozen('offset', 0)} if no constant torque acts (a level axis)"
        if "offset" in tied
        else ""
    )


def refuse_harmonics(experiments: Sequence[Experiment], harmonics: int, *, simulated: bool = False) -> None:
    """Refuse more harmonics than the samples can distinguish, before a column is made for each.

    Parameters
    ----------
    experiments : sequence of Experiment
    harmonics : int
        Each has two parameters.
    simulated : bool
        Whether simulations are fitted: their time is proportional to the square of the number of parameters.

    Raises
    ------
    InputError
        With the number of parameters, the memory or the time, and the greatest possible number of harmonics.
    """
    samples, count = sum(t.time.size for t in experiments), OTHERS + 2 * harmonics
    if harmonics and samples < 3 * count:
        raise InputError(
            f"{harmonics} harmonics make {count} parameters, too many for {samples} samples, which resolve at most "
            f"{max(0, (samples // 3 - OTHERS) // 2)}; give fewer"
        )
    size = 16.0 * samples * count
    if harmonics and size > MOST_BYTES:
        raise InputError(
            f"{harmonics} harmonics over {samples} samples would take {size / 1e9:.3g} GB; give at most "
            f"{max(0, math.floor(0.5 * (MOST_BYTES / 16.0 / samples - OTHERS)))}"
        )
    hours = SECONDS * samples * count**2 / 3600.0
    if harmonics and simulated and hours > MOST_HOURS:
        most = (math.sqrt(3600.0 * MOST_HOURS / SECONDS / samples) - OTHERS) / 2.0
        raise InputError(
            f"{harmonics} harmonics over {samples} samples would take about {hours:.2g} h; give at most "
            f"{max(0, math.floor(most))} (a day), or {name_option('inverse', True)}, which simulates nothing"
        )


def correlation_lags(residual: Array) -> int:
    """Return the samples over which a residual is correlated: four times its integral time, at most a fifth of it."""
    n = residual.size
    r = residual - residual.mean()
    spectrum = np.fft.rfft(r, 2 * n)
    correlation = np.fft.irfft(spectrum * np.conj(spectrum))[:n]
    if correlation[0] <= 0.0:
        return 0
    correlation /= correlation[0]
    past = np.flatnonzero(correlation < 0.05)
    reach = int(past[0]) if past.size else n
    time = 0.5 + float(np.sum(np.abs(correlation[1:reach])))
    return int(min(max(1, math.ceil(4.0 * time)), n // 5))


# ---- from a record to the linear system --------------------------------------------------------------------------


def uniform(experiment: Experiment) -> tuple[Array, Array, Array, float]:
    """Return times, positions and drive signal on a regular grid, and its rate in Hz; unchanged if already regular."""
    period = experiment.period
    signal = experiment.signal()
    if evenly_spaced(experiment.time):
        return experiment.time, experiment.position, signal, 1.0 / period
    rows = float(experiment.time[-1] - experiment.time[0]) / period
    if not rows <= SPARSE * experiment.time.size:
        raise InputError(
            f"{experiment.name}: {experiment.time.size} samples mostly {period:.3g} s apart lie over "
            f"{rows * period:.3g} s; cut the record where it has gaps ({name_option('start')}, {name_option('end')})"
        )
    t = np.arange(experiment.time[0], experiment.time[-1], period)
    return (
        t,
        np.interp(t, experiment.time, experiment.position),
        np.interp(t, experiment.time, signal),
        1.0 / period,
    )


def white_noise(q: Array, rate: float) -> float:
    """Return the spectral density of the position's white noise, rad²/Hz: median of the upper 40 % of its spectrum."""
    length = int(min(q.size - 2, 1024))
    f, power = spectrum(np.diff(q, 2), rate, length)
    high = (f > 0.3 * rate) & (f < 0.49 * rate)
    # A second difference multiplies the spectrum of white noise by (2 - 2 cos)².
    return float(np.median(power[high] / (2.0 - 2.0 * np.cos(2.0 * math.pi * f[high] / rate)) ** 2))


def least_cutoff(experiment: Experiment) -> float:
    """Return the corner below which the filters use more than `MOST_ENDS` of a record, limited by its rate, Hz."""
    seconds = float(experiment.time[-1] - experiment.time[0])
    return min(2.0 * TAPER / (MOST_ENDS * seconds), HIGHEST_PER_RATE / experiment.period)


def suitable_cutoff(experiment: Experiment) -> float:
    """Return the corner at which noise makes up `NOISE_SHARE` of the acceleration's power, within limits, Hz."""
    _, q, _, rate = uniform(experiment)
    highest = min(HIGHEST_CUTOFF, CUTOFF_PER_RATE * rate)
    density = white_noise(q, rate)
    corner = highest
    for _ in range(40):
        filtered = low_pass(q, corner, rate)
        power = float(np.var(np.gradient(np.gradient(filtered, 1.0 / rate), 1.0 / rate)))
        # The filters pass about the band below the corner of the noise.
        noise = density * (2.0 * math.pi) ** 4 * corner**5 / 5.0
        if noise <= NOISE_SHARE * power:
            break
        corner *= 0.9
    return corner


@dataclass(frozen=True, eq=False)
class Columns:
    """The decimated linear system of one experiment."""

    matrix: Array
    torque: Array
    time: Array
    velocity: Array
    position: Array


def _columns(
    experiment: Experiment, axis: ServoAxis, cutoff: float, per_direction: bool, harmonics: int, period: float
) -> Columns:
    t, q, u, rate = uniform(experiment)
    dt = 1.0 / rate
    if q.size < 12 * math.ceil(rate / cutoff):
        raise InputError(
            f"{experiment.name}: {q.size} samples, {q.size * dt:.3g} s, are too few for a low-pass at {cutoff:.3g} Hz, "
            f"which takes {12 * math.ceil(rate / cutoff)}; give a longer record"
        )
    density = white_noise(q, rate)
    q = low_pass(q, cutoff, rate)
    v = np.gradient(q, dt)
    acceleration = np.gradient(v, dt)
    gain, loss = axis.drive_gains(experiment.quantity)
    supply = 1.0 if experiment.supply is None else np.interp(t, experiment.time, experiment.supply)
    torque = gain * supply * u - loss * v
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.isfinite(torque @ torque):
            raise InputError(
                f"{experiment.name}: the drive's signal times {gain:.3g} (drive gain, torque constant) is too large to "
                "be computed with; correct that number or the unit of the signal"
            )
    ahead, back = (v > 0.0).astype(float), (v < 0.0).astype(float)
    columns = [acceleration]
    if per_direction:
        columns += [v * ahead, ahead, v * back, -back]
    else:
        columns += [v, ahead - back, np.ones(v.size)]
    if axis.gravity == "pendulum":
        columns += [np.sin(q), np.cos(q)]
    for i in range(1, harmonics + 1):
        angle = 2.0 * math.pi * i * q / period
        columns += [np.cos(angle), np.sin(angle)]
    factor = max(1, int(rate * 0.8 / (2.0 * BAND_PER_CUTOFF * cutoff)))
    edge = math.ceil(TAPER / cutoff * rate)
    floor = DEAD_ZONE * math.sqrt(density * (2.0 * math.pi) ** 2 * cutoff**3 / 3.0)
    sure = np.abs(v) >= floor
    rows = np.asarray(np.interp(t, experiment.time, experiment.rows.astype(float)) > 0.5, dtype=np.bool_)
    rows[:edge] = rows[v.size - edge :] = False
    keep = np.arange(0, v.size, factor)
    chosen = (rows & sure)[keep]
    matrix = np.column_stack([decimated(c, factor) for c in columns])[chosen]
    return Columns(
        matrix, decimated(torque, factor)[chosen], t[keep][chosen], v[keep][chosen], q[keep][chosen]
    )


def _names(axis: ServoAxis, per_direction: bool, harmonics: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    torque, damping = axis.unit("N·m"), axis.unit("N·m·s/rad")
    named = [("inertia", axis.unit("kg·m²"))]
    if per_direction:
        named += [("fv_plus", damping), ("fc_plus", torque), ("fv_minus", damping), ("fc_minus", torque)]
    else:
        named += [("fv", damping), ("fc", torque), ("offset", torque)]
    if axis.gravity == "pendulum":
        named += [("gravity_sin", torque), ("gravity_cos", torque)]
    for i in range(harmonics):
        named += [(f"cos[{i}]", torque), (f"sin[{i}]", torque)]
    return tuple(n for n, _ in named), tuple(u for _, u in named)
