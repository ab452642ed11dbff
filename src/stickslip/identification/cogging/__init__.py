"""Torque over the angle: its dependence on position alone, on position and direction, and on velocity.

``torque = offset + E(theta) + direction (F + O(theta)) [+ viscous v + inertia dv/dt]``: E is cogging, gravity,
unbalance; O is friction that varies over the angle, unless a lag with direction explains it. The data are standstill
maps (points at which the axis stood, forward and backward) and slow rotations; faster records are compared to the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.identification.cogging.fitting import Fit, fit
from stickslip.identification.cogging.moving import Motion, in_motion, speed_control
from stickslip.identification.cogging.orders import (
    Orders,
    chosen,
    grid_of,
    interleaved,
    left_out,
    moving_columns,
    path,
    sectors,
)
from stickslip.identification.cogging.remarks import eccentricities, lag_of
from stickslip.identification.cogging.result import (
    ROUND,
    Choice,
    estimates_of,
    motion_notes,
    notes_of,
    pictures_of,
)
from stickslip.identification.cogging.rows import FASTEST, Places, bounds_of, joined, places_of, velocity_of
from stickslip.identification.cogging.table import table_left_out, table_of
from stickslip.identification.estimate import Identification, silent
from stickslip.machines.angle import AngleMap
from stickslip.machines.motor import Harmonics
from stickslip.machines.position_map import PositionMap, Waves
from stickslip.models.model import Model

LEVELS = "fc", "sigma2"
"""Parameters of the model that have other names among the estimates."""
LEAST = 60
"""Fewest places to distinguish orders from noise."""


def identify_cogging(
    records: Sequence[Record], *, torque: str = "motor_torque", gear: float = 1.0,
    progress: Callable[[str], None] = silent,
) -> Identification:  # fmt: skip
    """Separate a torque over the angle into parts that are even and odd in the direction.

    Parameters
    ----------
    records : sequence of Record
        Channels ``position`` (rad, the same zero in all), the torque's, and if known ``position_reference`` (which
        separates the places of a standstill map) and ``velocity``. Records up to `FASTEST` are fitted, faster ones are
        compared to the result.
    torque : str
        Channel; its unit may be A.
    gear : float
        Turns of the position's shaft per turn of the slowest shaft: orders are then multiples of its inverse.

    Returns
    -------
    Identification
        ``even[n]`` and ``odd[n]``, amplitudes by order; ``details["map"]`` is the
        `stickslip.machines.position_map.PositionMap`. A Coulomb model if the torque is in N·m.

    Raises
    ------
    InputError
        If nothing is left to fit, or the units differ.
    """
    unit = _unit(records, torque)
    parts = [places_of(r, torque) for r in records]
    places = _usable(joined([p for p, _ in parts]), records)
    standing = all(stands for p, stands in parts if len(p))
    moving = () if standing else moving_columns(places)
    orders = grid_of(places, gear)
    progress(f"{len(places)} places, {orders.count} orders")
    found, choice, terms = chosen_terms(places, orders, moving)
    lag, eccentric = lag_of(found), eccentricities(found)
    the_map = map_of(found, places, unit, choice, bounds_of(places, records))
    notes = notes_of(the_map, found, orders, choice, lag, eccentric, places)
    motions: list[Motion] = []
    for i, record in enumerate(records):
        motion, line = in_motion(record, torque, the_map), speed_control(record, torque)
        name = str(record.meta.get("reading", {}).get("file", "")) or f"record {i + 1}"
        notes += motion_notes(name, unit, motion, line)
        motions += [motion] if motion is not None else []
    estimates = estimates_of(found, unit, lag, eccentric)
    model, angle = _model(the_map, terms, lag.orders if lag else ())
    misfit = {
        "rms": float(np.sqrt(np.mean(found.residual**2))), "places_left_out": choice.harmonics[0],
        "sectors_left_out": choice.harmonics[1], "table_places_left_out": choice.table[0],
        "table_sectors_left_out": choice.table[1], "no_map": choice.nothing[0],
    }  # fmt: skip
    for motion in [m for m in motions if m.visible][:1]:
        misfit |= {"in_motion": motion.with_map, "in_motion_no_map": motion.without}
    return Identification(
        "cogging", model, tuple(estimates), np.eye(len(estimates)), misfit, tuple(notes), _next(the_map, places),
        pictures_of(places, found, the_map),
        {"map": the_map, "fit": found, "motions": motions, "untouched": LEVELS, **angle},
    )  # fmt: skip


def _unit(records: Sequence[Record], torque: str) -> str:
    units = {r.units[torque] for r in records}
    if len(units) != 1:
        raise InputError(f"{torque} is in {' and in '.join(sorted(units))}; give all records in one unit")
    if any(r.units.get("position") not in ("rad", None) for r in records):
        raise InputError(
            f"{name_option('method', 'cogging')} takes angles in rad; for a linear axis give the "
            "motor's angle"
        )
    return units.pop()


def _usable(places: Places, records: Sequence[Record]) -> Places:
    if len(places) < LEAST:
        speeds = [float(np.median(np.abs(velocity_of(r)))) for r in records]
        why = (
            f"the records move at {min(speeds):.3g} rad/s and more, where the rotor's inertia carries the cogging; "
            f"record a standstill map or a rotation below {FASTEST:g} rad/s"
            if min(speeds) > FASTEST
            else f"{len(places)} places are left, {LEAST} are needed; record a revolution each way, slowly"
        )
        raise InputError(f"{name_option('method', 'cogging')}: {why}")
    if len(set(places.direction.tolist())) < 2:
        raise InputError(
            f"{name_option('method', 'cogging')}: only one direction is recorded, so that friction cannot be "
            "distinguished from "
            "the offset; record "
            "the same way forth and back"
        )
    return places


def chosen_terms(places: Places, orders: Orders, moving: Sequence[str]) -> tuple[Fit, Choice, list[Any]]:
    """Choose the terms by the error on sectors, and return the errors of the table on the same places."""
    by_sector, _ = left_out(places, orders, moving, sectors)
    by_place, _ = left_out(places, orders, moving, interleaved)
    count = chosen(by_sector)
    terms = path(places, orders, moving, most=max(count, 0))
    choice = Choice(
        (float(by_place[0]), float(by_sector[0])),
        (float(by_place[min(count, len(by_place) - 1)]), float(by_sector[count])),
        (table_left_out(places, interleaved), table_left_out(places, sectors)),
    )
    if not terms:
        choice = Choice(choice.nothing, choice.nothing, choice.table)
    return fit(places, terms, moving), choice, terms


def map_of(found: Fit, places: Places, unit: str, choice: Choice, bounds: tuple[float, float]) -> PositionMap:
    """Return the map of the harmonics, with the table if that is better."""

    def waves(part: str) -> Waves:
        own = sorted((t for t in found.terms if t[0] == part), key=lambda t: t[1])
        pairs = [found.pair(t) for t in own]
        return Waves(
            tuple(t[1] for t in own), tuple(float(p[0]) for p in pairs), tuple(float(p[1]) for p in pairs)
        )

    low, high = bounds
    table: tuple[float, ...] = ()
    odd: tuple[float, ...] = ()
    offset, friction = float(found.values[0]), float(found.values[1])
    if choice.form == "table" and high - low >= ROUND:
        both, apart = table_of(places)
        offset, friction = float(np.mean(both)), float(np.mean(apart))
        table, odd = tuple((both - offset).tolist()), tuple((apart - friction).tolist())
    kept = choice.table if table else choice.harmonics
    return PositionMap(waves("even"), waves("odd"), offset, friction, unit, low, high, table, odd, kept[0])


def _model(
    found: PositionMap, terms: Sequence[Any], lagging: Sequence[float]
) -> tuple[Model | None, dict[str, Any]]:
    """Return a Coulomb model and the angle's part, if the torque is in N·m and orders are whole numbers per turn."""
    whole = all(n == round(n) for _, n in terms)
    if found.unit != "N·m" or not found.friction > 0.0:
        return None, {}
    model = Model("coulomb", fc=found.friction)
    return model, {"angle": angle_of(found, lagging)} if whole else {}


def angle_of(found: PositionMap, lagging: Sequence[float]) -> AngleMap:
    """Return the map's waves, friction's relative to its level, without the orders that a lag explains."""
    own = [i for i, n in enumerate(found.odd.order) if n not in lagging]
    ripple = Harmonics(
        tuple(found.odd.order[i] for i in own), tuple(found.odd.amplitude[i] / found.friction for i in own),
        tuple(found.odd.phase[i] for i in own),
    )  # fmt: skip
    return AngleMap(ripple, Harmonics(found.even.order, found.even.amplitude, found.even.phase), found.offset)


def _next(found: PositionMap, places: Places) -> tuple[str, ...]:
    if found.upper - found.lower < ROUND:
        return ("Record a whole turn each way: only then are orders 1 and 2 known.",)
    if math.pi / places.spacing < 200.0:
        return ("Record places closer to each other: higher orders would show.",)
    return ()
