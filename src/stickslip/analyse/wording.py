"""Format numbers for people."""

from __future__ import annotations

import math

UNBOUNDED = 1e6
"""Multiple of a value above which the end of its interval counts as unlimited."""
HUGE = 1e30
"""The same for the value 0."""
NO_LIMIT = "no limit"
PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"))


def quantity(value: float, unit: str) -> str:
    """Return a value with three digits, in milli or micro units if that is easier to read."""
    if not unit or unit == "/s":
        return f"{value:.3g} {unit}".rstrip()
    if abs(value) < 1e-10:
        return f"0 {unit}"
    factor, prefix = next((p for p in PREFIXES if abs(value) * p[0] >= 0.1), PREFIXES[-1])
    return f"{value * factor:.3g} {prefix}{unit}"


def ends(value: float, lower: float, upper: float, form: str = ".4g") -> tuple[str, str]:
    """Return the bounds of an interval; "no limit" for one that is infinite or many decades beyond the value.

    Parameters
    ----------
    value, lower, upper : float
        In one unit.
    form : str
        Format of the bounds.
    """
    most = UNBOUNDED * max(abs(value), min(abs(lower), abs(upper))) or HUGE
    low = NO_LIMIT if lower < -most or lower == -math.inf else format(lower, form)
    high = NO_LIMIT if upper > most or upper == math.inf else format(upper, form)
    return low, high
