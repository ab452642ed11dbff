"""The axis as three inertias: rotor, coupling, shaft and friction disk; thesis 4.5 and figure 4.57.

Motor torque acts on the rotor, friction on the disk, and the encoder sits on the shaft between coupling and disk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from stickslip.arguments import constructor_named, insist_on_own
from stickslip.description import Par
from stickslip.errors import ParameterError
from stickslip.machines.described import described
from stickslip.machines.drivetrain import Chain


@constructor_named
@described
@dataclass(frozen=True)
class FlexibleAxis:
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
            value = getattr(self, name)
            if not (value > 0.0 and math.isfinite(value)):
                raise ParameterError(
                    f"flexible axis: {name} = {value:g} {unit} must be greater than 0 and finite"
                )
        if not 0.0 <= self.damping < 1.0:
            raise ParameterError(
                f"flexible axis: damping = {self.damping:g} must be at least 0 and less than 1"
            )

    @property
    def inertia(self) -> float:
        """Of the whole axis, kg·m²."""
        return self.rotor + self.shaft + self.disk

    @property
    def modes(self) -> tuple[float, float, float]:
        """Undamped modes of the free axis, Hz: 0, that of the shaft, that of the coupling."""
        chain = Chain((self.rotor, self.shaft, self.disk), (self.coupling, self.elasticity))
        zero, first, second = chain.modes().frequencies.tolist()
        return zero, first, second

    @property
    def dampers(self) -> tuple[float, float]:
        """Viscous damping beside coupling and shaft, N·m·s/rad."""
        behind = 1.0 / (self.rotor + self.shaft) + 1.0 / self.disk
        first = 2.0 * self.damping * math.sqrt(self.coupling / (1.0 / self.rotor + 1.0 / self.shaft))
        return first, 2.0 * self.damping * math.sqrt(self.elasticity / behind)

    def twist(self, torque: float) -> tuple[float, float]:
        """Static deflection of coupling and shaft under a torque at the disk (N·m), rad."""
        return torque / self.coupling, torque / self.elasticity

    def visible(self, stiffness: float) -> float:
        """`stiffness` of a contact at the disk (N·m/rad) as the encoder sees it: in series with the shaft."""
        return 1.0 / (1.0 / stiffness + 1.0 / self.elasticity)

    def behind(self, visible: float) -> float:
        """Stiffness of the contact whose stiffness at the encoder is `visible`; infinite if the shaft is softer."""
        rest = 1.0 / visible - 1.0 / self.elasticity
        return 1.0 / rest if rest > 0.0 else math.inf
