"""The three ways a machine crosses a sample, each compiled where a machine first takes it.

`stickslip.simulation.machine.step` calls them by address. Compiled into it, every machine would wait for both.
"""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import compiled_mover, kernel
from stickslip.simulation.machine.holding import cross as cross_events
from stickslip.simulation.machine.plant import FINEST, Plant, plant_at
from stickslip.simulation.machine.substep import cross
from stickslip.simulation.sampled.modes import friction
from stickslip.simulation.train.cross import advance
from stickslip.simulation.train.records import train_of


def mover(located: bool, holds: bool) -> int:
    """The address of a machine's way across a sample: the located flow of its train, steps between the events of a
    contact that holds at rest, or sub-steps.

    All take the addresses of a `Plant`, then what `substep.cross` takes, whose value they return.
    """
    return compiled_mover(flows if located else events if holds else steps)


def flows(
    machine: Any, now: Any, waves: Any, matrix: Any, search: Any, axis: Any, contact: Any, parameters: Any,
    surroundings: Any, train: Any, before: float, drive: float, late: float, factor: float,
) -> float:  # fmt: skip
    """Along the located flow, whose contact nothing scales or heats."""
    plant = plant_at(machine, now, waves, matrix, search, axis, contact, parameters, surroundings, train)
    locate(plant, before, drive, int(late))
    return 0.0


def events(
    machine: Any, now: Any, waves: Any, matrix: Any, search: Any, axis: Any, contact: Any, parameters: Any,
    surroundings: Any, train: Any, before: float, drive: float, late: float, factor: float,
) -> float:  # fmt: skip
    """By steps that end where the contact breaks away or comes to rest."""
    plant = plant_at(machine, now, waves, matrix, search, axis, contact, parameters, surroundings, train)
    return cross_events(plant, before, drive, int(late), factor)


def steps(
    machine: Any, now: Any, waves: Any, matrix: Any, search: Any, axis: Any, contact: Any, parameters: Any,
    surroundings: Any, train: Any, before: float, drive: float, late: float, factor: float,
) -> float:  # fmt: skip
    """By sub-steps under error control."""
    plant = plant_at(machine, now, waves, matrix, search, axis, contact, parameters, surroundings, train)
    return cross(plant, before, drive, int(late), factor)


@kernel()
def locate(plant: Plant, before: float, drive: float, late: int) -> None:
    """Move on by a sample along the located flow: under `before` for `late` of its shortest sub-steps, then `drive`."""
    now, x = plant.now, plant.axis
    train = train_of(plant.train)
    part = math.ldexp(float(late), -FINEST)
    taken = advance(train, x, before, 0.0, part) if late > 0 else 0
    if taken >= 0 and part < 1.0:
        rest = advance(train, x, drive, part, 1.0)
        taken = taken + rest if rest >= 0 else rest
    now.taken += taken
    now.friction = friction(train.axis, train.z)
    if taken < 0:
        x[plant.machine.disk] = math.nan
