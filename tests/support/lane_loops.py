"""Closed loops for the tests of lanes."""

import numpy as np

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model, Reference
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.many import simd_batch

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
LAWS = {
    "gms": Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE),
    "gms-3": Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE),
    "lugre": Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE),
    "stribeck": Model("stribeck", k=3.5e4, **CURVE),
    "coulomb": Model("coulomb", fc=0.285, sigma2=0.018),
    "maxwell_slip": Model("maxwell_slip", k=[1e4, 7e3], w=[0.15, 0.15], sigma2=0.018),
}
INERTIA = 3.8623e-4
HELPERS = {
    "none": None,
    "FF-lugre": Feedforward(LAWS["lugre"]),
    "FF-coulomb": Feedforward(LAWS["coulomb"]),
    "FB-gms": Feedback(LAWS["gms-3"]),
    "FB-lugre": Feedback(LAWS["lugre"]),
    "FB-stribeck": Feedback(LAWS["stribeck"]),
    "FB-coulomb": Feedback(LAWS["coulomb"]),
}


def loops(plant="gms", helper="none", n=20, duration=1.0, step=1e-4, kind="PD", spread=0.1, **more):
    rng = np.random.default_rng(5)
    controller = Controller(place(kind, INERTIA, 36.0, 1.0), HELPERS[helper])
    sine = Reference("sine", amplitude=0.01, frequency=2.0)
    case = prepare(
        RigidAxis(INERTIA, LAWS[plant]), controller, sine, duration, tolerance=1e-8, output=duration
    )
    columns = {
        f"friction.{name}": getattr(LAWS[plant].parameters, name) * rng.uniform(1.0 - spread, 1.0 + spread, n)
        for name in ("fs", "fc") if hasattr(LAWS[plant].parameters, name)
    } | {"inertia": INERTIA * rng.uniform(1.0 - spread, 1.0 + spread, n)} | more  # fmt: skip
    return case, columns, simd_batch.prepare(case, columns, step)
