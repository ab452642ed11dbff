"""Stick-slip of a dragged mass.

A mass of 1 kg lies on a surface and is pulled by a spring (2 N/m) whose end moves at 0.1 m/s. It sticks until the
spring pulls with the break-away force, jumps, and sticks again, since friction in motion is less than at rest (thesis
2.1.4). Contact and numbers are those of Canudas de Wit et al. (1995). The spring is a controller of one gain, its end
the reference: a servo axis in a slow ramp does the same.
"""

from __future__ import annotations

import numpy as np

from stickslip import Controller, Gains, Model, Record, Reference, RigidAxis, simulate
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

CONTACT = Model("lugre", sigma0=1e5, sigma1=1e5**0.5, sigma2=0.4, fc=1.0, fs=1.5, vs=1e-3)
SPRING, SPEED = 2.0, 0.1  # N/m, m/s
BLUE, ORANGE = Style("#0072B2", "-", 1.4), Style("#D55E00", (0, (4, 1.2)), 1.2)


def dragged(duration: float = 20.0, contact: Model = CONTACT) -> Record:
    """The mass from rest, the spring unloaded."""
    drag = Reference("ramp", velocity=SPEED)
    spring = Controller(Gains(kp=SPRING))
    return simulate(RigidAxis(1.0, contact), spring, drag, duration, integrator="adaptive", output=5e-3)


def rests(record: Record) -> list[tuple[float, float]]:
    """Begin and end of each stay: times with velocity below 1 mm/s for at least 0.1 s."""
    still = np.abs(record["velocity"]) < 1e-3
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    spans = [(record.time[a], record.time[b - 1]) for a, b in edges.reshape(-1, 2)]
    return [(float(a), float(b)) for a, b in spans if b - a >= 0.1]


def picture() -> Drawn:
    """Draw position, velocity and force."""
    record = dragged()
    end = (0.0, float(record.time[-1]))
    panels = [
        Panel(
            [
                Curve(record.time, record["position_reference"], "end of the spring", ORANGE),
                Curve(record.time, record["position"], "mass", BLUE),
            ],
            "position (m)", "time (s)", end, legend="upper left",
        ),
        Panel([Curve(record.time, record["velocity"], "", BLUE)], "velocity (m/s)", "time (s)", end),
        Panel(
            [
                Curve(record.time, record["motor_torque"], "spring", ORANGE),
                Curve(record.time, record["friction_torque"], "friction", BLUE),
            ],
            "force (N)", "time (s)", end, legend="lower right",
        ),
    ]  # fmt: skip
    count = len(rests(record))
    return "Stick-slip of a dragged mass", f"LuGre contact; the mass rests {count} times in 20 s", panels, 1.5
