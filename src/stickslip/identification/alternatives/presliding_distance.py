"""Friction that builds up again after every reversal or stop, over an unknown distance."""

from __future__ import annotations

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative

DISTANCES = (1e-4, 5e-4, 2.5e-3, 1.25e-2)
"""Distances of the build-up, parts of the range of motion, by factors of five."""
ALTERNATIVES = (
    Alternative(
        "rebuilding", lambda rows: rows.see(
            lambda r: r.sign[:, None] * np.exp(-r.since[:, None] / (np.array(DISTANCES) * rows.range))
        ),
        absent=0.05, present=(0.5,), odds=0.5,
        cause="friction that builds up again behind reversals", remedy="record longer strokes",
    ),
)  # fmt: skip
