"""Numbers as people read them."""

from __future__ import annotations

PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"))


def quantity(value: float, unit: str) -> str:
    """A value with three digits, in milli or micro units where that is easier to read."""
    if not unit or unit == "/s":
        return f"{value:.3g} {unit}".rstrip()
    if abs(value) < 1e-10:
        return f"0 {unit}"
    factor, prefix = next((p for p in PREFIXES if abs(value) * p[0] >= 0.1), PREFIXES[-1])
    return f"{value * factor:.3g} {prefix}{unit}"
