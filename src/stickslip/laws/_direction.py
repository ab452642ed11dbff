"""The direction of motion as a mode, for laws with modes whose rates have a kink at zero velocity.

0: not known (at rest), +1 or -1: moving in that direction. An engine that locates the end of this mode never
integrates across the kink.
"""

from __future__ import annotations


def direction_ends(mode: float, v: float) -> float:
    """The value that rises to zero where the direction ends."""
    if mode != 0.0:
        return -mode * v
    if v != 0.0:
        return abs(v)
    return -1.0


def direction_of(v: float) -> float:
    """+1, -1, or 0 at rest."""
    if v > 0.0:
        return 1.0
    if v < 0.0:
        return -1.0
    return 0.0
