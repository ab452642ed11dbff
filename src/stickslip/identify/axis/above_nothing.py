"""What no axis is without, an inertia and a level of friction, where the whole record would have none of it.

Least squares over reversals put what is not identified at 0 where friction builds up late, the torque comes late or
speeds are few. Such a value is of no use to a simulation or a recommendation; what other estimators say is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from stickslip.identify.estimate import Estimate

NEVER_NONE, TOUCHES = ("inertia", "fc"), 1e-6
"""Beginnings of the names of what no axis is without; part of its bound that a value at it may be off."""
QUANTILE = 1.96


def above_nothing(
    found: tuple[dict[str, float], float], values: Mapping[str, float], free: Mapping[str, tuple[float, float]],
    solved: Callable[[dict[str, float], dict[str, tuple[float, float]]], tuple[dict[str, float], float]], most: float,
) -> tuple[dict[str, float], float]:  # fmt: skip
    """What was found, an inertia and levels of friction that ended at their lower bounds as they were in `values`, and
    what else is free found anew; and what is left of the torque.

    Reversals, late torque or too few speeds send them there, though no axis is so. They stay there where else more than
    `most` of the torque would be left.
    """
    chosen, left = found
    while gone := {
        n: min(values[n], b[1]) for n, b in free.items()
        if n.startswith(NEVER_NONE) and chosen[n] <= (1.0 + TOUCHES) * b[0] < values[n]
    }:  # fmt: skip
        free = {n: b for n, b in free.items() if n not in gone}
        chosen, left = solved({**chosen, **gone}, free)
    return (chosen, left) if left <= max(most, found[1]) else found


def likely(estimates: Sequence[Estimate]) -> dict[str, float]:
    """The values of estimates; of an inertia that was cut off at its bound what its interval leaves above 0, on
    average."""
    return {e.name: above_zero(e) if e.name == "inertia" else e.value for e in estimates}


def above_zero(e: Estimate) -> float:
    """The value of an estimate; of one whose interval was cut off below, the mean of the normal distribution above 0
    (Johnson, Kotz and Balakrishnan 1994, 13.10)."""
    middle = e.upper - QUANTILE * e.std
    if e.identified or e.value > e.lower or not (e.std > 0.0 and -math.inf < middle < 0.0 < e.upper):
        return e.value
    out = -middle / e.std
    density = math.exp(-0.5 * out * out) / math.sqrt(2.0 * math.pi)
    return middle + e.std * density / (0.5 * math.erfc(out / math.sqrt(2.0)))
