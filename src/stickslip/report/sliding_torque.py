"""Measured and model torque in gross sliding, the basis of an identification."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from stickslip.identification.estimate import Identification
from stickslip.identification.monte_carlo import resisting_torque
from stickslip.identification.regression.force_error import model_torque
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.identification.rows import OVERLAP, Block
from stickslip.identification.sliding import SlidingPosterior
from stickslip.identification.windows import apply_at, window_weights
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]
WORSE = 1.05
"""Multiple of the force error of plain least squares above which a model's counts as larger."""
SMALL = 0.01
"""Share of the sliding torque: a model with a smaller misfit is not considered worse than another."""

POINTS = 4000
"""Most rows of a record; longer records are thinned to every second, third, ... row."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """Measured and model torque over time and velocity.

    Attributes
    ----------
    time, velocity, position : array, shape (n,)
        s, rad/s (m/s), rad (m).
    measured, model : array, shape (n,)
        Applied torque, and that of the model with the effects of friction drift and load oscillation, N·m (N).
    inertial : array, shape (n,)
        Model torque without friction and constant torque: acceleration, gravity, drift and oscillation, N·m (N).
    record : array of int, shape (n,)
        Record of each row.
    certain : bool
        Whether these are rows of gross sliding, else all rows of the inverse dynamics.
    share : float
        Share of the records.
    whole : tuple of (array, array)
        Times and applied torques of every record, including standstills and reversals.
    plain : float
        RMS residual of plain least squares in these rows, N·m (N); NaN if not computed.
    """

    time: Array
    velocity: Array
    position: Array
    measured: Array
    model: Array
    inertial: Array
    record: np.ndarray[Any, np.dtype[np.int64]]
    certain: bool
    share: float
    whole: tuple[tuple[Array, Array], ...]
    plain: float = math.nan

    @property
    def residual(self) -> Array:
        """Model minus measured, N·m (N)."""
        return self.model - self.measured

    @property
    def rms(self) -> float:
        """RMS residual of the model, N·m (N)."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def relative(self) -> float:
        """RMS residual relative to the RMS torque."""
        return self.rms / max(float(np.sqrt(np.mean(self.measured**2))), 1e-300)


@lru_cache(maxsize=1)  # used by the report's top, its pictures and the command line
def sliding_of(found: Identification) -> Sliding | None:
    """Return the torque in gross sliding; None if it was not evaluated or the law gives no torque."""
    posterior, mechanics = found.details.get("sliding"), found.details.get("mechanics")
    if not isinstance(posterior, SlidingPosterior) or not isinstance(mechanics, Mechanics):
        return None
    if found.model is None or found.model.law.steady is None:
        return None
    rows, skew = posterior.rows, posterior.numbers["skew"].value
    narrow = min(b.width for b in rows.blocks)
    blocks = [(i, b) for i, b in enumerate(rows.blocks) if b.width == narrow]
    places = np.concatenate([_thinned(np.flatnonzero(rows.block == i)) for i, _ in blocks])
    record = np.concatenate([np.full(_thinned(b.centres).size, k) for k, (_, b) in enumerate(blocks)])
    inertial = mechanics.inertia * rows.acceleration[places] + posterior.beside[places]
    position = rows.position[places]
    if mechanics.gravity:
        inertial = inertial + mechanics.gravity * np.sin(position - mechanics.gravity_angle)
    velocity, measured = rows.velocity[places], posterior.torque[places]
    seen = sum(b.centres.size * max(1, int(b.half / b.record.period / OVERLAP)) for _, b in blocks)
    return Sliding(
        np.concatenate([b.record.time[_thinned(b.centres)] for _, b in blocks]), velocity, position, measured,
        inertial + resisting_torque(found.model, velocity) + mechanics.offset, inertial, record, True,
        min(1.0, seen / sum(b.record.time.size for _, b in blocks)), tuple(acted(b, skew) for _, b in blocks),
        left_by_plain(posterior, places, found.details.get("inverse")),
    )  # fmt: skip


def _thinned(places: Any) -> Any:
    """Thin indices to at most `POINTS`."""
    return places[:: max(1, math.ceil(places.size / POINTS))]


def left_by_plain(posterior: SlidingPosterior, places: Any, inverse: Any) -> float:
    """Return the RMS residual of the plain inverse dynamics in those rows, N·m (N)."""
    if not isinstance(inverse, InverseDynamics):
        return math.nan
    rows, own = posterior.rows, inverse.numbers()
    told = own["inertia"] * rows.acceleration[places] + own["sigma2"] * rows.velocity[places]
    told = told + own["fc"] * rows.sign[places] + own["offset"]
    angle = rows.position[places]
    told = told + own.get("gravity_sin", 0.0) * np.sin(angle) + own.get("gravity_cos", 0.0) * np.cos(angle)
    return float(np.sqrt(np.mean((posterior.torque[places] - told - posterior.beside[places]) ** 2)))


def acted(block: Block, skew: float) -> tuple[Array, Array]:
    """Return times and applied torque of a whole record, seen through the same window."""
    weights = window_weights(block.half, block.record.period, (0,), skew)
    edge = weights.shape[1] // 2
    padded = np.pad(block.record.drive, edge, mode="edge")
    return block.record.time, apply_at(padded, np.arange(block.record.time.size) + edge, weights)[:, 0]


def over_all_rows(found: Identification) -> Sliding | None:
    """Return the same for all rows of the inverse dynamics, if sliding was not evaluated separately."""
    inverse, mechanics = found.details.get("inverse"), found.details.get("mechanics")
    if not isinstance(inverse, InverseDynamics):
        return None
    if found.method == "inverse dynamics":
        told = inverse.torque - inverse.residual
        inertia = inverse["inertia"]
    elif isinstance(mechanics, Mechanics) and found.model and found.model.law.steady and inverse.has("fc"):
        named: Mapping[str, float] = {
            k: float(getattr(mechanics, k)) for k in ("inertia", "offset", "gravity", "gravity_angle")
        }
        told, inertia = model_torque(inverse, found.model, named), mechanics.inertia
    else:
        return None
    inertial = inertia * inverse.matrix[:, inverse.names.index("inertia")]
    gravity = [n for n in inverse.names if n.startswith("gravity")]
    for name in gravity:
        inertial = inertial + inverse[name] * inverse.matrix[:, inverse.names.index(name)]
    record = np.concatenate([[0], np.cumsum(np.diff(inverse.time) <= 0.0)]).astype(np.int64)
    whole = tuple(
        (inverse.time[record == k], inverse.torque[record == k]) for k in range(int(record[-1]) + 1)
    )
    return Sliding(
        inverse.time, inverse.velocity, inverse.position, inverse.torque, told, inertial, record, False, 1.0, whole
    )  # fmt: skip


def beaten(sliding: Sliding) -> bool:
    """Whether plain least squares explains the torque better even in gross sliding."""
    return sliding.relative > SMALL and sliding.rms > WORSE * sliding.plain


def beside_held_inertia(found: Identification, unit: str) -> str:
    """Return a note that a given inertia may be the reason for a worse model; empty if it was fitted."""
    mechanics, inverse = found.details.get("mechanics"), found.details.get("inverse")
    fitted = any(e.name == "inertia" for e in found.estimates)
    if fitted or not isinstance(mechanics, Mechanics) or not isinstance(inverse, InverseDynamics):
        return ""
    return (
        f", with an inertia of {inverse['inertia']:.3g} {unit} in place of the {mechanics.inertia:.3g} that was given: "
        "check that first"
    )
