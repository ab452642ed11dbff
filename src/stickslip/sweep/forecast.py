"""How long a sweep takes, told before it starts: a few of its own cases are timed, with the checks that it runs."""

from __future__ import annotations

import time

import numpy as np

from stickslip.sweep.block import compute_cases, integrator_of
from stickslip.sweep.plan import BLOCK, Sweep

MOST_TIMED, SHARE = 16, 0.05
"""Cases timed of every run, at most, and as part of all that it has."""
CHUNK = 4
"""Cases timed at once."""
PATIENCE = 6.0
"""s of timing in all, about."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
"""Multiples of it, their whole part left out, are spread evenly from the first one on."""


def seconds_of(sweep: Sweep) -> float:
    """Time of a processor that the sweep takes, s, about: compilation left out.

    Every run is timed with cases of the sweep, evenly spread: compensators hunt in some, whose checks then go on to
    tighter tolerances, so that the nominal case tells too little.
    """
    patience = PATIENCE / len(sweep.runs)
    return sum(_seconds_of_run(sweep, run, patience) for run in range(len(sweep.runs)))


def _seconds_of_run(sweep: Sweep, run: int, patience: float) -> float:
    """Of all cases of one run."""
    cases = sweep.drawn.cases
    if integrator_of(sweep, run)[0] == "lanes":
        # Lanes are filled by whole blocks.
        chunk = most = min(BLOCK, cases)
    else:
        chunk, most = CHUNK, min(MOST_TIMED, max(CHUNK, int(SHARE * cases)))
    spent, timed = 0.0, 0
    _timed(sweep, run, [0])  # It compiles.
    while timed < most and spent < patience:
        spent += _timed(sweep, run, [int(cases * (GOLDEN * (timed + i) % 1.0)) for i in range(chunk)])
        timed += chunk
    return spent * cases / timed


def _timed(sweep: Sweep, run: int, cases: list[int]) -> float:
    """Time of a processor that these cases take, s."""
    numbers = np.concatenate([sweep.drawn.block(i, i + 1) for i in cases])
    begun = time.process_time()
    compute_cases(sweep, run, 0, numbers)
    return time.process_time() - begun
