"""Simulated records of axes whose truth is known, as a careful engineer would take them, for the coverage study.

Every record is a closed loop (PD or PID at 1 kHz, on an encoder's counts) that follows velocity levels in both
directions, in random order, and fast moves. Drawn at random: inertia, offset, the law's parameters, levels, ramps,
gains, encoder, a coloured disturbance torque on the axis (first-order autoregression, 0.5 to 2 % of Fc, 2 to 30 ms),
and coloured noise of the recorded torque (0.3 to 1 % of Fc). Slow levels may stick and slip: they are kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from stickslip.control.linear import place
from stickslip.core.record import Record
from stickslip.models.model import Model
from stickslip.models.plugins import law
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

__all__ = ["FAMILIES", "Case", "make"]

FAMILIES = ("coulomb", "stribeck", "lugre", "gms", "dahl")
PERIOD = 1e-3
COUNTS = (4096 * 4, 4096 * 16, 1_000_000)
FINE = 1e-4
"""Longest step of the simulation, s."""
STUCK, SELDOM = 0.1, 0.05
"""Part of a level below which the axis sticks there; part of the time that it may do so and still keep the level."""


@dataclass(frozen=True, eq=False)
class Case:
    """A record and its truth.

    Attributes
    ----------
    family : str
    model : Model
        The true law.
    truth : mapping of str to float
        True values by the names of the estimates: ``inertia``, ``offset``, ``fc``, ``k[0]``.
    record : Record
        Position (counted) and torque.
    slow_levels : int
        Velocity levels below twice the Stribeck velocity that the reference asks for.
    slow_held : int
        Those of them that the axis kept, in both directions: where it sticks and slips it has no such speed.
    """

    family: str
    model: Model
    truth: Mapping[str, float]
    record: Record
    slow_levels: int
    slow_held: int


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def coloured(rng: np.random.Generator, n: int, std: float, memory: float) -> Any:
    """First-order autoregression of a given standard deviation that forgets within `memory` seconds."""
    a = math.exp(-PERIOD / memory)
    start = [a * rng.standard_normal()]
    return std * lfilter([math.sqrt(1.0 - a * a)], [1.0, -a], rng.standard_normal(n), zi=start)[0]


def programme(levels: Any, dwell: Any, acceleration: float, moves: int, top: float) -> Any:
    """Velocity at every sample: each level in both directions, then fast moves, with raised-cosine ramps."""
    holds = [(sign * v, d) for v, d in zip(levels, dwell, strict=True) for sign in (1.0, -1.0)]
    holds += [(sign * top, 0.15) for _ in range(moves) for sign in (1.0, -1.0)]
    parts, last = [np.zeros(200)], 0.0
    for v, d in [*holds, (0.0, 0.2)]:
        k = max(2, math.ceil(abs(v - last) * 0.5 * math.pi / acceleration / PERIOD))
        ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(k) / k)
        parts += [last + (v - last) * ramp, np.full(int(d / PERIOD), v)]
        last = v
    return np.concatenate(parts)


def law_of(rng: np.random.Generator, family: str, inertia: float, sliding: Mapping[str, float]) -> Model:
    """The family's law with a random behaviour before it slides."""
    fc, fs, vs, sigma2 = (sliding[k] for k in ("fc", "fs", "vs", "sigma2"))
    if family == "coulomb":
        return Model(family, fc=fc, sigma2=sigma2)
    if family == "stribeck":
        return Model(family, **sliding, k=fs / (0.01 * vs))
    if family == "lugre":
        sigma0 = fs / log_uniform(rng, 1e-4, 1e-3)
        return Model(family, **sliding, sigma0=sigma0, sigma1=0.1 * math.sqrt(sigma0 * inertia))
    if family == "gms":
        reach = log_uniform(rng, 2e-4, 2e-3)
        return Model(
            family, **sliding, k=[1.6 * fs / reach, 0.9 * fs / reach, 0.35 * fs / reach], alpha=[0.4, 0.35, 0.25],
            c=fc / log_uniform(rng, 0.01, 0.05),
        )  # fmt: skip
    return Model(family, fc=fc, sigma2=sigma2, sigma0=fc / log_uniform(rng, 1e-4, 1e-3))


def make(seed: int, family: str = "", *, repeat: int = 0, coulomb: float = 1.0, rows: int = 0) -> Case:
    """The record of a seed; its family goes round with the seed unless it is given.

    Another `repeat` is the same motion of the same axis with other noise; `coulomb` is a factor on its Coulomb torque.
    With `rows` the programme of velocities is gone through again until the record has so many.
    """
    rng = np.random.default_rng([2026, seed])
    family = family or FAMILIES[seed % len(FAMILIES)]
    inertia, fc = log_uniform(rng, 3e-4, 5e-3), log_uniform(rng, 0.1, 0.6)
    top, vs = log_uniform(rng, 4.0, 12.0), log_uniform(rng, 0.03, 0.3)
    sliding = {
        "fs": fc * rng.uniform(1.15, 1.6),
        "fc": fc,
        "vs": vs,
        "sigma2": fc * rng.uniform(0.2, 1.0) / top,
    }
    offset = fc * rng.uniform(-0.1, 0.1)
    friction = law_of(rng, family, inertia, sliding)
    if coulomb != 1.0:
        friction = Model(friction.law, **{**friction.parameters._asdict(), "fc": coulomb * fc})
    levels = np.geomspace(vs * log_uniform(rng, 0.15, 2.0), top, int(rng.integers(6, 10)))
    velocity = programme(
        rng.permutation(levels), rng.uniform(0.4, 0.9, levels.size), fc * rng.uniform(0.5, 2.0) / inertia,
        int(rng.integers(3, 6)), top,
    )  # fmt: skip
    if rows:
        velocity = np.tile(velocity, math.ceil(rows / velocity.size))[:rows]
    position = np.concatenate([[0.0], np.cumsum(0.5 * PERIOD * (velocity[1:] + velocity[:-1]))])
    time = PERIOD * np.arange(position.size)
    gains = place(("PD", "PID")[int(rng.integers(2))], inertia, rng.uniform(10.0, 25.0), 1.0)
    count = 2.0 * math.pi / float(rng.choice(COUNTS))
    if repeat:
        rng = np.random.default_rng([2026, seed, repeat])
    disturbance = coloured(rng, time.size, fc * rng.uniform(0.005, 0.02), log_uniform(rng, 2e-3, 3e-2))
    noise = coloured(rng, time.size, fc * rng.uniform(0.003, 0.01), log_uniform(rng, 1e-3, 5e-3))
    out = drive_axis(
        Mechanics(inertia, offset=offset), friction,
        Drive(time, position, "feedback", Loop(gains.kp, gains.ki, gains.kd, gains.kr, count=count),
              disturbance=disturbance, max_step=FINE),
    )  # fmt: skip
    record = Record(
        time,
        {"position": count * np.floor(out[:, 0] / count + 0.5), "torque": out[:, 2] + noise},
        {"position": "rad", "torque": "N·m"},
        {"encoder_resolution": count, "seed": seed},
    )
    return Case(
        family,
        friction,
        {"inertia": inertia, "offset": offset, **numbers(friction)},
        record,
        int(np.sum(levels < 2.0 * vs)),
        sum(kept(velocity, out[:, 1], x) for x in levels[levels < 2.0 * vs]),
    )


def kept(wanted: Any, actual: Any, level: float) -> bool:
    """Whether the axis kept a level in both directions instead of sticking."""
    return all(
        float(np.mean(sign * actual[wanted == sign * level] < STUCK * level)) <= SELDOM
        for sign in (1.0, -1.0)
    )


def numbers(model: Model) -> dict[str, float]:
    """Every number of a model by the name of its estimate."""
    out: dict[str, float] = {}
    for name, value in model.parameters._asdict().items():
        out |= {f"{name}[{i}]": v for i, v in enumerate(value)} if isinstance(value, tuple) else {name: value}
    return out


def known_parameters(family: str) -> tuple[str, ...]:
    """Names of the law's parameters that a careful engineer leaves at their default."""
    return tuple(f.name for f in law(family).fields if f.name in ("delta_s", "delta_d"))
