"""What stands between a torque command and the torque on the rotor: converters, current loop, cogging, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.description import Par
from stickslip.core.errors import ParameterError
from stickslip.machines.described import described

HIGHEST = 4096
"""Order, at most: 24 slots behind a gear of 1:50 have 1200 at the output."""


@constructor_named
@described
@dataclass(frozen=True)
class Converter:
    """An analogue output or input of so many bits over plus and minus a range."""

    bits: Annotated[
        int, Par("-", "", "bits of the converter; 0 converts exactly", lower=0.0, upper=52.0, whole=True)
    ] = 0
    range: Annotated[
        float, Par("-", "", "largest value that it converts, in the unit of what it converts", positive=True)
    ] = math.inf

    def __post_init__(self) -> None:
        insist_on_own(self, "converter")
        if self.bits < 0 or self.bits > 52:
            raise ParameterError(f"converter: bits = {self.bits} must be from 0 to 52")
        if self.bits and not (self.range > 0.0 and math.isfinite(self.range)):
            raise ParameterError(f"converter: range = {self.range:g} must be a finite number greater than 0")

    @property
    def step(self) -> float:
        """The least difference it tells, in the unit of its range; 0 for an exact one."""
        return 2.0 * self.range / 2.0**self.bits if self.bits else 0.0


@constructor_named
@described
@dataclass(frozen=True)
class Amplifier:
    """A current amplifier with its motor.

    Attributes
    ----------
    command, monitor : Converter
        What the command comes from and the measured current goes to, A.
    """

    torque_constant: Annotated[float, Par("N·m/A", "", "torque per current", positive=True)]
    current_limit: Annotated[float, Par("A", "", "current at which it saturates", positive=True)] = math.inf
    bandwidth: Annotated[
        float,
        Par(
            "Hz",
            "",
            "corner of the current loop, of first order; without one it follows at once",
            positive=True,
        ),
    ] = math.inf
    command: Converter = Converter()
    monitor: Converter = Converter()
    current_noise: Annotated[
        float, Par("A", "", "RMS noise of the current itself, drawn anew for every sample", lower=0.0)
    ] = 0.0
    monitor_noise: Annotated[float, Par("A", "", "RMS noise of the measured current alone", lower=0.0)] = 0.0

    def __post_init__(self) -> None:
        insist_on_own(self, "amplifier")
        for name in ("torque_constant", "current_limit", "bandwidth"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"amplifier: {name} = {getattr(self, name):g} must be greater than 0")
        for name in ("current_noise", "monitor_noise"):
            if not getattr(self, name) >= 0.0:
                raise ParameterError(f"amplifier: {name} = {getattr(self, name):g} A must be at least 0")


@constructor_named
@described
@dataclass(frozen=True)
class Harmonics:
    """A sum of amplitude_k cos(order_k theta + phase_k) over a revolution.

    Cogging of a motor (amplitudes in N·m), or what a contact's friction varies by (relative): three lists of equal
    length.
    """

    order: Annotated[tuple[float, ...], Par("-", "", "waves a revolution, whole numbers from 1 to 4096")] = ()
    amplitude: Annotated[tuple[float, ...], Par("-", "", "size of each")] = ()
    phase: Annotated[tuple[float, ...], Par("rad", "", "where in its wave each is at angle 0")] = ()

    def __post_init__(self) -> None:
        insist_on_own(self, "harmonics")
        if not len(self.order) == len(self.amplitude) == len(self.phase):
            raise ParameterError(
                f"harmonics: {len(self.order)} orders, {len(self.amplitude)} amplitudes and {len(self.phase)} phases; "
                "give as many of each"
            )
        for order in self.order:
            if order != round(order) or not 1 <= order <= HIGHEST:
                raise ParameterError(f"harmonics: order {order:g} must be a whole number from 1 to {HIGHEST}")

    def at(self, angle: float) -> float:
        """The sum at an angle, rad."""
        return math.fsum(
            a * math.cos(n * angle + p)
            for n, a, p in zip(self.order, self.amplitude, self.phase, strict=True)
        )

    def peak_to_peak(self) -> float:
        """Greatest less least value over a revolution."""
        values = [self.at(2.0 * math.pi * i / 3600) for i in range(3600)]
        return max(values) - min(values)

    def scaled(self, factor: float) -> Harmonics:
        """All amplitudes multiplied by `factor`."""
        return Harmonics(self.order, tuple(factor * a for a in self.amplitude), self.phase)
