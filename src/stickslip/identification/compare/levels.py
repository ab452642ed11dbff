"""Size of the difference between two identified models, with its interval, whatever their laws.

Parameters of different laws have no common meaning; the torque at a speed has. Levels are torques at speeds that both
records contain, and at break-away if both models identified it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.identification.compare.same_turn import ANGLE
from stickslip.identification.estimate import Estimate
from stickslip.identification.fit.uncertainty import RATIO
from stickslip.identification.identified_file import Identified
from stickslip.identification.monte_carlo import curve_band, resisting_torque

Array = np.ndarray[Any, np.dtype[np.float64]]

DRAWS = 400


@dataclass(frozen=True)
class Change:
    """One number in both models, with its change.

    ``p`` is the probability of such a difference without a change, after Holm; NaN for a torque, whose interval
    decides. A number of friction decides (``decides``) only if the joint tests show that friction has changed.
    ``lower`` and ``upper`` are the 95 % bounds of second minus first.
    """

    name: str
    unit: str
    first: float
    second: float
    lower: float
    upper: float
    p: float
    decides: bool = True

    @property
    def changed(self) -> bool:
        """Whether it changed, at the 5 % level of all parameters; for a torque, whether its interval excludes 0."""
        return self.decides and self.differs

    @property
    def differs(self) -> bool:
        """Whether it differs, whatever the other tests show."""
        return self.told if math.isnan(self.p) else self.p < 0.05

    @property
    def percent(self) -> float:
        """Change in per cent of the first value; NaN if that is not meaningful.

        That is the case for a value near 0 relative to the interval of the change (such as an offset), for opposite
        signs, and for an angle.
        """
        near_zero = abs(self.first) <= 0.5 * (self.upper - self.lower)
        told = self.first * self.second > 0.0 and not near_zero and self.name != ANGLE
        return 100.0 * (self.second / self.first - 1.0) if told else math.nan

    @property
    def percent_span(self) -> tuple[float, float]:
        """The 95 % interval of the change, per cent of the first value; NaN where `percent` is."""
        if math.isnan(self.percent):
            return math.nan, math.nan
        low, high = sorted((100.0 * self.lower / self.first, 100.0 * self.upper / self.first))
        return low, high

    @property
    def told(self) -> bool:
        """Whether its own interval excludes 0."""
        return self.lower > 0.0 or self.upper < 0.0

    def of(self, law: Collection[str]) -> bool:
        """Return whether it is one of these parameters, or an element of one."""
        return self.name.partition("[")[0] in law

    def words(self) -> str:
        """Return name, change and interval as text: in per cent, or in its unit if that is not meaningful."""
        if math.isnan(self.percent):
            by = self.second - self.first
            return f"{self.name} {by:+.3g} {self.unit} [{self.lower:+.3g}, {self.upper:+.3g}]"
        low, high = self.percent_span
        return f"{self.name} {rounded(self.percent)} % [{rounded(low)}, {rounded(high)}]"


def rounded(percent: float) -> str:
    """Return a signed percentage: a whole number from 10 on, two digits below."""
    return f"{percent:+.0f}" if abs(percent) >= 9.95 else f"{percent:+.2g}"


def common_speeds(first: Identified, second: Identified) -> tuple[float, float] | None:
    """Return the least and greatest speed in both records, either direction, rad/s; None if a file lacks them."""
    if not (first.speeds and second.speeds):
        return None
    ends = [
        (min(float(v[0]) for v in m.speeds.values()), max(float(v[-1]) for v in m.speeds.values()))
        for m in (first, second)
    ]
    low, high = max(e[0] for e in ends), min(e[1] for e in ends)
    return (low, high) if low < high else None


def believed(model: Identified) -> tuple[tuple[Estimate, ...], Array]:
    """Return the law's estimates and their correlation.

    A narrow interval of an estimate that was not identified is widened by `RATIO` to each side, since it does not
    include the reason for that verdict.
    """
    estimates, correlation = model.law_estimates
    return tuple(
        replace(e, lower=e.lower / RATIO, upper=e.upper * RATIO)
        if not e.identified and e.value > 0.0 and e.upper <= RATIO * e.lower else e for e in estimates
    ), correlation  # fmt: skip


def levels_of(first: Identified, second: Identified, low: float, high: float) -> tuple[Change, ...]:
    """Compare break-away and the torque at three speeds from `low` to `high`, rad/s, in each direction of a law."""
    speeds = [low, math.sqrt(low * high), high]
    two = any(m.model.law.chosen.get("symmetry") == "asymmetric" for m in (first, second))
    points = [*speeds, *(-v for v in speeds)] if two else speeds
    names = [f"friction at {v:.3g} {first.unit('rad/s')}" for v in points]
    if all(any(e.name == "fs" and e.identified for e in m.estimates) for m in (first, second)):
        points, names = [0.0, *points], ["break-away", *names]
    velocity = np.array(points)
    best = [resisting_torque(m.model, velocity) for m in (first, second)]
    drawn = [
        curve_band(m.model, *believed(m), velocity, DRAWS, seed) for seed, m in enumerate((first, second))
    ]
    count = min(len(d) for d in drawn)
    if count < 20:
        return ()
    off = (drawn[1][:count] - best[1]) - (drawn[0][:count] - best[0])
    low_, high_ = np.percentile(off, [2.5, 97.5], axis=0)
    unit = first.unit("N·m")
    return tuple(
        Change(name, unit, float(a), float(b), float(b - a + lo), float(b - a + hi), math.nan, decides=False)
        for name, a, b, lo, hi in zip(names, *best, low_, high_, strict=True)
    )


def said_of(
    changes: Sequence[Change], levels: Sequence[Change], own: Collection[str], changed: bool, untold: Sequence[str]
) -> str:  # fmt: skip
    """Return the verdict as text: changes of friction, of other parameters, and the parameters in `untold`."""
    beside = [c.words() for c in changes if c.changed and not c.of(own)]
    friction = ", ".join(c.words() for c in (*(c for c in changes if c.of(own)), *levels) if c.differs)
    names = ", ".join(untold)
    text = "No change of the friction that the intervals do not explain."
    if changed:
        text = f"The friction has changed{': ' if friction else ''}{friction}."
    elif friction:
        why = "chance, or what is not identified, may explain it" if untold else "chance may explain it"
        text = f"The friction may have changed: {friction}; its curve as a whole does not say so, and {why}."
    if untold:
        text += f" Not identified in both, so nothing is said of {names}."
    if beside:
        text += f" Beside it has changed: {', '.join(beside)}."
    return text


def unseen(changes: Sequence[Change], levels: Sequence[Change]) -> tuple[str, ...]:
    """Report, for each number without a change, the smallest change that would have been detected."""
    parts: list[str] = []
    for c in (*changes, *levels):
        if c.differs or c.told:
            continue
        half = 0.5 * (c.upper - c.lower)
        size = f"{100.0 * half / abs(c.first):.2g} %" if c.first else f"{half:.2g} {c.unit}"
        if not math.isnan(c.percent) or not c.first:
            parts.append(f"{c.name} by {size}")
        else:
            parts.append(f"{c.name} by {half:.2g} {c.unit}")
    return (f"Smaller changes than these would not have been seen: {', '.join(parts)}.",) if parts else ()
