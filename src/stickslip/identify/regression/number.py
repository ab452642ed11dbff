"""A number that a regression gives, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

from stickslip.identify.fit.uncertainty import RATIO

QUANTILE = 1.96
"""Standard deviations on either side of 95 %."""


@dataclass(frozen=True, slots=True)
class Number:
    """A value and its standard deviation."""

    value: float
    std: float

    @property
    def interval(self) -> tuple[float, float]:
        """Of 95 %."""
        return self.value - QUANTILE * self.std, self.value + QUANTILE * self.std

    @property
    def told_to_two(self) -> bool:
        """Whether its interval spans a factor of two at most."""
        low, high = self.interval
        return 0.0 < high <= RATIO * low
