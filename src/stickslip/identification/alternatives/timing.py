"""The torque's column acts later or earlier than its row, or is spread over time.

The plain model has a skew near 0 rows. It may be off by several (a bus, a filter in the log), and a hold, a mean or a
current loop is a delay to a few hundredths of a row only.
"""

from __future__ import annotations

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows

ALTERNATIVES = (
    Alternative(
        "late torque", lambda rows: rows.jerk[:, None], "skew", absent=0.03, present=(3.0,),
        cause="the delay of the torque column", remedy="log torque and motion by one clock, or state --delay",
    ),
    Alternative(
        "delay by frequency", lambda rows: delay_by_band(rows), "inertia", absent=0.02, present=(0.5,),
        cause="a delay that differs with frequency", remedy="log the torque unfiltered",
    ),
)  # fmt: skip


def delay_by_band(rows: SlidingRows):
    """Jerk, with another sign in narrow windows than in wide ones."""
    return (-rows.jerk * rows.period * rows.band)[:, None]
