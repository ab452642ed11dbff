"""A virtual machine laid out for its compiled sample (`stickslip.simulation.machine.step`), and runs of it."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.jit import compiled_law, flat, kernel
from stickslip.machines.machine import Machine
from stickslip.simulation.machine import step
from stickslip.simulation.machine.step import plant_of, sample
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
    memory[step.SLOPE] = 1.0
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
    a, places = linear_part(machine)
    size = a.shape[0]
    inputs = np.zeros((size, 4))  # motor, cogging, bearings, friction
    flexible = machine.flexible
    inertias = (flexible.rotor, flexible.shaft, flexible.disk) if flexible else (machine.inertia,) * 3
    rotor, shaft, disk = places["rotor"] + 1, places["shaft"] + 1, places["disk"] + 1
    if places["lag"]:
        inputs[places["lag"], 0] = 2.0 * math.pi * machine.amplifier.bandwidth
    else:
        inputs[rotor, 0] = 1.0 / inertias[0]
    inputs[rotor, 1] = 1.0 / inertias[0]
    inputs[shaft, 2] = 1.0 / inertias[1]
    inputs[disk, 3] = 1.0 / inertias[2]
    # Van Loan 1978: input held (first block) and rising from 0 to 1 (second block) over h.
    big = np.zeros((size + 8, size + 8))
    big[:size, :size], big[:size, size : size + 4] = a * h, inputs * h
    big[size : size + 4, size + 4 :] = np.eye(4)
    linalg: Any = importlib.import_module("scipy.linalg")
    flow = np.asarray(linalg.expm(big), dtype=np.float64)[:size]
    held, rising = flow[:, size : size + 4], flow[:, size + 4 :]
    out = np.zeros((size, size + step.INPUTS))
    out[:, :size] = flow[:, :size]
    out[:, size + step.IN_MOTOR] = held[:, 0]
    out[:, size + step.IN_COG] = held[:, 1]
    out[:, size + step.IN_BEARING] = held[:, 2]
    out[:, size + step.IN_FIRST] = 0.0 if damped else held[:, 3] - rising[:, 3]
    out[:, size + step.IN_LAST] = held[:, 3] if damped else rising[:, 3]
    return {**places, "size": size}, out


def linear_part(machine: Machine) -> tuple[Array, dict[str, int]]:
    """dx/dt = A x: positions and velocities in turn, then the motor's lagging torque, then the encoder's mode."""
    flexible, amplifier, encoder = machine.flexible, machine.amplifier, machine.encoder
    bodies = 3 if flexible else 1
    lag = 2 * bodies if math.isfinite(amplifier.bandwidth) else 0
    mode = 2 * bodies + (1 if lag else 0) if encoder.mode > 0.0 and encoder.mode_share > 0.0 else 0
    size = 2 * bodies + (1 if lag else 0) + (2 if mode else 0)
    a = np.zeros((size, size))
    inertias = (flexible.rotor, flexible.shaft, flexible.disk) if flexible else (machine.inertia,)
    for body in range(bodies):
        a[2 * body, 2 * body + 1] = 1.0
    if flexible:
        springs = (flexible.coupling, flexible.elasticity)
        for i, (k, d) in enumerate(zip(springs, flexible.dampers, strict=True)):
            for body, sign in ((i, -1.0), (i + 1, 1.0)):
                a[2 * body + 1, 2 * i] += sign * k / inertias[body]
                a[2 * body + 1, 2 * i + 2] -= sign * k / inertias[body]
                a[2 * body + 1, 2 * i + 1] += sign * d / inertias[body]
                a[2 * body + 1, 2 * i + 3] -= sign * d / inertias[body]
    places = {
        "rotor": 0, "shaft": 2 if flexible else 0, "disk": 4 if flexible else 0, "lag": lag, "mode": mode,
    }  # fmt: skip
    shaft = places["shaft"]
    viscous = machine.contact.bearings.viscous
    a[shaft + 1, shaft + 1] -= viscous / (flexible.shaft if flexible else machine.inertia)
    if lag:
        a[lag, lag] = -2.0 * math.pi * amplifier.bandwidth
        a[1, lag] = 1.0 / inertias[0]
    if mode:
        omega = 2.0 * math.pi * encoder.mode
        a[mode, mode + 1] = 1.0
        a[mode + 1, mode], a[mode + 1, shaft] = -(omega**2), omega**2
        a[mode + 1, mode + 1] = -2.0 * encoder.mode_damping * omega
        a[mode + 1, shaft + 1] = 2.0 * encoder.mode_damping * omega
    return a, places


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
