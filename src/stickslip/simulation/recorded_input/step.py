"""One implicit step of an axis that a drive moves: what output-error identification simulates.

The axis obeys M dv/dt = T_drive - T_gravity - offset - F, with F from any law through its ``step``. Each step is
Alexander's SDIRK of order 2 (Alexander 1977, SIAM J. Numer. Anal. 14): two stages of backward Euler over which
the law sees a constant velocity. It is L-stable, so that a contact stiffer than the step resolves comes to rest
instead of ringing, and a fit may try any stiffness. A law whose torque jumps at zero velocity holds the axis
while the impulse of the stage lies within what it withstands.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import call_holding, call_step, kernel

GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
ROUNDING = 1e-11  # of the velocity, relative above 1e-2

# ---- the plant's numbers ----------------------------------------------------------------------------------
(
    INERTIA, OFFSET, GRAVITY, GRAVITY_ANGLE, DRIVE_GAIN, BACK_EMF, LOAD_MOTOR, LOAD_EXTERNAL, BACKLASH,
    SCALED_BY_LOAD, PERIOD, HARMONICS, PUSH, LOSS, FOURIER,
) = range(15)  # fmt: skip
# PUSH is a torque from outside that no gearing carries (an observer's), LOSS all damping: the back-EMF's and that.
# From FOURIER on: for each harmonic the cosine's and sine's torque, then the cosine's and sine's share of friction.


class Plant(NamedTuple):
    """What a step reads besides the state, and scratch for the law's state.

    All but the whole numbers are addresses: arrays in a tuple would count references at every access, which took
    half of a step's time.
    """

    numbers: Any
    step: int
    holding: int
    parameters: Any
    surroundings: Any
    base: Any
    trial: Any
    slopes: Any
    states: int


@kernel(inline=True)
def harmonics(n: Any, q: float, first: int) -> float:
    """Sum of the Fourier series that starts at column `first` (0: torque, 2: share of friction)."""
    total = 0.0
    for i in range(int(n[HARMONICS])):
        angle = 2.0 * math.pi * (i + 1) * q / n[PERIOD]
        at = FOURIER + 4 * i + first
        total += n[at] * math.cos(angle) + n[at + 1] * math.sin(angle)
    return total


@kernel(inline=True)
def outer(n: Any, q: float) -> float:
    """Torque that position alone makes, opposing motion in the positive direction: gravity, offset, cogging."""
    torque = n[OFFSET]
    if n[GRAVITY] != 0.0:
        torque += n[GRAVITY] * math.sin(q - n[GRAVITY_ANGLE])
    if n[HARMONICS] > 0.0:
        torque += harmonics(n, q, 0)
    return torque


@kernel(inline=True)
def share(n: Any, q: float) -> float:
    """Factor on friction from the position."""
    return 1.0 + harmonics(n, q, 2) if n[HARMONICS] > 0.0 else 1.0


@kernel(inline=True)
def load_of(n: Any, q: float, v: float, drive: float) -> float:
    """Load on the contact over the load at which its parameters hold: it grows with the torques that meet in it."""
    if n[LOAD_MOTOR] == 0.0 and n[LOAD_EXTERNAL] == 0.0:
        return 1.0
    motor = drive - n[BACK_EMF] * v
    return 1.0 + abs(n[LOAD_MOTOR] * motor + n[LOAD_EXTERNAL] * outer(n, q))


@kernel(inline=True)
def friction(plant: Plant, z0: Any, v: float, h: float, factor: float) -> float:
    """Torque of the contact after a step at constant velocity from the state z0; ``trial`` holds its new state."""
    for i in range(plant.states):
        plant.trial[i] = z0[i]
    return factor * call_step(plant.step, v, v, h, plant.trial, plant.parameters, plant.surroundings)


@kernel(inline=True)
def unbalance(
    plant: Plant, z0: Any, q0: float, v0: float, drive: float, h: float, factor: float, v: float
) -> float:
    """M (v - v0) - h (torques at the end of the stage): zero at the velocity that solves it."""
    n = plant.numbers
    applied = drive - n[LOSS] * v - outer(n, q0 + h * v)
    return n[INERTIA] * (v - v0) - h * (applied - friction(plant, z0, v, h, factor))


@kernel()
def stage(
    plant: Plant,
    z0: Any,
    q0: float,
    v0: float,
    drive: float,
    h: float,
    factor: float,
    guess: float,
    which: int,
) -> float:
    """The velocity after a stage of backward Euler from (q0, v0, z0); ``trial`` holds the law's new state.

    ``which`` is the stage's place in ``slopes``: how the unbalance rose with the velocity when it was last solved.
    """
    n = plant.numbers
    if plant.holding != 0:
        impulse = n[INERTIA] * v0 + h * (drive - outer(n, q0))
        side = 1.0 if impulse > 0.0 else -1.0
        held = factor * call_holding(plant.holding, side, z0, plant.parameters, plant.surroundings)
        if abs(impulse) <= h * held:
            friction(plant, z0, 0.0, h, factor)
            return 0.0
        # The unbalance jumps at rest: on this side of it lies the root.
        near, f_near = 0.0, side * h * held - impulse
        if guess * side <= 0.0:
            guess = (impulse - side * h * held) / n[INERTIA]
        x = guess
    else:
        near = guess
        f_near = unbalance(plant, z0, q0, v0, drive, h, factor, near)
        if f_near == 0.0:
            return near
        x = near - f_near / plant.slopes[which]
    f = unbalance(plant, z0, q0, v0, drive, h, factor, x)
    # Away from `near` until the sign changes, by secants that lead at least as far again, at most ten times.
    for _ in range(60):
        if f * f_near <= 0.0 or solved(plant, f, x):
            break
        stride = x - near
        onwards = -f * stride / (f - f_near)
        ratio = onwards / stride
        near, f_near = x, f
        x += stride * (min(ratio * 1.1, 10.0) if ratio > 0.0 else 10.0)
        f = unbalance(plant, z0, q0, v0, drive, h, factor, x)
    return narrow(plant, z0, q0, v0, drive, h, factor, near, f_near, x, f, which)


@kernel(inline=True)
def solved(plant: Plant, f: float, v: float) -> bool:
    """Whether an unbalance is small enough; one that is not finite ends the search too."""
    return abs(f) <= plant.numbers[INERTIA] * ROUNDING * max(1e-2, abs(v)) or not math.isfinite(f)


@kernel()
def narrow(
    plant: Plant, z0: Any, q0: float, v0: float, drive: float, h: float, factor: float,
    other: float, f_other: float, x: float, f: float, which: int,
) -> float:  # fmt: skip
    """Root between two velocities of opposite unbalance: secants, and the middle where they do not help."""
    last, f_last = other, f_other
    for _ in range(200):
        if solved(plant, f, x) or abs(x - other) <= ROUNDING * max(1e-2, abs(x)):
            break
        new = x - f * (x - last) / (f - f_last)
        if not min(x, other) < new < max(x, other) or abs(f) > 0.5 * abs(f_last):
            new = 0.5 * (x + other)
        last, f_last = x, f
        x = new
        f = unbalance(plant, z0, q0, v0, drive, h, factor, x)
        if f * f_last < 0.0:
            other, f_other = last, f_last
    if f != f_last:
        rise = (f - f_last) / (x - last)
        if rise > 0.0 and math.isfinite(rise):
            plant.slopes[which] = rise
    return x


@kernel()
def advance(plant: Plant, state: Any, z: Any, drive: float, rate: float, h: float) -> None:
    """Move ``state`` (position, velocity) and the law's state z on by h.

    ``drive`` is the torque of the drive at standstill at the begin, ``rate`` its slope in time.
    """
    n = plant.numbers
    q, v = state[0], state[1]
    u = plant.surroundings
    u[0], u[1] = q, load_of(n, q, v, drive)
    factor = share(n, q) * (u[1] if n[SCALED_BY_LOAD] != 0.0 else 1.0)
    _, state[0], state[1] = two_stages(plant, z, q, v, drive + n[PUSH], rate, h, factor)


@kernel()
def two_stages(
    plant: Plant, z: Any, q: float, v: float, total: float, rate: float, h: float, factor: float
) -> tuple[float, float, float]:
    """The step from (q, v, z) under a torque that runs from `total` at `rate`: velocity of the first stage, position
    and velocity at the end; z is moved on."""
    part, rest = GAMMA * h, (1.0 - GAMMA) * h
    middle = stage(plant, z, q, v, total + rate * part, part, factor, v, 0)
    ratio = rest / part
    # The second stage starts from the begin, moved on for `rest` with the slopes of the first.
    for i in range(plant.states):
        plant.base[i] = z[i]
    friction(plant, plant.base, middle, rest, factor)
    for i in range(plant.states):
        plant.base[i] = plant.trial[i]
    q_base = q + rest * middle
    v_base = v + ratio * (middle - v)
    end = stage(plant, plant.base, q_base, v_base, total + rate * h, part, factor, middle + (middle - v), 1)
    for i in range(plant.states):
        z[i] = plant.trial[i]
    return middle, q_base + part * end, end
