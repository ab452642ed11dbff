"""The friction of a machine: a law, what it varies with, and the bearings' part of it.

Torques that people identify at the motor contain the bearings' friction; the law of a machine is written down with
it, and `Contact.clutch` takes it off again (thesis 4.3.1.1.2: "the friction in bearings can be treated as it is
composed of Coulomb and viscous friction levels").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, cast

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.core.errors import ParameterError
from stickslip.machines.described import described
from stickslip.machines.motor import Harmonics
from stickslip.models.model import Model

LEVELS = ("fs", "fc", "alpha0", "beta0", "curve_torque")
"""Parameters that lift a whole sliding curve: of the Stribeck curve, of thesis eqs. 4.4 and 4.5, of a table."""
NONE = Harmonics()


@constructor_named
@described
@dataclass(frozen=True)
class Bearings:
    """Coulomb and viscous friction of the shaft's and the motor's bearings, between motor and torque sensor."""

    coulomb: Annotated[
        float, Par("N·m", "", "friction that is approached over a displacement as in Dahl's law", lower=0.0)
    ] = 0.0
    viscous: Annotated[float, Par("N·m·s/rad", "", "viscous friction coefficient", lower=0.0)] = 0.0
    stiffness: Annotated[
        float, Par("N·m/rad", "", "slope of that friction over the displacement from rest", positive=True)
    ] = 5.0

    def __post_init__(self) -> None:
        insist_on_own(self, "bearings")
        for name in ("coulomb", "viscous"):
            value = getattr(self, name)
            if not (value >= 0.0 and math.isfinite(value)):
                raise ParameterError(f"bearings: {name} = {value:g} must be a finite number of at least 0")
        if not (self.stiffness > 0.0 and math.isfinite(self.stiffness)):
            raise ParameterError(
                f"bearings: stiffness = {self.stiffness:g} N·m/rad must be greater than 0 and finite"
            )


@constructor_named
@described
@dataclass(frozen=True)
class Drift:
    """Change of friction after the machine was switched on: a factor 1 + change (1 - exp(-(t - begin) / time))."""

    change: Annotated[float, Par("-", "", "part by which friction has changed in the end", upper=10.0)] = 0.0
    time: Annotated[float, Par("s", "", "time constant", positive=True)] = 1800.0
    begin: Annotated[float, Par("s", "", "when the change begins", lower=0.0)] = 0.0

    def __post_init__(self) -> None:
        insist_on_own(self, "drift")
        if not -1.0 < self.change <= 10.0:
            raise ParameterError(f"drift: change = {self.change:g} must be above -1 and at most 10")
        if not self.time > 0.0:
            raise ParameterError(f"drift: time = {self.time:g} s must be greater than 0")
        if not (self.begin >= 0.0 and math.isfinite(self.begin)):
            raise ParameterError(f"drift: begin = {self.begin:g} s must be a finite number of at least 0")


@constructor_named
@described
@dataclass(frozen=True)
class Heat:
    """How warm the contact gets and what that does: a factor exp(coefficient (T - reference)) on friction.

    The temperature follows ``ambient`` plus ``resistance`` times the power of friction, delayed by ``time``.
    """

    coefficient: Annotated[
        float, Par("1/K", "", "relative change of friction with temperature", lower=-0.1, upper=0.1)
    ] = 0.0
    reference: Annotated[float, Par("°C", "", "temperature at which friction is as written")] = 20.0
    ambient: Annotated[float, Par("°C", "", "temperature without friction, and at the start")] = 20.0
    resistance: Annotated[float, Par("K/W", "", "rise of temperature per power of friction", lower=0.0)] = 0.0
    time: Annotated[float, Par("s", "", "time constant of the temperature", positive=True)] = 600.0

    def __post_init__(self) -> None:
        insist_on_own(self, "heat")
        if not abs(self.coefficient) <= 0.1:
            raise ParameterError(f"heat: coefficient = {self.coefficient:g} 1/K must be from -0.1 to 0.1")
        if not (self.resistance >= 0.0 and self.time > 0.0):
            raise ParameterError(
                f"heat: resistance = {self.resistance:g} K/W must be at least 0, time = {self.time:g} s greater"
            )


@constructor_named
@dataclass(frozen=True)
class Contact:
    """The friction of a machine.

    Attributes
    ----------
    friction : Model
        The whole friction of the axis as a motor sees it, the bearings' included; parameters for both directions.
    ripple : Harmonics
        What it varies by over a revolution, relative.
    direction : (float, float)
        Factors on levels and viscous terms for positive and for negative velocity.
    bearings : Bearings
    drift : Drift
    heat : Heat
    """

    friction: Model
    ripple: Harmonics = NONE
    direction: tuple[float, float] = (1.0, 1.0)
    bearings: Bearings = Bearings()
    drift: Drift = Drift()
    heat: Heat = Heat()

    def __post_init__(self) -> None:
        insist_on_own(self, "contact")
        if math.fsum(self.ripple.amplitude) >= 1.0:
            raise ParameterError(
                f"contact: its ripple adds up to {math.fsum(self.ripple.amplitude):g} of friction; it must stay below 1"
            )
        for factor in self.direction:
            if not 0.0 < factor < 10.0:
                raise ParameterError(f"contact: direction factor {factor:g} must lie between 0 and 10")

    def clutch(self, stiffness: float = 1.0) -> Model:
        """The law of the friction disk alone: without the bearings' part, per direction; springs times `stiffness`."""
        values: dict[str, Any] = dict(self.friction.parameters._asdict())
        law = self.friction.law
        _less(values, law.name, self.bearings)
        if stiffness != 1.0:
            for name in ("k", "sigma0"):
                if name in values:
                    values[name] = _times(stiffness, values[name])
        if self.direction != (1.0, 1.0):
            for f in law.fields:
                if f.par.directional and "N·m" in f.par.unit:
                    base = values[f.name]
                    values[f"{f.name}_negative"] = _times(self.direction[1], base)
                    values[f.name] = _times(self.direction[0], base)
            law = law.having(symmetry="asymmetric")
        return Model(law, {}, **_listed(values))


def _less(values: dict[str, Any], name: str, bearings: Bearings) -> None:
    """Take the bearings' part off the levels and the viscous term."""
    if bearings.coulomb > 0.0:
        lifted = [key for key in LEVELS if key in values]
        if not lifted:
            raise ParameterError(
                f"bearings: law {name!r} has no level ({', '.join(LEVELS)}) that holds the bearings' Coulomb friction; "
                "set coulomb = 0"
            )
        for key in lifted:
            old = values[key]
            values[key] = (
                [x - bearings.coulomb for x in cast("tuple[float, ...]", old)]
                if isinstance(old, tuple)
                else old - bearings.coulomb
            )
    if bearings.viscous > 0.0:
        if "sigma2" not in values:
            raise ParameterError(f"bearings: law {name!r} has no viscous term sigma2; set viscous = 0")
        values["sigma2"] -= bearings.viscous


def _times(factor: float, value: Any) -> Any:
    if isinstance(value, (tuple, list)):
        return [factor * v for v in cast("list[float]", value)]
    return factor * value


def _listed(values: dict[str, Any]) -> dict[str, Any]:
    return {k: list(cast("tuple[float, ...]", v)) if isinstance(v, tuple) else v for k, v in values.items()}
