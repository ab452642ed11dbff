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

Ripple, cogging and bearings are taken at the middle of the sub-step.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import columns_times, kernel, pointer
from stickslip.simulation.machine.contact import ENOUGH, PARTS, Tried, sliding
from stickslip.simulation.machine.plant import (
    BLOCK,
    FINEST,
    GIVEN,
    IN_ANGLE,
    IN_BEARING,
    IN_COG,
    IN_MOTOR,
    LEVELS,
    SLOTS,
    SPRINGS,
    Plant,
)

GROWS = 0.125
"""Of the tolerance, below which the next sub-step is twice as long."""
SLIDES = 0.999
"""Of the bearings' Coulomb torque, from which they have no spring to resolve."""
NEAR = 0.02
"""rad of the fastest ripple or cogging, within which both follow a parabola to a millionth of themselves."""


@kernel()
def cross(plant: Plant, before: float, drive: float, late: int, factor: float) -> float:
    """Move on by a sample under a motor torque, N·m: `before` for `late` of its shortest sub-steps, then `drive`.

    `factor` scales the contact's torque; returns the mean power that the contact takes for a factor of 1, W.
    """
    n, now = plant.machine, plant.now
    turning = n.disk + 1
    energy, place = 0.0, 0
    while place < PARTS:
        torque = before if place < late else drive
        room = (late if place < late else PARTS) - place
        level = max(now.level, least_level(plant))
        while PARTS >> level > room or place % (PARTS >> level) != 0:
            level += 1
        wrong = attempt(plant, torque, factor, now.spring, level)
        while wrong > 1.0 and level < n.finest:
            now.spring = spring_seen(plant)
            level = max(level + 1, least_level(plant))
            wrong = attempt(plant, torque, factor, now.spring, level)
        now.level = level - (1 if wrong < GROWS else 0)
        now.short += 1 if wrong > 1.0 else 0
        keep(plant)
        place += PARTS >> level
        energy += now.friction * plant.axis[turning] * float(PARTS >> level)
    return energy / PARTS


@kernel(inline=True)
def least_level(plant: Plant) -> int:
    """Halvings of the sample that a sub-step needs whatever its error is: of its springs, and of ripple and cogging.

    Bearings that slide have no spring: their torque stays what it is until the shaft turns round.
    """
    n, now, x = plant.machine, plant.now, plant.axis
    slides = n.unresolved == 0 and now.bearing * math.copysign(1.0, x[n.shaft + 1]) > SLIDES * n.bearing
    level = 0 if slides else n.coarsest
    if now.spring > 0:
        level = max(level, n.resolving)
    way = n.order * abs(x[n.disk + 1]) * n.sample_time
    while way > n.wave and level < FINEST:
        way *= 0.5
        level += 1
    return level


@kernel()
def harmonics(waves: Any, first: int, count: int, angle: float) -> float:
    """Sum of count harmonics from the harmonic `first` on."""
    total = 0.0
    for i in range(first, first + count):
        total += waves[3 * i + 1] * math.cos(waves[3 * i] * angle + waves[3 * i + 2])
    return total


@kernel()
def near(waves: Any, order: float, kept: Any, first: int, count: int, angle: float) -> float:
    """The same by a parabola about a kept angle, which is made anew where the angle has left it."""
    away = angle - kept.angle
    if abs(away) * order > NEAR or kept.known == 0:
        value, slope, bend, away = 0.0, 0.0, 0.0, 0.0
        for i in range(first, first + count):
            phase = waves[3 * i] * angle + waves[3 * i + 2]
            cosine = waves[3 * i + 1] * math.cos(phase)
            value += cosine
            slope -= waves[3 * i] * waves[3 * i + 1] * math.sin(phase)
            bend -= waves[3 * i] * waves[3 * i] * cosine
        kept.angle, kept.value, kept.slope, kept.bend, kept.known = angle, value, slope, bend, 1
    return kept.value + away * (kept.slope + 0.5 * away * kept.bend)


@kernel(inline=True)
def rolled(n: Any, torque: float, distance: float) -> float:
    """The bearings' Coulomb torque after a displacement in one direction (Dahl 1968, exact)."""
    if distance == 0.0:
        return torque
    goal = math.copysign(n.bearing, distance)
    return goal + (torque - goal) * math.exp(-n.bearing_stiffness * abs(distance) / n.bearing)


# ---- a sub-step that is tried -----------------------------------------------------------------------------------


@kernel()
def attempt(plant: Plant, drive: float, factor: float, spring: int, level: int) -> float:
    """Try a sub-step; returns how many times its tolerance it is wrong by. `keep` makes it the machine's."""
    n, now = plant.machine, plant.now
    x = plant.axis
    h = n.sample_time / float(1 << level)
    plant.search[ENOUGH] = n.unbalance / float(1 << level)
    x[n.size + IN_MOTOR], x[n.size + IN_ANGLE] = drive, x[n.disk]
    act(plant, factor, h)
    block = (spring * LEVELS + level) * BLOCK
    columns_times(pointer(plant.matrix, block), x, n.size + GIVEN, pointer(x, SLOTS))
    half = block + BLOCK
    middle, speed = 0.0, 0.0
    if n.unresolved == 0:
        middle, speed = disk_after(plant, half + n.disk)
    return sliding(plant, Tried(block, half, middle, speed, h, spring), now.scale * now.friction)


@kernel(inline=True)
def act(plant: Plant, factor: float, h: float) -> None:
    """Write down ripple, cogging and the bearings' torque in the middle of a sub-step of h s."""
    n, now, x = plant.machine, plant.now, plant.axis
    given = n.size  # behind the states
    now.scale = factor
    if n.ripples > 0:
        angle = x[n.disk] + 0.5 * h * x[n.disk + 1]
        now.scale = factor * (1.0 + near(plant.waves, n.order, now.ripple, 0, n.ripples, angle))
    if n.cogs > 0:
        angle = x[n.rotor] + 0.5 * h * x[n.rotor + 1]
        x[given + IN_COG] = near(plant.waves, n.order, now.cogging, n.ripples, n.cogs, angle)
    if n.bearing > 0.0:
        x[given + IN_BEARING] = -rolled(n, now.bearing, 0.5 * h * x[n.shaft + 1])


@kernel(inline=True)
def disk_after(plant: Plant, row: int) -> tuple[float, float]:
    """Angle and velocity of the disk after a sub-step in which the contact's springs alone act; its matrix's row."""
    angle, velocity = 0.0, 0.0
    for j in range(plant.machine.size + GIVEN):
        angle += plant.matrix[row + j * SLOTS] * plant.axis[j]
        velocity += plant.matrix[row + j * SLOTS + 1] * plant.axis[j]
    return angle, velocity


# ---- a sub-step that is kept ------------------------------------------------------------------------------------


@kernel(inline=True)
def spring_seen(plant: Plant) -> int:
    """The part of the contact's stiffness that the sub-step just tried has seen, in `SPRINGS` parts."""
    n, now, x = plant.machine, plant.now, plant.axis
    if n.stiffness == 0.0 or n.unresolved != 0:
        return 0
    way = x[SLOTS + n.disk] - x[n.disk]
    if way == 0.0:
        return now.spring
    part = now.spring + SPRINGS * (now.rest - now.scale * now.friction) / (way * n.stiffness)
    return int(min(max(math.floor(part + 0.5), 0.0), float(SPRINGS)))


@kernel(inline=True)
def keep(plant: Plant) -> None:
    """Make the sub-step that was tried the machine's."""
    n, now, x = plant.machine, plant.now, plant.axis
    z = plant.contact
    seen, part = spring_seen(plant), n.stiffness / SPRINGS
    way = x[SLOTS + n.disk] - x[n.disk]
    if way != 0.0:
        rate = (now.rest - now.scale * now.friction) / way + part * (now.spring - seen)
        now.rate = min(max(rate, -part), part)
    # What is left of the unbalance goes to the torque: axis and law have moved alike.
    whole = now.rest + part * now.spring * way
    if n.bearing > 0.0:
        now.bearing = rolled(n, now.bearing, x[SLOTS + n.shaft] - x[n.shaft])
    now.friction, now.spring = whole / now.scale, seen
    for i in range(n.size):
        x[i] = x[SLOTS + i]
    for i in range(n.states):
        z[i] = z[n.states + i]
    now.taken += 1
