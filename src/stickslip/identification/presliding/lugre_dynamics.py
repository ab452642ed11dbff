"""LuGre's sigma0 and sigma1 from an open-loop stick-slip response to a known torque.

Thesis 3.1.3.2.3.1 and 4.3.1.1.4 fit the simulated position to the measured one. If the law is not exactly the friction
of the axis, gross sliding dominates that misfit by orders of magnitude, and its minimum contains no information about
the stiffness: for the thesis's own record (0.35 N·m at 1 Hz) it decreases with sigma0 without limit. The parts of the
record in which the axis sticks near zero load are therefore compared separately, each relative to its first sample:
there the displacement is the bristles' alone. Their slope, extrapolated to zero load, is the small-signal stiffness,
which requires no law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.fit.broyden import descend_by_secants
from stickslip.identification.fit.levenberg_marquardt import Residuals, Squares
from stickslip.identification.fit.noise import Noise, as_noise
from stickslip.identification.fit.parallel import mapped
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.fit.uncertainty import Fit, fit
from stickslip.identification.presliding.hysteresis import correlation_lags
from stickslip.identification.presliding.known_curve import describe_unused, static_levels, transfer_curve
from stickslip.identification.presliding.lugre_scan import (
    plain_scan,
    plain_verdict,
    response_picture,
    scan_picture,
)
from stickslip.models.friction_levels import levels_of
from stickslip.models.model import Model
from stickslip.simulation.recorded_input.simulation import Course, Drive, Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

NEAR = 0.15
"""Greatest load near zero, part of the static torque: there LuGre and other laws have the same slope."""
STEP = 2e-4
"""Longest step of the simulation, s; its error is extrapolated to zero from this step and half of it."""
ROUGH = 1e-3
"""Longest step while the search is far from its minimum, s."""
ENOUGH = 0.1
"""Decrease of the sum of squares at which the search stops, in squared standard deviations of a sample."""
BUSY = (0.1, 10.0)
"""Speeds, relative to the Stribeck velocity, between which friction falls and rises and nearly all integration error
arises."""
GRADES = ((0.02, STEP), (0.002, 5e-5))
"""Times before and after these speeds, s, and the longest step within them, s; ringing after a stop has decayed by
then."""
COARSER = 4.0
"""Factor on these steps if only the displacements of sticking parts count, for which they are accurate enough."""
DIFFERENCE = 1e-3
"""Step of the coordinates for Jacobians: the place of a reversal between two steps limits the precision to 7 digits."""


@dataclass(frozen=True, eq=False)
class Response:
    """An open-loop response.

    Attributes
    ----------
    time, torque, position : array, shape (n,)
        s, strictly increasing; motor torque in N·m, smooth from sample to sample; rad.
    """

    time: Array
    torque: Array
    position: Array

    def __post_init__(self) -> None:
        if self.time.size < 20 or np.any(np.diff(self.time) <= 0.0):
            raise InputError("an open-loop response needs at least 20 samples with strictly ascending times")
        if not (self.torque.shape == self.position.shape == self.time.shape):
            raise InputError("time, torque and position of a response must be equally long")

    @classmethod
    def of(cls, record: Record, torque: str = "motor_torque") -> Response:
        """Build the response from the channels of a record; of samples at the same time the first is kept."""
        kept = np.concatenate([[True], np.diff(record.time) > 1e-9])
        return cls(record.time[kept], record[torque][kept], record["position"][kept])


def sticking_pieces(response: Response, fs: float) -> list[Rows]:
    """Return runs of samples in which the load is near zero and the axis sticks, at least 4 samples each.

    The axis sticks if its position changes less than that of a spring a hundred times softer than the softest in the
    record's quiet parts.
    """
    quiet = np.abs(response.torque) <= NEAR * fs
    rate = np.abs(np.gradient(response.position, response.time))
    if not np.any(quiet):
        return []
    slow = rate <= 100.0 * float(np.quantile(rate[quiet], 0.25)) + 1e-12
    rows = np.flatnonzero(quiet & slow)
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [r for r in runs if r.size >= 4]


def small_signal_stiffness(response: Response, fs: float, noise: Noise | None = None) -> Estimate:
    """Estimate the slope of the load over the displacement at zero load from the sticking parts, N·m/rad.

    Every part has its own mean; the compliance is a constant plus a term linear in the load's magnitude, which removes
    the effect of softening near break-away.
    """
    pieces = sticking_pieces(response, fs)
    if not pieces:
        raise InputError(
            "the axis never sticks near zero torque; use a torque that starts from zero and is sampled faster"
        )
    rows = np.concatenate(pieces)
    columns = [response.torque[rows], response.torque[rows] * np.abs(response.torque[rows])]
    for piece in pieces:
        columns.append(np.isin(rows, piece).astype(np.float64))
    matrix = np.stack(columns, axis=1)
    scale = np.linalg.norm(matrix, axis=0)
    solved: Any = pseudo_inverse(matrix / scale) @ response.position[rows]
    rest: Any = matrix / scale @ solved - response.position[rows]
    dof = max(rows.size - matrix.shape[1], 1)
    std = max(math.sqrt(float(rest @ rest) / dof), noise.std if noise else 0.0)
    inverse: Any = pseudo_inverse((matrix / scale).T @ (matrix / scale))
    compliance = float(solved[0] / scale[0])
    spread = std * math.sqrt(float(inverse[0, 0])) / float(scale[0])
    if compliance <= 0.0:
        return Estimate("stiffness", "N·m/rad", "k_0", math.nan, math.nan, 0.0, math.inf, False,
                        "the displacement does not follow the load: noise or quantisation hides it")  # fmt: skip
    value = 1.0 / compliance
    low = 1.0 / (compliance + 1.96 * spread)
    high = 1.0 / (compliance - 1.96 * spread) if compliance > 1.96 * spread else math.inf
    why = "" if high <= 2.0 * low else "the displacement near zero load is too small against the noise"
    return Estimate("stiffness", "N·m/rad", "k_0", value, value**2 * spread, low, high, not why, why)


def pseudo_inverse(matrix: Any) -> Any:
    """Return numpy's pseudo-inverse, whose types are unknown."""
    inverse: Any = np.linalg.pinv
    return inverse(matrix)


def lugre_vector(curve: Model, sigma0: float, sigma1: float, most: float = math.inf) -> Vector:
    """Return LuGre with the sliding curve of another law, frozen, and sigma1 at most `most`."""
    model = transfer_curve("lugre", curve, sigma0=sigma0, sigma1=sigma1)
    return Vector(model, free=["sigma0", "sigma1"], limits={"sigma1": (0.0, most)})


def stribeck_velocity(curve: Model) -> float:
    """Return the smaller Stribeck velocity of both directions, rad/s."""
    return min(levels_of(curve, direction).vs for direction in (1.0, -1.0))


class Simulation:
    """The axis under the record's torque, which can be simulated with any sigma0 and sigma1.

    LuGre's friction is smooth except for its slope at zero velocity, so the error of the second-order step decreases
    with its square; two runs, one with half the step of the other, eliminate it (Richardson 1911). ``longest`` is the
    longest step, s, between all samples or between each two.
    """

    def __init__(
        self, response: Response, vector: Vector, inertia: float, longest: float | Array = STEP
    ) -> None:
        assert vector.base is not None
        self.response, self.vector, self.mechanics = response, vector, Mechanics(inertia)
        period = np.diff(response.time)
        parts = np.maximum(np.ceil(period / longest - 1e-9), 1.0).astype(np.intp)
        self.rows = np.concatenate([[0], np.cumsum(parts)])
        first = np.repeat(np.arange(parts.size), parts)
        inside = (np.arange(first.size) - self.rows[first]) / parts[first]
        time = np.append(response.time[first] + inside * period[first], response.time[-1])
        # Linear interpolation of a fast sine loses a little of it, which a slip amplifies: both runs follow the
        # curvature, and the extrapolation removes the rest.
        bend = Akima1DInterpolator(response.time, response.torque, method="makima")
        start = (float(response.position[0]), 0.0)
        self.coarse, self.fine = (
            Course(vector.base.law, Drive(t, np.asarray(bend(t)), "linear", start=start, max_step=math.inf))
            for t in (time, with_middles(time))
        )

    def position(self, u: Array) -> Array:
        """Return the positions at the times of the record, rad."""
        parameters = self.vector.law_parameters(u)
        # In parallel, the long one by the caller.
        coarse, fine = mapped(lambda c: c.run(self.mechanics, parameters)[:, 0], (self.coarse, self.fine))
        ends = fine[2 * self.rows]
        return ends + (ends - coarse[self.rows]) / 3.0

    def graded(self, u: Array, vs: float, coarser: float = 1.0) -> Simulation:
        """Return the simulation with steps as short as the motion at u requires, times `coarser`."""
        velocity = self.fine.run(self.mechanics, self.vector.law_parameters(u))[2 * self.rows, 1]
        longest = coarser * graded(self.response, velocity, vs)
        return Simulation(self.response, self.vector, self.mechanics.inertia, longest)


def misfit(response: Response, simulation: Simulation) -> Residuals:
    """Return simulated minus measured position at the vector's coordinates, rad, without its mean.

    The simulation starts at the first sample, whose noise would otherwise shift all of it; friction does not depend on
    the position, so a free offset is the mean.
    """

    def difference(u: Array) -> Array:
        apart = simulation.position(u) - response.position
        return apart - np.mean(apart)

    return difference


def with_middles(values: Array) -> Array:
    """Return the values with the midpoints between them."""
    out = np.zeros(2 * values.size - 1)
    out[::2], out[1::2] = values, 0.5 * (values[:-1] + values[1:])
    return out


def graded(response: Response, velocity: Array, vs: float) -> Array:
    """Return the longest steps between the samples, s: short around break-away and stops, shape (n - 1,)."""
    speed, time = np.abs(velocity), response.time
    busy = time[(speed > BUSY[0] * vs) & (speed < BUSY[1] * vs)]
    longest = np.full(time.size - 1, ROUGH)
    for around, step in GRADES if busy.size else ():
        right = np.minimum(np.searchsorted(busy, time), busy.size - 1)
        left = np.maximum(right - 1, 0)
        close = np.minimum(np.abs(busy[right] - time), np.abs(time - busy[left])) <= around
        longest[close[:-1] | close[1:]] = step
    return longest


def squares_of(vector: Vector, residuals: Residuals) -> Squares:
    """Return the residuals with the bounds of the vector."""
    return Squares(residuals, vector.lower, vector.upper, DIFFERENCE)


def fit_position(
    response: Response, inertia: float, curve: Model, *, sigma0: float, sigma1: float,
    noise: Noise | float | None = None, profiles: bool = True,
) -> Fit:  # fmt: skip
    """Fit by plain output error: least squares of the simulated position, all samples equal, with a free start.

    Thesis 3.1.3.2.3.1, but with a free start. Correct if the friction is LuGre's; otherwise see
    `identify_lugre_dynamics`.
    """
    vector, vs = lugre_vector(curve, sigma0, sigma1), stribeck_velocity(curve)
    rough = Simulation(response, vector, inertia, ROUGH)
    # sigma0 alone first: far from the minimum sigma1 would be driven to 0, from which it recovers slowly.
    near, _ = descend_by_secants(
        squares_of(vector, misfit(response, rough)), vector.start, held=[vector.names.index("sigma1")], tolerance=0.1
    )  # fmt: skip
    enough = ENOUGH / response.time.size
    near, _ = descend_by_secants(
        squares_of(vector, misfit(response, rough.graded(near, vs))), near, tolerance=enough
    )
    residuals = misfit(response, rough.graded(near, vs))
    known, size = as_noise(noise), float(np.ptp(response.position))
    first = fit(
        residuals,
        vector,
        noise=known,
        size=size,
        starts=near[None, :],
        profiles=False,
        tolerance=enough,
        difference=DIFFERENCE,
    )
    # A residual above the noise is an error of the model or the simulation, and correlated.
    lags = correlation_lags(first.optimum.residuals) if known is None or first.rms > 1.1 * known.std else 0
    if not profiles and lags == 0:
        return first
    return fit(
        residuals, vector, noise=known, size=size, starts=first.u[None, :], profiles=profiles, lags=lags,
        tolerance=enough, difference=DIFFERENCE,
    )  # fmt: skip


def fit_bristles(
    response: Response, simulation: Simulation, pieces: Sequence[Rows], vs: float, noise: Noise | None
) -> Fit:
    """Fit the displacements within the sticking parts, each without its mean; vs in rad/s."""
    vector = simulation.vector

    def bristles(position: Array) -> Array:
        return np.concatenate([position[p] - np.mean(position[p]) for p in pieces])

    measured = bristles(response.position)
    enough = ENOUGH / measured.size

    def apart(stepped: Simulation) -> Residuals:
        return lambda u: bristles(stepped.position(u)) - measured

    def descended(u: Array) -> tuple[Array, float]:
        return descend_by_secants(
            squares_of(vector, apart(simulation.graded(u, vs, COARSER))), u, tolerance=enough
        )

    # sigma1 hardly matters here, and may reach either of its bounds.
    undamped = vector.start.copy()
    undamped[vector.names.index("sigma1")] = 0.0
    near = min((descended(u) for u in (vector.start, undamped)), key=lambda found: found[1])[0]
    return fit(
        apart(simulation.graded(near, vs, COARSER)), vector, noise=noise, size=float(np.max(np.abs(measured))),
        starts=near[None, :], tolerance=enough, difference=DIFFERENCE,
    )  # fmt: skip


def left_open(found: Fit) -> list[str]:
    """Return notes on the parameters that this record does not determine."""
    notes: list[str] = []
    if any(e.name == "sigma1" and not e.identified for e in found.estimates):
        notes.append(
            "sigma1 is not determined by this record: near zero load its torque is a tiny part of the spring's."
        )
    if not found.noise.known:
        notes.append(
            "The noise of the position is unknown; give it, or nothing can be reported as identified."
        )
    return notes


def identify_lugre_dynamics(
    response: Response, inertia: float, curve: Model, *, noise: Noise | float | None = None,
) -> Identification:  # fmt: skip
    """Identify sigma0 and sigma1 from an open-loop stick-slip response, with its pre-sliding parts weighted separately.

    Parameters
    ----------
    response : Response
    inertia : float
        Inertia, kg·m².
    curve : Model
        Any law with the previously identified sliding curve: of any shape, symmetric or for each direction.
    noise : Noise or float, optional
        Standard deviation of a position, rad; else from the residual in the pre-sliding parts.

    Returns
    -------
    Identification
        Estimates sigma0, sigma1 and stiffness (small-signal, without a law). ``details["scan"]`` contains the plain
        position misfit over sigma0, and ``details["plain_determines_sigma0"]`` whether that has a distinct minimum.

    Raises
    ------
    InputError
        If the axis never sticks near zero torque.
    """
    known, fs = as_noise(noise), min(static_levels(curve))
    stiffness = small_signal_stiffness(response, fs, known)
    begin = stiffness.value if math.isfinite(stiffness.value) else 1e4
    # Above critical damping bristles would not act as springs, which this record could not show.
    critical = 2.0 * math.sqrt(begin * inertia)
    vector = lugre_vector(curve, begin, 0.1 * critical, critical)
    simulation = Simulation(response, vector, inertia)
    pieces = sticking_pieces(response, fs)
    found = fit_bristles(response, simulation, pieces, stribeck_velocity(curve), known)
    scan = plain_scan(response.position, simulation.position, found)
    decides, sentence = plain_verdict(scan, found.values["sigma0"])
    simulated, model = simulation.position(found.u), vector.model(found.u)
    next_steps = (
        ()
        if decides
        else ("Measure small loops of torque over displacement below break-away for the stiffness.",)
    )
    correlation = np.full((3, 3), math.nan)
    correlation[:2, :2], correlation[2, 2] = found.correlation, 1.0
    return Identification(
        "lugre_dynamics", model, (*found.estimates, stiffness), correlation,
        {
            "presliding_rms_rad": found.rms,
            "position_rms_rad": float(np.sqrt(np.mean((simulated - response.position) ** 2))),
        },
        (sentence, *left_open(found), *describe_unused(curve, model)), next_steps,
        (response_picture(response.time, response.position, simulated), scan_picture(scan, found.values["sigma0"])),
        {"scan": scan, "plain_determines_sigma0": decides, "pieces": len(pieces)},
    )  # fmt: skip
