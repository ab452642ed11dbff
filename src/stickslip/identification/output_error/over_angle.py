"""The torque over the angle from the records of an axis: rows of gross sliding are the points of a map.

Waves over the angle are fitted together with inertia and the friction curve; orders are chosen by cross-validation on
whole sectors, as for a standstill map (`stickslip.identification.cogging`). The map is then subtracted from the
recorded torque, and the axis is identified without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.identification.cogging import angle_of, chosen_terms, map_of
from stickslip.identification.cogging.fitting import Fit
from stickslip.identification.cogging.orders import (
    HIGHEST,
    Orders,
    about_motion,
    columns,
    moving_columns,
    sectors,
)
from stickslip.identification.cogging.remarks import Lag, eccentricities, lag_of
from stickslip.identification.cogging.result import ROUND, Choice, estimates_of, pictures_of, remarks_of
from stickslip.identification.cogging.rows import Places
from stickslip.identification.estimate import Estimate, Identification, Picture
from stickslip.identification.experiment import Experiment
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.posterior import falls_of
from stickslip.identification.search import Asked
from stickslip.identification.sliding import SlidingPosterior
from stickslip.identification.windows import POWER
from stickslip.machines.position_map import PositionMap
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]

FALLS = np.array([0.03, 0.1])
"""Velocities of friction's fall, parts of the highest speed; a faster one resembles viscous friction."""
SECTORS = 12
"""Sectors of a turn, each of which must be passed in both directions."""
RESOLVED = 1.0
"""Greatest phase of a wave (rad) that passes within the window's width for a row to resolve it."""
SLOWER = 0.25
"""Part of the rows that must resolve the highest order tried."""
USUAL = 24
"""Highest order that must be resolved: slots of a usual motor. A faster record is refused."""
INDEPENDENT = 1e-2
"""Part of the largest singular value below which columns are dependent."""


@dataclass(frozen=True, eq=False)
class SlidingPlaces(Places):
    """Rows of gross sliding, seen through a smooth window; `width` is its standard deviation as an angle, rad.

    Attributes
    ----------
    others : array, shape (n, k)
        Columns of other torque components.
    """

    others: Array

    @property
    def beside(self) -> Array:
        """Columns of other torque components, shape (n, k)."""
        return self.others

    def motion(self, orders: Sequence[float], late: float = 0.0) -> Array:
        """Return velocity and acceleration, denoised by the windows, `late` s before each place, shape (n, 2)."""
        return np.column_stack([self.velocity - late * self.acceleration, self.acceleration])

    def damping(self, order: float) -> Array:
        """Return the window's attenuation of a wave of this order, shape (n,)."""
        return np.exp(-0.5 * (order * self.width) ** 2)


@dataclass(frozen=True, eq=False)
class OverAngle:
    """A map from the records of an axis, with its source."""

    found: PositionMap
    estimates: tuple[Estimate, ...]
    choice: Choice
    lag: Lag | None
    notes: tuple[str, ...]
    pictures: tuple[Picture, ...]
    skew: float
    """Delay of the torque's column relative to the torque that acted, s."""

    def taken_out_of(self, experiment: Experiment, axis: ServoAxis) -> Experiment:
        """Return the experiment without the map's torque in the drive's signal."""
        gain, _ = axis.drive_gains(experiment.quantity)
        factor = gain * (np.ones(experiment.time.size) if experiment.supply is None else experiment.supply)
        acted = experiment.time - self.skew
        angle = np.interp(acted, experiment.time, experiment.position)
        direction = np.sign(np.interp(acted, experiment.time, experiment.velocity()))
        torque = self.found.beside(angle) + direction * self.found.ripple(angle)
        own = np.divide(torque, factor, out=np.zeros_like(torque), where=factor != 0.0)
        return replace(experiment, drive=experiment.signal() - own)

    def joined_to(self, axis: Identification) -> Identification:
        """Return the axis's result with the map's numbers, notes and pictures."""
        count, more = len(axis.estimates), len(self.estimates)
        correlation = np.eye(count + more)
        correlation[:count, :count] = axis.correlation
        errors = {
            "map_sectors_left_out_Nm": self.choice.harmonics[1], "no_map_sectors_left_out_Nm": self.choice.nothing[1],
            "map_places_left_out_Nm": self.choice.harmonics[0], "no_map_places_left_out_Nm": self.choice.nothing[0],
        }  # fmt: skip
        angle = replace(
            angle_of(self.found, self.lag.orders if self.lag else ()), offset=axis.details["mechanics"].offset
        )
        return replace(
            axis, estimates=(*axis.estimates, *self.estimates), correlation=correlation,
            misfit={**axis.misfit, **errors}, notes=(*axis.notes, *self.notes),
            pictures=(*axis.pictures, *self.pictures), details={**axis.details, "map": self.found, "angle": angle},
        )  # fmt: skip


def over_angle(
    experiments: Sequence[Experiment], axis: ServoAxis, skew: float | None, estimate: EstimateSliding
) -> OverAngle:
    """Identify the map over the angle from the records.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the drive's signal; angles in rad, with the same zero in all.
    axis : ServoAxis
    skew : float or None
        Delay of the torque's column relative to the torque that acted, s, if it is known.
    estimate : callable
        `stickslip.identification.sliding.estimate_sliding`, or a memo of it.

    Raises
    ------
    InputError
        If the records show no map, with the reason.
    """
    if axis.motion != "rotary":
        raise InputError("the positions are lengths; give the motor's angle")
    if any(t.drive is None or t.closed_loop for t in experiments):
        raise InputError(
            f"it is found in the recorded torque, not in a simulated loop; leave {name_option('loop')} out"
        )
    sliding = estimate(experiments, axis, Asked(axis.gravity == "pendulum", skew=skew))
    places = places_of(sliding, axis)
    refuse_narrow(places)
    orders = orders_of(places)
    moving = moving_columns(places)
    found, choice, terms = chosen_terms(places, orders, moving)
    without, with_map = about_motion(places, orders, moving, sectors, len(terms))
    choice = replace(choice, nothing=(choice.nothing[0], without), harmonics=(choice.harmonics[0], with_map))
    lag, eccentric = lag_of(found), eccentricities(found)
    estimates = [
        e for e in estimates_of(found, "N·m", lag, eccentric)
        if e.name.partition("[")[0] in ("even", "odd", "lag", "eccentricity")
    ]  # fmt: skip
    if not any(e.identified for e in estimates):
        raise InputError(
            f"no order up to {orders.count} is more than chance ({choice.nothing[1]:.3g} N·m RMS about inertia and "
            "friction)"
        )
    choice = replace(choice, table=(math.inf, math.inf))  # Inertia and friction are fitted with waves only.
    bounds = float(places.angle.min()), float(places.angle.max())
    the_map = map_of(found, places, "N·m", choice, bounds)
    even = sum(part == "even" for part, _ in terms)
    notes = (
        f"Torque over the angle: {even} orders in both directions alike, {len(terms) - even} with the direction, "
        "chosen by the error on sectors left out whole; about inertia and friction of all the rows it is "
        f"{choice.harmonics[1]:.3g} N·m RMS there (no map {choice.nothing[1]:.3g}). All other numbers, errors and "
        "pictures of the axis are those of the torque without this map.",
        *remarks_of(found, orders, lag, eccentric),
    )
    pictures = pictures_of(without_motion(places, found, moving), found, the_map)
    return OverAngle(the_map, tuple(estimates), choice, lag, notes, pictures, sliding.numbers["skew"].value)


def places_of(sliding: SlidingPosterior, axis: ServoAxis) -> SlidingPlaces:
    """Return the rows of the narrowest windows, with friction and inertia terms besides Coulomb's level and slope."""
    rows = sliding.rows
    width = min(b.width for b in rows.blocks)
    narrow = np.isin(rows.block, [i for i, b in enumerate(rows.blocks) if b.width == width])
    angle, direction = rows.position[narrow], rows.sign[narrow]
    speed, acceleration = rows.velocity[narrow], rows.acceleration[narrow]
    gone = rows.at_centres(lambda r: r.since)[narrow]
    ways = np.maximum(np.quantile(gone, [0.1, 0.5]), 1e-12).tolist()
    falls = falls_of(rows, rows.fastest * FALLS, (2.0,)).alike[narrow]
    others = [
        rows.jerk[narrow], *falls.T, *(direction * np.exp(-gone / way) for way in ways),
        direction * np.abs(acceleration), np.abs(speed),
    ]  # fmt: skip
    if axis.gravity == "pendulum":
        others += [np.sin(angle), np.cos(angle)]
    fixed = np.column_stack([acceleration, speed, direction, np.ones(speed.size)])
    core = np.column_stack([fixed, np.abs(speed) * speed])
    half = np.concatenate([np.full(b.centres.size, b.half) for b in rows.blocks])[narrow]
    seen = np.abs(speed) * half / math.sqrt(2 * POWER + 3)
    return SlidingPlaces(
        angle, sliding.torque[narrow], direction, speed, acceleration, rows.stroke[narrow].astype(np.intp), seen,
        np.zeros(angle.size), np.zeros((angle.size, 2)), independent(core, np.column_stack(others)),
    )  # fmt: skip


def independent(core: Array, others: Array) -> Array:
    """Return the part of columns that is independent of `core`, as a basis with mean square 1."""
    basis, _ = np.linalg.qr(core / np.maximum(np.linalg.norm(core, axis=0), 1e-300))
    size = np.linalg.norm(others, axis=0)
    own = others[:, size > 0.0] / size[size > 0.0]
    left, singular, _ = np.linalg.svd(own - basis @ (basis.T @ own), full_matrices=False)
    return left[:, singular > INDEPENDENT * singular[0]] * math.sqrt(core.shape[0])


def refuse_narrow(places: Places) -> None:
    """Refuse motion of less than a turn in each direction."""
    low, high = float(places.angle.min()), float(places.angle.max())
    if high - low < ROUND:
        raise InputError(
            f"the axis slides from {low:.4g} to {high:.4g} rad, less than a revolution; record a revolution each way"
        )
    sector = np.floor(SECTORS * np.mod(places.angle, 2.0 * math.pi) / (2.0 * math.pi)).astype(int)
    for side, word in ((1.0, "forward"), (-1.0, "backward")):
        passed = np.unique(sector[places.direction == side]).size
        if passed < SECTORS:
            raise InputError(
                f"going {word}, the axis slides in {passed} of {SECTORS} sectors of the revolution; record a "
                "revolution each way"
            )


def orders_of(places: Places) -> Orders:
    """Return the orders that the slower rows resolve."""
    slow = float(np.quantile(places.width, SLOWER))
    highest = int(min(HIGHEST, RESOLVED / max(slow, 1e-12)))
    if highest < USUAL:
        raise InputError(
            f"in {100.0 * (1.0 - SLOWER):.0f} % of the rows of sliding, at "
            f"{float(np.quantile(np.abs(places.velocity), SLOWER)):.3g} rad/s and more, the rotor's inertia, not the "
            f"motor, carries the cogging: of orders above {highest} the slower rows alone tell anything, too few for a "
            "map, which is neither fitted nor applied; record slower motion"
        )
    return Orders(1.0, highest)


def without_motion(places: Places, found: Fit, moving: Sequence[str]) -> Places:
    """Return the places with only levels and waves in the torque, as in a picture over the angle."""
    moved = columns(places, (), moving)[:, 2:]
    # For long strokes, columns of the swing follow, which a picture keeps.
    return replace(places, torque=places.torque - moved @ found.values[2 : 2 + moved.shape[1]])
