"""The axis as three inertias: rotor, coupling, shaft and friction disk; thesis 4.5 and figure 4.57.

Motor torque acts on the rotor, friction on the disk, and the encoder sits on the shaft between coupling and disk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.machines.described import described
from stickslip.machines.train import Train, refuse_damping, refuse_part


@constructor_named
@described
@dataclass(frozen=True)
class FlexibleAxis(Train):
    """Rotor, shaft and disk, with the coupling and the shaft as springs between them."""

    rotor: Annotated[float, Par("kg·m²", "J_1", "rotor with half of the coupling", positive=True)]
    shaft: Annotated[
        float,
        Par(
            "kg·m²", "J_2", "the coupling's other half, with encoder and shaft up to the disk", positive=True
        ),
    ]
    disk: Annotated[float, Par("kg·m²", "J_3", "the rest of the shaft with the friction disk", positive=True)]
    coupling: Annotated[float, Par("N·m/rad", "k_1", "spring between rotor and shaft", positive=True)]
    elasticity: Annotated[float, Par("N·m/rad", "k_2", "spring between shaft and disk", positive=True)]
    damping: Annotated[
        float, Par("-", "", "part of critical damping of each spring with the inertias beside it", lower=0.0)
    ] = 0.0

    def __post_init__(self) -> None:
        insist_on_own(self, "flexible axis")
        for name, unit in (
            ("rotor", "kg·m²"), ("shaft", "kg·m²"), ("disk", "kg·m²"), ("coupling", "N·m/rad"),
            ("elasticity", "N·m/rad"),
        ):  # fmt: skip
            refuse_part("flexible axis", name, getattr(self, name), unit)
        refuse_damping("flexible axis", self.damping)

    @property
    def inertias(self) -> tuple[float, float, float]:
        """Rotor, shaft and disk, kg·m²."""
        return self.rotor, self.shaft, self.disk

    @property
    def springs(self) -> tuple[float, float]:
        """Coupling and shaft, N·m/rad."""
        return self.coupling, self.elasticity

    @property
    def dampers(self) -> tuple[float, float]:
        """Viscous damping beside coupling and shaft, N·m·s/rad."""
        behind = 1.0 / (self.rotor + self.shaft) + 1.0 / self.disk
        first = 2.0 * self.damping * math.sqrt(self.coupling / (1.0 / self.rotor + 1.0 / self.shaft))
        return first, 2.0 * self.damping * math.sqrt(self.elasticity / behind)

    @property
    def encoder_at(self) -> int:
        """On the shaft."""
        return 1

    def scaled(self, factor: float) -> FlexibleAxis:
        """The same with every inertia times `factor`."""
        return replace(self, rotor=factor * self.rotor, shaft=factor * self.shaft, disk=factor * self.disk)

    def twist(self, torque: float) -> tuple[float, float]:
        """Static deflection of coupling and shaft under a torque at the disk (N·m), rad."""
        return torque / self.coupling, torque / self.elasticity
