"""Torque, measured and of the model, where an axis slides for certain: what an identification rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from stickslip.identification.rows import OVERLAP, Block
from stickslip.identification.sliding import SlidingPosterior
from stickslip.identification.windows import apply_at, window_weights
from stickslip.identify.estimate import Identification
from stickslip.identify.monte_carlo import resisting_torque
from stickslip.identify.regression.force_error import model_torque
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]
WORSE = 1.05
"""Times plain least squares' force error, from which on a model's counts as larger."""
SMALL = 0.01
"""Of the torque where the axis slides: a model that misses less is not beaten by another."""

POINTS = 4000
"""Rows of a record that are looked at, at most: every second, third ... of more."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """Torque over time and velocity, measured and of the model.

    Attributes
    ----------
    time, velocity, position : array, shape (n,)
        s, rad/s (m/s), rad (m).
    measured, model : array, shape (n,)
        The torque that acted, and that of the model with what friction's drift and a load's swing add to it, N·m (N).
    inertial : array, shape (n,)
        What of the model's accelerates, lifts, drifts and swings: all but friction and the constant torque, N·m (N).
    record : array of int, shape (n,)
        Which record a row belongs to.
    certain : bool
        Whether these are rows of gross sliding; else all of the inverse dynamics'.
    share : float
        Part of the records that they are.
    whole : tuple of (array, array)
        Time and torque that acted of every record, standstills and reversals included.
    plain : float
        Root mean square of what plain least squares leaves in these rows, N·m (N); not a number where not asked.
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
        """Model less measured, N·m (N)."""
        return self.model - self.measured

    @property
    def rms(self) -> float:
        """Root mean square of what the model leaves, N·m (N)."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def relative(self) -> float:
        """The same over that of the torque."""
        return self.rms / max(float(np.sqrt(np.mean(self.measured**2))), 1e-300)


@lru_cache(maxsize=1)  # the head, its pictures and the command line ask for the same
def sliding_of(found: Identification) -> Sliding | None:
    """Torque in gross sliding; None where that was not looked at, or the law says no torque."""
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
    """At most `POINTS` of some places."""
    return places[:: max(1, math.ceil(places.size / POINTS))]


def left_by_plain(posterior: SlidingPosterior, places: Any, inverse: Any) -> float:
    """RMS of what the plain inverse dynamics leaves of the torque in those rows, N·m (N)."""
    if not isinstance(inverse, InverseDynamics):
        return math.nan
    rows, own = posterior.rows, inverse.numbers()
    told = own["inertia"] * rows.acceleration[places] + own["sigma2"] * rows.velocity[places]
    told = told + own["fc"] * rows.sign[places] + own["offset"]
    angle = rows.position[places]
    told = told + own.get("gravity_sin", 0.0) * np.sin(angle) + own.get("gravity_cos", 0.0) * np.cos(angle)
    return float(np.sqrt(np.mean((posterior.torque[places] - told - posterior.beside[places]) ** 2)))


def acted(block: Block, skew: float) -> tuple[Array, Array]:
    """Time and torque that acted, of a whole record through the same window."""
    weights = window_weights(block.half, block.record.period, (0,), skew)
    edge = weights.shape[1] // 2
    padded = np.pad(block.record.drive, edge, mode="edge")
    return block.record.time, apply_at(padded, np.arange(block.record.time.size) + edge, weights)[:, 0]


def over_all_rows(found: Identification) -> Sliding | None:
    """The same over all rows of the inverse dynamics, where sliding was not looked at on its own."""
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
    """That an inertia that was given, and not fitted, may be why the model is beaten; empty where it was fitted."""
    mechanics, inverse = found.details.get("mechanics"), found.details.get("inverse")
    fitted = any(e.name == "inertia" for e in found.estimates)
    if fitted or not isinstance(mechanics, Mechanics) or not isinstance(inverse, InverseDynamics):
        return ""
    return (
        f", with an inertia of {inverse['inertia']:.3g} {unit} in place of the {mechanics.inertia:.3g} that was given: "
        "check that first"
    )
