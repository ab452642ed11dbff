"""A torque over the angle as harmonics: what depends on the position alone, and what on position and direction."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError, ParameterError

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Waves:
    """A sum of cosine_k cos(order_k theta) + sine_k sin(order_k theta); orders in 1/rad: periods of a turn."""

    order: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.order) == len(self.cosine) == len(self.sine):
            raise ParameterError(
                f"waves: {len(self.order)} orders, {len(self.cosine)} cosines and {len(self.sine)} sines; give as many "
                "of each"
            )
        if not all(math.isfinite(x) for x in (*self.order, *self.cosine, *self.sine)):
            raise ParameterError("waves: every order, cosine and sine must be a finite number")

    @property
    def amplitude(self) -> tuple[float, ...]:
        """Of every order."""
        return tuple(map(math.hypot, self.cosine, self.sine))

    @property
    def phase(self) -> tuple[float, ...]:
        """Of every order, rad: amplitude cos(order theta + phase)."""
        return tuple(math.atan2(-s, c) for c, s in zip(self.cosine, self.sine, strict=True))

    def at(self, angle: Array) -> Array:
        """The sum at angles (rad), shape (n,)."""
        total = np.zeros(np.shape(angle))
        for n, c, s in zip(self.order, self.cosine, self.sine, strict=True):
            total += c * np.cos(n * angle) + s * np.sin(n * angle)
        return total


@dataclass(frozen=True)
class PositionMap:
    """What a drive must give at an angle: even part + direction x odd part, torque or current.

    Attributes
    ----------
    even : Waves
        Cogging, gravity, unbalance: the same in both directions.
    odd : Waves
        Changes its sign with the direction: friction that varies over the angle.
    offset, friction : float
        Means of the two parts.
    unit : str
        "N·m", "N" or "A".
    lower, upper : float
        Angles between which it was measured, rad; a whole turn or more holds everywhere.
    table, table_odd : tuple of float
        Values of the two parts without their means at ``2 pi i / len(table)``, where a table was
        chosen instead of harmonics.
    residual : float
        What it leaves on places that were not fitted, RMS, `unit`.
    """

    even: Waves = Waves()
    odd: Waves = Waves()
    offset: float = 0.0
    friction: float = 0.0
    unit: str = "N·m"
    lower: float = -math.inf
    upper: float = math.inf
    table: tuple[float, ...] = ()
    table_odd: tuple[float, ...] = ()
    residual: float = math.nan

    @property
    def form(self) -> str:
        """ "harmonics" or "table"."""
        return "table" if self.table else "harmonics"

    def beside(self, angle: Array) -> Array:
        """The even part without its mean at angles (rad), shape (n,)."""
        return _in_table(self.table, angle) if self.table else self.even.at(angle)

    def ripple(self, angle: Array) -> Array:
        """The odd part without its mean at angles (rad), shape (n,)."""
        return _in_table(self.table_odd, angle) if self.table_odd else self.odd.at(angle)

    def __call__(self, angle: Array, direction: Array | float) -> Array:
        """What the drive must give at angles (rad) and directions (+1, -1), shape (n,)."""
        return self.offset + self.beside(angle) + direction * (self.friction + self.ripple(angle))

    def sampled(self, points: int) -> Array:
        """The even part at ``2 pi i / points``, shape (points,)."""
        return self.beside(2.0 * math.pi * np.arange(points) / points)

    def scaled(self, factor: float, unit: str) -> PositionMap:
        """The map in another unit: all its values multiplied."""

        def waves(w: Waves) -> Waves:
            return Waves(w.order, tuple(factor * x for x in w.cosine), tuple(factor * x for x in w.sine))

        return PositionMap(
            waves(self.even), waves(self.odd), factor * self.offset, factor * self.friction, unit, self.lower,
            self.upper, tuple(factor * x for x in self.table), tuple(factor * x for x in self.table_odd),
            abs(factor) * self.residual,
        )  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """Plain data, as ``[position_map]`` of a file holds it."""
        parts = {"even": self.even, "odd": self.odd}
        return {
            **{f"{k}_{n}": list(getattr(w, n)) for k, w in parts.items() for n in ("order", "cosine", "sine")},
            **{k: float(getattr(self, k)) for k in ("offset", "friction", "lower", "upper", "residual")},
            "unit": self.unit, "table": list(self.table), "table_odd": list(self.table_odd),
        }  # fmt: skip

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> PositionMap:
        """What `as_dict` wrote.

        Raises
        ------
        InputError
            If a key is missing, or is no number or list of numbers.
        """

        def numbers(key: str) -> tuple[float, ...]:
            return tuple(float(x) for x in data[key])

        def waves(part: str) -> Waves:
            return Waves(numbers(f"{part}_order"), numbers(f"{part}_cosine"), numbers(f"{part}_sine"))

        try:
            levels = {k: float(data[k]) for k in ("offset", "friction", "lower", "upper", "residual")}
            return cls(
                waves("even"), waves("odd"), unit=str(data["unit"]), table=numbers("table"),
                table_odd=numbers("table_odd"), **levels,
            )  # fmt: skip
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"[position_map] cannot be read ({error}); identify the axis again") from None


def _in_table(values: tuple[float, ...], angle: Array) -> Array:
    """A table over a turn at angles (rad), linear between its points."""
    turn = 2.0 * math.pi
    return np.interp(np.mod(angle, turn), turn * np.arange(len(values)) / len(values), values, period=turn)
