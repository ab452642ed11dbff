"""Contacts that hold at rest, on a flexible machine, against closed forms and integrators of the test's own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import stickslip as ss
from stickslip.machines.contact import Contact
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Amplifier

TRAIN = FlexibleAxis(3e-4, 2e-4, 5e-4, 5000.0, 800.0, 0.03)
INERTIAS = np.array([TRAIN.rotor, TRAIN.shaft, TRAIN.disk])
PERIOD, KP, KD = 1e-3, 1.2, 0.04
AMPLITUDE, OMEGA = 0.2, 2.0 * math.pi * 4.0
DISK, LAG, MOTOR = 4, 6, 7
"""States: angle and velocity of rotor, shaft and disk, the motor's lagging torque; behind them what is held."""


def mechanics() -> np.ndarray[Any, Any]:
    """Rates of the states without contact or current loop, by the states."""
    a = np.zeros((7, 7))
    dampers = (
        2 * TRAIN.damping * math.sqrt(TRAIN.coupling / (1 / TRAIN.rotor + 1 / TRAIN.shaft)),
        # Rotor and shaft move as one against the disk.
        2 * TRAIN.damping * math.sqrt(TRAIN.elasticity / (1 / (TRAIN.rotor + TRAIN.shaft) + 1 / TRAIN.disk)),
    )
    for i in range(3):
        a[2 * i, 2 * i + 1] = 1.0
    for i, (k, d) in enumerate(zip((TRAIN.coupling, TRAIN.elasticity), dampers, strict=True)):
        for body, sign in ((i, -1.0), (i + 1, 1.0)):
            for j, value in ((2 * i, k), (2 * i + 1, d), (2 * i + 2, -k), (2 * i + 3, -d)):
                a[2 * body + 1, j] += sign * value / INERTIAS[body]
    return a


def generator(side: int, bandwidth: float, fc: float, sigma2: float) -> np.ndarray[Any, Any]:
    """Rates of the states and of what is held (command, 1) while the disk rests (side 0) or slides."""
    m = np.zeros((9, 9))
    m[:7, :7] = mechanics()
    m[5, 5] -= sigma2 / TRAIN.disk
    m[5, 8] = -side * fc / TRAIN.disk
    if math.isinf(bandwidth):
        m[1, MOTOR] = 1.0 / TRAIN.rotor
    else:
        m[1, LAG] = 1.0 / TRAIN.rotor
        m[LAG, LAG], m[LAG, MOTOR] = -2 * math.pi * bandwidth, 2 * math.pi * bandwidth
    if side == 0:
        m[4:6] = 0.0
    return m


class PieceByPiece:
    """Coulomb friction with a static level: matrix exponentials of 10 us, events by bisection."""

    def __init__(self, fs: float, fc: float, sigma2: float, bandwidth: float) -> None:
        self.fs, self.m = fs, {s: generator(s, bandwidth, fc, sigma2) for s in (-1, 0, 1)}
        self.e = {s: expm(m * 1e-5) for s, m in self.m.items()}
        self.pull = TRAIN.disk * mechanics()[5]
        self.side = 0

    def over(self, x: Any, motor: float, steps: int) -> Any:
        x = np.concatenate([x, [motor, 1.0]])
        self._resolve(x)
        for _ in range(steps):
            left = 1e-5
            y = self.e[self.side] @ x
            while self._gone(y, x):
                low, high = 0.0, left
                for _ in range(50):
                    middle = 0.5 * (low + high)
                    if self._gone(expm(self.m[self.side] * middle) @ x, x):
                        high = middle
                    else:
                        low = middle
                y = expm(self.m[self.side] * high) @ x
                left -= high
                if self.side:
                    y[5], self.side = 0.0, 0
                    self._resolve(y)
                else:
                    self.side = 1 if self.pull @ y[:7] > 0 else -1
                x, y = y, expm(self.m[self.side] * left) @ y
            x = y
        return x[:7]

    def _gone(self, y: Any, before: Any) -> bool:
        if self.side:
            return y[5] * self.side < 0.0 and before[5] * self.side >= 0.0
        return abs(self.pull @ y[:7]) > self.fs

    def _resolve(self, x: Any) -> None:
        if self.side == 0 and abs(self.pull @ x[:7]) > self.fs:
            self.side = 1 if self.pull @ x[:7] > 0 else -1


class ByScipy:
    """Any law with a state, by an integrator for ordinary differential equations."""

    def __init__(self, law: dict[str, float], bandwidth: float) -> None:
        self.law, self.m = law, generator(1, bandwidth, 0.0, 0.0)
        self.z = 0.0

    def over(self, x: Any, motor: float, steps: int) -> Any:
        p = self.law

        def rate(_: float, y: Any) -> Any:
            v, z = y[5], y[7]
            dz = (
                v
                - p["sigma0"] * abs(v) / (p["fc"] + (p["fs"] - p["fc"]) * math.exp(-((v / p["vs"]) ** 2))) * z
            )
            out = np.append(self.m[:7] @ np.concatenate([y[:7], [motor, 1.0]]), dz)
            out[5] -= (p["sigma0"] * z + p["sigma1"] * dz + p["sigma2"] * v) / TRAIN.disk
            return out

        y = solve_ivp(
            rate, (0, steps * 1e-5), np.append(x, self.z), method="LSODA", rtol=1e-10, atol=1e-13
        ).y[:, -1]
        self.z = float(y[7])
        return y[:7]


def loop_by(plant: Any, samples: int, delay: float) -> np.ndarray[Any, Any]:
    """Angle of the encoder at the samples under the PD controller of `machine_run`."""
    x, old, out, told = np.zeros(7), 0.0, [], [0.0] * (math.floor(delay) + 1)
    late = round(delay * 100) % 100
    for k in range(samples + 1):
        out.append(x[2])
        w = OMEGA * k * PERIOD
        torque = KP * (AMPLITUDE * (1 - math.cos(w)) - x[2]) + KD * AMPLITUDE * OMEGA * math.sin(w)
        torque -= KD * (x[2] - old) / PERIOD if k else 0.0
        old = x[2]
        told.append(torque)
        before, now = told[-math.floor(delay) - 2], told[-math.floor(delay) - 1]
        x = plant.over(plant.over(x, before, late), now, 100 - late) if late else plant.over(x, now, 100)
    return np.array(out)


def machine_run(friction: ss.Model, samples: int, delay: float, bandwidth: float, **how: Any) -> ss.Record:
    m = Machine(
        "own", float(INERTIAS.sum()), Contact(friction), flexible=TRAIN, sample_time=PERIOD, delay=delay,
        amplifier=Amplifier(1.0, bandwidth=bandwidth),
    )  # fmt: skip
    controller = ss.Controller(ss.Gains(KP, kd=KD, kr=KD), sample_time=PERIOD)
    reference = ss.Reference("sine", amplitude=AMPLITUDE, frequency=OMEGA / (2 * math.pi))
    return ss.simulate(m, controller, reference, samples * PERIOD, metered=False, **how)


def test_a_disk_that_never_slips_leaves_a_linear_train() -> None:
    """Nothing of the motion is told by the friction: a matrix exponential a sample."""
    r = machine_run(ss.Model("coulomb", fc=100.0, sigma2=0.0), 100, 0.0, math.inf, check=True)
    truth = loop_by(PieceByPiece(100.0, 100.0, 0.0, math.inf), 100, 0.0)
    assert np.ptp(truth) > 1e-4
    assert np.max(np.abs(r["position"] - truth)) < 1e-13


@pytest.mark.parametrize("bandwidth", [math.inf, 500.0])
@pytest.mark.parametrize("delay", [0.0, 0.5, 1.0, 2.0, 3.25])
@pytest.mark.parametrize("law", ["coulomb", "static"])
def test_it_breaks_away_and_stops_where_it_does(law: str, delay: float, bandwidth: float) -> None:
    values = {"fc": 0.3, "sigma2": 0.01} | ({"fs": 0.36} if law == "static" else {})
    r = machine_run(ss.Model(law, **values), 300, delay, bandwidth)
    truth = loop_by(PieceByPiece(values.get("fs", 0.3), 0.3, 0.01, bandwidth), 300, delay)
    assert np.ptp(truth) > 0.1
    assert np.max(np.abs(r["position"] - truth)) < 1e-9


@pytest.mark.parametrize("delay", [0.0, 1.0, 2.5])
def test_the_estimate_of_the_error_holds_for_sub_steps(delay: float) -> None:
    values = {"sigma0": 3e3, "sigma1": 0.3, "fs": 0.36, "fc": 0.3, "vs": 0.01, "sigma2": 0.01}
    r = machine_run(ss.Model("lugre", **values), 150, delay, 500.0, check=True)
    truth = loop_by(ByScipy(values, 500.0), 150, delay)
    error = float(np.max(np.abs(r["position"] - truth)))
    assert error <= r.meta["accuracy"]["error_rad"] < 10.0 * error
    finer = machine_run(ss.Model("lugre", **values), 150, delay, 500.0, tolerance=1e-13)
    assert np.max(np.abs(finer["position"] - truth)) < 1e-2 * error


@pytest.mark.parametrize("law", ["stribeck_plain", "karnopp"])
def test_a_sliding_curve_keeps_the_tolerance(law: str) -> None:
    """Neither has a closed form; both tend to one motion, which the estimate knows."""
    values = {"fs": 0.36, "fc": 0.3, "vs": 0.05, "sigma2": 0.01} | ({"dv": 1e-6} if law == "karnopp" else {})
    usual, fine, finest = (
        machine_run(ss.Model(law, **values), 200, 0.5, 500.0, check=True, tolerance=tolerance)
        for tolerance in (1e-9, 1e-12, 1e-14)
    )
    away = [float(np.max(np.abs(r["position"] - finest["position"]))) for r in (usual, fine)]
    assert away[1] < 0.1 * away[0]
    assert away[0] <= usual.meta["accuracy"]["error_rad"] < 1e-5
