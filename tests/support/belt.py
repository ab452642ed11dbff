"""A motor and a load on a belt, moved in plain steps: nothing of the package's engines takes part."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from stickslip.identification.experiment import Experiment

MOTOR, LOAD, STEP, EVERY = 3e-4, 5e-4, 5e-5, 20


def reference(t: float) -> tuple[float, float]:
    """Moves there and back with ramps of 0.12 s at three speeds, rad and rad/s."""
    speed = (20.0, 50.0, 110.0)[int(t / 1.6) % 3]
    phase, side = (t % 0.8) / 0.8, 1.0 if (t % 1.6) < 0.8 else -1.0
    ramp = min(1.0, phase / 0.15, (0.9 - phase) / 0.15) if phase < 0.9 else 0.0
    return 0.0, side * speed * max(ramp, 0.0)


def driven(frequency: float, friction: Callable[[float], float], seconds: float = 9.6) -> Experiment:
    """A motor on a spring of a load that swings so often a second with the motor held, under velocity control."""
    stiffness = LOAD * (2.0 * math.pi * frequency) ** 2
    damping = 0.1 * math.sqrt(stiffness * LOAD)
    q, v, x, w, gone, torque = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    rows: list[tuple[float, float, float]] = []
    noise = np.random.default_rng(5).standard_normal(round(seconds / STEP / EVERY) + 1)
    for k in range(round(seconds / STEP)):
        t = k * STEP
        if k % EVERY == 0:
            wanted = reference(t)[1]
            gone += (wanted - v) * STEP * EVERY
            torque = 0.02 * (wanted - v) + 0.2 * gone
            rows.append((t, q, torque + 1e-4 * noise[k // EVERY]))
        spring = stiffness * (q - x) + damping * (v - w)
        v += STEP * (torque - spring - friction(v)) / MOTOR
        w += STEP * spring / LOAD
        q += STEP * v
        x += STEP * w
    time, position, drive = np.array(rows).T
    return Experiment("belt", time, position, drive)


def coulomb(v: float) -> float:
    """0.2 N·m and 0.8 mN·m·s/rad, the sign rounded within 0.05 rad/s."""
    return 0.2 * math.tanh(v / 0.05) + 8e-4 * v


def followed(
    frequency: float, gains: tuple[float, float], feedforward: Callable[[float, float], float], at_load: bool,
    amplitude: float = 3.0, turns: float = 0.5, seconds: float = 4.0,
) -> float:  # fmt: skip
    """RMS error, rad, of a PD controller (N·m/rad, N·m·s/rad; velocity by differences) on 1 - cos of so many turns a
    second, behind the first; `feedforward` takes the reference's velocity and acceleration, friction acts at the load
    or at the motor."""
    stiffness = LOAD * (2.0 * math.pi * frequency) ** 2
    damping = 0.1 * math.sqrt(stiffness * LOAD)
    q, v, x, w, torque, last = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    left: list[float] = []
    for k in range(round(seconds / STEP)):
        if k % EVERY == 0:
            t, turn = k * STEP, 2.0 * math.pi * turns
            wanted = amplitude * (1.0 - math.cos(turn * t))
            speed, rise = amplitude * turn * math.sin(turn * t), amplitude * turn * turn * math.cos(turn * t)
            torque = gains[0] * (wanted - q) + gains[1] * (speed - (q - last) / (EVERY * STEP))
            torque, last = torque + feedforward(speed, rise), q
            if t > 1.0 / turns:
                left.append(wanted - q)
        spring = stiffness * (q - x) + damping * (v - w)
        v += STEP * (torque - spring - (0.0 if at_load else coulomb(v))) / MOTOR
        w += STEP * (spring - (coulomb(w) if at_load else 0.0)) / LOAD
        q += STEP * v
        x += STEP * w
    return float(np.sqrt(np.mean(np.square(left))))
