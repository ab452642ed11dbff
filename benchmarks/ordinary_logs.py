"""Logs of ordinary drives, made by plain code of its own: no engine, law or controller of the package takes part.

An axis with a LuGre contact, a constant torque and viscous friction is driven by a P-PI cascade, a PID or a cascade
with feedforward, in fixed steps of 20 us. What a drive writes down is imitated: four kinds of torque column, three
rates, four motions, five imperfections. `draw(seed, ...)` gives one log and the truth behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

STEP = 2e-5  # s
COLUMNS = ("held", "commanded", "actual", "mean")
"""Torque columns: the command, held exactly from row to row; a command that acts behind a current loop; the actual
torque
at the instant of the row; and its mean over the row before."""
RATES = (1000, 500, 250)  # rows a second
LOOPS = ("p-pi", "pid", "feedforward")
MOTIONS = ("production", "sine", "staircase", "steps")
IMPERFECTIONS = ("clean", "cogging", "backlash", "flexible", "asymmetry")


@dataclass(frozen=True, eq=False)
class Machine:
    """What `simulate` needs of an axis, and what its drive is made for.

    Attributes
    ----------
    axis, orders, sizes : array
        As `simulate` takes them (``cog_order``, ``cog_size``).
    encoder : float
        rad, its step.
    limit, fastest, acceleration : float
        Of the drive: N·m, rad/s, rad/s².
    """

    axis: Array
    orders: Array
    sizes: Array
    encoder: float
    limit: float
    fastest: float
    acceleration: float


@dataclass(frozen=True, eq=False)
class Log:
    """One log, and what is true of the axis that made it.

    Attributes
    ----------
    time, position, reference, torque : array, shape (n,)
        s, rad, rad, N·m: what the drive writes down.
    truth : dict
        ``inertia``, ``offset`` (with half the difference of both directions, which is the same thing), ``fc``,
        ``fs``, ``vs``, ``sigma2``, ``sigma0`` in SI units, and ``skew``: s by which the torque column lies behind
        the torque that acted, on average (negative: ahead of it).
    about : dict
        Which column, rate, loop, motion and imperfection, and the seed.
    machine : Machine
        The axis itself.
    """

    time: Array
    position: Array
    reference: Array
    torque: Array
    truth: dict[str, float]
    about: dict[str, Any]
    machine: Machine

    def frame(self) -> dict[str, Array]:
        """Columns with headers that state their units."""
        return {
            "time [s]": self.time, "position [rad]": self.position,
            "position_reference [rad]": self.reference, "motor_torque [N·m]": self.torque,
        }  # fmt: skip


# ---- the simulator ------------------------------------------------------------------------------------------------


@numba.njit(cache=True)
def bristle(z, v, fc, ratio, vs, sigma0, sigma1, sigma2, exponent):
    """LuGre's deflection after a step at constant velocity, exactly, and the torque."""
    power = (v / vs) ** 2 if exponent == 2.0 else abs(v / vs) ** exponent
    goal = fc * (1.0 + (ratio - 1.0) * math.exp(-power)) / sigma0
    after = math.copysign(goal, v)
    after += (z - after) * math.exp(-abs(v) * 2e-5 / goal)
    return after, sigma0 * after + sigma1 * (after - z) / 2e-5 + sigma2 * v


@numba.njit(cache=True)
def simulate(axis, loop, reference, control_steps, row_controls, encoder, cog_order, cog_size):
    """Position, reference and three torque columns, a row each `row_controls` control periods of `control_steps` steps.

    axis: motor and load inertia, coupling stiffness and damping, gap, offset, Fc+, Fc-, Fs/Fc, vs, sigma0, sigma1,
    sigma2, current loop's time constant, the load's share of friction, exponent of friction's fall. loop: kp, kv, ki
    of the position P or PID, velocity filter's share, limit, acceleration, velocity and friction feedforward, 1 for a
    PID.
    """
    jm, jl, stiff, damp, gap, offset, fc_up, fc_down, ratio, vs, sigma0, sigma1, sigma2, lag, at_load = axis[
        :15
    ]
    exponent = axis[15]
    kp, kv, ki, share, limit, ff_a, ff_v, ff_f, is_pid = loop
    h = 2e-5
    period = control_steps * h
    rows = reference.shape[0] // row_controls
    out = np.zeros((rows, 5))
    q, v, z, ql, vl, zl = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    actual, summed, command = 0.0, 0.0, 0.0
    measured_before = math.floor(0.0 / encoder) * encoder
    speed, integral = 0.0, 0.0
    decay = math.exp(-h / lag) if lag > 0.0 else 0.0
    for k in range(rows * row_controls):
        measured = math.floor(q / encoder) * encoder
        raw = (measured - measured_before) / period
        measured_before = measured
        speed += share * (raw - speed)
        r = reference[k]
        error = r[0] - measured
        if is_pid > 0.5:
            integral += ki * error * period
            wanted = kp * error + integral + kv * (r[1] - speed)
        else:
            slip = kp * error + r[1] * (1.0 if ff_v > 0.0 else 0.0) - speed
            integral += ki * slip * period
            wanted = kv * slip + integral
        wanted += ff_a * r[2] + ff_f * math.tanh(r[1] / (0.2 * vs)) + ff_v * r[1]
        command = min(max(wanted, -limit), limit)
        integral = min(max(integral, -limit), limit)
        if k % row_controls == 0:
            row = k // row_controls
            out[row, 0], out[row, 1], out[row, 2] = measured, r[0], command
            out[row, 3] = actual if lag > 0.0 else command
            out[row, 4] = summed / (row_controls * control_steps)
            summed = 0.0
        for _ in range(control_steps):
            actual = command + (actual - command) * decay
            summed += actual
            z, contact = bristle(
                z, v, fc_up if v > 0.0 else fc_down, ratio, vs, sigma0, sigma1, sigma2, exponent
            )
            contact *= 1.0 - at_load
            for i in range(cog_order.shape[0]):
                contact += cog_size[i, 0] * math.sin(cog_order[i] * q + cog_size[i, 1])
            spring = 0.0
            if jl > 0.0:
                twist = q - ql
                if twist > 0.5 * gap:
                    spring = stiff * (twist - 0.5 * gap) + damp * (v - vl)
                elif twist < -0.5 * gap:
                    spring = stiff * (twist + 0.5 * gap) + damp * (v - vl)
                zl, drag = bristle(
                    zl, vl, fc_up if vl > 0.0 else fc_down, ratio, vs, sigma0, sigma1, sigma2, exponent
                )
                vl += h * (spring - at_load * drag) / jl
                ql += h * vl
            v += h * (actual - contact - offset - spring) / jm
            q += h * v
    return out


# ---- what is simulated --------------------------------------------------------------------------------------------


def profile(distance: float, speed: float, acceleration: float, dt: float) -> Array:
    """Velocities of a move with a trapezoidal velocity, its corners rounded over a tenth of its ramp; rad/s."""
    ramp = speed / acceleration
    if abs(distance) < speed * ramp:
        ramp = math.sqrt(abs(distance) / acceleration)
    cruise = max(0.0, abs(distance) / (acceleration * ramp) - ramp)
    t = np.arange(0.0, 2.0 * ramp + cruise + dt, dt)
    v = acceleration * np.clip(np.minimum(t, 2.0 * ramp + cruise - t), 0.0, ramp)
    width = max(1, round(0.2 * ramp / dt))
    v = np.convolve(np.pad(v, width), np.ones(width) / width, "same")
    return math.copysign(1.0, distance) * v * abs(distance) / max(v.sum() * dt, 1e-12)


def motion(
    kind: str, rng: np.random.Generator, fastest: float, acceleration: float, duration: float, dt: float
) -> Array:
    """Reference position, velocity and acceleration at every control period, shape (n, 3)."""
    n = round(duration / dt)
    velocity: list[Array] = [np.zeros(round(0.3 / dt))]
    made, place = velocity[0].size, 0.0
    if kind == "sine":
        frequency = rng.uniform(0.15, 0.5)
        t = np.arange(n) * dt
        swing = rng.uniform(0.05, 0.3) * fastest / (2.0 * math.pi * frequency)
        velocity = [swing * 2.0 * math.pi * frequency * np.sin(2.0 * math.pi * frequency * t)]
    else:
        levels = fastest * np.array([1.0, 0.5, 0.2, 0.08, 0.03, 0.01])
        number = 0
        while made < n:
            if kind == "production":
                far = rng.uniform(0.3, 4.0) * (-1.0 if place > 0.0 else 1.0)
                part = profile(far, fastest * rng.choice([1.0, 0.6, 0.3]), acceleration, dt)
                rest = np.zeros(round(rng.uniform(0.05, 0.4) / dt))
            elif kind == "staircase":
                speed = levels[(number // 2) % levels.size] * (1.0 if number % 2 == 0 else -1.0)
                far = speed * (0.8 if abs(speed) > 0.1 * fastest else 1.6)
                part = profile(far, abs(speed), 0.5 * acceleration, dt)
                rest = np.zeros(round(0.1 / dt))
            else:
                size = rng.choice([0.02, 0.05, 0.2]) * (1.0 if number % 2 == 0 else -1.0)
                part = profile(size, 4.0 * fastest, 20.0 * acceleration, dt)
                rest = np.zeros(round(rng.uniform(0.3, 0.5) / dt))
            place += part.sum() * dt
            number += 1
            velocity += [part, rest]
            made += part.size + rest.size
    v = np.concatenate(velocity)[:n]
    return np.column_stack([np.cumsum(v) * dt, v, np.gradient(v, dt)])


def draw(
    seed: int, column: str = "actual", rate: int = 1000, loop: str = "p-pi", moves: str = "production",
    imperfection: str = "clean", duration: float = 12.0, orders: tuple[int, ...] = (),
    exponent: float = 2.0,
) -> Log:  # fmt: skip
    """One random axis, its drive and its log; `orders` are those of the cogging a revolution where they are given,
    `exponent` is the power of v/vs with which friction falls."""
    rng = np.random.default_rng(seed)
    inertia = 10.0 ** rng.uniform(-4.2, -2.2)
    fastest, acceleration = rng.uniform(5.0, 40.0), rng.uniform(60.0, 400.0)
    fc = rng.uniform(0.1, 0.8) * inertia * acceleration
    ratio, vs = rng.uniform(1.1, 1.5), fastest * 10.0 ** rng.uniform(-2.3, -1.2)
    reach = 10.0 ** rng.uniform(-4.2, -3.0)
    sigma0 = min(fc * ratio / reach, inertia * (2.0 * math.pi * 800.0) ** 2)
    sigma1 = rng.uniform(0.2, 0.8) * 2.0 * math.sqrt(sigma0 * inertia)
    sigma2 = rng.uniform(0.05, 0.6) * fc / fastest
    offset = rng.uniform(-0.3, 0.3) * fc
    uneven = 0.06 * rng.choice([-1.0, 1.0]) if imperfection == "asymmetry" else 0.0
    load = rng.uniform(0.3, 0.6) if imperfection in ("backlash", "flexible") else 0.0
    mode = (
        2.0
        * math.pi
        * (rng.uniform(40.0, 120.0) if imperfection == "flexible" else rng.uniform(100.0, 200.0))
    )
    jl, jm = load * inertia, (1.0 - load) * inertia
    stiff = mode**2 * jl * jm / inertia
    gap = rng.uniform(0.002, 0.02) if imperfection == "backlash" else 0.0
    lag = 0.0 if column == "held" else rng.uniform(0.2e-3, 0.5e-3)
    axis = np.array([
        jm, jl, stiff, 2.0 * 0.03 * mode * jl * jm / inertia, gap, offset, fc * (1.0 + 0.5 * uneven), fc * (1.0 - 0.5
        * uneven), ratio, vs, sigma0, sigma1, sigma2, lag, 0.5 if load else 0.0, exponent,
    ])  # fmt: skip
    period = 1.0 / rate if column == "held" else 1e-3
    controls = 1 if column == "held" else 1000 // rate
    slower = min(1.0, 2e-3 / (period + 1e-3)) * (0.5 if load else 1.0)
    limit = 4.0 * (inertia * acceleration + fc * ratio + abs(offset) + sigma2 * fastest)
    gains = controller(loop, rng, slower, inertia, fc, sigma2, limit)
    reference = motion(moves, rng, fastest, acceleration, duration, period)
    if imperfection == "cogging":
        order = np.array(orders or rng.choice(np.arange(1, 51), 3, replace=False), dtype=np.float64)
        size = np.column_stack([0.1 * fc / np.arange(1, order.size + 1), rng.uniform(0.0, 6.28, order.size)])
    else:
        order, size = np.zeros(0), np.zeros((0, 2))
    counts = 2.0 ** rng.integers(17, 21)
    out = simulate(
        axis, gains, reference, round(period / STEP), controls, 2.0 * math.pi / counts, order, size
    )
    torque = out[:, {"held": 2, "commanded": 2, "actual": 3, "mean": 4}[column]]
    if column in ("actual", "mean"):
        torque = torque + 0.005 * limit / 4.0 * rng.standard_normal(torque.size) / (
            1.0 if column == "actual" else 2.0
        )
    # A command acts half a period and the current loop's lag after its row; what is sampled at the end of each step of
    # the command stands for a mean that was earlier.
    acts = 0.5 * period + lag
    sampled = period / (1.0 - math.exp(-period / lag)) if lag > 0.0 else period
    skew = {"held": -acts, "commanded": -acts, "actual": sampled - acts, "mean": 0.5 / rate}[column]
    return Log(
        np.arange(out.shape[0]) / rate, out[:, 0], out[:, 1], torque,
        {"inertia": inertia, "offset": offset + 0.5 * uneven * fc, "fc": fc, "fs": fc * ratio, "vs": vs, "sigma2":
        sigma2, "sigma0": sigma0,
         "skew": skew},
        {"seed": seed, "column": column, "rate": rate, "loop": loop, "motion": moves, "imperfection": imperfection},
        Machine(axis, order, size, 2.0 * math.pi / counts, limit, fastest, acceleration),
    )  # fmt: skip


def controller(
    loop: str, rng: np.random.Generator, slower: float, inertia: float, fc: float, sigma2: float, limit: float
) -> Array:
    """Gains of a drive tuned as drives are."""
    share = rng.choice([1.0, 0.5, 0.3])
    if loop == "pid":
        w = 2.0 * math.pi * rng.uniform(5.0, 12.0) * slower
        return np.array(
            [3.0 * inertia * w**2, 3.0 * inertia * w, inertia * w**3, share, limit, 0.0, 0.0, 0.0, 1.0]
        )
    w = 2.0 * math.pi * rng.uniform(15.0, 40.0) * slower
    kv, ki, kp = inertia * w, inertia * w * w / 4.0, w / 4.0
    if loop == "p-pi":
        return np.array([kp, kv, ki, share, limit, 0.0, 0.0, 0.0, 0.0])
    return np.array(
        [kp, kv, ki, share, limit, inertia * rng.uniform(0.7, 1.1), sigma2, fc * rng.uniform(0.5, 1.0), 0.0]
    )
