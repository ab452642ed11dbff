"""Where the numbers of a virtual machine lie: fixed ones, its sub-steps' matrices, and what changes."""

from __future__ import annotations

from typing import Any, NamedTuple

from stickslip.jit import kernel, pointer
from stickslip.simulation.root import ROOT

# ---- numbers of a machine, fixed ----------------------------------------------------------------------------
(
    SAMPLE, SIZE, STATES, KT, LIMIT, COMMAND_STEP, MONITOR_STEP, CURRENT_NOISE, MONITOR_NOISE, DELAY,
    LAGS, SEED, COUNT, JITTER, MODE, MODE_SHARE, SENSOR_STEP, SENSOR_NOISE, MAX_SPEED, DRIFT, DRIFT_TIME, KAPPA,
    T_REFERENCE, T_AMBIENT, HEATING, HEAT_KEPT, BEARING, BEARING_K, ROTOR, SHAFT, DISK, HARMONICS, COGS,
    HEAT_TIME, VISCOUS, DRIFT_BEGIN, STIFFNESS, COARSEST, RESOLVING, UNRESOLVED, WEIGHT, STRAY, WAVES, NUMBERS,
) = range(44)  # fmt: skip
# NUMBERS is where the harmonics begin: order, amplitude, phase of each of the contact's, then of the cogging.

# ---- columns of a sub-step's matrix: SIZE of the transition, then what each input adds ------------------------
IN_MOTOR, IN_COG, IN_BEARING, IN_FIRST, IN_LAST, IN_ANGLE, INPUTS = range(7)

FINEST = 8
"""Halvings of a sample down to its shortest sub-step."""
LEVELS = FINEST + 2
"""Lengths of sub-steps that have matrices, each half the one before."""
SPRINGS = 4
"""Parts of the contact's stiffness: a matrix for none of it, one part, ... all of it."""

# ---- what changes ---------------------------------------------------------------------------------------------
(
    TICK, PENDING, TRIPPED, WARMTH, FRICTION, BEARING_NOW, PAUSED, LEVEL, SPRING, SCALE, REST, RATE, TAKEN, RIPPLE,
) = range(14)  # fmt: skip
COG, SEARCH = RIPPLE + 5, RIPPLE + 10
HEAD = SEARCH + len(ROOT.scalars)
# From RIPPLE and from COG on an angle, value, slope and bend there of ripple and cogging, and whether they are known.
# From SEARCH on what the root finder keeps; from HEAD on: the linear state (SIZE), the law's state (STATES), the law's
# state after the sub-step that is tried and in its middle, a work vector (SIZE).


class Plant(NamedTuple):
    """What a sample reads and writes: addresses, since arrays in a tuple count references at every access."""

    numbers: Any
    matrix: Any
    memory: Any
    step: int
    holding: int
    parameters: Any
    surroundings: Any


@kernel(inline=True)
def plant_of(
    numbers: Any, matrix: Any, memory: Any, parameters: Any, surroundings: Any, step: int, holding: int
) -> Plant:
    """The addresses of arrays that outlive the call."""
    return Plant(
        pointer(numbers, 0), pointer(matrix, 0), pointer(memory, 0), step, holding, pointer(parameters, 0),
        pointer(surroundings, 0),
    )  # fmt: skip
