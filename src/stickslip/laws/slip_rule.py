"""The one rule from stick to slip, in its two readings.

An element that sticks slips once its load reaches its share of s(v). The thesis writes |F_i| > alpha_i s(v)
(after eq. 2.17); taken literally, an element still loaded against the motion slips the wrong way after a
reversal and feeds energy in. The signed reading counts only the load that resists the motion, and is passive.
"""

from __future__ import annotations

from typing import Any

from stickslip.core.spec import Choice, Option


def signed(direction: float, force: float) -> float:
    """Load of an element: the part of its force that resists motion in `direction` (+1 or -1), N·m."""
    return direction * force


def literal(direction: float, force: float) -> float:
    """Load of an element as the thesis prints it: |F_i|, N·m, whatever the direction."""
    return abs(force)


def switch(v: float, z: Any, p: Any, u: Any, g: Any) -> None:
    """Leave the modes whose guard is not negative: slip in the direction of motion, or stick."""
    direction = 1.0
    if v < 0.0:
        direction = -1.0
    for i in range(len(p.k)):
        if g.mode[i] >= 0.0:
            if z.mode[i] == 0.0:
                z.mode[i] = direction
            else:
                z.mode[i] = 0.0


SLIP_RULE = Choice(
    "slip_rule",
    replaces="load_of",
    options={"signed": Option(signed), "literal": Option(literal, passive=False)},
    default="signed",
)
