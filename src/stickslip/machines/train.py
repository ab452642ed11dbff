"""Inertias in a row with springs between them, as a machine has them instead of one inertia."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Self

from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import Chain


class Train(ABC):
    """What a machine with springs is: torque acts on the first inertia, friction on the last."""

    @property
    @abstractmethod
    def inertias(self) -> tuple[float, ...]:
        """Motor first, kg·m²."""

    @property
    @abstractmethod
    def springs(self) -> tuple[float, ...]:
        """Between them, N·m/rad."""

    @property
    @abstractmethod
    def dampers(self) -> tuple[float, ...]:
        """Viscous damping beside each spring, N·m·s/rad."""

    @property
    @abstractmethod
    def encoder_at(self) -> int:
        """The inertia whose angle is measured, counted from 0."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """The same with every inertia times `factor`."""

    @property
    def inertia(self) -> float:
        """Of the whole axis, kg·m²."""
        return sum(self.inertias)

    @property
    def modes(self) -> tuple[float, ...]:
        """Undamped modes of the free axis, Hz, ascending from 0, the rigid motion."""
        return tuple(Chain(self.inertias, self.springs).modes().frequencies.tolist())

    @property
    def behind_encoder(self) -> float:
        """Compliance between encoder and friction, rad/(N·m)."""
        return math.fsum(1.0 / k for k in self.springs[self.encoder_at :])

    def visible(self, stiffness: float) -> float:
        """`stiffness` of a contact (N·m/rad) as the encoder sees it: in series with the springs between."""
        return 1.0 / (1.0 / stiffness + self.behind_encoder)

    def behind(self, visible: float) -> float:
        """Stiffness of the contact whose stiffness at the encoder is `visible`; infinite if what lies between is
        softer."""
        rest = 1.0 / visible - self.behind_encoder
        return 1.0 / rest if rest > 0.0 else math.inf


def refuse_part(owner: str, name: str, value: float, unit: str) -> None:
    """Refuse an inertia or a spring that is none.

    Raises
    ------
    ParameterError
    """
    if not (value > 0.0 and math.isfinite(value)):
        raise ParameterError(f"{owner}: {name} = {value:g} {unit} must be greater than 0 and finite")


def refuse_damping(owner: str, damping: float) -> None:
    """Refuse what is no part of critical damping.

    Raises
    ------
    ParameterError
    """
    if not 0.0 <= damping < 1.0:
        raise ParameterError(f"{owner}: damping = {damping:g} must be at least 0 and less than 1")
