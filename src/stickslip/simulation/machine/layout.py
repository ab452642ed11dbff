"""A virtual machine laid out for its compiled sample (`stickslip.simulation.machine.step`), and runs of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.spec import Surroundings
from stickslip.jit import compiled_law, flat, kernel
from stickslip.machines.drivetrain import INPUTS, Flow, StateSpace
from stickslip.machines.machine import Machine
from stickslip.simulation.machine.contact import torque_after
from stickslip.simulation.machine.held_tables import NODES, WATCHED, pace_of, tables, terms_of
from stickslip.simulation.machine.held_tables import RESOLVED as RESOLVED_EVENTS
from stickslip.simulation.machine.movers import mover
from stickslip.simulation.machine.plant import (
    CHANNELS,
    COLUMNS,
    FINEST,
    FIRST,
    IN_ANGLE,
    IN_BEARING,
    IN_COG,
    IN_MOTOR,
    LAST,
    LEVELS,
    MACHINE,
    NOW,
    QUEUE,
    SLOTS,
    SPRINGS,
    Laid,
    plant_of,
)
from stickslip.simulation.machine.step import measure, sample
from stickslip.simulation.root import ROOT
from stickslip.simulation.root import compiled as root
from stickslip.simulation.train.layout import NO_TRAIN, SHARE, halvings, lay_out_train, stand_train

__all__ = ["CHANNELS", "Laid", "lay_out_machine", "look", "run", "stand_at", "wait"]

Array = np.ndarray[Any, np.dtype[np.float64]]

RESOLVED = 1.5
"""omega h of the contact's spring that a sub-step takes at most where the spring, or a part of it, sticks."""
UNRESOLVABLE = 6
"""Halvings of a sample; a contact whose spring would need more is damped, and its sub-steps are this short."""
UNBALANCE, LEAST_UNBALANCE = 1e-6, 1e-5
"""Of a velocity, over a whole sample, by which a solved sub-step may be out of balance at the usual tolerance; part of
that at the tightest."""
HELD_UNBALANCE = 1e-3
"""Times that, of a contact that holds at rest, whose law costs little."""
TIGHTEST = 1e-13
"""rad: such a contact's steps are held to no tighter a tolerance, of which rounding would leave nothing."""
BEARING_STEP = 0.1
"""omega h of the bearings' spring, which is taken explicitly."""
WAVE = 0.3
"""rad of the fastest ripple or cogging in a sub-step, which takes it at its middle; less at a tighter tolerance."""
ROUNDING, LEAST = 1e-8, 0.1
"""Of a velocity above 0.1 rad/s, to which ends that enclose a jump approach."""
TOLERANCE = 1e-7
"""rad, in position, which one sub-step may be wrong by at the end of the sample."""


def lay_out_machine(machine: Machine, tolerance: float = TOLERANCE, *, located: bool = True) -> Laid:
    """Arrays of a machine at rest at position 0.

    Parameters
    ----------
    machine : Machine
    tolerance : float
        Error in position that a sub-step may make by the end of its sample, rad.
    located : bool
        Whether it may move along the located flow of its train; False: by sub-steps, which know of torques over the
        position that are written into it later.
    """
    model = machine.clutch
    pointers = compiled_law(model.law)
    state = flat(model.law.pack_state(model.law.state(model.parameters)))
    states = model.law.state_size(model.parameters)
    stiff = contact_spring(machine)
    resolving = halvings(machine.sample_time * math.sqrt(stiff / disk_of(machine)) / RESOLVED)
    unresolved = resolving > UNRESOLVABLE
    parameters = flat(model.law.pack(model.parameters))
    train = lay_out_train(machine, parameters, tolerance) if located else NO_TRAIN.copy()
    system = machine.linear().state_space()
    places = places_in(system, machine)
    holds = model.law.holding is not None
    damping = viscous_part(machine) if holds else 0.0
    if holds:
        matrix = tables(system, places["disk"] + 1, damping, machine.sample_time)
    elif train.size == 1:
        matrix = transition(machine, system, 0.0 if unresolved else stiff)
    else:
        matrix = np.zeros(1)
    queued = max(math.ceil(machine.delay) - 1, 0)
    numbers, memory = np.zeros(1, MACHINE), np.zeros(QUEUE + queued)
    n, now = numbers[0], memory[:QUEUE].view(NOW)[0]
    write_numbers(n, machine, places, tolerance)
    n["states"], n["stiffness"], n["unresolved"] = states, stiff, unresolved
    n["queued"], n["delay"] = queued, math.floor(math.ldexp(machine.delay - queued, FINEST) + 0.5)
    n["located"] = train.size > 1
    n["mover"], n["step"], n["holding"] = mover(bool(n["located"]), holds), pointers.step, pointers.holding
    n["resolving"] = min(resolving, UNRESOLVABLE)
    if holds:
        n["damping"] = damping
        n["weight"] *= min(tolerance / TIGHTEST, 1.0) / SHARE
        n["unbalance"] *= HELD_UNBALANCE
        fastest = pace_of(system, places["disk"] + 1) * machine.sample_time
        n["resolving"] = min(halvings(fastest / RESOLVED_EVENTS), FINEST)
        n["watched"] = min(halvings(fastest / (WATCHED * NODES)), int(n["resolving"]))
        n["terms"] = terms_of(2.0 * fastest / float(1 << int(n["resolving"])))
    if unresolved:
        n["coarsest"] = UNRESOLVABLE
    now["warmth"], now["scale"] = machine.contact.heat.ambient, 1.0
    now["spring"] = 0 if unresolved or stiff == 0.0 else SPRINGS
    search, contact = np.zeros(len(ROOT.scalars)), np.zeros(max(3 * states, 1))
    root.ready(search, 1.0, ROUNDING, LEAST, 1.0)
    contact[:states] = state[:states]
    return Laid(
        numbers.view(np.float64), memory, waves_of(machine), matrix, search,
        np.zeros(2 * SLOTS), contact, parameters, np.array(Surroundings()), train,
    )  # fmt: skip


def disk_of(machine: Machine) -> float:
    """The inertia at the contact, kg·m²."""
    return machine.linear().inertias[-1]


def contact_spring(machine: Machine) -> float:
    """Slope of the contact's torque over a displacement from rest, N·m/rad, as its law has it; 0 without states."""
    model = machine.clutch
    if not model.law.state_fields or model.law.holding is not None:
        return 0.0
    z = model.law.state(model.parameters)
    tiny = 1e-9
    viscous = model.law.step(tiny, tiny, 0.0, z, model.parameters, Surroundings())
    torque = model.law.step(tiny, tiny, 1.0, z, model.parameters, Surroundings()) - viscous
    return abs(torque) / tiny


def places_in(system: StateSpace, machine: Machine) -> dict[str, int]:
    """Where the states lie, and how many they are."""
    drivetrain = machine.linear()
    return {
        "rotor": 0, "shaft": 2 * drivetrain.encoder, "disk": 2 * len(drivetrain.springs),
        "lag": place_of("torque", system), "mode": place_of("mode", system), "size": len(system.states),
    }  # fmt: skip


def viscous_part(machine: Machine) -> float:
    """Slope of the contact's torque over the velocity where it slides fast, N·m s/rad, of both directions the mean."""
    model, total = machine.clutch, 0.0
    z = model.law.state(model.parameters)
    for side in (1.0, -1.0):
        slow, fast = (
            model.law.step(v, v, 0.0, z, model.parameters, Surroundings()) for v in (side, 2.0 * side)
        )
        total += 0.5 * side * (fast - slow)
    return max(total, 0.0) if math.isfinite(total) else 0.0


def transition(machine: Machine, system: StateSpace, stiff: float) -> Array:
    """The exact flow of the linear part over every length of a sub-step, with every part of the contact's stiffness
    (N·m/rad): what it makes of the states, and what each input adds."""
    disk = 2 * len(machine.linear().springs)
    out = np.zeros((SPRINGS + 1 if stiff > 0.0 else 1, LEVELS, COLUMNS, SLOTS))
    for part in range(out.shape[0]):
        spring = stiff * part / SPRINGS
        a = system.a.copy()
        a[:, disk] -= spring * system.b[:, INPUTS.index("load")]
        flow = replace(system, a=a).over(math.ldexp(machine.sample_time, 1 - LEVELS))
        for level in reversed(range(LEVELS)):
            columns(out[part, level], flow, spring)
            flow = flow.doubled()
    return flat(out.ravel())


def columns(out: Array, flow: Flow, spring: float) -> None:
    """Write one flow as `stickslip.simulation.machine.substep` reads it."""
    size = len(flow.moved)
    out[:size, :size] = flow.moved.T
    for place, source in ((IN_MOTOR, "command"), (IN_COG, "motor"), (IN_BEARING, "encoder")):
        out[size + place, :size] = flow.held[:, INPUTS.index(source)]
    held, rising = flow.held[:, INPUTS.index("load")], flow.rising[:, INPUTS.index("load")]
    out[FIRST, :size], out[LAST, :size] = held - rising, rising
    out[size + IN_ANGLE, :size] = spring * held


def place_of(name: str, system: StateSpace) -> int:
    """The place of a state; 0 where the machine has none of that name."""
    return system.states.index(name) if name in system.states else 0


def write_numbers(n: Any, machine: Machine, places: dict[str, int], tolerance: float) -> None:
    """Fill in a machine's `MACHINE`, but for what its contact's stiffness decides."""
    amplifier, encoder, sensor = machine.amplifier, machine.encoder, machine.sensor
    contact, heat, bearings = machine.contact, machine.contact.heat, machine.contact.bearings
    # What is taken in the middle of a sub-step is wrong by the square of its length.
    finer = max(math.sqrt(TOLERANCE / tolerance), 1.0)
    values = {
        **places, "ripples": len(contact.ripple.order), "cogs": len(machine.cogging.order),
        "coarsest": min(halvings(bearing_parts(machine, finer)), FINEST), "finest": FINEST, "seed": machine.seed,
        "sample_time": machine.sample_time,
        "torque_constant": amplifier.torque_constant, "current_limit": min(amplifier.current_limit, 1e300),
        "command_step": amplifier.command.step, "monitor_step": amplifier.monitor.step,
        "current_noise": amplifier.current_noise, "monitor_noise": amplifier.monitor_noise,
        "count": 2.0 * math.pi / encoder.counts if encoder.counts > 0.0 else 0.0, "encoder_noise": encoder.noise,
        "mode_share": encoder.mode_share, "max_speed": min(encoder.max_speed, 1e300),
        "sensor_step": sensor.converter.step, "sensor_noise": sensor.noise, "drift": contact.drift.change,
        "drift_time": contact.drift.time, "drift_begin": contact.drift.begin, "heat_coefficient": heat.coefficient,
        "heat_reference": heat.reference, "ambient": heat.ambient, "heating": heat.resistance,
        "heat_kept": math.exp(-machine.sample_time / heat.time), "heat_time": heat.time,
        "bearing": bearings.coulomb, "bearing_stiffness": bearings.stiffness, "viscous": bearings.viscous,
        "weight": 2.0 / 3.0 * machine.sample_time / (disk_of(machine) * tolerance),
        "order": max((abs(o) for o in (*contact.ripple.order, *machine.cogging.order)), default=0.0),
        "wave": WAVE / finer, "unbalance": UNBALANCE * min(max(tolerance / TOLERANCE, LEAST_UNBALANCE), 1.0),
    }  # fmt: skip
    for name, value in values.items():
        n[name] = value


def waves_of(machine: Machine) -> Array:
    """Order, amplitude and phase of every harmonic: the contact's ripple, then the cogging."""
    rows = [
        (order, amplitude, phase + order * machine.start_angle)
        for part in (machine.contact.ripple, machine.cogging)
        for order, amplitude, phase in zip(part.order, part.amplitude, part.phase, strict=True)
    ]
    return flat(np.array(rows, dtype=np.float64).ravel())


def bearing_parts(machine: Machine, finer: float) -> float:
    """Parts of a sample that resolve the bearings' spring, so many times finer than at the usual tolerance."""
    bearings = machine.contact.bearings
    if bearings.coulomb == 0.0:
        return 1.0
    drivetrain = machine.linear()
    shaft = drivetrain.inertias[drivetrain.encoder]
    return machine.sample_time * math.sqrt(bearings.stiffness / shaft) * finer / BEARING_STEP


# ---- runs ---------------------------------------------------------------------------------------------------


@kernel()
def run(laid: Laid, torques: Any, rows: Any) -> None:
    """One sample per torque; what is measured after it goes to the rows."""
    plant = plant_of(laid)
    for k in range(torques.size):
        sample(plant, torques[k], rows[k])


@kernel()
def look(laid: Laid, row: Any) -> None:
    """Measure without moving."""
    measure(plant_of(laid), 0.0, 1.0, row)


def wait(laid: Laid, seconds: float) -> None:
    """Let the clock pass with zero torque at rest: drift goes on, the contact cools, nothing moves."""
    n, now = laid.machine, laid.now
    now["paused"] += seconds
    now["warmth"] = n["ambient"] + (now["warmth"] - n["ambient"]) * math.exp(-seconds / n["heat_time"])


def stand_at(laid: Laid, position: float, velocity: float = 0.0) -> None:
    """Every inertia, and what the encoder shows, at this position, rad, and velocity, rad/s; the contact unloaded."""
    n = laid.machine
    for place in {int(n[k]) for k in ("rotor", "shaft", "disk")} | {int(n["mode"])} - {0}:
        laid.axis[place], laid.axis[place + 1] = position, velocity
    stand_train(laid.train, position)
    if velocity != 0.0:
        resist(laid, velocity)


@kernel()
def resist(laid: Laid, velocity: float) -> None:
    """Let the contact's damping act from the first moment on: the torque of a sub-step runs on from the one before."""
    plant = plant_of(laid)
    plant.now.friction = torque_after(plant, velocity, velocity, 0.0, plant.machine.states)
