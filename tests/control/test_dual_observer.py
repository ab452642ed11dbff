"""The dual observer: its energy falls as the theory says, and it learns friction that was believed wrongly."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.spec import Surroundings
from support.golden_rows import INERTIA, PID, W

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01}
HIGH = ss.Reference("sine", amplitude=0.5, frequency=0.1)


def observer(velocity="reference", **more):
    values = {"sigma0": 3.5e4, "sigma2": 0.018, "slope": 0.5 * W, "rate0": 100.0, **CURVE, **more}
    return ss.ControlBlock("dual_observer", None, {"velocity": velocity}, **values)


# ---- the theorem ---------------------------------------------------------------------------------------------------

SOFT, LAMBDA, DAMPING, TIME = 2000.0, 30.0, 0.05, 1e-5
K0, K1, RATES = 1e-3, 1e-5, (400.0, 20.0, 2.0)
TRUE = {"scale": 1.4, "damping": 0.6, "viscous": 0.05}
"""Of the axis; the observer begins with 1, 0.2 and 0.01."""


def energies(steps):
    """J s^2 / 2 and the weighted squares of all errors, J, along an axis that has the law with other factors."""
    block = observer(
        "measured", sigma0=SOFT, sigma1=0.2, sigma2=0.01, slope=LAMBDA, k0=K0, k1=K1, rate0=RATES[0], rate1=RATES[1],
        rate2=RATES[2],
    )  # fmt: skip
    z, p, u = block.state(), block.parameters, SimpleNamespace(**Surroundings()._asdict())
    position = velocity = bend = 0.0
    out = []
    for k in range(steps):
        t = TIME * k
        w = 2.0 * math.pi * 2.0
        wanted = (0.2 * (1.0 - math.cos(w * t)), 0.2 * w * math.sin(w * t), 0.2 * w * w * math.cos(w * t))
        error, rate = wanted[0] - position, wanted[1] - velocity
        s = rate + LAMBDA * error
        y = SimpleNamespace(
            reference_velocity=wanted[1] or 1e-12, velocity=velocity, error=error, elapsed=TIME
        )
        torque = block.law.sample(y, z, p, u)
        h = SOFT * abs(velocity) / (0.285 + 0.05 * math.exp(-((velocity / 0.01) ** 2)))
        apart = (
            (bend - z.z0) ** 2 * TRUE["scale"] * SOFT / K0 + (bend - z.z1) ** 2 * TRUE["damping"] / K1,
            sum((TRUE[n] - getattr(z, n)) ** 2 / g for n, g in zip(("scale", "damping", "viscous"), RATES)),
        )
        out.append(0.5 * (INERTIA * s * s + sum(apart)))
        friction = (
            TRUE["scale"] * SOFT * bend + TRUE["damping"] * (velocity - h * bend) + TRUE["viscous"] * velocity
        )
        control = INERTIA * (wanted[2] + LAMBDA * rate) + DAMPING * s + torque
        bend = bend * math.exp(-h * TIME) + velocity * TIME * (
            -math.expm1(-h * TIME) / (h * TIME) if h else 1.0
        )
        velocity += TIME * (control - friction) / INERTIA
        position += TIME * velocity
    return np.array(out)


def test_the_energy_of_all_errors_falls_in_continuous_time():
    found = energies(30_000)
    assert np.all(np.diff(found) <= 1e-6 * found[0])  # a step's error
    per_period = found[::500]
    assert np.all(np.diff(per_period) < 0.0)
    assert found[-1] < 0.95 * found[0]


# ---- at 1 kHz ------------------------------------------------------------------------------------------------------


def rms(controller, scale):
    curve = {"fs": scale * 0.335, "fc": scale * 0.285, "vs": 0.01, "sigma2": 0.018}
    friction = ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **curve)
    plant = ss.RigidAxis(INERTIA, friction)
    record = ss.simulate(plant, controller, HIGH, 20.0, integrator="sampled", metered=False)
    error = (record["position_reference"] - record["position"])[record["event"] == 0.0]
    return math.sqrt(float(np.mean(error**2)))


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "share"), [(0.7, 0.9), (1.0, 0.2), (1.3, 0.22)])
def test_it_is_better_than_the_pid_whatever_the_friction(scale, share):
    pid = ss.ControlBlock("pid", **PID)
    alone = ss.Controller(loop=pid, sample_time=1e-3, torque_limit=1.0)
    adaptive = ss.Controller(loop=pid, sample_time=1e-3, observer=observer(), torque_limit=1.0)
    assert rms(adaptive, scale) < share * rms(alone, scale)


def moved(controller, samples, position, reference, velocity):
    n, m, z, p = controller.settings, controller.memory(), controller.state(), controller.parameters
    u, out = SimpleNamespace(**Surroundings()._asdict()), []
    for k in range(samples):
        t = 1e-3 * k
        controller.functions["sample"](position(t), reference(t), velocity(t), 0.0, n, m, z, p, u)
        out.append(controller.learned(z))
    return out


def test_factors_stay_within_their_bounds_and_where_they_are_at_rest():
    pid = ss.ControlBlock("pid", **PID)
    block = observer(rate1=1.0, rate2=1.0, most1=0.3, most2=0.1)
    drive = ss.Controller(loop=pid, sample_time=1e-3, observer=block, torque_limit=1.0)
    late = moved(drive, 5000, lambda t: 0.0, lambda t: 0.3 * t, lambda t: 0.3)[-1]
    assert late["observer_scale"] == 2.0
    assert 0.0 <= late["observer_damping"] <= 0.3
    assert late["observer_viscous"] == 0.1
    ahead = moved(drive, 5000, lambda t: 0.6 * t, lambda t: 0.3 * t, lambda t: 0.3)[-1]
    assert ahead["observer_scale"] == 0.0
    still = moved(drive, 3000, lambda t: 0.0, lambda t: 0.3 * min(t, 1.0), lambda t: 0.3 * (t < 1.0))
    assert still[1100] == still[-1]
