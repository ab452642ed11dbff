"""Golden vectors: random steps of a law and what plain Python answers to them."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np

from stickslip.model import Model
from stickslip.spec import Surroundings

__all__ = ["Golden", "as_csv", "golden", "random_steps"]

Array = np.ndarray[Any, np.dtype[np.float64]]


class Golden(NamedTuple):
    """Steps in order, each from the state that the one before left; shape (n,) each.

    v0, v1 in rad/s, dt in s, position in rad, torque in N·m.
    """

    v0: Array
    v1: Array
    dt: Array
    position: Array
    torque: Array


def random_steps(count: int, seed: int, scale: float = 1.0) -> tuple[Array, Array, Array, Array]:
    """v0, v1, dt and position of a random motion: speeds over 8 decades, reversals and stops.

    The velocity goes on from step to step; dt runs from 1e-6 to 1e-2 s. ``scale`` is the greatest speed, rad/s.
    """
    draw = np.random.default_rng(seed)
    speed = scale * 10.0 ** draw.uniform(-8.0, 0.0, count + 1)
    speed *= np.cumprod(draw.choice((-1.0, 1.0), count + 1, p=(0.25, 0.75)))
    speed[draw.random(count + 1) < 0.05] = 0.0
    dt = 10.0 ** draw.uniform(-6.0, -2.0, count)
    position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[:-1] + speed[1:]) * dt)])[:-1]
    return speed[:-1], speed[1:], dt, position


def golden(model: Model, count: int = 400, seed: int = 1) -> Golden:
    """Random steps and the torque of plain Python, from rest."""
    v0, v1, dt, position = random_steps(count, seed)
    z, p = model.law.state(model.parameters), model.parameters
    torque = [
        model.law.step(float(a), float(b), float(h), z, p, Surroundings(position=float(x)))
        for a, b, h, x in zip(v0, v1, dt, position)
    ]
    return Golden(v0, v1, dt, position, np.array(torque, dtype=np.float64))


def as_csv(vectors: Golden) -> str:
    """The vectors as CSV; numbers with all their digits."""
    out = io.StringIO()
    out.write("v0_rad_s,v1_rad_s,dt_s,position_rad,torque_Nm\n")
    for row in zip(*vectors):
        out.write(",".join(repr(float(x)) for x in row) + "\n")
    return out.getvalue()
