"""What a machine whose contact holds at rest is moved by: flows of the axis with its contact free and held at rest,
what both show between the ends of a step, and the series of either for steps of any length.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stickslip.jit import WIDTH
from stickslip.machines.drivetrain import INPUTS, Array, StateSpace, exponential
from stickslip.simulation.machine.plant import (
    BLOCK,
    COLUMNS,
    FINEST,
    FIRST,
    GIVEN,
    IN_BEARING,
    IN_COG,
    IN_MOTOR,
    LAST,
    LEVELS,
    SLOTS,
)

FREE, HELD = range(2)
"""What the contact does: nothing that is linear, or it keeps the disk where it is."""
NODES = WIDTH
"""Evenly spaced times behind the start of a step, at which it shows the velocity of the disk or the load on it."""
TERMS = 40
"""Of a series at most."""
PIECE = 2 * LEVELS * BLOCK
"""A step of any length: of its flow only what the contact's torque does."""
WATCH = PIECE + BLOCK
"""What the nodes show, by contact and length: columns as those of a flow."""
PULL = WATCH + 2 * (FINEST + 1) * BLOCK
"""Torque on a disk at rest by every state and what is given, N·m."""
RATES = PULL + SLOTS
"""The rates of the states by the states and what is given, free and held, by columns."""
PUSHED = RATES + 2 * SLOTS * SLOTS
"""Powers of the free matrix times what a torque on the disk does."""
SERIES = PUSHED + TERMS * SLOTS
"""Terms of the series that was made last."""
POWERS = SERIES + TERMS * SLOTS
"""Powers of the nodes' parts of a step, by columns."""
CURVE = POWERS + (TERMS + 2) * NODES
"""A polynomial of the part of a step."""
SHOWN = CURVE + TERMS + 2
"""What the nodes of a step show."""
SCRATCH = SHOWN + NODES
WHOLE = SCRATCH + 4 * max(TERMS, SLOTS)

RESOLVED = 1.5
"""omega h of the fastest mode in a step that is looked through for events."""
WATCHED = 0.6
"""The same between two nodes of a longer one, which show whether there is anything to look for."""
NOTHING = 1e-18
"""Of a series, that may be left out."""
OF_STATES = ((IN_MOTOR, "command"), (IN_COG, "motor"), (IN_BEARING, "encoder"))
"""Places of what is given, and the inputs of the linear system that these are."""


def held_system(system: StateSpace, turning: int) -> StateSpace:
    """The same with the velocity `turning` kept as it is."""
    a, b = system.a.copy(), system.b.copy()
    a[turning] = 0.0
    b[turning] = 0.0
    return replace(system, a=a, b=b)


def pace_of(system: StateSpace, turning: int) -> float:
    """The largest eigenvalue of the axis, its contact free or held, 1/s."""
    both = (system.a, held_system(system, turning).a)
    return max(float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0)) for a in both)


def terms_of(reach: float) -> int:
    """Terms of exp(reach) beyond which nothing is left of it."""
    terms, left = 2, 0.5 * reach * reach
    while left > NOTHING and terms < TERMS - 1:
        terms += 1
        left *= reach / terms
    return terms + 1


def tables(system: StateSpace, turning: int, damping: float, sample_time: float) -> Array:
    """The memory of `stickslip.simulation.machine.holding`, filled in.

    Parameters
    ----------
    turning : int
        The state that is the velocity at the contact.
    damping : float
        N·m s/rad of the contact while it slides.
    """
    out = np.zeros(WHOLE)
    size = len(system.states)
    load = system.b[:, INPUTS.index("load")]
    pull = out[PULL : PULL + SLOTS]
    pull[:size] = system.a[turning] / load[turning]
    for place, source in OF_STATES:
        pull[size + place] = system.b[turning, INPUTS.index(source)] / load[turning]
    flows, watch = (
        out[:PIECE].reshape(2, LEVELS, COLUMNS, SLOTS),
        out[WATCH:PULL].reshape(2, FINEST + 1, COLUMNS, SLOTS),
    )
    rates = out[RATES:PUSHED].reshape(2, SLOTS, SLOTS)
    sliding = replace(system, a=system.a.copy())
    sliding.a[:, turning] -= damping * load
    for kind, own in ((FREE, sliding), (HELD, held_system(system, turning))):
        generator = generator_of(own)
        rates[kind, : size + GIVEN] = generator[:SLOTS, : size + GIVEN].T
        seen = np.zeros(len(generator))
        if kind == FREE:
            seen[turning] = 1.0
        else:
            seen[:SLOTS] = pull
        fill(flows[kind], watch[kind], generator, seen, sample_time, size)
    power = out[PUSHED:SERIES].reshape(TERMS, SLOTS)
    power[0, :size] = load
    for k in range(1, TERMS):
        power[k, :size] = sliding.a @ power[k - 1, :size]
    parts = np.arange(1.0, NODES + 1.0) / NODES
    out[POWERS:CURVE] = (parts ** np.arange(TERMS + 2.0)[:, None]).ravel()
    return out


def generator_of(system: StateSpace) -> Array:
    """The matrix of states, of what is given, and of the contact's torque and its rise, which have no rates or are one:
    shape (`SLOTS` + 2,) twice."""
    size = len(system.states)
    out = np.zeros((SLOTS + 2, SLOTS + 2))
    out[:size, :size] = system.a
    for place, source in OF_STATES:
        out[:size, size + place] = system.b[:, INPUTS.index(source)]
    out[:size, SLOTS] = system.b[:, INPUTS.index("load")]
    return out


def fill(flows: Array, watch: Array, generator: Array, seen: Array, sample_time: float, size: int) -> None:
    """Write the flows over all lengths, and what the nodes of all but the shortest show."""
    count = size + GIVEN
    shortest = math.ldexp(sample_time, 1 - LEVELS) / NODES
    big = generator * shortest
    big[SLOTS, SLOTS + 1] = 1.0  # by 1 over a piece between two nodes of the shortest step
    powers = [exponential(big)]  # over a piece, two, four, ...
    doublings = NODES.bit_length() - 1
    for _ in range(LEVELS - 1 + doublings):
        powers.append(powers[-1] @ powers[-1])
    for level in range(LEVELS):
        first = LEVELS - 1 - level
        rise = 1.0 / (NODES << first)
        write(flows[level, :, :size], powers[first + doublings][:size].T, rise, count)
        if level <= FINEST:
            shown = (seen @ powers[first])[None]
            for k in range(doublings):
                shown = np.concatenate([shown, shown @ powers[first + k]])
            write(watch[level], shown.T, rise, count)


def write(out: Array, columns: Array, rise: float, count: int) -> None:
    """Write columns as a step reads them: the contact's torque at both ends is taken off."""
    out[:count] = columns[:count]
    last = rise * columns[SLOTS + 1]
    out[FIRST], out[LAST] = columns[SLOTS] - last, last
