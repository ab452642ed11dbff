"""Friction and constant torque that change with time (warm-up, grease that spreads) or between records."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative, legendre
from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]

REMEDY = "warm the axis up first, and repeat moves in another order"


def over_time(record: SlidingRecord) -> Array:
    """Return constant torque and friction that change smoothly over the record, shape (samples, 6)."""
    late = legendre(np.linspace(-1.0, 1.0, record.time.size), range(1, 4))
    return np.column_stack([late, record.sign[:, None] * late])


def by_record(rows: SlidingRows) -> Array:
    """Return constant torque and friction of each record minus the mean of all, shape (n, 2 records)."""
    own = list(rows.records)
    of = np.concatenate([np.full(b.centres.size, own.index(b.record)) for b in rows.blocks])
    each = (of[:, None] == np.arange(len(own))) - 1.0 / len(own)
    return np.column_stack([each, rows.sign[:, None] * each])


ALTERNATIVES = (
    Alternative(
        "drift", lambda rows: rows.see(over_time), absent=0.0005, present=(0.05,), odds=0.2, removable=True,
        cause="friction that changes with time", remedy=REMEDY,
    ),
)  # fmt: skip
BETWEEN_RECORDS = Alternative(
    "change between records", by_record, absent=0.0005, present=(0.05,), odds=0.2,
    cause="friction that differs from record to record", remedy="identify each record on its own",
)  # fmt: skip
