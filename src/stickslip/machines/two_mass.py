"""The axis as a two-mass system: a motor and a load with a spring between them, such as a belt, a long shaft or a gear.

Motor torque acts on the motor, the contact's friction on the load, the bearings' at the encoder, which is on either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.core.errors import ParameterError
from stickslip.machines.described import described
from stickslip.machines.train import Train, refuse_damping, refuse_part

ENCODERS = ("motor", "load")


@constructor_named
@described
@dataclass(frozen=True)
class TwoMassAxis(Train):
    """Motor and load with a spring between them.

    The friction of `Contact` acts on the load. Friction on the motor: `Contact.bearings` (Coulomb and viscous) acts at
    the inertia with the encoder, so that with ``encoder="motor"`` a machine has friction on both, and with a contact of
    little friction on the motor alone. A record of `simulate` has ``motor_position`` and ``load_position``.

    Attributes
    ----------
    encoder : {"motor", "load"}
        Whose angle the position is.

    Raises
    ------
    ParameterError
        If an inertia or the spring is not greater than 0, the damping not from 0 to 1, or the encoder on neither.
    """

    motor: Annotated[float, Par("kg·m²", "J_1", "motor, with what turns with it", positive=True)]
    load: Annotated[float, Par("kg·m²", "J_2", "load behind the spring, seen from the motor", positive=True)]
    stiffness: Annotated[
        float, Par("N·m/rad", "k", "spring between motor and load, seen from the motor", positive=True)
    ]
    damping: Annotated[float, Par("-", "", "part of critical damping of the free axis's mode", lower=0.0)] = (
        0.0
    )
    encoder: Literal["motor", "load"] = "motor"

    def __post_init__(self) -> None:
        insist_on_own(self, "two-mass axis")
        for name, unit in (("motor", "kg·m²"), ("load", "kg·m²"), ("stiffness", "N·m/rad")):
            refuse_part("two-mass axis", name, getattr(self, name), unit)
        refuse_damping("two-mass axis", self.damping)
        if self.encoder not in ENCODERS:
            raise ParameterError(f"two-mass axis: encoder = {self.encoder!r} must be {' or '.join(ENCODERS)}")

    @property
    def inertias(self) -> tuple[float, float]:
        """Motor and load, kg·m²."""
        return self.motor, self.load

    @property
    def springs(self) -> tuple[float]:
        """The one between them, N·m/rad."""
        return (self.stiffness,)

    @property
    def dampers(self) -> tuple[float]:
        """Viscous damping beside the spring, N·m·s/rad."""
        return (2.0 * self.damping * math.sqrt(self.stiffness / (1.0 / self.motor + 1.0 / self.load)),)

    @property
    def encoder_at(self) -> int:
        """0 on the motor, 1 on the load."""
        return ENCODERS.index(self.encoder)

    @property
    def antiresonance(self) -> float:
        """At which the load swings while the motor is held, Hz."""
        return math.sqrt(self.stiffness / self.load) / (2.0 * math.pi)

    def scaled(self, factor: float) -> TwoMassAxis:
        """The same with both inertias times `factor`."""
        return replace(self, motor=factor * self.motor, load=factor * self.load)
