"""Shared parts of procedures: moves, the positioning loop, a rough estimate of the inertia."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import RigError
from stickslip.core.resources import number_of
from stickslip.rigs.procedures.base import BYTES, POSITION, Step
from stickslip.rigs.rig import Rig, setpoints

Array = np.ndarray[Any, np.dtype[np.float64]]

ROOM = 0.95
"""Share of the rig's torque limit for controllers and ramps."""
PUSH = 0.15
"""Share of the torque limit for planned accelerations."""


def samples(rig: Rig, seconds: float) -> int:
    """Return the number of samples in a time, at least 2.

    Raises
    ------
    InputError
        If they do not fit into memory.
    """
    return max(2, number_of(seconds, rig.sample_time, BYTES, f"{rig.name}, a step of {seconds:.3g} s"))


def now(rig: Rig, seconds: float = 0.05) -> Step:
    """Return a step that only measures the position."""
    return Step(setpoints(samples(rig, seconds)))


def holder(rig: Rig, inertia: float, bandwidth: float) -> Controller:
    """Return a PID for positions (thesis eq. 3.15; damping 0.85 as in Table 6), within the torque limit."""
    gains = place("PID", inertia, bandwidth, 0.85)
    return Controller(gains, None, ROOM * rig.limits.torque, rig.sample_time)


def smooth(begin: float, end: float, count: int, sample_time: float) -> tuple[Array, Array]:
    """Return position and velocity of a minimum-jerk move from rest to rest (Flash and Hogan 1985)."""
    s = np.arange(1, count + 1) / count
    shape = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    slope = 30.0 * s**2 * (1.0 - s) ** 2 / (count * sample_time)
    return begin + (end - begin) * shape, (end - begin) * slope


def move(rig: Rig, controller: Controller, begin: float, end: float, inertia: float) -> Step:
    """Return a closed-loop move, as fast as `PUSH` and a third of the speed limit allow, at least 0.3 s."""
    distance = abs(end - begin)
    by_torque = math.sqrt(5.8 * distance * inertia / (PUSH * rig.limits.torque))
    by_speed = 1.9 * distance / (0.33 * rig.limits.speed)
    count = samples(rig, max(by_torque, by_speed, 0.3))
    position, velocity = smooth(begin, end, count, rig.sample_time)
    return Step(setpoints(count, position=position, velocity=velocity, closed=1.0), controller)


def brake(rig: Rig, controller: Controller, begin: float, speed: float, inertia: float) -> Step:
    """Return a closed-loop stop from a speed."""
    count = samples(rig, max(abs(speed) * inertia / (PUSH * rig.limits.torque), 0.1))
    t = rig.sample_time * np.arange(1, count + 1)
    end = count * rig.sample_time
    position = begin + speed * (t - 0.5 * t**2 / end)
    return Step(setpoints(count, position=position, velocity=speed * (1.0 - t / end), closed=1.0), controller)


def uniform(
    rig: Rig, begin: float, speed: float, travel: float, inertia: float
) -> tuple[Array, Array, float]:
    """Return setpoints that accelerate, those at constant speed over a travel, and the final position, rad."""
    dt = rig.sample_time
    rise = samples(rig, max(abs(speed) * inertia / (PUSH * rig.limits.torque), 0.1))
    t = dt * np.arange(1, rise + 1)
    ramp = setpoints(
        rise, position=begin + 0.5 * speed * t**2 / (rise * dt), velocity=speed * t / (rise * dt), closed=1.0
    )
    start = begin + 0.5 * speed * rise * dt
    samples(rig, travel / abs(speed))
    count = max(2, math.ceil(travel / (abs(speed) * dt)))
    t = dt * np.arange(1, count + 1)
    level = setpoints(count, position=start + speed * t, velocity=speed, closed=1.0)
    return ramp, level, start + speed * count * dt


def speed_up(
    rig: Rig, controller: Controller, begin: float, speed: float, inertia: float
) -> tuple[Step, float]:
    """Return a closed-loop step from rest to a speed, kept for a second, and the final position, rad."""
    ramp, level, end = uniform(rig, begin, speed, abs(speed), inertia)
    return Step(np.concatenate([ramp, level]), controller), end


def rough_inertia(rig: Rig) -> Generator[Step, Array, tuple[float, float]]:
    """Estimate roughly the inertia and the torque that moves the axis, without prior knowledge.

    A ramp gives the torque at which it moves; a push of twice that and the coasting after it give an acceleration and a
    deceleration. Their sum is the push divided by the inertia, independent of friction.
    """
    dt, top = rig.sample_time, ROOM * rig.limits.torque
    rows = yield Step(setpoints(round(2.0 / dt), torque=np.linspace(0.0, top, round(2.0 / dt))), travel=0.05)
    moved = abs(float(rows[-1, POSITION] - rows[0, POSITION]))
    if moved < 0.04:
        raise RigError(
            f"{rig.name} does not move at {top:.3g} N·m; loosen its brake or raise its torque limit"
        )
    torque = top * len(rows) / round(2.0 / dt)
    yield Step(setpoints(round(0.5 / dt)), pause=0.2)
    push = min(2.0 * torque, top)
    run = yield Step(setpoints(round(1.0 / dt), torque=push), travel=0.3)
    coast = yield Step(setpoints(max(20, round(0.6 / dt))))
    inertia = push / (_acceleration(run[len(run) // 4 :, POSITION], dt) + _braking(coast[:, POSITION], dt))
    yield Step(setpoints(round(0.1 / dt)), pause=0.5)
    return inertia, torque


def _acceleration(position: Array, dt: float) -> float:
    t = dt * np.arange(position.size)
    return max(2.0 * float(_parabola(t, position)[0]), 1e-9)


def _braking(position: Array, dt: float) -> float:
    """Return the deceleration while it coasts, from the part before it stops."""
    total = float(position[-1] - position[0])
    moving = np.flatnonzero(np.abs(position - position[0]) < 0.85 * abs(total))
    part = position[: max(int(moving[-1]) + 1 if moving.size else 0, 6)]
    t = dt * np.arange(part.size)
    return max(-2.0 * float(_parabola(t, part)[0]), 0.0)


def _parabola(t: Any, position: Array) -> Array:
    return np.asarray(np.polyfit(t, position - position[0], 2), dtype=np.float64)
