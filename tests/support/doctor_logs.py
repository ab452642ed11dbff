"""Logs for the tests of the doctor: good ones, how they are written, and by what they are spoiled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from stickslip import Controller, Model, Reference, RigidAxis, place, simulate

INERTIA = 1e-3
Table = dict[str, np.ndarray]


def run(law: str, amplitude: float, frequency: float, duration: float, **parameters: float) -> Table:
    """A closed loop with a friction law, as a log: time, position, velocity, torque."""
    axis = RigidAxis(INERTIA, Model(law, **parameters))
    controller = Controller(place("PD", INERTIA, 20.0, 1.0))
    reference = Reference("sine", amplitude=amplitude, frequency=frequency)
    record = simulate(axis, controller, reference, duration)
    grid = record["event"] == 0.0
    return {"time": record.time[grid], "position": record["position"][grid], "velocity": record["velocity"][grid],
            "torque": record["motor_torque"][grid]}  # fmt: skip


def turned(seed: int = 0) -> Table:
    """Four turns to and fro against Stribeck friction, with an encoder of 2^20 counts and some noise of the torque."""
    time = np.arange(0.0, 8.0, 1e-3)
    rng = np.random.default_rng(seed)
    velocity = 12.0 * np.sin(2 * np.pi * 0.25 * time) * np.abs(np.sin(2 * np.pi * 0.25 * time))
    position = np.cumsum(velocity) * 1e-3
    friction = np.tanh(velocity / 0.01) * (0.28 + 0.1 * np.exp(-np.abs(velocity) / 0.3)) + 0.01 * velocity
    torque = INERTIA * np.gradient(velocity, time) + friction + 2e-3 * rng.standard_normal(time.size)
    count = 2 * np.pi / 2**20
    return {
        "time": time,
        "position": count * np.round(position / count),
        "velocity": velocity,
        "torque": torque,
    }


GOOD: dict[str, Callable[[], Table]] = {
    "turned": turned,
    "lugre": lambda: run(
        "lugre", 8.0, 0.5, 4.0, sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01
    ),
    "coulomb": lambda: run("coulomb", 5.0, 1.0, 3.0, fc=0.2, sigma2=0.01),
    "stribeck": lambda: run("stribeck", 6.0, 0.4, 5.0, k=500.0, fc=0.2, fs=0.3, vs=0.1, sigma2=0.01),
}
ONCE: dict[str, Table] = {}


def made(name: str) -> Table:
    if name not in ONCE:
        ONCE[name] = GOOD[name]()
    return {k: v.copy() for k, v in ONCE[name].items()}


HEADER = {
    "time": "time [s]",
    "position": "position [rad]",
    "velocity": "velocity [rad/s]",
    "torque": "torque [Nm]",
}
BARE = {"time": "time", "position": "position", "velocity": "velocity", "torque": "torque"}


def write(path: Path, table: Table, names: dict[str, str]) -> Path:
    columns = [(names.get(k, k), v) for k, v in table.items()]
    lines = [",".join(n for n, _ in columns)]
    row = ",".join(["%.12g"] * len(columns))
    lines += [row % values for values in zip(*(v.tolist() for _, v in columns), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


# ---- by what they are spoiled ---------------------------------------------------------------------------------


def rows(table: Table, keep: np.ndarray) -> Table:
    return {k: v[keep] for k, v in table.items()}


def with_(table: Table, **changed: np.ndarray) -> Table:
    return {**table, **changed}


def put(values: np.ndarray, where: object, what: float) -> np.ndarray:
    out = values.copy()
    out[where] = what
    return out


def n(table: Table) -> int:
    return table["time"].size


def every(table: Table, k: int) -> np.ndarray:
    return np.arange(n(table)) % k != 0


def clip(values: np.ndarray, share: float) -> np.ndarray:
    top = share * np.max(np.abs(values))
    return np.clip(values, -top, top)


def delayed(values: np.ndarray, k: int) -> np.ndarray:
    return (
        np.concatenate([np.full(k, values[0]), values[:-k]])
        if k > 0
        else np.concatenate([values[-k:], np.full(-k, values[-1])])
    )


def steps(values: np.ndarray, size: float) -> np.ndarray:
    return size * np.round(values / size)


def moving_up(table: Table) -> Table:
    """Only the rows that move forward, put together to a motion that never reverses."""
    velocity = np.abs(table["velocity"])
    position = np.cumsum(velocity) * np.median(np.diff(table["time"]))
    return with_(
        table, velocity=velocity, position=position, torque=table["torque"] * np.sign(table["velocity"])
    )


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


UNITS = {"position": "rad", "motor_torque": "N·m"}
DEG = 180.0 / np.pi
