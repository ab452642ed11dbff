"""A virtual machine laid out for its compiled sample (`stickslip.simulation.machine.step`), and runs of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.jit import compiled_law, flat, kernel
from stickslip.machines.drivetrain import INPUTS, StateSpace
from stickslip.machines.machine import Machine
from stickslip.simulation.machine import step
from stickslip.simulation.machine.step import plant_of, sample
from stickslip.simulation.root import compiled as root
from stickslip.spec import Surroundings

__all__ = ["CHANNELS", "Laid", "lay_out_machine", "look", "run", "wait"]

Array = np.ndarray[Any, np.dtype[np.float64]]

CHANNELS = ("time", "position", "motor_torque", "sensor_torque", "temperature", "status")
"""What a sample measures, in the order of `stickslip.rigs.rig.Measurement`."""

RESOLVED = 1.2
"""omega h of the contact's spring that a sub-step takes at most."""
FEWEST, MOST = 4, 40
"""Sub-steps of a sample; a contact that would need more is damped (see `machine.step`)."""
BEARING_STEP = 0.1
"""omega h of the bearings' spring, which is taken explicitly."""


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


def lay_out_machine(machine: Machine, substeps: int = 0) -> Laid:
    """Arrays of a machine at rest at position 0.

    Parameters
    ----------
    machine : Machine
    substeps : int
        Of a sample; 0 chooses (`RESOLVED`).
    """
    model = machine.clutch
    pointers = compiled_law(model.law)
    state = flat(model.law.pack_state(model.law.state(model.parameters)))
    states = model.law.state_size(model.parameters)
    stiff = contact_spring(machine)
    parts = substeps or substeps_of(machine, stiff)
    h = machine.sample_time / parts
    disk = machine.flexible.disk if machine.flexible else machine.inertia
    damped = pointers.holding != 0 or h * math.sqrt(stiff / disk) > 1.5 * RESOLVED or not states
    places, matrix = transition(machine, h, damped)
    numbers = numbers_of(machine, parts, states, places, damped)
    memory = np.zeros(step.HEAD + 2 * places["size"] + 2 * max(states, 1))
    memory[step.WARMTH] = machine.contact.heat.ambient
    root.ready(memory[step.SEARCH : step.HEAD], 1.0, step.UNBALANCE, step.LEAST, 1.0)
    memory[step.HEAD + places["size"] : step.HEAD + places["size"] + states] = state[:states]
    return Laid(
        numbers, flat(matrix.ravel()), memory, flat(model.law.pack(model.parameters)),
        np.array(Surroundings()), pointers.step, pointers.holding,
    )  # fmt: skip


def contact_spring(machine: Machine) -> float:
    """Slope of the contact's torque over a displacement from rest, N·m/rad, as its law has it; 0 without states."""
    model = machine.clutch
    if not model.law.state_fields or model.law.holding is not None:
        return 0.0
    z = model.law.state(model.parameters)
    tiny = 1e-9
    viscous = model.law.step(tiny, tiny, 0.0, z, model.parameters, Surroundings())
    torque = model.law.step(tiny, tiny, 1.0, z, model.parameters, Surroundings()) - viscous
    largest = 1.0 + math.fsum(machine.contact.ripple.amplitude)
    return abs(torque) / tiny * largest


def substeps_of(machine: Machine, stiffness: float) -> int:
    """Sub-steps of a sample that resolve the contact's and the bearings' springs."""
    disk = machine.flexible.disk if machine.flexible else machine.inertia
    shaft = machine.flexible.shaft if machine.flexible else machine.inertia
    need = machine.sample_time * math.sqrt(stiffness / disk) / RESOLVED
    if machine.contact.bearings.coulomb > 0.0:
        own = machine.sample_time * math.sqrt(machine.contact.bearings.stiffness / shaft) / BEARING_STEP
        need = max(need, own)
    return min(max(math.ceil(need), FEWEST), MOST)


def transition(machine: Machine, h: float, damped: bool) -> tuple[dict[str, int], Array]:
    """Where the states lie, and the exact flow of the linear part over h with what each input adds to it."""
    system = machine.linear().state_space()
    places = {
        "rotor": 0, "shaft": 2 if machine.flexible else 0, "disk": 4 if machine.flexible else 0,
        "lag": place_of("torque", system), "mode": place_of("mode", system), "size": len(system.states),
    }  # fmt: skip
    size, flow = places["size"], system.over(h)
    out = np.zeros((size, size + step.INPUTS))
    out[:, :size] = flow.moved
    for column, source in ((step.IN_MOTOR, "command"), (step.IN_COG, "motor"), (step.IN_BEARING, "encoder")):
        out[:, size + column] = flow.held[:, INPUTS.index(source)]
    held, rising = flow.held[:, INPUTS.index("load")], flow.rising[:, INPUTS.index("load")]
    out[:, size + step.IN_FIRST] = 0.0 if damped else held - rising
    out[:, size + step.IN_LAST] = held if damped else rising
    return places, out


def place_of(name: str, system: StateSpace) -> int:
    """The place of a state; 0 where the machine has none of that name."""
    return system.states.index(name) if name in system.states else 0


def numbers_of(machine: Machine, parts: int, states: int, places: dict[str, int], damped: bool) -> Array:
    """The fixed numbers of a machine, in the order of `machine.step`."""
    amplifier, encoder, sensor = machine.amplifier, machine.encoder, machine.sensor
    contact, heat, bearings = machine.contact, machine.contact.heat, machine.contact.bearings
    ripple, cogging = contact.ripple, machine.cogging
    n = np.zeros(step.NUMBERS + 3 * (len(ripple.order) + len(cogging.order)))
    values = {
        step.SAMPLE: machine.sample_time, step.SUBSTEPS: parts, step.SIZE: places["size"], step.STATES: states,
        step.KT: amplifier.torque_constant, step.LIMIT: min(amplifier.current_limit, 1e300),
        step.COMMAND_STEP: amplifier.command.step, step.MONITOR_STEP: amplifier.monitor.step,
        step.CURRENT_NOISE: amplifier.current_noise, step.MONITOR_NOISE: amplifier.monitor_noise,
        step.DELAY: math.floor(machine.delay * parts + 0.5), step.LAGS: places["lag"], step.SEED: machine.seed,
        step.COUNT: 2.0 * math.pi / encoder.counts if encoder.counts > 0.0 else 0.0,
        step.JITTER: encoder.noise, step.MODE: places["mode"], step.MODE_SHARE: encoder.mode_share,
        step.SENSOR_STEP: sensor.converter.step, step.SENSOR_NOISE: sensor.noise,
        step.MAX_SPEED: min(encoder.max_speed, 1e300), step.DRIFT: contact.drift.change,
        step.DRIFT_TIME: contact.drift.time, step.KAPPA: heat.coefficient, step.T_REFERENCE: heat.reference,
        step.T_AMBIENT: heat.ambient, step.HEATING: heat.resistance,
        step.HEAT_KEPT: math.exp(-machine.sample_time / heat.time), step.HEAT_TIME: heat.time,
        step.BEARING: bearings.coulomb, step.BEARING_K: bearings.stiffness, step.ROTOR: places["rotor"],
        step.SHAFT: places["shaft"], step.DISK: places["disk"], step.HARMONICS: len(ripple.order),
        step.COGS: len(cogging.order), step.DAMPED: 1.0 if damped else 0.0, step.VISCOUS: bearings.viscous,
        step.DRIFT_BEGIN: contact.drift.begin,
    }  # fmt: skip
    for place, value in values.items():
        n[place] = value
    rows = [
        (order, amplitude, phase + order * machine.start_angle)
        for part in (ripple, cogging)
        for order, amplitude, phase in zip(part.order, part.amplitude, part.phase, strict=True)
    ]
    n[step.NUMBERS :] = np.array(rows, dtype=np.float64).ravel()
    return n


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
    step.measure(plant, 0.0, 1.0, row)


def wait(laid: Laid, seconds: float) -> None:
    """Let the clock pass with zero torque at rest: drift goes on, the contact cools, nothing moves."""
    n, m = laid.numbers, laid.memory
    m[step.PAUSED] += seconds
    kept = math.exp(-seconds / n[step.HEAT_TIME])
    m[step.WARMTH] = n[step.T_AMBIENT] + (m[step.WARMTH] - n[step.T_AMBIENT]) * kept
