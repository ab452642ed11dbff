"""The angle at which a pendulum hangs, determined up to whole turns, shifted to a common turn in two models."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stickslip.identification.identified_file import Identified

ANGLE = "gravity_angle"
"""Name of the angle, rad. It has no natural zero, so percentages and logarithms of it are meaningless."""


def in_one_turn(first: Identified, second: Identified) -> Identified:
    """Return the second model with its angle shifted by whole turns to within half a turn of the first one's."""
    angles = [e.value for m in (first, second) for e in m.estimates if e.name == ANGLE]
    if len(angles) < 2 or not all(map(math.isfinite, angles)):
        return second
    by = math.tau * round((angles[0] - angles[1]) / math.tau)
    estimates = tuple(
        replace(e, value=e.value + by, lower=e.lower + by, upper=e.upper + by) if e.name == ANGLE else e
        for e in second.estimates
    )
    return replace(second, estimates=estimates)


def without_angle(found: Identified) -> Identified:
    """Return the model without that angle: after conversion through a gear, it has whole turns of another shaft."""
    kept = [k for k, e in enumerate(found.estimates) if e.name != ANGLE]
    correlation = found.correlation[np.ix_(kept, kept)]
    return replace(found, estimates=tuple(found.estimates[k] for k in kept), correlation=correlation)
