"""Studies as mappings of objects, and what the verb makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.studies.plan import Study, load
from stickslip.verbs.plain_given import file_of
from stickslip.verbs.study_given import study_tables

LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
LESS = LUGRE.scaled(fs=0.9, fc=0.9)
COULOMB = ss.Model("coulomb", fc=0.285, sigma2=0.018)
GMS = ss.Model(
    "gms", k=[1e4, 5e3], alpha=[0.5, 0.5], fs=0.335, fc=0.285, vs=0.01, delta_s=2.0, sigma2=0.018, c=24.0
)
AXIS = ss.RigidAxis(4e-4, LUGRE)
PD = ss.place("PD", 4e-4, 20.0)
SINE = ss.Reference("sine", amplitude=0.01, frequency=4.0)
T = np.linspace(0.0, 0.1, 21)
RECORDED = ss.Reference.table(T, 0.01 * (1.0 - np.cos(20.0 * math.pi * T)), 0.2 * np.sin(20.0 * math.pi * T))
SHAFT = ss.FlexibleAxis(rotor=1.5e-4, shaft=0.5e-4, disk=2e-4, coupling=8e3, elasticity=300.0, damping=0.02)
FLEXIBLE = ss.Machine(
    "flexible", SHAFT.inertia, ss.Contact(LUGRE, ss.Harmonics((3.0,), (0.02,), (0.1,)), (1.0, 0.95)),
    flexible=SHAFT, amplifier=ss.Amplifier(0.2, current_limit=15.0, bandwidth=1500.0, current_noise=1e-3),
    encoder=ss.Encoder(counts=65536, noise=1e-6), cogging=ss.Harmonics((12.0,), (0.005,), (0.0,)),
    models={"believed": COULOMB}, limits={"torque": 3.0}, notes=("of a test",), delay=0.2, seed=4,
)  # fmt: skip
PLAIN = ss.Machine(
    "plain", 5e-4, ss.Contact(GMS, bearings=ss.Bearings(0.02, 0.002)), encoder=ss.Encoder(counts=65536)
)
AHEAD = ss.ControlBlock("inertia_feedforward", inertia=1e-4)
OBSERVER = ss.ControlBlock("disturbance_observer", inertia=4e-4, corner=400.0)
CONTROLLERS = {
    "PD": ss.Controller(PD),
    "FF": ss.Controller(PD, ss.Feedforward(LUGRE, 0.9, lead=1e-3, deadband=1e-4, offset=0.01), 2.0, 1e-3, 65536.0),
    "composed": ss.Controller(
        loop=ss.ControlBlock("pd", kp=6.0, kd=0.1), observer=OBSERVER, sample_time=1e-3, torque_limit=2.0,
        feedforward=[ss.ControlBlock("friction_feedforward", LESS), AHEAD],
    ),
}  # fmt: skip


def base(**changes: Any) -> dict[str, Any]:
    """A mapping that can be run."""
    own = {"axis": AXIS, "references": {"sine": (SINE, 0.1)}, "controllers": {"PD": CONTROLLERS["PD"]}}
    return {**own, **changes}


def read(content: Mapping[str, Any], folder: str = "own") -> Study:
    """What the verb makes of a mapping, without running it."""
    with file_of(content, folder, "study", study_tables) as (path, shown):
        return load(path, shown=shown)
