"""Frictional lag: the torque follows a changing velocity late.

While a contact slides one way with a velocity that swings, its torque is larger while the speed rises than while it
falls, and the loop widens with the frequency of the swing (thesis 2.1.3). GMS has a rate for it, the attraction
parameter C; in LuGre the lag is the time in which the bristles take another deflection, a distance of some 10 µrad.
"""

from __future__ import annotations

import numpy as np

from stickslip import Model, Record, Reference, law, respond
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

GMS = Model("gms", **law("gms").example)
LUGRE = Model("lugre", **law("lugre").example)
MEAN, SWING = 0.011, 0.010  # rad/s
FREQUENCIES = (0.2, 2.0, 10.0)  # Hz
STYLES = (
    Style("#000000", (0, (1, 1)), 1.4),
    Style("#0072B2", "-", 1.3),
    Style("#D55E00", (0, (4, 1.2)), 1.3),
)


def swung(model: Model, frequency: float) -> Record:
    """The second of two periods at velocities from 1 to 21 mrad/s, never reversing."""
    amplitude = SWING / (2.0 * np.pi * frequency)
    motion = Reference("harmonic", amplitude=amplitude, frequency=frequency, velocity=MEAN)
    times = np.linspace(0.0, 2.0 / frequency, 2001)
    whole = respond(model, motion, times, tolerance=1e-9)
    late = slice(1000, None)
    channels = {name: values[late] for name, values in whole.channels.items()}
    return Record(whole.time[late], channels, whole.units)


def width(record: Record) -> float:
    """Torque while the speed rises less torque while it falls, at the mean velocity, N·m.

    The velocity is a cosine: it falls through its mean after a quarter of the period and rises after three.
    """
    n = len(record) - 1
    return float(record["friction_torque"][3 * n // 4] - record["friction_torque"][n // 4])


def picture() -> Drawn:
    """Draw the loops."""
    panels: list[Panel] = []
    for name, model in (("GMS", GMS), ("LuGre", LUGRE)):
        records = {f: swung(model, f) for f in FREQUENCIES}
        curves = [
            Curve(1e3 * r["velocity"], r["friction_torque"], f"{f:g} Hz", style)
            for (f, r), style in zip(records.items(), STYLES)
        ]
        note = f"{name}: width " + ", ".join(f"{1e3 * width(r):.2g}" for r in records.values()) + " mN·m"
        panels.append(Panel(curves, "torque (N·m)", "velocity (mrad/s)", note=note))
    message = "Torque over a velocity that swings about 11 mrad/s; width at the mean velocity"
    return "Frictional lag widens with the frequency", message, panels, 2.0
