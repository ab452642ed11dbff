"""Simulated records of a known axis: closed loop, counted position, coloured torque noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip import Model, Record
from stickslip.identification.experiment import Experiment
from stickslip.models.plugins import law
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis

INERTIA, FC, SIGMA2 = 4e-4, 0.285, 0.018  # thesis Tables 1 and 4, about
COUNT = 2.0 * math.pi / 65536.0
LOOP = Loop(kp=8.0, kd=0.08, kr=0.08, limit=3.0)

LAWS: dict[str, dict[str, Any]] = {
    "coulomb": {"fc": FC, "sigma2": SIGMA2},
    "stribeck": {"k": 50.0, "sigma2": SIGMA2, "fs": 0.335, "fc": FC, "vs": 0.1},
    "lugre": {"sigma0": 300.0, "sigma1": 0.1, "sigma2": SIGMA2, "fs": 0.335, "fc": FC, "vs": 0.1},
    "gms": {
        "k": [150.0, 100.0],
        "alpha": [0.5, 0.5],
        "c": 50.0,
        "sigma2": SIGMA2,
        "fs": 0.335,
        "fc": FC,
        "vs": 0.1,
    },
}


def model(name: str) -> Model:
    return Model(law(name), **LAWS[name])


def wanted(time: Any, seed: int) -> Any:
    """Sums of slow and fast sinusoids from rest: many speeds, many reversals."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 2.0 * math.pi, 4)
    parts = ((0.6, 0.2), (0.5, 0.7), (0.2, 1.9), (0.05, 4.3))
    return sum(
        (
            a * (np.sin(2.0 * math.pi * f * time + p) - math.sin(p))
            for (a, f), p in zip(parts, phase, strict=True)
        ),
        np.zeros(time.size),
    )


def experiment(
    name: str,
    seed: int = 0,
    seconds: float = 6.0,
    offset: float = 0.03,
    noise: float = 0.01,
    drift: float = 0.0,
    **mechanics: Any,
) -> Experiment:
    """One record; `noise` is the standard deviation of a torque with a time constant of 5 ms, N·m."""
    time = np.arange(0.0, seconds, 1e-3) + 0.0
    rng = np.random.default_rng(1000 + seed)
    if drift > 0.0:
        time = np.cumsum(1e-3 * (1.0 + drift * rng.uniform(-1.0, 1.0, time.size)))
    push = np.zeros(time.size)
    keep = math.exp(-1e-3 / 5e-3)
    for i in range(1, time.size):
        push[i] = keep * push[i - 1] + math.sqrt(1.0 - keep * keep) * noise * rng.normal()
    reference = wanted(time, seed)
    loop = Loop(LOOP.kp, LOOP.ki, LOOP.kd, LOOP.kr, LOOP.limit, count=COUNT)
    drive = Drive(time, reference, "feedback", loop, disturbance=push, max_step=1e-4)
    out = drive_axis(Mechanics(INERTIA, offset=offset, **mechanics), model(name), drive)
    position = COUNT * np.round(out[:, 0] / COUNT)
    return Experiment(f"{name} {seed}", time, position, out[:, 2], "torque", reference, LOOP)


def record(name: str, seed: int = 0, **options: Any) -> Record:
    t = experiment(name, seed, **options)
    assert t.drive is not None
    assert t.reference is not None
    return Record(
        t.time,
        {"position": t.position, "torque": t.drive, "position_reference": t.reference},
        {"position": "rad", "torque": "N·m", "position_reference": "rad"},
        {"source": t.name},
    )
