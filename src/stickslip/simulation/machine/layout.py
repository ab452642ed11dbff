"""A virtual machine laid out for its compiled sample (`stickslip.simulation.machine.step`), and runs of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.jit import compiled_law, flat, kernel
from stickslip.machines.drivetrain import INPUTS, Flow, StateSpace
from stickslip.machines.machine import Machine
from stickslip.simulation.machine import places as at
from stickslip.simulation.machine.places import FINEST, LEVELS, SPRINGS, plant_of
from stickslip.simulation.machine.step import measure, sample
from stickslip.simulation.root import compiled as root
from stickslip.spec import Surroundings

__all__ = ["CHANNELS", "Laid", "lay_out_machine", "look", "run", "wait"]

Array = np.ndarray[Any, np.dtype[np.float64]]

CHANNELS = ("time", "position", "motor_torque", "sensor_torque", "temperature", "status")
"""What a sample measures, in the order of `stickslip.rigs.rig.Measurement`."""

RESOLVED = 1.5
"""omega h of the contact's spring that a sub-step takes at most where the spring, or a part of it, sticks."""
UNRESOLVABLE = 6
"""Halvings of a sample; a contact whose spring would need more is damped, and its sub-steps are this short."""
BEARING_STEP = 0.1
"""omega h of the bearings' spring, which is taken explicitly."""
ROUNDING, LEAST = 1e-8, 0.1
"""Of a velocity above 0.1 rad/s, to which ends that enclose a jump approach."""
TOLERANCE = 1e-7
"""rad, in position, which one sub-step may be wrong by at the end of the sample."""


@dataclass(frozen=True, eq=False)
class Laid:
    """Flat arrays: what `stickslip.simulation.machine.step.plant_of` makes a `Plant` of; ``memory`` changes."""

    numbers: Array
    matrix: Array
    memory: Array
    parameters: Array
    surroundings: Array
    step: int
    holding: int


def lay_out_machine(machine: Machine, tolerance: float = TOLERANCE) -> Laid:
    """Arrays of a machine at rest at position 0.

    Parameters
    ----------
    machine : Machine
    tolerance : float
        Error in position that a sub-step may make by the end of its sample, rad.
    """
    model = machine.clutch
    pointers = compiled_law(model.law)
    state = flat(model.law.pack_state(model.law.state(model.parameters)))
    states = model.law.state_size(model.parameters)
    stiff = contact_spring(machine)
    resolving = halvings(machine.sample_time * math.sqrt(stiff / disk_of(machine)) / RESOLVED)
    unresolved = resolving > UNRESOLVABLE
    places, matrix = transition(machine, 0.0 if unresolved else stiff)
    numbers = numbers_of(machine, states, places, tolerance)
    numbers[at.STIFFNESS], numbers[at.UNRESOLVED] = stiff, float(unresolved)
    numbers[at.RESOLVING] = min(resolving, UNRESOLVABLE)
    if unresolved:
        numbers[at.COARSEST] = UNRESOLVABLE
    memory = np.zeros(at.HEAD + 2 * places["size"] + 3 * states)
    memory[at.WARMTH] = machine.contact.heat.ambient
    memory[at.SCALE] = 1.0
    memory[at.SPRING] = 0.0 if unresolved or stiff == 0.0 else SPRINGS
    root.ready(memory[at.SEARCH : at.HEAD], 1.0, ROUNDING, LEAST, 1.0)
    memory[at.HEAD + places["size"] : at.HEAD + places["size"] + states] = state[:states]
    return Laid(
        numbers, matrix, memory, flat(model.law.pack(model.parameters)),
        np.array(Surroundings()), pointers.step, pointers.holding,
    )  # fmt: skip


def disk_of(machine: Machine) -> float:
    """The inertia at the contact, kg·m²."""
    return machine.flexible.disk if machine.flexible else machine.inertia


def halvings(parts: float) -> int:
    """Halvings of a sample that make at least so many parts."""
    return max(math.ceil(math.log2(parts)), 0) if parts > 1.0 else 0


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


def transition(machine: Machine, stiff: float) -> tuple[dict[str, int], Array]:
    """Where the states lie, and the exact flow of the linear part over every length of a sub-step, with every part of
    the contact's stiffness (N·m/rad): what it makes of the states, and what each input adds."""
    system = machine.linear().state_space()
    places = {
        "rotor": 0, "shaft": 2 if machine.flexible else 0, "disk": 4 if machine.flexible else 0,
        "lag": place_of("torque", system), "mode": place_of("mode", system), "size": len(system.states),
    }  # fmt: skip
    size = places["size"]
    out = np.zeros((SPRINGS + 1 if stiff > 0.0 else 1, LEVELS, size, size + at.INPUTS))
    for part in range(out.shape[0]):
        spring = stiff * part / SPRINGS
        a = system.a.copy()
        a[:, places["disk"]] -= spring * system.b[:, INPUTS.index("load")]
        flow = replace(system, a=a).over(math.ldexp(machine.sample_time, 1 - LEVELS))
        for level in reversed(range(LEVELS)):
            columns(out[part, level], flow, spring)
            flow = flow.doubled()
    return places, flat(out.ravel())


def columns(out: Array, flow: Flow, spring: float) -> None:
    """Write one flow as `stickslip.simulation.machine.substep` reads it."""
    size = out.shape[0]
    out[:, :size] = flow.moved
    for column, source in ((at.IN_MOTOR, "command"), (at.IN_COG, "motor"), (at.IN_BEARING, "encoder")):
        out[:, size + column] = flow.held[:, INPUTS.index(source)]
    held, rising = flow.held[:, INPUTS.index("load")], flow.rising[:, INPUTS.index("load")]
    out[:, size + at.IN_FIRST], out[:, size + at.IN_LAST] = held - rising, rising
    out[:, size + at.IN_ANGLE] = spring * held


def place_of(name: str, system: StateSpace) -> int:
    """The place of a state; 0 where the machine has none of that name."""
    return system.states.index(name) if name in system.states else 0


def numbers_of(machine: Machine, states: int, places: dict[str, int], tolerance: float) -> Array:
    """The fixed numbers of a machine, in the order of `stickslip.simulation.machine.places`."""
    amplifier, encoder, sensor = machine.amplifier, machine.encoder, machine.sensor
    contact, heat, bearings = machine.contact, machine.contact.heat, machine.contact.bearings
    ripple, cogging = contact.ripple, machine.cogging
    n = np.zeros(at.NUMBERS + 3 * (len(ripple.order) + len(cogging.order)))
    values = {
        at.SAMPLE: machine.sample_time, at.SIZE: places["size"], at.STATES: states,
        at.KT: amplifier.torque_constant, at.LIMIT: min(amplifier.current_limit, 1e300),
        at.COMMAND_STEP: amplifier.command.step, at.MONITOR_STEP: amplifier.monitor.step,
        at.CURRENT_NOISE: amplifier.current_noise, at.MONITOR_NOISE: amplifier.monitor_noise,
        at.DELAY: math.floor(math.ldexp(machine.delay, FINEST) + 0.5), at.LAGS: places["lag"], at.SEED: machine.seed,
        at.COUNT: 2.0 * math.pi / encoder.counts if encoder.counts > 0.0 else 0.0,
        at.JITTER: encoder.noise, at.MODE: places["mode"], at.MODE_SHARE: encoder.mode_share,
        at.SENSOR_STEP: sensor.converter.step, at.SENSOR_NOISE: sensor.noise,
        at.MAX_SPEED: min(encoder.max_speed, 1e300), at.DRIFT: contact.drift.change,
        at.DRIFT_TIME: contact.drift.time, at.KAPPA: heat.coefficient, at.T_REFERENCE: heat.reference,
        at.T_AMBIENT: heat.ambient, at.HEATING: heat.resistance,
        at.HEAT_KEPT: math.exp(-machine.sample_time / heat.time), at.HEAT_TIME: heat.time,
        at.BEARING: bearings.coulomb, at.BEARING_K: bearings.stiffness, at.ROTOR: places["rotor"],
        at.SHAFT: places["shaft"], at.DISK: places["disk"], at.HARMONICS: len(ripple.order),
        at.COGS: len(cogging.order), at.VISCOUS: bearings.viscous,
        at.DRIFT_BEGIN: contact.drift.begin, at.COARSEST: halvings(bearing_parts(machine)),
        at.WEIGHT: 2.0 / 3.0 * machine.sample_time / (disk_of(machine) * tolerance), at.STRAY: 1.0 / tolerance,
        at.WAVES: max((abs(order) for order in (*ripple.order, *cogging.order)), default=0.0),
    }  # fmt: skip
    for place, value in values.items():
        n[place] = value
    rows = [
        (order, amplitude, phase + order * machine.start_angle)
        for part in (ripple, cogging)
        for order, amplitude, phase in zip(part.order, part.amplitude, part.phase, strict=True)
    ]
    n[at.NUMBERS :] = np.array(rows, dtype=np.float64).ravel()
    return n


def bearing_parts(machine: Machine) -> float:
    """Parts of a sample that resolve the bearings' spring."""
    bearings = machine.contact.bearings
    if bearings.coulomb == 0.0:
        return 1.0
    shaft = machine.flexible.shaft if machine.flexible else machine.inertia
    return machine.sample_time * math.sqrt(bearings.stiffness / shaft) / BEARING_STEP


# ---- runs ---------------------------------------------------------------------------------------------------


@kernel()
def run(
    numbers: Any, matrix: Any, memory: Any, parameters: Any, surroundings: Any, law: int, holding: int,
    torques: Any, rows: Any,
) -> None:  # fmt: skip
    """One sample per torque; what is measured after it goes to the rows."""
    plant = plant_of(numbers, matrix, memory, parameters, surroundings, law, holding)
    for k in range(torques.size):
        sample(plant, torques[k], rows[k])


@kernel()
def look(
    numbers: Any, matrix: Any, memory: Any, parameters: Any, surroundings: Any, law: int, holding: int,
    row: Any,
) -> None:  # fmt: skip
    """Measure without moving."""
    plant = plant_of(numbers, matrix, memory, parameters, surroundings, law, holding)
    measure(plant, 0.0, 1.0, row)


def wait(laid: Laid, seconds: float) -> None:
    """Let the clock pass with zero torque at rest: drift goes on, the contact cools, nothing moves."""
    n, m = laid.numbers, laid.memory
    m[at.PAUSED] += seconds
    kept = math.exp(-seconds / n[at.HEAT_TIME])
    m[at.WARMTH] = n[at.T_AMBIENT] + (m[at.WARMTH] - n[at.T_AMBIENT]) * kept
