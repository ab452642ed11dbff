"""One sub-step of a virtual machine: its linear part exactly, its contact implicitly, under error control.

Between two samples everything linear (inertias, springs, current loop, encoder mode) is propagated exactly, by the
matrix exponential of the sub-step. The contact's torque is K (theta - theta_0) + G. Its sticking springs K belong to
the linear part, so that a contact that rings is exact however long the sub-step; G, what its law says beside that, is
linear in time, its end solved from the law's own ``step``. K is one of a few parts of the contact's stiffness, the one
nearest to what the last sub-step has seen: all of it while everything sticks, none while everything slips.

**Error control.** The law is asked for the middle of the sub-step, too: what G there lies beside the straight line is
the torque by which the sub-step is wrong. Where that moves the axis by more than its tolerance, the sub-step is
halved, down to 1/256 of a sample. Sub-steps lie on halves, quarters, ... of the sample, so that their matrices are few
and kept.

**A law that jumps at rest** is held while it can hold, and landed on and left in the shortest sub-steps. One that is
stiff (a steep slope through rest) takes G constant, with its value at the end, which damps what is not resolved.
Ripple, cogging and bearings are taken at the middle of the sub-step.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import call_holding, call_step, kernel, pointer
from stickslip.simulation.machine.places import (
    BEARING,
    BEARING_K,
    BEARING_NOW,
    COARSEST,
    COG,
    COGS,
    DISK,
    FINEST,
    FRICTION,
    HARMONICS,
    HEAD,
    IN_ANGLE,
    IN_BEARING,
    IN_COG,
    IN_FIRST,
    IN_LAST,
    IN_MOTOR,
    INPUTS,
    LEVEL,
    LEVELS,
    NUMBERS,
    RATE,
    RESOLVING,
    REST,
    RIPPLE,
    ROTOR,
    SAMPLE,
    SCALE,
    SEARCH,
    SHAFT,
    SIZE,
    SPRING,
    SPRINGS,
    STATES,
    STIFFNESS,
    STRAY,
    TAKEN,
    UNRESOLVED,
    WAVES,
    WEIGHT,
    Plant,
)
from stickslip.simulation.root import MOST, ROOT
from stickslip.simulation.root import compiled as root

__all__ = ["cross", "harmonics"]

PARTS = 1 << FINEST
"""Shortest sub-steps in a sample."""
UNBALANCE = 1e-6
"""Of a velocity, over a whole sample, by which a solved sub-step may be out of balance; the torque takes it up."""
FLATTEST, STEEPEST = 0.1, 1e6
"""Of the unbalance's rise with the velocity, for the next guess."""
STIFF = 4.0
"""Of the same, from which the contact's torque is taken constant over a sub-step."""
GROWS = 0.125
"""Of the tolerance, below which the next sub-step is twice as long."""
STEADY = 0.25
"""Of the velocity, that a sub-step which does not resolve the contact's spring may change it by."""
WAVE = 0.3
"""rad of the fastest ripple or cogging in a sub-step, which takes it at its middle."""
NEAR = 0.02
"""rad of the fastest ripple or cogging, within which both follow a parabola to a millionth of themselves."""
CUT = 2.0
"""Tolerances: a sub-step that is wrong by that is halved."""
X, INVERSE, ENOUGH = (ROOT.scalars.index(name) for name in ("x", "inverse", "enough"))
begin, begin_beyond, improve = root.begin, root.begin_beyond, root.improve


@kernel()
def cross(plant: Plant, before: float, drive: float, late: int, factor: float) -> float:
    """Move on by a sample under a motor torque, N·m: `before` for `late` of its shortest sub-steps, then `drive`.

    `factor` scales the contact's torque; returns the mean power that the contact takes for a factor of 1, W.
    """
    n, memory = plant.numbers, plant.memory
    disk = HEAD + int(n[DISK])
    energy, place = 0.0, 0
    while place < PARTS:
        torque = before if place < late else drive
        room = (late if place < late else PARTS) - place
        level = int(max(memory[LEVEL], least_level(n, memory[disk + 1], memory[SPRING])))
        while PARTS >> level > room or place % (PARTS >> level) != 0:
            level += 1
        wrong = attempt(plant, torque, factor, int(memory[SPRING]), level)
        while wrong > 1.0 and level < FINEST:
            memory[SPRING] = spring_seen(plant)
            level = max(level + 1, int(least_level(n, memory[disk + 1], memory[SPRING])))
            wrong = attempt(plant, torque, factor, int(memory[SPRING]), level)
        memory[LEVEL] = float(level) - (1.0 if wrong < GROWS else 0.0)
        keep(plant, level)
        place += PARTS >> level
        energy += memory[FRICTION] * memory[disk + 1] * float(PARTS >> level)
    return energy / PARTS


@kernel(inline=True)
def least_level(n: Any, v: float, spring: float) -> float:
    """Halvings of the sample that a sub-step needs whatever its error is: of its springs, and of ripple and cogging."""
    level = n[COARSEST]
    if spring > 0.0:
        level = max(level, n[RESOLVING])
    way = n[WAVES] * abs(v) * n[SAMPLE]
    while way > WAVE and level < FINEST:
        way *= 0.5
        level += 1.0
    return level


@kernel()
def harmonics(n: Any, first: int, count: int, angle: float) -> float:
    """Sum of count harmonics that start at entry `first`."""
    total = 0.0
    for i in range(count):
        at = first + 3 * i
        total += n[at + 1] * math.cos(n[at] * angle + n[at + 2])
    return total


@kernel()
def near(n: Any, memory: Any, kept: int, first: int, count: int, angle: float) -> float:
    """The same from value, slope and bend at a kept angle, which are made anew where the angle has left it."""
    away = angle - memory[kept]
    if abs(away) * n[WAVES] > NEAR or memory[kept + 4] == 0.0:
        value, slope, bend, away = 0.0, 0.0, 0.0, 0.0
        for i in range(count):
            at = first + 3 * i
            phase = n[at] * angle + n[at + 2]
            cosine = n[at + 1] * math.cos(phase)
            value += cosine
            slope -= n[at] * n[at + 1] * math.sin(phase)
            bend -= n[at] * n[at] * cosine
        memory[kept], memory[kept + 1], memory[kept + 2], memory[kept + 3] = angle, value, slope, bend
        memory[kept + 4] = 1.0
    return memory[kept + 1] + away * (memory[kept + 2] + 0.5 * away * memory[kept + 3])


@kernel(inline=True)
def rolled(n: Any, torque: float, distance: float) -> float:
    """The bearings' Coulomb torque after a displacement in one direction (Dahl 1968, exact)."""
    if distance == 0.0:
        return torque
    goal = math.copysign(n[BEARING], distance)
    return goal + (torque - goal) * math.exp(-n[BEARING_K] * abs(distance) / n[BEARING])


# ---- a sub-step that is tried -----------------------------------------------------------------------------------


@kernel()
def attempt(plant: Plant, drive: float, factor: float, spring: int, level: int) -> float:
    """Try a sub-step; returns how many times its tolerance it is wrong by. `keep` makes it the machine's."""
    n, memory = plant.numbers, plant.memory
    size = int(n[SIZE])
    rotor, shaft, disk = HEAD + int(n[ROTOR]), HEAD + int(n[SHAFT]), HEAD + int(n[DISK])
    h = n[SAMPLE] / float(1 << level)
    memory[SEARCH + ENOUGH] = UNBALANCE / float(1 << level)
    scale, cog, bearing = factor, 0.0, 0.0
    if n[HARMONICS] > 0.0:
        angle = memory[disk] + 0.5 * h * memory[disk + 1]
        scale *= 1.0 + near(n, memory, RIPPLE, NUMBERS, int(n[HARMONICS]), angle)
    if n[COGS] > 0.0:
        first = NUMBERS + 3 * int(n[HARMONICS])
        cog = near(n, memory, COG, first, int(n[COGS]), memory[rotor] + 0.5 * h * memory[rotor + 1])
    if n[BEARING] > 0.0:
        bearing = rolled(n, memory[BEARING_NOW], 0.5 * h * memory[shaft + 1])
    memory[SCALE] = scale
    work = HEAD + size + 3 * int(n[STATES])
    block = (spring * LEVELS + level) * size * (size + INPUTS)
    for i in range(size):
        memory[work + i] = moved(plant, block, i, drive, cog, bearing)
    half = block + size * (size + INPUTS)
    place = int(n[DISK])
    middle, speed = 0.0, 0.0
    if n[UNRESOLVED] == 0.0:
        middle = moved(plant, half, place, drive, cog, bearing)
        speed = moved(plant, half, place + 1, drive, cog, bearing)
    if plant.holding != 0:
        return with_rest(plant, block, half, middle, speed, h)
    return sliding(plant, block, half, middle, speed, h, scale * memory[FRICTION], spring)


@kernel(inline=True)
def moved(plant: Plant, block: int, i: int, drive: float, cog: float, bearing: float) -> float:
    """A state after a sub-step in which the contact's springs alone act."""
    n, memory, matrix = plant.numbers, plant.memory, plant.matrix
    size = int(n[SIZE])
    row = block + i * (size + INPUTS)
    total = 0.0
    for j in range(size):
        total += matrix[row + j] * memory[HEAD + j]
    row += size
    return (
        total + matrix[row + IN_MOTOR] * drive + matrix[row + IN_COG] * cog
        - matrix[row + IN_BEARING] * bearing + matrix[row + IN_ANGLE] * memory[HEAD + int(n[DISK])]
    )  # fmt: skip


@kernel(inline=True)
def gain(plant: Plant, block: int, place: int, column: int) -> float:
    """What a torque of the contact takes off a state of the disk (its angle, or the velocity after it)."""
    size = int(plant.numbers[SIZE])
    return plant.matrix[block + (int(plant.numbers[DISK]) + place) * (size + INPUTS) + size + column]


@kernel(inline=True)
def torque_after(plant: Plant, v0: float, v: float, h: float, out: int) -> float:
    """The law's torque after a piece of a sub-step; from ``out`` on its state then."""
    memory, z = plant.memory, HEAD + int(plant.numbers[SIZE])
    for i in range(int(plant.numbers[STATES])):
        memory[out + i] = memory[z + i]
    return call_step(plant.step, v0, v, h, pointer(memory, out), plant.parameters, plant.surroundings)


@kernel()
def sliding(
    plant: Plant, block: int, half: int, middle: float, speed: float, h: float, start: float, spring: int
) -> float:
    """The end of the contact's torque, and what its middle says of the error; `start` is its beginning, N·m."""
    n, memory = plant.numbers, plant.memory
    size, states = int(n[SIZE]), int(n[STATES])
    disk, work = HEAD + int(n[DISK]), HEAD + size + 3 * states
    r = pointer(memory, SEARCH)
    at, v0, scale = memory[disk], memory[disk + 1], memory[SCALE]
    stiff = n[STIFFNESS] * float(spring) / SPRINGS
    flat = n[UNRESOLVED] != 0.0 or (states == 0 and r[INVERSE] * STIFF < 1.0)
    first, last = gain(plant, block, 1, IN_FIRST), gain(plant, block, 1, IN_LAST)
    if flat:
        first, last = 0.0, first + last
    base = memory[work + int(n[DISK]) + 1]
    free = base - first * start
    farther, turning = 0.0, 0.0
    if spring > 0:
        # The angle at the end belongs to the velocity there.
        turning = gain(plant, block, 0, IN_LAST) / last
        farther = memory[work + int(n[DISK])] - gain(plant, block, 0, IN_FIRST) * start - turning * free - at
        rate = memory[RATE]
        rises = 1.0 + last * rate * turning
        r[INVERSE] = 1.0 / rises
        begin(r, (free - last * (start + rate * farther)) / rises)
    else:
        slope = 1.0 / r[INVERSE]
        begin(r, (free - last * start - (slope - 1.0) * v0) / slope)
    trial = HEAD + size + states
    for _ in range(MOST):
        v = r[X]
        if spring > 0:
            way = farther + turning * v
            lacks = last * (scale * torque_after(plant, 2.0 * way / h - v, v, h, trial) - stiff * way)
        else:
            lacks = last * scale * torque_after(plant, v if flat else v0, v, h, trial)
        if improve(r, v - free + lacks) == 0.0:
            break
    r[INVERSE] = min(max(r[INVERSE], 1.0 / STEEPEST), 1.0 / FLATTEST)
    v = r[X]
    end = (free - v) / last if last > 0.0 else start
    first_end = end if flat else start
    memory[REST] = end
    finish(plant, block, first_end, end)
    if n[UNRESOLVED] != 0.0:
        return 0.0
    wrong = beside(plant, half, middle, speed, h, first_end, end, stiff, v if flat else v0, spring)
    unseen = spring == 0 and h * float(1 << int(n[RESOLVING])) > 1.01 * n[SAMPLE]
    # Not so steady a motion may have stopped in between, and rung.
    return max(wrong, CUT) if unseen and abs(v - v0) > STEADY * abs(v0) else wrong


@kernel(inline=True)
def beside(
    plant: Plant, half: int, middle: float, speed: float, h: float, start: float, end: float, stiff: float,
    v0: float, spring: int,
) -> float:  # fmt: skip
    """How many tolerances the torque in the middle of the sub-step lies beside the straight line."""
    n, memory = plant.numbers, plant.memory
    mean = 0.5 * (start + end)
    v = speed - gain(plant, half, 1, IN_FIRST) * start - gain(plant, half, 1, IN_LAST) * mean
    way = 0.0
    if spring > 0:
        way = middle - gain(plant, half, 0, IN_FIRST) * start - gain(plant, half, 0, IN_LAST) * mean
        way -= memory[HEAD + int(n[DISK])]
        v0 = 4.0 * way / h - v
    out = HEAD + int(n[SIZE]) + 2 * int(n[STATES])
    torque = memory[SCALE] * torque_after(plant, v0, v, 0.5 * h, out) - stiff * way
    return abs(torque - mean) * h * n[WEIGHT]


@kernel(inline=True)
def finish(plant: Plant, block: int, start: float, end: float) -> None:
    """Write the states after the sub-step, under a torque of the contact from `start` to `end` beside its springs."""
    n, memory, matrix = plant.numbers, plant.memory, plant.matrix
    size = int(n[SIZE])
    work = HEAD + size + 3 * int(n[STATES])
    for i in range(size):
        row = block + i * (size + INPUTS) + size
        memory[work + i] -= matrix[row + IN_FIRST] * start + matrix[row + IN_LAST] * end


# ---- a law that jumps at rest -----------------------------------------------------------------------------------


@kernel()
def with_rest(plant: Plant, block: int, half: int, middle: float, speed: float, h: float) -> float:
    """A sub-step of a law that holds at rest: it rests, leaves, slides or lands."""
    n, memory = plant.numbers, plant.memory
    size, states = int(n[SIZE]), int(n[STATES])
    disk, trial = HEAD + int(n[DISK]), HEAD + size + states
    base = memory[HEAD + size + 3 * states + int(n[DISK]) + 1]
    v0, start = memory[disk + 1], memory[SCALE] * memory[FRICTION]
    first, last = gain(plant, block, 1, IN_FIRST), gain(plant, block, 1, IN_LAST)
    if v0 == 0.0:
        mean = base / (first + last)
        early = speed / (gain(plant, half, 1, IN_FIRST) + gain(plant, half, 1, IN_LAST))
        # At both ends, where the load grows evenly.
        soon, late = 2.0 * early - mean, 3.0 * mean - 2.0 * early
        side = 1.0 if late > 0.0 else -1.0
        held = held_at_rest(plant, side)
        if max(abs(mean), abs(late)) <= held:
            rests(plant, block, h, mean, mean, trial)
            memory[REST] = late
            memory[HEAD + size + 3 * states + int(n[DISK])] = memory[disk]
            return 0.0
        if side * soon <= held and h * PARTS > 1.5 * n[SAMPLE]:
            return CUT
        start = side * held
    free = base - first * start
    side = 1.0 if free > 0.0 else -1.0
    held = held_at_rest(plant, side)
    if abs(free) <= last * held:
        rests(plant, block, h, start, free / last, trial)
        return 0.5 * abs(v0) * h * n[STRAY]
    r = pointer(memory, SEARCH)
    flat = r[INVERSE] * STIFF < 1.0
    if flat:
        free, start, last = base, 0.0, first + last
        side = 1.0 if free > 0.0 else -1.0
        if abs(free) <= last * held:
            rests(plant, block, h, free / last, free / last, trial)
            return 0.5 * abs(v0) * h * n[STRAY]
    begin_beyond(r, 0.0, side * last * held - free, free - side * last * held)
    for _ in range(MOST):
        v = r[X]
        lacks = last * memory[SCALE] * torque_after(plant, v if flat or v0 * v <= 0.0 else v0, v, h, trial)
        if improve(r, v - free + lacks) == 0.0:
            break
    r[INVERSE] = min(max(r[INVERSE], 1.0 / STEEPEST), 1.0 / FLATTEST)
    v = r[X]
    end = (free - v) / last
    memory[REST] = end
    finish(plant, block, end if flat else start, end)
    if v * v0 < 0.0:
        return 0.5 * abs(v0) * h * n[STRAY]
    return beside(
        plant, half, middle, speed, h, end if flat else start, end, 0.0, v if flat or v0 == 0.0 else v0, 0
    )


@kernel(inline=True)
def held_at_rest(plant: Plant, side: float) -> float:
    """The torque that the contact withstands at rest in a direction, N·m."""
    z = HEAD + int(plant.numbers[SIZE])
    held = call_holding(plant.holding, side, pointer(plant.memory, z), plant.parameters, plant.surroundings)
    return plant.memory[SCALE] * held


@kernel(inline=True)
def rests(plant: Plant, block: int, h: float, start: float, end: float, trial: int) -> float:
    """End the sub-step at rest."""
    memory = plant.memory
    torque_after(plant, 0.0, 0.0, h, trial)
    memory[REST] = end
    finish(plant, block, start, end)
    work = HEAD + int(plant.numbers[SIZE]) + 3 * int(plant.numbers[STATES])
    memory[work + int(plant.numbers[DISK]) + 1] = 0.0
    return 0.0


# ---- a sub-step that is kept ------------------------------------------------------------------------------------


@kernel(inline=True)
def spring_seen(plant: Plant) -> float:
    """The part of the contact's stiffness that the sub-step just tried has seen, in `SPRINGS` parts."""
    n, memory = plant.numbers, plant.memory
    if n[STIFFNESS] == 0.0 or n[UNRESOLVED] != 0.0:
        return 0.0
    work = HEAD + int(n[SIZE]) + 3 * int(n[STATES])
    way = memory[work + int(n[DISK])] - memory[HEAD + int(n[DISK])]
    if way == 0.0:
        return memory[SPRING]
    rise = memory[REST] - memory[SCALE] * memory[FRICTION]
    part = memory[SPRING] + SPRINGS * rise / (way * n[STIFFNESS])
    return min(max(math.floor(part + 0.5), 0.0), float(SPRINGS))


@kernel(inline=True)
def keep(plant: Plant, level: int) -> None:
    """Make the sub-step that was tried the machine's."""
    n, memory = plant.numbers, plant.memory
    size, states = int(n[SIZE]), int(n[STATES])
    z, work = HEAD + size, HEAD + size + 3 * states
    shaft, disk = int(n[SHAFT]), int(n[DISK])
    seen, part = spring_seen(plant), n[STIFFNESS] / SPRINGS
    way = memory[work + disk] - memory[HEAD + disk]
    if way != 0.0:
        memory[RATE] = (memory[REST] - memory[SCALE] * memory[FRICTION]) / way + part * (
            memory[SPRING] - seen
        )
        memory[RATE] = min(max(memory[RATE], -part), part)
    # What is left of the unbalance goes to the torque: axis and law have moved alike.
    whole = memory[REST] + part * memory[SPRING] * way
    if n[BEARING] > 0.0:
        memory[BEARING_NOW] = rolled(n, memory[BEARING_NOW], memory[work + shaft] - memory[HEAD + shaft])
    memory[FRICTION] = whole / memory[SCALE]
    memory[SPRING] = seen
    for i in range(size):
        memory[HEAD + i] = memory[work + i]
    for i in range(states):
        memory[z + i] = memory[z + states + i]
    memory[TAKEN] += 1.0
