"""Dependence on position.

Surfaces are not the same everywhere, nor is the load on them (thesis 2.1.6): the torque ripples over a revolution, and
comes back at the same place however fast, and from whichever side, the axis passes it. Any law may have such a ripple,
by the choice `position_dependence = "spectrum"`: relative amplitudes, and phases, of the harmonics of a revolution. It
multiplies the torque of the law, as a load that changes with the position would.
"""

from __future__ import annotations

import numpy as np

from stickslip import Model, Record, Reference, law, respond
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

HARMONICS = {1: 0.10, 6: 0.04}  # periods per revolution: share of the torque
SPEED = 0.2  # rad/s
RIPPLE = {"ripple": [*HARMONICS.values()], "order": [float(n) for n in HARMONICS], "ripple_phase": [0.0, 1.0]}
FORWARD, BACKWARD = Style("#0072B2", "-", 1.5), Style("#D55E00", (0, (4, 1.2)), 1.5)


def rippling(name: str) -> Model:
    """A law with its example's parameters and the ripple."""
    return Model(name, {"position_dependence": "spectrum"}, **law(name).example, **RIPPLE)


def turned(model: Model, speed: float) -> Record:
    """The second of two revolutions at constant speed, rad/s; positions from 0 to 2 pi."""
    turn = 2.0 * np.pi / abs(speed)
    motion = Reference("harmonic", amplitude=0.0, frequency=1.0, velocity=speed)
    whole = respond(model, motion, np.linspace(0.0, 2.0 * turn, 1441), tolerance=1e-9)
    late = slice(721, None)
    channels = {name: values[late] for name, values in whole.channels.items()}
    channels["position"] = np.mod(channels["position"] + 1e-9, 2.0 * np.pi)
    return Record(whole.time[late], channels, whole.units)


def harmonic(record: Record, periods: int) -> float:
    """Amplitude of a harmonic of the torque over its mean, -."""
    torque = record["friction_torque"]
    part = np.mean(torque * np.exp(-1j * periods * record["position"]))
    return float(2.0 * abs(part) / abs(torque.mean()))


def picture() -> Drawn:
    """Draw the size of the torque over the position, both ways."""
    curves: list[Curve] = []
    for name, speed, style in (("forward", SPEED, FORWARD), ("backward", -SPEED, BACKWARD)):
        record = turned(rippling("gms"), speed)
        order = np.argsort(record["position"])
        degrees = np.degrees(record["position"][order])
        curves.append(Curve(degrees, np.abs(record["friction_torque"][order]), name, style))
    note = ", ".join(f"{100 * share:.0f} % at {n} per revolution" for n, share in HARMONICS.items())
    panel = Panel(curves, "|torque| (N·m)", "position (°)", legend="lower left", note=note)
    message = f"GMS at {1e3 * SPEED:.0f} mrad/s: the same ripple from both sides"
    return "Friction that depends on the position", message, [panel], 2.4
