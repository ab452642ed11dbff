"""A machine of the library as the linear axis that stability is computed on."""

from __future__ import annotations

import math

from stickslip.analyse.presliding_loop import Axis, Contact, Drivetrain
from stickslip.machines.machine import Machine

__all__ = ["axis_of"]


def axis_of(machine: Machine, amplitude: float = 0.0) -> Axis:
    """Drivetrain and contact of a machine with the imperfections that it has; noise, ripple and drift do not enter.

    Parameters
    ----------
    machine : Machine
    amplitude : float
        Of the motion at the encoder that counts as small, rad; 0 takes one count of the encoder, or 1e-6 rad.
    """
    flexible, bearings, encoder = machine.flexible, machine.contact.bearings, machine.encoder
    inertias = (flexible.rotor, flexible.shaft, flexible.disk) if flexible else (machine.inertia,)
    # Bearings stick like their spring as long as the motion is small; viscous they are always.
    beside = Contact(bearings.stiffness if bearings.coulomb > 0.0 else 0.0, bearings.viscous)
    drivetrain = Drivetrain(
        inertias,
        (flexible.coupling, flexible.elasticity) if flexible else (),
        dampers=flexible.dampers if flexible else (),
        encoder=1 if flexible else 0,
        encoder_mode=encoder.mode if encoder.mode_share > 0.0 else 0.0,
        encoder_damping=encoder.mode_damping,
        encoder_share=encoder.mode_share,
        amplifier=machine.amplifier.bandwidth,
        bearings=beside,
    )
    count = 2.0 * math.pi / encoder.counts if encoder.counts > 0.0 else 1e-6
    return Axis(drivetrain, machine.clutch, amplitude or count)
