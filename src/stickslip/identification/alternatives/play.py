"""Backlash: after braking starts, the load crosses the gap for a while and the motor moves alone."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative, braking
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

SPELLS = (0.0, 0.015, 0.04, 0.1)
"""Bounds of the intervals after braking starts, s: a gap of some hundredths of a radian is crossed in tens of
milliseconds."""


def in_the_gap(record: SlidingRecord) -> Array:
    """Return the acceleration in intervals after braking starts, shape (samples, 3)."""
    on = braking(record) > 0.0
    begins = np.concatenate([[False], on[1:] & ~on[:-1]])
    began = np.maximum.accumulate(np.where(begins, np.arange(on.size), -(10**9)))
    late = (np.arange(on.size) - began) * record.period
    spells = [on & (late >= a) & (late < b) for a, b in itertools.pairwise(SPELLS)]
    return record.acceleration[:, None] * np.column_stack(spells)


ALTERNATIVES = (
    Alternative(
        "play", lambda rows: rows.see(in_the_gap), "inertia", absent=0.002, present=(0.3,), odds=0.2, compliant=True,
        cause="backlash", remedy="record moves at constant speed with gentle ramps, which keep the play closed",
    ),
)  # fmt: skip
