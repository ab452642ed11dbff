"""One record, one machine: what changes within the record is found, and what does not change draws no word."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stickslip import Record
from stickslip.identification.doctor import examine
from stickslip.identification.doctor.change import other_motion

SWITCH = 0.43
COUNT = 2.0 * np.pi / 2**18


def moves(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Velocity of production moves: random ways and speeds to and fro, with dwells."""
    v, i, q = np.zeros(t.size), 0, 0.0
    while i < t.size:
        way = rng.uniform(0.9, 3.0) * (-1.0 if q > 0.0 else 1.0)
        n = max(2, int(max(1.9 * abs(way) / rng.uniform(1.6, 8.0), 0.15) / (t[1] - t[0])))
        bell = 2.0 * way / (n * (t[1] - t[0])) * np.sin(np.pi * np.arange(n) / n) ** 2
        v[i : i + n] = bell[: t.size - i]
        i, q = i + n + int(rng.uniform(0.05, 0.3) / (t[1] - t[0])), q + way
    return v


def velocity(kind: str, t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    if kind == "moves":
        return moves(t, rng)
    if kind == "sine":
        return 5.0 * np.sin(np.pi * t)
    if kind == "growing":
        return (0.3 + 8.0 * t / t[-1]) * np.sin(np.pi * t)
    if kind == "faster":
        return np.where(t < 0.5 * t[-1], 0.8, 8.0) * np.sin(np.pi * t)
    if kind == "sweep":
        return 6.0 * np.sin(2.0 * np.pi * (0.2 * t + 2.4 * t**2 / t[-1]))
    if kind == "staircase":
        levels = np.repeat([0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0], 2) * np.tile([1.0, -1.0], 8)
        steps = levels[np.minimum((16 * t / t[-1]).astype(int), 15)]
        return np.convolve(steps, np.hanning(101) / np.sum(np.hanning(101)), "same")
    parts = ((3.0, 0.21), (3.0, 0.73), (2.0, 1.9), (1.0, 4.1))
    return sum((a * np.sin(2.0 * np.pi * f * t + rng.uniform(0, 6)) for a, f in parts), np.zeros(t.size))


def record(
    kind: str, seed: int = 0, *, friction: float = 0.0, inertia: float = 0.0, load: float = 0.0,
    gradual: bool = False, rate: float = 500.0, seconds: float = 30.0,
) -> Record:  # fmt: skip
    """An axis with Stribeck friction of 2 to 2.6 N·m, cogging, coloured noise, 3 % asymmetry, and a change."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    v = velocity(kind, t, rng)
    q = np.cumsum(v) / rate
    step = t / seconds if gradual else (t > SWITCH * seconds).astype(float)
    curve = np.tanh(v / 0.01) * (2.0 + 0.6 * np.exp(-((v / 0.3) ** 2))) * np.where(v > 0.0, 1.03, 0.97)
    cogging = 0.2 * np.sin(4 * q + 1.0) + 0.2 * np.sin(12 * q) + 0.1 * np.sin(24 * q)
    noise = np.convolve(rng.standard_normal(t.size), 0.02 * 0.98 ** np.arange(250), "same")
    torque = 0.015 * (1.0 + inertia * step) * np.gradient(v, t) + (1.0 + friction * step) * (curve + 0.05 * v)
    torque += cogging + noise + 0.05 * rng.standard_normal(t.size) + load * step
    channels = {"position": COUNT * np.round(q / COUNT), "motor_torque": torque}
    return Record(t, channels, {"position": "rad", "motor_torque": "N·m"})


def said(r: Record) -> str:
    return "".join(f.line() for f in examine(r).findings if f.code == "change")


@pytest.mark.parametrize("kind", ["moves", "multisine", "sine"])
def test_less_friction_and_more_inertia_from_some_time_on(kind):
    found = said(record(kind, friction=-0.3, inertia=0.6))
    percent = float(found.partition("friction changes by ")[2].partition(" ")[0])
    assert percent == pytest.approx(-30.0, abs=3.0)
    at = float(found.partition("end=")[2].partition(",")[0])
    assert at == pytest.approx(SWITCH * 30.0, abs=0.6)
    assert kind != "multisine" or "inertia changes by +6" in found or "inertia changes by +5" in found


def test_half_an_hour_in_which_the_machine_changes():
    found = said(record("moves", friction=-0.3, inertia=0.6, rate=100.0, seconds=1800.0))
    assert "friction changes by -3" in found
    assert "inertia changes by +6" in found


def test_a_load_put_on():
    found = said(record("sine", load=0.5))
    assert float(found.partition("constant torque changes by ")[2].partition(" ")[0]) == pytest.approx(
        0.5, abs=0.05
    )


def test_a_machine_that_warms_up():
    found = said(record("multisine", friction=-0.3, gradual=True))
    assert "over the record" in found
    assert "warm up" in found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "kind", ["moves", "multisine", "sine", "growing", "faster", "sweep", "staircase"]
)  # fmt: skip
def test_a_machine_that_stays_the_same_draws_no_word(kind, seed):
    assert said(record(kind, seed)) == ""


def test_a_temperature_that_rises():
    r = record("sine")
    hot = Record(r.time, {**r.channels, "temperature": 25.0 + 0.5 * r.time}, {**r.units, "temperature": "°C"})
    found = [f.line() for f in examine(hot).findings if f.code == "temperature-change"]
    assert "from 25.75 to 39.25 °C" in found[0]
    assert not [f for f in examine(r).findings if f.code == "temperature-change"]


@pytest.mark.parametrize(("seed", "column"), [(11206, "mean"), (11086, "commanded"), (11146, "actual")])
def test_creeping_after_fast_steps_is_no_other_inertia(logs: Any, seed: int, column: str) -> None:
    """Where hardly anything accelerates, the cogging that is left passes for an inertia 2 to 6 times as large."""
    log = logs.draw(seed, column, 500, "feedforward", "staircase", "cogging")
    channels = {"position": log.position, "motor_torque": log.torque}
    assert said(Record(log.time, channels, {"position": "rad", "motor_torque": "N·m"})) == ""


@pytest.mark.parametrize(("ratio", "other"), [(1.0, False), (2.0, False), (4.0, True)])
@pytest.mark.parametrize("gradual", [False, True])
def test_a_sweep_is_another_motion_at_its_end(ratio: float, other: bool, gradual: bool) -> None:
    """Its frequencies, of one acceleration, were called a change of the inertia by +991 %."""
    x = np.linspace(0.0, 1.0, 6000)
    shape = x if gradual else np.heaviside(x - 0.5, 1.0)
    rate = 10.0 * np.where(shape > 0.5, ratio, 1.0)
    phase = np.cumsum(rate) * 1e-2
    assert other_motion(np.cos(phase), np.sin(phase) / rate, shape) is other
