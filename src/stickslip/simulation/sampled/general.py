"""The sampled engine's way across a sample for any law: steps of `recorded_input.step`, under error control.

The step knows of a law no more than its ``step``. Where it would be wrong by more than its share of the tolerance it is
shortened, so that stick and slip are cut where they happen. A law that jumps at zero velocity (or at the edge of its
band, thesis 2.2.3) is cut there: it is landed on, and left when the torque exceeds what the contact withstands.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_holding, call_step, kernel, pointer
from stickslip.simulation.case_arrays import INERTIA, PLANT_BAND, Case, surroundings
from stickslip.simulation.recorded_input import contact
from stickslip.simulation.recorded_input.contact import AXIS, Plant, axis_of, keep
from stickslip.simulation.recorded_input.step import GAMMA, LEAST, MOTION, ROUNDING, compiled
from stickslip.simulation.root import ROOT
from stickslip.simulation.root import compiled as root
from stickslip.simulation.sampled import moving
from stickslip.simulation.sampled.moving import TINY
from stickslip.simulation.sampled.rates import HOLDS, STEPS

THIRD = 3.0 * GAMMA**2 - 2.0 * GAMMA**3 - 1.0 / 6.0
"""What the step makes wrong of the third derivative, over h^3."""
SHORTEST = 1e-6
"""Of a sample, from which a step is not cut any more."""
GROWS, SHRINKS, SAFE, SHORT = 4.0, 0.15, 0.9, 0.8
"""Of a step: what the next one may be longer, or this one shorter; the reserve in its length; and of the time to
rest, in which the axis is brought near it."""
ready = root.ready
two_stages: Any = compiled(dict.fromkeys(contact.GIVEN, contact.__name__) | {"withheld": moving.__name__})
"""The step of `recorded_input.step` for an axis that moves."""
SEARCH, MOVES, INVERSE = len(ROOT.scalars), len(MOTION.scalars), ROOT.scalars.index("inverse")
AROUND, TIME, APPLIED = 0, 3, 4
"""Places in the surroundings."""


class Contact(NamedTuple):
    """A law as the general step takes it: addresses, and arrays that outlive them."""

    step: int
    holding: int
    band: float
    numbers: Any
    parameters: Any
    around: Any
    state: Any
    kept: Any
    base: Any
    trial: Any
    motion: Any
    searches: Any


def contact_of(case: Case) -> Contact:
    """The plant's law, at rest."""
    n, side = case.numbers, case.plant
    numbers = np.zeros(1, AXIS)
    numbers["inertia"], numbers["holds"] = n[INERTIA], side.pointers.holding != 0
    states = side.state.size
    return Contact(
        side.pointers.step, side.pointers.holding, float(n[PLANT_BAND]), numbers.view(np.float64), side.parameters,
        surroundings(n), side.state.copy(), np.zeros(states), np.zeros(states), np.zeros(states), np.zeros(MOVES),
        np.zeros((2, SEARCH)),
    )  # fmt: skip


class Held(NamedTuple):
    """What general steps ask of a law beside its `Plant`. No arrays: references to them are counted at every call."""

    holding: int
    kept: Any
    """address of the law's state while a step is tried"""


@kernel(exact=False)
def held_of(c: Contact) -> Held:
    """The part of a contact that is handed on at every stretch."""
    return Held(c.holding, pointer(c.kept, 0))


@kernel(exact=False)
def plant_of(c: Contact) -> Plant:
    """The addresses of the contact's arrays, its root finders ready."""
    plant = Plant(
        c.step, c.holding, pointer(c.parameters, 0), pointer(c.around, 0), pointer(c.state, 0), pointer(c.base, 0),
        pointer(c.trial, 0), c.state.size, pointer(c.numbers, 0), pointer(c.motion, 0), pointer(c.searches, 0),
        pointer(c.searches, SEARCH), c.band,
    )  # fmt: skip
    inertia, sharp = axis_of(plant.numbers).inertia, 1.0 - axis_of(plant.numbers).holds
    ready(plant.first, inertia, ROUNDING, LEAST, sharp)
    ready(plant.second, inertia, ROUNDING, LEAST, sharp)
    return plant


@kernel(exact=False)
def torque_at(plant: Plant, v0: float, v1: float, h: float) -> float:
    """Torque after a piece of h from v0 to v1; ``trial`` holds the law's state then."""
    for i in range(plant.states):
        plant.trial[i] = plant.state[i]
    return call_step(plant.step, v0, v1, h, plant.trial, plant.parameters, plant.surroundings)


@kernel(exact=False)
def edge_of(plant: Plant, direction: float) -> float:
    """The velocity at which a law that jumps begins to slide, rad/s."""
    return direction * max(plant.band, TINY)


@kernel(exact=False)
def act_on(axis: Any, z: Any, c: Held, plant: Plant, t: float) -> None:
    """The torque on the axis is another one now: its acceleration, and whether a contact lets go."""
    u = plant.surroundings
    u[AROUND], u[TIME], u[APPLIED] = z.position, t, z.torque
    if z.mode == HOLDS:
        hold(axis, z, c, plant, t, 0.0)
    else:
        z.held = torque_at(plant, z.velocity, z.velocity, 0.0)
        z.acceleration = (z.torque - z.held) / axis.inertia


@kernel(exact=False)
def hold(axis: Any, z: Any, c: Held, plant: Plant, t: float, left: float) -> float:
    """Rest for `left` at most, or let go; returns the time taken. In a band (Karnopp's) momentum gathers meanwhile."""
    u = plant.surroundings
    u[AROUND], u[TIME], u[APPLIED] = z.position, t, z.torque
    push = 1.0 if z.torque > 0.0 else -1.0
    held = call_holding(c.holding, push, plant.state, plant.parameters, u)
    excess = z.torque - push * min(abs(z.torque), held)
    taken, leaves = left, excess != 0.0
    if plant.band > 0.0:
        # ``goal`` is the velocity that the momentum would make.
        rate = excess / axis.inertia
        push = 1.0 if rate > 0.0 or (rate == 0.0 and z.goal > 0.0) else -1.0
        room = max(push * (push * plant.band - z.goal), 0.0)
        leaves = rate != 0.0 and room <= left * abs(rate)
        taken = room / abs(rate) if leaves else left
        z.goal += rate * taken
    elif leaves:
        taken = 0.0
    z.velocity = z.acceleration = 0.0
    z.held = z.torque - excess
    if taken > 0.0:
        torque_at(plant, 0.0, 0.0, taken)
        keep(plant)
    if leaves:
        z.mode, z.direction = STEPS, push
        z.velocity = push * plant.band
        edge = edge_of(plant, push)
        z.held = torque_at(plant, edge, edge, 0.0)
        z.acceleration = (z.torque - z.held) / axis.inertia
        z.next = min(z.next, 1e-2 * axis.sample_time)
        z.events += 1
    return taken


@kernel(exact=False)
def landing(axis: Any, z: Any, plant: Plant, h: float) -> tuple[float, float]:
    """When an axis that is below the edge after h comes to rest, s, and how its acceleration bends until then.

    From the accelerations now and there; ``trial`` holds the law's state there.
    """
    edge = edge_of(plant, z.direction)
    there = (z.torque - torque_at(plant, z.velocity, edge, h)) / axis.inertia
    slows = -0.5 * z.direction * (z.acceleration + there)
    return abs(
        z.velocity - z.direction * plant.band
    ) / slows if slows > 0.0 else math.inf, there - z.acceleration


@kernel(exact=False)
def land(axis: Any, z: Any, plant: Plant, h: float, bend: float) -> float:
    """Come to rest after h, which is returned; ``trial`` is of `landing`."""
    keep(plant)
    z.position += 0.5 * h * (z.velocity + z.direction * plant.band) - h * h * bend / 12.0
    z.goal, z.mode, z.events = z.direction * plant.band, HOLDS, z.events + 1
    z.velocity, z.acceleration, z.held = 0.0, 0.0, z.torque
    return h


@kernel(exact=False)
def step_on(axis: Any, z: Any, c: Held, plant: Plant, t: float, left: float) -> float:
    """One step of a moving axis, at most `left` s long; returns the time taken."""
    state, kept, motion = plant.state, c.kept, plant.motion
    u, q, v = plant.surroundings, z.position, z.velocity
    if c.holding != 0 and v != 0.0:
        z.direction = math.copysign(1.0, v)
    h = min(min(z.next, axis.longest), left)
    if h < left < 2.0 * h:
        h = 0.5 * left
    asked, least = h, SHORTEST * axis.sample_time
    for i in range(plant.states):
        kept[i] = state[i]
    u[APPLIED] = z.torque
    while True:
        u[AROUND], u[TIME] = q + 0.5 * h * (v + 0.5 * h * z.acceleration), t + 0.5 * h
        motion[0], motion[1] = q, v
        two_stages(plant, plant.numbers, motion, plant.first, plant.second, z.torque, 0.0, h, 1.0)
        position, end, middle = motion[0], motion[1], motion[2]
        wrong, last = error_of(axis, z, plant, h, middle, end)
        below = c.holding != 0 and min(z.direction * middle, z.direction * end) <= plant.band
        if (not below and wrong <= axis.local) or (h <= least and (not below or v == 0.0)):
            break
        for i in range(plant.states):
            state[i] = kept[i]
        z.rejected += 1
        if not math.isfinite(wrong):
            z.failed = 1
            return h
        if below:
            x, bend = landing(axis, z, plant, h)
            near = x * abs(bend) * axis.sample_time <= axis.local or x <= least
            if v != 0.0 and (h <= least or (x <= h and near)):
                return land(axis, z, plant, min(x, h), bend)
            h = max(0.5 * h if v == 0.0 else min(SHORT * x, 0.5 * h), least)
        else:
            h = max(h * max(SHRINKS, SAFE * (axis.local / wrong) ** (1.0 / 3.0)), least)
    factor = SAFE * (axis.local / max(wrong, 1e-3 * axis.local)) ** (1.0 / 3.0)
    # What the end of a sample has cut may go on as long as before.
    z.next = max(h * min(factor, GROWS), z.next if h == asked and factor > 1.0 else 0.0)
    z.position, z.velocity, z.acceleration = position, end, last
    z.held = z.torque - axis.inertia * last
    return h


@kernel(exact=False, inline=True)
def error_of(axis: Any, z: Any, plant: Plant, h: float, middle: float, end: float) -> tuple[float, float]:
    """What a step makes wrong of the position by the end of a sample, rad, and the acceleration at its end.

    From the accelerations at its begin, in its first stage and at its end. A slope of friction that the step does not
    resolve pulls an error back, where the law remembers nothing of it.
    """
    v = z.velocity
    first = (middle - v) / (GAMMA * h)
    last = (end - v - (1.0 - GAMMA) * h * first) / (GAMMA * h)
    bend = 2.0 * ((last - first) / (1.0 - GAMMA) - (first - z.acceleration) / GAMMA)
    changes = max(h * abs(last - z.acceleration), axis.sample_time * abs(bend))
    pulled = 1.0 if plant.states > 0 else min(1.0, axis.inertia * plant.second[INVERSE])
    return THIRD * h * changes * pulled, last
