"""Torque at constant velocities: a friction law plus a constant torque, for the parameters of a fit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from stickslip.core.spec import Par
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.models.model import Model
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

OFFSET = Par("N·m", "T_0", "constant torque against positive motion")
SPEEDS = 60
"""Number of speeds over the measured range at which the effects of parameters are compared."""
STEP, SAME = 1e-4, 1e-6
"""Relative step of a derivative; greatest relative residual for such derivatives to add up to a constant torque."""
PART = 0.1
"""Least coefficient of a parameter in that sum for it to be named, part of the largest."""


class Torques:
    """Torque at fixed velocities for coordinates or values of a vector.

    Parameters
    ----------
    vector : Vector
        Parameters of a law and ``offset``.
    velocity, side : array, shape (n,)
        As in `Steady`.
    """

    def __init__(self, vector: Vector, velocity: Array, side: Array) -> None:
        assert vector.base is not None
        self._vector = vector
        self._steady = Steady(vector.base.law, velocity, side)

    def at(self, u: Array) -> Array:
        """Return the torque at coordinates of the vector, N·m, shape (n,)."""
        return self._steady.torque(self._vector.packed(u)) + self._vector.named(u)["offset"]

    def at_all(self, several: Array) -> Array:
        """Return the torque at several coordinates, shape (m, size), N·m, shape (m, n)."""
        offsets = np.array([[self._vector.named(u)["offset"]] for u in several])
        return self._steady.torques(np.array([self._vector.packed(u) for u in several])) + offsets

    def at_values(self, values: Array) -> Array:
        """Return the torque at values of the free parameters, N·m, shape (n,)."""
        vector = self._vector
        held = next(p for p in vector.parameters if p.name == "offset")
        offset = float(values[vector.names.index("offset")]) if held.free else held.value
        return self._steady.torque(vector.packed_values(values)) + offset


def steady_vector(points: SlidingPoints, template: Model, frozen: Iterable[str]) -> Vector:
    """Return the parameters that act at these velocities as free, the others as frozen.

    The constant torque is free if it is not known and the points can separate it from the law's parameters.
    """
    frozen = tuple(frozen)
    vector = vector_of(points, template, frozen)
    torques = Torques(vector, points.velocity, points.side)
    values = vector.values(vector.start)
    here = torques.at_values(values)
    idle: list[str] = []
    for i, p in enumerate(vector.free):
        changed = values.copy()
        changed[i] = p.value * 1.1 if p.value else 0.1 * p.scale
        effect = np.abs(torques.at_values(changed) - here)
        if p.shares or float(np.max(effect)) <= 1e-12 * float(np.max(np.abs(here))):
            idle.append(p.name)
    hidden = ("offset",) if points.offset is None and tied_to_offset(points, template, frozen) else ()
    return vector_of(points, template, (*frozen, *idle, *hidden))


def vector_of(
    points: SlidingPoints, template: Model, frozen: Iterable[str] = (),
    limits: dict[str, tuple[float, float]] | None = None, free: Iterable[str] | None = None,
) -> Vector:  # fmt: skip
    """Return the parameters of a law and the constant torque, which is free if it is not known."""
    scale = float(np.median(np.abs(points.torque))) or 1.0
    offset = Parameter("offset", OFFSET, points.offset or 0.0, points.offset is None, scale=scale)
    return Vector(template, free=free, frozen=frozen, extra=[offset], limits=limits)


def tied_to_offset(points: SlidingPoints, template: Model, frozen: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the free parameters of a law of which the points determine only the sum with a constant torque.

    At speeds in one direction a constant torque is equivalent to Coulomb friction; at speeds in both directions it is
    so if a law has separate parameters for each direction.
    """
    moving = np.abs(points.velocity[points.velocity != 0.0])
    if moving.size == 0:
        return ()
    ways = np.unique(points.side[points.velocity != 0.0])
    speeds = np.geomspace(0.5 * float(np.min(moving)), 2.0 * float(np.max(moving)), SPEEDS)
    velocity = np.concatenate([way * speeds for way in ways])
    vector = vector_of(points, template, (*frozen, "offset"))
    torques = Torques(vector, velocity, np.sign(velocity))
    values, columns = vector.values(vector.start), dict[str, Array]()
    for i, p in enumerate(vector.free):
        step = STEP * (abs(values[i]) or p.scale)
        more, less = values.copy(), values.copy()
        more[i] += step
        less[i] -= step
        column = torques.at_values(more) - torques.at_values(less)
        if np.all(np.isfinite(column)) and np.any(column):
            columns[p.name] = column / np.linalg.norm(column)
    if not columns:
        return ()
    matrix, constant = np.column_stack(list(columns.values())), np.ones(velocity.size)
    sum_of = np.linalg.lstsq(matrix, constant, rcond=None)[0]
    if np.linalg.norm(matrix @ sum_of - constant) > SAME * np.linalg.norm(constant):
        return ()
    size = np.abs(sum_of)
    return tuple(n for n, x in zip(columns, size, strict=True) if x > PART * float(size.max()))
