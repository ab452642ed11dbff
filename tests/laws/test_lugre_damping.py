"""Damping that fades with speed: a stiff contact, well damped while it sticks, gives no energy back."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.spec import Surroundings

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
STIFF = 3.5e4
DAMPED = 2.0 * math.sqrt(STIFF * 3.8623e-4)  # 7.35 N·m·s/rad: critically damped while it sticks
VD = 1e-3


def contact(damping, sigma1=DAMPED):
    more = {"vd": VD} if damping == "fading" else {}
    return ss.Model("lugre", {"damping": damping}, sigma0=STIFF, sigma1=sigma1, **CURVE, **more)


def test_the_declaration_is_that_of_the_energy():
    for damping, passive in (("constant", False), ("fading", True)):
        model = contact(damping)
        assert model.law.dissipates(model.parameters) is passive
    weak = contact("constant", 0.1)
    assert weak.law.dissipates(weak.parameters)


def test_no_motion_gets_energy_out_of_fading_damping():
    rng = np.random.default_rng(3)
    model, u = contact("fading"), Surroundings()
    for _ in range(30):
        z, last, work, dt = model.law.state(model.parameters), 0.0, 0.0, 1e-5
        for target in rng.normal(size=60) * 10.0 ** rng.uniform(-5, -0.5, 60):
            for v in np.linspace(last, target, 20):
                torque = model.law.step(last, float(v), dt, z, model.parameters, u)
                work += torque * float(v) * dt
                last = float(v)
                assert work - model.law.stored(z, model.parameters) >= -1e-9


def extra(model):
    """The least of F v - dE/dt over states and speeds, W: negative where the contact could drive."""
    p, law = model.parameters, model.law
    worst = math.inf
    for v in np.geomspace(1e-6, 3.0, 300):
        for share in np.linspace(-1.0, 1.0, 81):
            z, dz = law.state(p), law.state(p)
            z.z = share * 0.335 / STIFF
            power = law.rate(float(v), z, p, Surroundings(), dz) * float(v) - STIFF * z.z * dz.z
            worst = min(worst, power)
    return float(worst)


def test_constant_damping_of_that_size_could_drive_the_axis():
    assert extra(contact("constant")) < -1e-6
    assert extra(contact("fading")) >= 0.0


def test_a_stuck_contact_is_damped_alike_and_a_sliding_one_not():
    u = Surroundings()
    torques = {}
    for damping in ("constant", "fading"):
        model = contact(damping)
        z = model.law.state(model.parameters)
        torques[damping] = [model.law.step(v, v, 1e-9, z, model.parameters, u) for v in (1e-5, 0.1)]
    assert torques["fading"][0] == pytest.approx(torques["constant"][0], rel=1e-3)
    assert abs(torques["fading"][1]) < 0.5 * abs(torques["constant"][1])


def test_an_axis_runs_with_it():
    axis = ss.RigidAxis(3.8623e-4, contact("fading"))
    drive = ss.Controller(
        loop=ss.ControlBlock("pd", kp=6.099, kd=0.097067), sample_time=1e-3, torque_limit=1.0
    )
    record = ss.simulate(axis, drive, ss.Reference("sine", amplitude=0.1, frequency=1.0), 1.0)
    energy = record.meta["energy"]
    assert energy["friction_loss"] > 0.0
    assert abs(energy["residual"]) < 1e-3 * energy["motor_work"]
