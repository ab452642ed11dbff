"""A bristle that slides faster than any axis under control does: a loop that runs away.

It settles within nanoseconds, so that steps, which have to follow that, would be millions a sample.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import kernel
from stickslip.simulation.sampled.rates import BENDS

RUNAWAY = 1e4
"""rad/s (1e5 rpm), from which an axis slides by the closed form of level friction."""
NEARLY = 1e-6
"""Of its level, by which a bristle counts as settled: it is in nanoseconds; steps that just follow it leave more."""
SERIES = 1e-4
"""Of a closed form's exponent, below which its series is as good."""


@kernel(exact=False)
def rush(axis: Any, z: Any, left: float) -> float:
    """Slide on while the bristle is bent as in steady sliding; returns the time taken, 0 where it is not bent so.

    Its force is level then, and the motion linear. At the end the axis has at least half of its velocity left.
    """
    speed = z.direction * z.velocity
    force, settled = z.direction * axis.level, max(axis.settled, NEARLY * axis.level)
    if axis.kind != BENDS or z.spring > 0.0 or 0.5 * speed <= axis.far or abs(z.slipping - force) > settled:
        return 0.0
    a = (z.torque - force - axis.viscous * z.velocity) / axis.inertia
    h = left
    if z.direction * a < 0.0:  # it slows down, most at the start
        h = min(h, 0.5 * speed / abs(a))
    damping = axis.viscous / axis.inertia
    x = damping * h
    kept = -math.expm1(-x) / damping if damping > 0.0 else h
    moved = a * (h - kept) / damping if x > SERIES else 0.5 * a * h * h * (1.0 - x / 3.0 * (1.0 - 0.25 * x))
    z.moved += z.velocity * h + moved
    z.velocity += a * kept
    z.slipping, z.acceleration = force, a * (1.0 - damping * kept)
    return h
