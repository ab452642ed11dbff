"""Break-away force against the rate of the applied force.

A force that grows linearly from zero is applied to a mass at rest. The largest friction it meets before it slides is
its break-away force, which falls with the rate of the force and settles at a level (thesis 2.1.1). A fast force has the
mass past the Stribeck velocity before the contact has yielded, so that the static level is never reached. Contact and
rates are those of Canudas de Wit et al. (1995): Fs = 1.5 N, Fc = 1 N, 1 kg.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip import Controller, Gains, Model, Record, Reference, RigidAxis, simulate
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

LEVELS: dict[str, Any] = {"fs": 1.5, "fc": 1.0, "vs": 1e-3, "sigma2": 0.4}  # N, N, m/s, N·s/m
LUGRE = Model("lugre", sigma0=1e5, sigma1=1e5**0.5, **LEVELS)
GMS = Model("gms", k=[5e4, 3e4, 2e4], alpha=[1 / 3] * 3, c=100.0, **LEVELS)
STYLES = {"LuGre": Style("#D55E00", (0, (4, 1.2)), 1.4, "s"), "GMS": Style("#0072B2", "-", 1.4, "o")}
RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # N/s


def pulled(model: Model, rate: float) -> Record:
    """A mass of 1 kg at rest under a force that grows by `rate`, N/s, up to 2 N."""
    end = 2.0 / rate
    # The controller has no gain but on the reference's velocity: it passes that on as the force.
    force = Reference("table", time=[0.0, end], position=[0.0, 0.5 * rate * end**2], velocity=[0.0, 2.0])
    passing = Controller(Gains(kp=0.0, kr=1.0))
    return simulate(RigidAxis(1.0, model), passing, force, end, integrator="adaptive", output=end / 4000)


def breakaway(record: Record) -> float:
    """The largest friction until the mass moves at ten Stribeck velocities, N."""
    resting = record["velocity"] < 10.0 * LEVELS["vs"]
    return float(record["friction_torque"][resting].max())


def picture() -> Drawn:
    """Draw break-away force over rate."""
    panel = Panel(
        [
            Curve(np.array(RATES), np.array([breakaway(pulled(model, r)) for r in RATES]), name, STYLES[name])
            for name, model in (("LuGre", LUGRE), ("GMS", GMS))
        ],
        "break-away force (N)", "rate of the applied force (N/s)", x_scale="log",
    )  # fmt: skip
    message = "From the static level of 1.5 N towards the Coulomb level of 1 N"
    return "Break-away force falls with the rate of the force", message, [panel], 2.2
