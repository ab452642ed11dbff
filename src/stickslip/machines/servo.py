"""The axis that a record was taken on: gearing, motor, gravity, and at which side it was measured.

Everything an identification returns holds at one side of the gearing, `ServoAxis.seen_from`: the position measured
there, the inertia and friction as felt there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from stickslip.core.arguments import no_number
from stickslip.core.errors import ParameterError
from stickslip.core.messages import in_linear_units, name_option
from stickslip.core.type_rules import is_number

SIDES = ("motor", "load")
GRAVITIES = ("constant", "pendulum")
MOTIONS = ("rotary", "linear")
DRIVE_QUANTITIES = ("torque", "current", "rated_torque", "voltage")
"""What a recorded drive signal may be: N·m, A, per cent of the rated torque, V."""


def positive(owner: str, name: str, value: Any, unit: str) -> None:
    """Refuse what is not a positive number."""
    if not is_number(value):
        raise no_number(owner, name, value, unit)
    if not (value > 0.0 and math.isfinite(value)):
        raise ParameterError(f"{owner}: {name} = {value:g} {unit} must be greater than 0 and finite")


@dataclass(frozen=True)
class Motor:
    """What turns the drive's signal into torque at the motor's shaft.

    Attributes
    ----------
    torque_constant : float or None
        kt, N·m/A (N/A). Needed for a current or a voltage.
    resistance : float or None
        R of the winding, ohm. Needed for a voltage: T = kt (u - ke v) / R; the inductance is neglected.
    back_emf_constant : float or None
        ke, V·s/rad; equal to kt in SI units where it is not given.
    rated_torque : float or None
        N·m. Needed for a torque in per cent of it.
    """

    torque_constant: float | None = None
    resistance: float | None = None
    back_emf_constant: float | None = None
    rated_torque: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (
            ("torque_constant", "N·m/A"), ("resistance", "ohm"), ("back_emf_constant", "V·s/rad"),
            ("rated_torque", "N·m"),
        ):  # fmt: skip
            if getattr(self, name) is not None:
                positive("motor", name, getattr(self, name), unit)

    def gains(self, quantity: str) -> tuple[float, float]:
        """Torque per unit of the signal, and torque lost per velocity, at the motor's shaft.

        Raises
        ------
        ParameterError
            If a constant that the quantity needs is not given.
        """
        if quantity == "torque":
            return 1.0, 0.0
        if quantity == "rated_torque":
            return self._needed("rated_torque", quantity) / 100.0, 0.0
        kt = self._needed("torque_constant", quantity)
        if quantity == "current":
            return kt, 0.0
        r = self._needed("resistance", quantity)
        ke = self.back_emf_constant if self.back_emf_constant is not None else kt
        return kt / r, kt * ke / r

    def _needed(self, name: str, quantity: str) -> float:
        value = getattr(self, name)
        if value is None:
            also = (
                f", or {name_option('drive_gain')}, the torque per unit of the signal (of a linear motor "
                f"{name_option('force_constant')})"
            )
            also = "" if name == "resistance" else also
            raise ParameterError(
                f"motor: a drive signal that is a {quantity} needs {name}; give {name_option(name)}{also}"
            )
        return value


@dataclass(frozen=True)
class ServoAxis:
    """Gearing, motor and gravity of an axis.

    Attributes
    ----------
    motion : {"rotary", "linear"}
        What the position is: rad with N·m, or m with N. The units of results follow.
    gear_ratio : float
        Turns of the motor per turn of the load (linear: rad of the motor per m).
    seen_from : {"load", "motor"}
        The side at which results hold.
    position_side, drive_side : {"load", "motor"}
        Where the position is measured, and where the torque acts.
    gravity : {"constant", "pendulum"}
        "constant": part of the offset; "pendulum": m g l sin(q - q0), identified or given.
    motor : Motor
        How the drive's signal becomes torque.
    drive_gain : float or None
        Torque per unit of the drive's signal at `drive_side`, instead of the motor's constants (N/V of a voltage
        that commands current, say).
    backlash : float
        Play between the side that moves and the position sensor, rad (m), at `seen_from`.
    """

    motion: str = "rotary"
    gear_ratio: float = 1.0
    seen_from: str = "load"
    position_side: str = "load"
    drive_side: str = "motor"
    gravity: str = "constant"
    motor: Motor = Motor()
    drive_gain: float | None = None
    backlash: float = 0.0

    def __post_init__(self) -> None:
        for name, allowed in (
            ("motion", MOTIONS), ("seen_from", SIDES), ("position_side", SIDES), ("drive_side", SIDES),
            ("gravity", GRAVITIES),
        ):  # fmt: skip
            if getattr(self, name) not in allowed:
                raise ParameterError(
                    f"axis: {name} = {getattr(self, name)!r} must be one of {', '.join(allowed)}"
                )
        if self.motion == "linear" and self.gravity == "pendulum":
            raise ParameterError(
                "axis: a pendulum turns, and this axis moves along a line, where weight is part of the offset; leave "
                f"out {name_option('pendulum', True)}"
            )
        positive("axis", "gear_ratio", self.gear_ratio, "-")
        if self.drive_gain is not None:
            positive("axis", "drive_gain", self.drive_gain, "N·m per unit of the drive's signal")
        if not (self.backlash >= 0.0 and math.isfinite(self.backlash)):
            raise ParameterError(f"axis: backlash = {self.backlash:g} must be 0 or greater")

    @property
    def position_factor(self) -> float:
        """Factor from the measured position to the one at `seen_from`."""
        if self.position_side == self.seen_from:
            return 1.0
        return self.gear_ratio if self.seen_from == "motor" else 1.0 / self.gear_ratio

    def drive_gains(self, quantity: str) -> tuple[float, float]:
        """Torque per unit of the drive's signal, and torque lost per velocity, at `seen_from`."""
        gain, loss = (self.drive_gain, 0.0) if self.drive_gain is not None else self.motor.gains(quantity)
        if self.drive_side == self.seen_from:
            return gain, loss
        ratio = self.gear_ratio if self.seen_from == "load" else 1.0 / self.gear_ratio
        return gain * ratio, loss * ratio * ratio

    def unit(self, angular: str) -> str:
        """A unit of the angular system in the axis's own: N·m becomes N, rad becomes m, kg·m² becomes kg."""
        return angular if self.motion == "rotary" else in_linear_units(angular)
