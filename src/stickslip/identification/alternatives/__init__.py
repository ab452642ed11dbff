"""Alternative explanations of a record, one file per kind: to add an alternative, add a file here.

A file has ``ALTERNATIVES``, a tuple of `stickslip.identification.alternatives.alternative.Alternative`.
"""

from __future__ import annotations

from stickslip.identification.alternatives import (
    bands,
    braking_load,
    curve,
    direction,
    drift,
    elasticity,
    play,
    position,
    presliding_distance,
    timing,
)
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows

FILES = (
    timing,
    elasticity,
    play,
    bands,
    braking_load,
    direction,
    curve,
    presliding_distance,
    position,
    drift,
)


def usual_alternatives(rows: SlidingRows, by_direction: bool = False) -> tuple[Alternative, ...]:
    """Return all alternatives that need neither a model nor a search; fewer if friction is identified by direction."""
    between = (drift.BETWEEN_RECORDS,) if len(rows.records) > 1 else ()
    every = (*(a for file in FILES for a in file.ALTERNATIVES), *between)
    return tuple(a for a in every if not (by_direction and a is direction.VISCOUS))
