"""The contact of a virtual machine over a sub-step that is tried: its torque at the end, and what the middle says.

The linear part has moved under the contact's springs alone (`Tried`); here is solved what the law says beside them, G,
linear in time, and the states are corrected for it.

A law that is stiff (a steep slope through rest) takes G constant, with its value at the end, which damps what is not
resolved. One that jumps at rest moves by `stickslip.simulation.machine.holding`.
"""

from __future__ import annotations

from typing import NamedTuple

from stickslip.jit import call_step, kernel, pointer
from stickslip.simulation.machine.plant import FINEST, FIRST, LAST, SLOTS, SPRINGS, Plant
from stickslip.simulation.root import MOST, ROOT
from stickslip.simulation.root import compiled as root

PARTS = 1 << FINEST
"""Shortest sub-steps in a sample."""
FLATTEST, STEEPEST = 0.1, 1e6
"""Of the unbalance's rise with the velocity, for the next guess."""
STIFF = 4.0
"""Of the same, from which the contact's torque is taken constant over a sub-step."""
STEADY = 0.25
"""Of the velocity, that a sub-step which does not resolve the contact's spring may change it by."""
CUT = 2.0
"""Tolerances: a sub-step that is wrong by that is halved."""
X, INVERSE, ENOUGH = (ROOT.scalars.index(name) for name in ("x", "inverse", "enough"))
begin, improve = root.begin, root.improve


class Tried(NamedTuple):
    """A sub-step in which the contact's springs alone have acted.

    Attributes
    ----------
    block, half : int
        Where its matrix and that of half its length begin.
    middle, speed : float
        The contact's angle, rad, and velocity, rad/s, in its middle.
    length : float
        s
    spring : int
        The part of the contact's stiffness that acted, in `SPRINGS` parts.
    """

    block: int
    half: int
    middle: float
    speed: float
    length: float
    spring: int


@kernel(inline=True)
def gain(plant: Plant, block: int, place: int, column: int) -> float:
    """What a torque of the contact takes off a state of the disk (its angle, or the velocity after it)."""
    return plant.matrix[block + column * SLOTS + plant.machine.disk + place]


@kernel(inline=True)
def torque_after(plant: Plant, v0: float, v: float, h: float, out: int) -> float:
    """The law's torque after a piece of a sub-step; from ``out`` on its state then."""
    z = plant.contact
    for i in range(plant.machine.states):
        z[out + i] = z[i]
    return call_step(plant.machine.step, v0, v, h, pointer(z, out), plant.parameters, plant.surroundings)


@kernel()
def sliding(plant: Plant, tried: Tried, start: float) -> float:
    """Finish a sub-step; returns how many tolerances it is wrong by. `start` is the contact's torque before it, N·m."""
    n, now, x = plant.machine, plant.now, plant.axis
    r, h = plant.search, tried.length
    at, v0, scale = x[n.disk], x[n.disk + 1], now.scale
    stiff = n.stiffness * float(tried.spring) / SPRINGS
    flat = n.unresolved != 0 or (n.states == 0 and r[INVERSE] * STIFF < 1.0)
    first, last = gain(plant, tried.block, 1, FIRST), gain(plant, tried.block, 1, LAST)
    if flat:
        first, last = 0.0, first + last
    free = x[SLOTS + n.disk + 1] - first * start
    farther, turning = 0.0, 0.0
    if tried.spring > 0:
        # The angle at the end belongs to the velocity there.
        turning = gain(plant, tried.block, 0, LAST) / last
        farther = x[SLOTS + n.disk] - gain(plant, tried.block, 0, FIRST) * start - turning * free - at
        rises = 1.0 + last * now.rate * turning
        r[INVERSE] = 1.0 / rises
        begin(r, (free - last * (start + now.rate * farther)) / rises)
    else:
        slope = 1.0 / r[INVERSE]
        begin(r, (free - last * start - (slope - 1.0) * v0) / slope)
    for _ in range(MOST):
        v = r[X]
        if tried.spring > 0:
            way = farther + turning * v
            lacks = last * (scale * torque_after(plant, 2.0 * way / h - v, v, h, n.states) - stiff * way)
        else:
            lacks = last * scale * torque_after(plant, v if flat else v0, v, h, n.states)
        if improve(r, v - free + lacks) == 0.0:
            break
    r[INVERSE] = min(max(r[INVERSE], 1.0 / STEEPEST), 1.0 / FLATTEST)
    v = r[X]
    end = (free - v) / last if last > 0.0 else start
    start = end if flat else start
    finish(plant, tried.block, start, end)
    if n.unresolved != 0:
        return 0.0
    wrong = beside(plant, tried, start, end, v if flat else v0)
    unseen = tried.spring == 0 and h * float(1 << n.resolving) > 1.01 * n.sample_time
    # Not so steady a motion may have stopped in between, and rung.
    return max(wrong, CUT) if unseen and abs(v - v0) > STEADY * abs(v0) else wrong


@kernel(inline=True)
def beside(plant: Plant, tried: Tried, start: float, end: float, v0: float) -> float:
    """How many tolerances the torque in the middle of the sub-step lies beside the straight line."""
    n, half = plant.machine, tried.half
    mean = 0.5 * (start + end)
    v = tried.speed - gain(plant, half, 1, FIRST) * start - gain(plant, half, 1, LAST) * mean
    way = 0.0
    if tried.spring > 0:
        way = tried.middle - gain(plant, half, 0, FIRST) * start - gain(plant, half, 0, LAST) * mean
        way -= plant.axis[n.disk]
        v0 = 4.0 * way / tried.length - v
    torque = plant.now.scale * torque_after(plant, v0, v, 0.5 * tried.length, 2 * n.states)
    torque -= n.stiffness * float(tried.spring) / SPRINGS * way
    return abs(torque - mean) * tried.length * n.weight


@kernel(inline=True)
def finish(plant: Plant, block: int, start: float, end: float) -> None:
    """Write the states after the sub-step, under a torque of the contact from `start` to `end` beside its springs."""
    plant.now.rest = end
    first, last = block + FIRST * SLOTS, block + LAST * SLOTS
    for i in range(SLOTS):
        plant.axis[SLOTS + i] -= plant.matrix[first + i] * start + plant.matrix[last + i] * end
