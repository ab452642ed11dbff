"""A machine of the library as the linear axis that stability is computed on."""

from __future__ import annotations

import math

from stickslip.analyse.presliding_loop import Axis
from stickslip.machines.machine import Machine


def axis_of(machine: Machine, amplitude: float = 0.0) -> Axis:
    """Drivetrain and contact of a machine with the imperfections that it has; noise, ripple and drift do not enter.

    Parameters
    ----------
    machine : Machine
    amplitude : float
        Of the motion at the encoder that counts as small, rad; 0 takes one count of the encoder, or 1e-6 rad.
    """
    counts = machine.encoder.counts
    count = 2.0 * math.pi / counts if counts > 0.0 else 1e-6
    return Axis(machine.linear(bearings=machine.stuck_bearings), machine.clutch, amplitude or count)
