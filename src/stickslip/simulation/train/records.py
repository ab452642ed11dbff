"""What the located flow of a train reads and writes: one array, and where its parts lie."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import WIDTH, pointer, record_at, spliced
from stickslip.simulation.sampled.rates import AXIS, STATE
from stickslip.simulation.train.shapes import COLUMNS, NODES, TERMS

SLIDING, STICKING, PARTIAL = range(3)
"""Systems by what of the contact is a spring: nothing, all of it; from here on what sticks while something slips."""
KINDS = 10
"""Systems that are kept."""

TRAIN = np.dtype(
    [
        *((name, np.int64) for name in (
            # Linear states, and which of them is the velocity at the contact; the angle lies before it.
            "size", "turning",
            # Halvings of a sample from which a step resolves every mode, from which its nodes do; of the shortest kept.
            "resolved", "watched", "deepest",
            # Halvings that the next step tries; events of this sample; systems written so far.
            "level", "events", "written",
        )),
        # s; the fastest mode, sliding and sticking, 1/s; the springs that stick in every system, N·m/rad.
        ("sample_time", np.float64),
        ("pace", np.float64, (2,)),
        ("springs", np.float64, (KINDS,)),
    ]
)  # fmt: skip
"""A train's numbers, SI units."""
MOST = 12
"""Linear states at most, so that they and what is given with them are no more than a column."""
GIVEN = 2 + NODES
"""Beside the states: the motor's torque, the contact's at the start of the step, and its rate at the nodes."""
BLOCK = 2 * (MOST + GIVEN) * WIDTH
"""A step's flow: for every state and what is given, the states at its end, then the contact's velocities and angles at
the nodes behind the start."""
SYSTEM = (MOST + MOST * (TERMS + 1) + 2 * TERMS) * WIDTH
"""A linear system: its matrix, by columns the powers of it, and these times what the motor and the contact act on."""
MATRIX, RAISED, MOTOR, CONTACT = (
    0,
    MOST * WIDTH,
    MOST * (TERMS + 2) * WIDTH,
    (MOST * (TERMS + 2) + TERMS) * WIDTH,
)
AT, NOW = TRAIN.itemsize // 8, TRAIN.itemsize // 8 + AXIS.itemsize // 8
SCRATCH = NOW + STATE.itemsize // 8
(
    INPUTS, FACTORS, SHOWN, VELOCITY, ANGLE, FORCE, DECAY, VELOCITY_POWERS, ANGLE_POWERS, MOVED, HALVES,
) = (SCRATCH + 2 * WIDTH * i for i in (0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 12))  # fmt: skip
"""Scratch, of at least two columns each: what a step's flow is multiplied by, factors of a series (four), velocities
and angles at the nodes behind the start, each at all nodes, the slipping force and the rate of its relaxation there,
coefficients of velocity and angle, states, and halves of a flow."""
TABLES = SCRATCH + 2 * WIDTH * 14
SYSTEMS = TABLES + COLUMNS * WIDTH
BLOCKS = SYSTEMS + KINDS * SYSTEM
"""The first is of no whole part of a sample; behind it those of every system, longest first."""


class Train(NamedTuple):
    """A train by its addresses."""

    n: Any
    axis: Any
    z: Any
    all: Any


@spliced
def train_of(address: Any) -> Train:
    """The records of a train."""
    return Train(
        record_at(address, TRAIN),
        record_at(pointer(address, AT), AXIS),
        record_at(pointer(address, NOW), STATE),
        address,
    )
