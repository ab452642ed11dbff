"""What depends on the angle of an axis: friction's ripple, and the torque that acts beside friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.machines.motor import Harmonics
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]
NONE = Harmonics()


@dataclass(frozen=True)
class AngleMap:
    """What depends on the angle of an axis.

    Attributes
    ----------
    ripple : Harmonics
        Of friction, relative to its mean over a revolution.
    beside : Harmonics
        Of the torque that the drive must give beside friction, whatever the direction, N·m.
    offset : float
        Mean of that torque, N·m: a load, or half of what friction differs by between the directions.
    """

    ripple: Harmonics = NONE
    beside: Harmonics = NONE
    offset: float = 0.0

    def torque(self, angle: Array) -> Array:
        """What the drive must give beside friction at angles (rad), N·m, shape (n,)."""
        return self.offset + harmonic_sum(self.beside, angle)

    @property
    def largest(self) -> float:
        """A bound of what the drive must give beside friction, N·m."""
        return abs(self.offset) + sum(self.beside.amplitude)

    def on(self, model: Model) -> Model:
        """A law with this ripple: thesis 2.1.6.

        Raises
        ------
        InputError
            If the law depends on the position already: the ripple would stand twice.
        """
        if not self.ripple.order:
            return model
        own = model.law.option_of("position_dependence")
        if own not in ("", "none"):
            raise InputError(
                f"{model.law.name} depends on the position by position_dependence = {own!r} and by the ripple of "
                "[angle]; leave one of them out"
            )
        values: dict[str, Any] = {
            k: list(cast("tuple[float, ...]", v)) if isinstance(v, tuple) else v
            for k, v in model.parameters._asdict().items()
        }
        choices = {**model.law.chosen, "position_dependence": "spectrum"}
        return Model(
            model.law, choices, **values, ripple=list(self.ripple.amplitude), order=list(self.ripple.order),
            ripple_phase=list(self.ripple.phase),
        )  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """Plain data, as ``[angle]`` of a model.toml holds it."""
        return {
            "ripple_order": list(self.ripple.order), "ripple": list(self.ripple.amplitude),
            "ripple_phase": list(self.ripple.phase), "torque_offset": self.offset,
            "torque_order": list(self.beside.order), "torque": list(self.beside.amplitude),
            "torque_phase": list(self.beside.phase),
        }  # fmt: skip

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> AngleMap:
        """What `as_dict` wrote.

        Raises
        ------
        InputError
            If a list is missing or no list of numbers.
        """

        def harmonics(order: str, amplitude: str, phase: str) -> Harmonics:
            return Harmonics(*(tuple(float(x) for x in data[key]) for key in (order, amplitude, phase)))

        try:
            return cls(
                harmonics("ripple_order", "ripple", "ripple_phase"),
                harmonics("torque_order", "torque", "torque_phase"), float(data["torque_offset"]),
            )  # fmt: skip
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"[angle] cannot be read ({error}); identify the axis again") from None


def harmonic_sum(h: Harmonics, angle: Array) -> Array:
    """A sum of harmonics at angles, shape (n,)."""
    total = np.zeros_like(angle)
    for n, a, p in zip(h.order, h.amplitude, h.phase, strict=True):
        total += a * np.cos(n * angle + p)
    return total
