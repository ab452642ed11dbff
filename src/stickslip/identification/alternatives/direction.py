"""Inertia, viscous friction or the friction curve differ by direction of motion."""

from __future__ import annotations

import numpy as np

from stickslip.core.messages import name_option
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.alternatives.curve import octaves

REMEDY = (
    f"identify friction per direction ({name_option('per_direction', True)}), or record both directions alike"
)
VISCOUS = Alternative(
    "viscous friction by direction", lambda rows: rows.see(lambda r: np.abs(r.velocity)) / rows.fastest,
    present=(0.1,), odds=0.2, even=lambda v, rows: (v / rows.fastest)[:, None],
    cause="viscous friction that differs by direction", remedy=REMEDY,
)  # fmt: skip
ALTERNATIVES = (
    VISCOUS,
    Alternative(
        "inertia by direction", lambda rows: rows.see(lambda r: r.acceleration * r.sign), "inertia", present=(0.1,),
        splits="inertia", cause="an inertia that differs by direction", remedy=REMEDY,
    ),
    Alternative(
        "curve by direction", lambda rows: rows.see(lambda r: octaves(r.velocity, rows.fastest)),
        absent=0.0005, present=(0.01,), odds=0.2, even=lambda v, rows: octaves(v, rows.fastest),
        cause="a friction curve that differs by direction", remedy=REMEDY,
    ),
)  # fmt: skip
