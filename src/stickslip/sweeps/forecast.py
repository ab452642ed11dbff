"""How long a sweep takes, told before it starts: a few of its own cases are timed, with the checks that it runs.

From the same times follows how many cases make a block: what is in hand is lost when the command is killed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from stickslip.sweeps.block import compute_cases
from stickslip.sweeps.plan import BLOCK, Sweep

MOST_TIMED, SHARE = 16, 0.05
"""Cases timed of every run, at most, and as part of all that it has."""
CHUNK = 4
"""Cases timed at once."""
PATIENCE = 6.0
"""s of timing in all, about."""
IN_HAND = 4.0
"""s that a block may take, about."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
"""Multiples of it, their whole part left out, are spread evenly from the first one on."""


def paces_of(sweep: Sweep) -> tuple[float, ...]:
    """Time of a processor that a case of every run takes, s, about: compilation left out.

    Every run is timed with cases of the sweep, evenly spread: compensators hunt in some, whose checks then go on to
    tighter tolerances, so that the nominal case tells too little.
    """
    patience = PATIENCE / len(sweep.runs)
    return tuple(_pace_of(sweep, run, patience) for run in range(len(sweep.runs)))


def seconds_of(sweep: Sweep, paces: Sequence[float]) -> float:
    """Time of a processor that the sweep takes, s, about."""
    return sweep.drawn.cases * sum(paces)


def block_size(pace: float) -> int:
    """Cases that make a block, a power of two, at a time for each, s."""
    return max(1, min(BLOCK, 2 ** math.floor(math.log2(IN_HAND / pace)))) if pace > 0.0 else BLOCK


def size_timed(sweep: Sweep, run: int) -> int:
    """Return the same for a run that was not timed, from a single case of it."""
    _timed(sweep, run, [0])  # It compiles.
    return block_size(_timed(sweep, run, [sweep.drawn.cases // 2]))


def _pace_of(sweep: Sweep, run: int, patience: float) -> float:
    """Of one run."""
    cases = sweep.drawn.cases
    most = min(MOST_TIMED, max(CHUNK, int(SHARE * cases)))
    spent, timed = 0.0, 0
    _timed(sweep, run, [0])  # It compiles.
    while timed < most and spent < patience:
        spent += _timed(sweep, run, [int(cases * (GOLDEN * (timed + i) % 1.0)) for i in range(CHUNK)])
        timed += CHUNK
    return spent / timed


def _timed(sweep: Sweep, run: int, cases: list[int]) -> float:
    """Time of a processor that these cases take, s."""
    numbers = np.concatenate([sweep.drawn.block(i, i + 1) for i in cases])
    begun = time.process_time()
    compute_cases(sweep, run, 0, numbers)
    return time.process_time() - begun
