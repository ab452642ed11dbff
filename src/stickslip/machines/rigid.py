"""The rigid axis: J dv/dt = T_m - T_f; thesis eq. 3.1."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.errors import ParameterError
from stickslip.core.reprs import making, standard_of
from stickslip.models.model import Model

ABSOLUTE_ZERO = -273.15
"""°C"""


@constructor_named
@dataclass(frozen=True, repr=False)
class RigidAxis:
    """One inertia with friction.

    Attributes
    ----------
    inertia : float
        J, kg·m² (all that turns, seen at the motor).
    friction : Model
        The friction torque that opposes its motion.
    load : float
        Normal load on its contacts over the load at which the friction's parameters hold.
    temperature : float
        Of its contacts, °C. Both matter to friction with a dependence on them (`stickslip.laws.modulation`).
    """

    inertia: float
    friction: Model
    load: float = 1.0
    temperature: float = 20.0

    def __post_init__(self) -> None:
        insist_on_own(self, "axis")
        if not math.isfinite(self.inertia) or self.inertia <= 0.0:
            raise ParameterError(f"axis: inertia = {self.inertia:g} kg·m² must be greater than 0 and finite")
        if not (math.isfinite(self.load) and self.load >= 0.0):
            raise ParameterError(f"axis: load = {self.load:g} must be a finite number of at least 0")
        if not (math.isfinite(self.temperature) and self.temperature >= ABSOLUTE_ZERO):
            raise ParameterError(
                f"axis: temperature = {self.temperature:g} °C must be a finite number of at least "
                f"{ABSOLUTE_ZERO:g} °C, absolute zero"
            )

    def __repr__(self) -> str:
        return making(self, standard_of(RigidAxis))
