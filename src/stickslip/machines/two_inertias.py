"""Motor and load behind a spring, as a log of the motor's position and torque tells them.

Such an axis is described by its whole inertia J, the motor's part of it, and the frequency at which the load swings
while the motor is held (the antiresonance of its frequency response); free of its drive it resonates at that frequency
over the root of the motor's part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stickslip.core.errors import ParameterError
from stickslip.machines.two_mass import TwoMassAxis

USUAL_DAMPING = 0.03
"""Of the spring, part of critical: usual of belts, couplings and gears. A log hardly tells it."""


@dataclass(frozen=True)
class TwoInertias:
    """A motor and a load behind a spring.

    Attributes
    ----------
    antiresonance : float
        At which the load swings while the motor is held, Hz.
    antiresonance_interval : tuple of float
        Of 95 %.
    motor_share : float
        The motor's part of the whole inertia.
    motor_share_interval : tuple of float
        Of 95 %.

    Raises
    ------
    ParameterError
        If a number is outside what such an axis can have, or an interval does not hold its value.
    """

    antiresonance: float
    antiresonance_interval: tuple[float, float]
    motor_share: float
    motor_share_interval: tuple[float, float]

    def __post_init__(self) -> None:
        for name, most in (("antiresonance", math.inf), ("motor_share", 1.0)):
            value, (low, high) = getattr(self, name), getattr(self, f"{name}_interval")
            if not 0.0 < low <= value <= high < most:
                raise ParameterError(
                    f"two inertias: {name} = {value:g} [{low:g}, {high:g}] must be greater than 0, less than {most:g} "
                    "and within its interval"
                )

    @property
    def resonance(self) -> float:
        """At which motor and load swing against each other, Hz."""
        return self.antiresonance / math.sqrt(self.motor_share)

    def axis(
        self,
        inertia: float,
        damping: float = USUAL_DAMPING,
        antiresonance: float | None = None,
        motor_share: float | None = None,
    ) -> TwoMassAxis:
        """The axis of this inertia with the encoder at the motor and friction at the load.

        Parameters
        ----------
        inertia : float
            Of the whole, kg·m².
        damping : float
            Part of critical.
        antiresonance, motor_share : float, optional
            Other numbers within the intervals.

        Raises
        ------
        ParameterError
            If the inertia is not greater than 0.
        """
        motor = inertia * (self.motor_share if motor_share is None else motor_share)
        load = inertia - motor
        held = 2.0 * math.pi * (self.antiresonance if antiresonance is None else antiresonance)
        return TwoMassAxis(motor, load, load * held**2, damping)

    def as_dict(self) -> dict[str, Any]:
        """Plain data for a file."""
        return {
            "antiresonance": self.antiresonance, "antiresonance_interval": list(self.antiresonance_interval),
            "motor_share": self.motor_share, "motor_share_interval": list(self.motor_share_interval),
        }  # fmt: skip

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> TwoInertias:
        """As `as_dict` gave it.

        Raises
        ------
        KeyError, TypeError, ValueError
            If a number is missing or none.
        ParameterError
            As of the class.
        """
        (low, high), (least, most) = (content[f"{n}_interval"] for n in ("antiresonance", "motor_share"))
        return cls(
            float(content["antiresonance"]), (float(low), float(high)),
            float(content["motor_share"]), (float(least), float(most)),
        )  # fmt: skip
