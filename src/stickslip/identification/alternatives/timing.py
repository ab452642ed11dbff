"""Timing of the torque's column: delayed or early relative to its row, or spread over time.

The plain model has a skew near 0 rows. The true one may be several rows (a bus, a filter in the log), and a hold, a
mean or a current loop equals a pure delay only to a few hundredths of a row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.core.messages import name_option
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]


def one_row(rows: SlidingRows) -> Array:
    """Return the effect of a delay of one row on a torque proportional to the acceleration, shape (n, 1)."""
    return (-rows.jerk * rows.period)[:, None]


ALTERNATIVES = (
    Alternative(
        "late torque", lambda rows: rows.jerk[:, None], "skew", present=(3.0,),
        cause="the delay of the torque column", remedy="log torque and motion by one clock, or state "
            f"{name_option('delay')}",
    ),
    Alternative(
        "no mere delay", one_row, "inertia", absent=0.03, present=(0.1,),
        cause="a torque column that is spread over time", remedy="log the torque at the drive's own rate, unfiltered",
    ),
    Alternative(
        "delay by frequency", lambda rows: one_row(rows) * rows.band[:, None], "inertia", absent=0.02, present=(0.5,),
        cause="a delay that differs with frequency", remedy="log the torque unfiltered",
    ),
)  # fmt: skip
