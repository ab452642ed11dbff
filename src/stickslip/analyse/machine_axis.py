"""Convert a machine to the linear axis of the stability analysis."""

from __future__ import annotations

import math

from stickslip.analyse.presliding_loop import Axis
from stickslip.machines.machine import Machine


def axis_of(machine: Machine, amplitude: float = 0.0) -> Axis:
    """Return drivetrain and contact of a machine with its imperfections, except noise, ripple and drift.

    Parameters
    ----------
    machine : Machine
    amplitude : float
        Of small motion at the encoder, rad; 0: one count of the encoder, or 1e-6 rad.
    """
    counts = machine.encoder.counts
    count = 2.0 * math.pi / counts if counts > 0.0 else 1e-6
    return Axis(machine.linear(bearings=machine.stuck_bearings), machine.clutch, amplitude or count)
