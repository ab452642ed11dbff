"""A step of a train: its linear part exactly, the rate of the slipping force as a polynomial through nine nodes.

dS/dt = C (A sign(v) - S / s(v)) at the nodes, with v there from the exact flow under S: Picard's iteration, which
converges since within a sample the force hardly moves the velocity by which it changes.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import WIDTH, columns_times, kernel, pointer
from stickslip.simulation.sampled.rates import FOLLOWS, SLIPS, curve_at
from stickslip.simulation.train.records import (
    ANGLE,
    DECAY,
    FACTORS,
    FORCE,
    GIVEN,
    INPUTS,
    SHOWN,
    TABLES,
    VELOCITY,
    Train,
)
from stickslip.simulation.train.shapes import INTEGRAL, NODES, PARTS

ROUNDS = 14
"""Of Picard's iteration; a step that needs more is halved."""
SOLVED = 1e-2
"""Of the tolerance, by which the last round may change the position."""
LAST = 0.05
"""Of the highest difference of the rates, which a step may be wrong by."""
EARLY, HOPELESS = 2, 100.0
"""Rounds after which a step that is wrong by so many tolerances is given up."""
BINOMIAL = (1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0)


@kernel(inline=True)
def begin(train: Train, x: Any, torque: float) -> None:
    """Write down where steps from here start: states, the motor's torque, and the contact's beside its spring."""
    mem, size, z = train.all, train.n.size, train.z
    for i in range(size):
        mem[INPUTS + i] = x[i]
    mem[INPUTS + size] = torque
    mem[INPUTS + size + 1] = z.held - z.spring * z.position + z.slipping
    mem[VELOCITY], mem[ANGLE] = x[train.n.turning], x[train.n.turning - 1]
    mem[FORCE] = z.slipping


@kernel(inline=True)
def shown_by(train: Train, block: int, count: int) -> None:
    """Velocities and angles of the contact at the nodes of a step, by the first `count` states and what is given."""
    mem, nodes = train.all, block + (train.n.size + GIVEN) * WIDTH
    columns_times(pointer(mem, nodes), pointer(mem, INPUTS), count, pointer(mem, SHOWN))
    for i in range(PARTS):
        mem[VELOCITY + 1 + i], mem[ANGLE + 1 + i] = mem[SHOWN + i], mem[SHOWN + PARTS + i]


@kernel(inline=True)
def moved_by(train: Train, block: int) -> None:
    """Add what the rates at the nodes behind the start do to velocities and angles there, on what `SHOWN` has."""
    mem, behind = train.all, train.n.size + 3
    nodes = block + (train.n.size + GIVEN + behind) * WIDTH
    columns_times(pointer(mem, nodes), pointer(mem, INPUTS + behind), PARTS, pointer(mem, FACTORS))
    for i in range(PARTS):
        mem[VELOCITY + 1 + i] = mem[SHOWN + i] + mem[FACTORS + i]
        mem[ANGLE + 1 + i] = mem[SHOWN + PARTS + i] + mem[FACTORS + PARTS + i]


@kernel(inline=True)
def level_at(axis: Any, v: float) -> float:
    """The sliding curve, N·m, which far out is level."""
    return axis.level if abs(v) > axis.far else curve_at(axis, v)


@kernel()
def solve(train: Train, block: int, h: float) -> float:
    """Try a step of h s from `begin`; returns how many tolerances it is wrong by."""
    n, axis, z, mem = train.n, train.axis, train.z, train.all
    rates = INPUTS + n.size + 2
    if z.mode != SLIPS or axis.kind == FOLLOWS:
        shown_by(train, block, n.size + 2)
        return 0.0
    goal = axis.attraction * z.share * z.direction
    mem[DECAY] = axis.attraction / level_at(axis, mem[VELOCITY])
    first = goal - mem[DECAY] * mem[FORCE]
    for i in range(NODES):
        mem[rates + i] = first
    # A force that is wrong by that moves the axis within a sample.
    weight = h * axis.sample_time * axis.sample_time / (axis.inertia * axis.local)
    shown_by(train, block, n.size + 3)
    change, left, rounds = math.inf, math.inf, 0
    while left * weight > SOLVED and rounds < ROUNDS:
        moved_by(train, block)
        forces(train, rates, h)
        before = change
        change = 0.0
        for i in range(1, NODES):
            decay = axis.attraction / level_at(axis, mem[VELOCITY + i])
            rate = goal - decay * mem[FORCE + i]
            change = max(change, abs(rate - mem[rates + i]))
            mem[DECAY + i], mem[rates + i] = decay, rate
        # What the next round will change, as this one has to the one before.
        left = change * (change / before if change < before < math.inf else 1.0)
        rounds += 1
        if rounds == EARLY and LAST * abs(highest(train, rates)) * weight > HOPELESS:
            return math.inf
    if not left * weight <= SOLVED:
        return math.inf
    return LAST * abs(highest(train, rates)) * weight


@kernel(inline=True)
def highest(train: Train, rates: int) -> float:
    """The highest difference of the rates at the nodes."""
    total = 0.0
    for i in range(NODES):
        total += BINOMIAL[i] * train.all[rates + i]
    return total


@kernel(inline=True)
def forces(train: Train, rates: int, h: float) -> None:
    """The slipping force at the nodes, from its rates there."""
    mem = train.all
    columns_times(pointer(mem, TABLES + INTEGRAL * WIDTH), pointer(mem, rates), NODES, pointer(mem, FACTORS))
    for i in range(PARTS):
        mem[FORCE + 1 + i] = mem[FORCE] + h * mem[FACTORS + i]


@kernel()
def take(train: Train, block: int, h: float, x: Any) -> None:
    """Make the step that was tried the train's."""
    n, z, mem = train.n, train.z, train.all
    count = n.size + 2
    if z.mode == SLIPS and train.axis.kind != FOLLOWS:
        count = n.size + GIVEN
        forces(train, INPUTS + n.size + 2, h)
        z.slipping = mem[FORCE + PARTS]
        relaxed = 0.0
        for i in range(NODES):
            relaxed += mem[TABLES + (INTEGRAL + i) * WIDTH + PARTS - 1] * mem[DECAY + i]
        z.relaxed += h * relaxed
    columns_times(pointer(mem, block), pointer(mem, INPUTS), count, x)
    z.velocity, z.moved = x[n.turning], x[n.turning - 1] - z.position
