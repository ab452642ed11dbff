"""Golden vectors: random steps of a law, random samples of a controller, and what plain Python answers to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.plain import plain_sample
from stickslip.core.spec import Surroundings
from stickslip.exports.nearest import surroundings_of
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]
TRIED, ROUNDED, NEAR = 24, 1e-6, 0.1
"""Motions that are tried beside a jump, what they differ by, and the share of the bound from which a torque counts."""
STILL = Surroundings()
PACE = 1e3
"""Of the time along the golden vectors, so that single precision sees slow changes too."""
TURNS = 6.0 * math.pi
"""rad: over which the position goes where friction depends on it."""
FAR = 1000.0
"""rad: where the samples' motion is, so that a loss of precision with the angle shows."""


class Golden(NamedTuple):
    """Steps in order, each from the state that the one before left; shape (n,) each.

    v0, v1 in rad/s, dt in s, position in rad, torque in N·m.
    """

    v0: Array
    v1: Array
    dt: Array
    position: Array
    torque: Array


class Surrounded(NamedTuple):
    """Steps as `Golden` has them, with a load, a temperature in degrees Celsius and a time in s; shape (n,) each."""

    v0: Array
    v1: Array
    dt: Array
    position: Array
    torque: Array
    load: Array
    temperature: Array
    time: Array


def random_steps(count: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """v0, v1, dt and position of a random motion: speeds over 8 decades, reversals and stops.

    The velocity goes on from step to step, up to 1 rad/s; dt runs from 1e-6 to 1e-2 s.
    """
    draw = np.random.default_rng(seed)
    speed = 10.0 ** draw.uniform(-8.0, 0.0, count + 1)
    speed *= np.cumprod(draw.choice((-1.0, 1.0), count + 1, p=(0.25, 0.75)))
    speed[draw.random(count + 1) < 0.05] = 0.0
    dt = 10.0 ** draw.uniform(-6.0, -2.0, count)
    position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[:-1] + speed[1:]) * dt)])[:-1]
    return speed[:-1], speed[1:], dt, position


def golden(model: Model, count: int = 400, seed: int = 1) -> Golden:
    """Random steps and the torque of plain Python, from rest, at the load, temperature and time of rest."""
    steps = _placed(model, random_steps(count, seed), seed)
    return Golden(*steps, answered(model, *steps))


def _placed(
    model: Model, steps: tuple[Array, Array, Array, Array], seed: int
) -> tuple[Array, Array, Array, Array]:
    """The steps all over three turns, where friction depends on the position."""
    if "position" not in surroundings_of(model):
        return steps
    place = np.random.default_rng(seed + 2).uniform(-0.5 * TURNS, 0.5 * TURNS, steps[0].size)
    return (*steps[:3], place)


def golden_around(model: Model, pace: float = 1.0, count: int = 400, seed: int = 1) -> Golden | Surrounded:
    """As `golden`; of a law that depends on load, temperature or time, these move, time ``pace`` times as fast."""
    read = surroundings_of(model)
    if not read & {"load", "temperature", "time"}:
        return golden(model, count, seed)
    steps = _placed(model, random_steps(count, seed), seed)
    load, temperature = changing(STILL, count, seed)
    load = load if "load" in read else np.full(count, STILL.load)
    temperature = temperature if "temperature" in read else np.full(count, STILL.temperature)
    time = pace * np.cumsum(steps[2]) if "time" in read else np.full(count, STILL.time)
    torque = answered(model, *steps, around=(load, temperature, time))
    return Surrounded(*steps, torque, load, temperature, time)


def changing(around: Surroundings, count: int, seed: int) -> tuple[Array, Array]:
    """A load from half to twice that around, and a temperature up to 15 degrees beside."""
    draw = np.random.default_rng(seed + 1)
    return (
        around.load * draw.uniform(0.5, 2.0, count),
        around.temperature + draw.uniform(-15.0, 15.0, count),
    )


def answered(
    model: Model,
    v0: Array,
    v1: Array,
    dt: Array,
    position: Array,
    *,
    around: tuple[Array, Array, Array] | None = None,
) -> Array:
    """The torques of plain Python along steps from rest, N·m; ``around``: load, temperature and time of each."""
    z, p = model.law.state(model.parameters), model.parameters
    still = (np.full(v0.size, x) for x in (STILL.load, STILL.temperature, STILL.time))
    torque = [
        model.law.step(float(a), float(b), float(h), z, p, Surroundings(*map(float, u)))
        for a, b, h, *u in zip(v0, v1, dt, position, *(around or still))
    ]
    return np.array(torque, dtype=np.float64)


def room_beside_jumps(
    answer: Callable[[Array, Array, Array, Array], Array], vectors: Golden | Surrounded, bound: float
) -> Array:
    """What the torque of each step may be off besides `bound`, N·m: 0 but where a jump of it moves to another step.

    Velocities and times a little off (`ROUNDED`, some roundings of single precision) are tried `TRIED` times.

    Parameters
    ----------
    answer : callable
        The torques along steps from rest, as `answered`.
    vectors : Golden or Surrounded
    bound : float
        N·m
    """
    draw, most = np.random.default_rng(2), np.zeros(vectors.torque.size)
    for _ in range(TRIED):
        speed = 1.0 + ROUNDED * draw.uniform(-1.0, 1.0, vectors.v0.size + 1)
        time = 1.0 + ROUNDED * draw.uniform(-1.0, 1.0, vectors.dt.size)
        found = answer(vectors.v0 * speed[:-1], vectors.v1 * speed[1:], vectors.dt * time, vectors.position)
        most = np.maximum(most, np.abs(found - vectors.torque))
    return np.where(most > NEAR * bound, most + bound, 0.0)


class Samples(NamedTuple):
    """Samples of a controller in order; shape (n,) each.

    position and reference in rad, their velocity in rad/s and acceleration in rad/s², torque in N·m, temperature in
    degrees Celsius.
    """

    position: Array
    reference: Array
    reference_velocity: Array
    reference_acceleration: Array
    torque: Array
    load: Array
    temperature: Array


def random_motion(
    sample_time: float, reach: float, count: int, seed: int
) -> tuple[Array, Array, Array, Array]:
    """Position and reference of a motion with reversals, stops, a blocked axis and inputs that are no numbers.

    ``reach`` is the error at which the controller comes to its torque limit, rad.
    """
    draw = np.random.default_rng(seed)
    pieces = np.arange(count) // 20
    speed: Array = 10.0 ** draw.uniform(-2.0, 0.5, count // 20 + 1) * draw.choice(
        (-1.0, 1.0), count // 20 + 1
    )
    speed[::5] = 0.0
    velocity: Array = speed[pieces]
    reference = FAR + np.cumsum(velocity) * sample_time
    lag = 1e-3 * np.cumsum(draw.standard_normal(count) * (velocity != 0.0)) * math.sqrt(sample_time)
    position = reference - lag
    # The axis is blocked until the limit holds the torque back, and comes free again.
    blocked = slice(count // 2, 3 * count // 4)
    position[blocked] -= 2.0 * min(reach, 1.0)
    position[count // 4 : count // 4 + 3] = math.nan
    reference[count - 20] = math.nan
    return position, reference, velocity, np.gradient(velocity, sample_time)


def sampled_torques(
    sample: Callable[..., float], u: Any, inputs: tuple[Array, ...], change: tuple[Array, Array]
) -> Array:
    """What a controller answers to its inputs, N·m, while load and temperature change in ``u``."""
    torque: list[float] = []
    for *row, u.load, u.temperature in zip(*inputs, *change):
        torque.append(plain_sample(sample, *map(float, row)))
    return np.array(torque, dtype=np.float64)


HEADS: dict[type, str] = {
    Golden: "v0_rad_s,v1_rad_s,dt_s,position_rad,torque_Nm",
    Surrounded: "v0_rad_s,v1_rad_s,dt_s,position_rad,torque_Nm,load,temperature_degC,time_s",
    Samples: "position_rad,reference_rad,reference_velocity_rad_s,reference_acceleration_rad_s2,torque_Nm,"
    "load,temperature_degC",
}


def as_csv(vectors: Golden | Surrounded | Samples) -> str:
    """The vectors as CSV; numbers with all their digits."""
    return csv_of(HEADS[type(vectors)], vectors)


def csv_of(head: str, columns: Iterable[Iterable[float]]) -> str:
    """Columns of numbers under a head as CSV."""
    rows = "\n".join(",".join(repr(float(x)) for x in row) for row in zip(*columns))
    return f"{head}\n{rows}\n"
