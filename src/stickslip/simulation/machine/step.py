"""One sample of a virtual machine: what a torque command does until the next measurement, compiled.

Between the samples everything linear (inertias, springs, current loop, encoder mode) is propagated exactly, by the
matrix exponential of the sub-step; the contact's torque enters as linear in time over the sub-step, its end solved
from the law's own ``step`` (see `solve`): the trapezoid for a rigid axis, A-stable. Where a sub-step does not resolve
the contact's spring (`stickslip.simulation.machine.layout` decides) its torque enters constant, with its value at the
end, which damps what is not resolved. Ripple, cogging and bearings are taken at the middle of the sub-step.

Noise is drawn from a counter, not from a sequence: a sample's noise depends on the seed, the sample's number and the
channel alone, so that blocks and single samples agree, and switching one imperfection off leaves the others' noise.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_holding, call_step, kernel, pointer
from stickslip.simulation.root import MOST, ROOT
from stickslip.simulation.root import compiled as root

# ---- numbers of a machine, fixed ----------------------------------------------------------------------------
(
    SAMPLE, SUBSTEPS, SIZE, STATES, KT, LIMIT, COMMAND_STEP, MONITOR_STEP, CURRENT_NOISE, MONITOR_NOISE, DELAY,
    LAGS, SEED, COUNT, JITTER, MODE, MODE_SHARE, SENSOR_STEP, SENSOR_NOISE, MAX_SPEED, DRIFT, DRIFT_TIME, KAPPA,
    T_REFERENCE, T_AMBIENT, HEATING, HEAT_KEPT, BEARING, BEARING_K, ROTOR, SHAFT, DISK, HARMONICS, COGS,
    DAMPED, HEAT_TIME, VISCOUS, DRIFT_BEGIN, NUMBERS,
) = range(39)  # fmt: skip
# NUMBERS is where the harmonics begin: order, amplitude, phase of each of the contact's, then of the cogging.

# ---- columns of the sub-step's matrix: SIZE of the transition, then what each input adds ----------------------
IN_MOTOR, IN_COG, IN_BEARING, IN_FIRST, IN_LAST, INPUTS = range(6)

# ---- what changes ---------------------------------------------------------------------------------------------
(
    TICK, PENDING, TRIPPED, WARMTH, FRICTION, BEARING_NOW, PAUSED, SEARCH,
) = range(8)  # fmt: skip
HEAD = SEARCH + len(ROOT.scalars)
# From SEARCH on what the root finder keeps; from HEAD on: the linear state (SIZE), the law's state (STATES), the law's
# trial state, a work vector (SIZE).

OVERSPEED = 33792.0  # 8400h of CiA 402: velocity speed controller
UNBALANCE, LEAST = 1e-8, 0.1  # relative, above 0.1 rad/s; the torque takes it up, 1e-8 N·m
FLATTEST, STEEPEST = 0.1, 1e6  # of the unbalance's rise with the velocity, for the next guess
X, INVERSE = ROOT.scalars.index("x"), ROOT.scalars.index("inverse")
begin, begin_beyond, improve = root.begin, root.begin_beyond, root.improve


class Plant(NamedTuple):
    """What a sample reads and writes: addresses, since arrays in a tuple count references at every access."""

    numbers: Any
    matrix: Any
    memory: Any
    step: int
    holding: int
    parameters: Any
    surroundings: Any


@kernel(inline=True)
def plant_of(
    numbers: Any, matrix: Any, memory: Any, parameters: Any, surroundings: Any, step: int, holding: int
) -> Plant:
    """The addresses of arrays that outlive the call."""
    return Plant(
        pointer(numbers, 0), pointer(matrix, 0), pointer(memory, 0), step, holding, pointer(parameters, 0),
        pointer(surroundings, 0),
    )  # fmt: skip


# ---- noise, converters ----------------------------------------------------------------------------------------


@kernel(inline=True)
def mixed(x: Any) -> Any:
    """SplitMix64's finalizer (Steele, Lea and Flood 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel()
def gaussian(seed: float, tick: float, channel: int) -> float:
    """A standard normal number for this sample and channel (Box and Muller 1958)."""
    key = mixed(np.uint64(np.int64(seed)) + np.uint64(0x9E3779B97F4A7C15))
    key = mixed(key + np.uint64(np.int64(tick)) * np.uint64(0x9E3779B97F4A7C15))
    key = mixed(key + np.uint64(channel))
    first = (np.float64(key >> np.uint64(11)) + 0.5) * 1.1102230246251565e-16
    second = np.float64(mixed(key) >> np.uint64(11)) * 1.1102230246251565e-16
    return math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)


@kernel(inline=True)
def converted(x: float, step: float) -> float:
    """In whole steps; exact where there are none."""
    return step * math.floor(x / step + 0.5) if step > 0.0 else x


@kernel()
def harmonics(n: Any, first: int, count: int, angle: float) -> float:
    """Sum of count harmonics that start at entry `first`."""
    total = 0.0
    for i in range(count):
        at = first + 3 * i
        total += n[at + 1] * math.cos(n[at] * angle + n[at + 2])
    return total


# ---- one sub-step ---------------------------------------------------------------------------------------------


@kernel(inline=True)
def torque_after(plant: Plant, v0: float, v: float, h: float, z: int, trial: int) -> float:
    """The contact's torque at the end of a sub-step, unscaled; ``trial`` holds the law's state there."""
    memory = plant.memory
    for i in range(int(plant.numbers[STATES])):
        memory[trial + i] = memory[z + i]
    return call_step(plant.step, v0, v, h, pointer(memory, trial), plant.parameters, plant.surroundings)


@kernel()
def solve(plant: Plant, v0: float, free: float, gain: float, h: float, z: int, trial: int) -> float:
    """The velocity v = free - gain F(v) at the end of a sub-step; ``trial`` holds the law's state, FRICTION the torque.

    The first guess is exact where the torque is linear in v with the slope that it had in the last sub-step, as in a
    sticking or a sliding contact. A law that holds at rest stays while it can.
    """
    memory = plant.memory
    r = pointer(memory, SEARCH)
    if plant.holding != 0:
        side = 1.0 if free > 0.0 else -1.0
        held = call_holding(plant.holding, side, pointer(memory, z), plant.parameters, plant.surroundings)
        if abs(free) <= gain * held:
            torque_after(plant, 0.0, 0.0, h, z, trial)
            memory[FRICTION] = free / gain if gain > 0.0 else 0.0
            return 0.0
        begin_beyond(r, 0.0, side * gain * held - free, free - side * gain * held)
    else:
        slope = 1.0 / r[INVERSE]
        begin(r, (free - gain * memory[FRICTION] - (slope - 1.0) * v0) / slope)
    for _ in range(MOST):
        if improve(r, unbalance(plant, v0, free, gain, h, z, trial, r[X])) == 0.0:
            break
    r[INVERSE] = min(max(r[INVERSE], 1.0 / STEEPEST), 1.0 / FLATTEST)
    return r[X]


@kernel(inline=True)
def unbalance(
    plant: Plant, v0: float, free: float, gain: float, h: float, z: int, trial: int, v: float
) -> float:
    """v - free + gain F(v); rises with v."""
    begin = v if plant.numbers[DAMPED] != 0.0 else v0
    plant.memory[FRICTION] = torque_after(plant, begin, v, h, z, trial)
    return v - free + gain * plant.memory[FRICTION]


@kernel()
def substep(plant: Plant, drive: float, factor: float, h: float) -> None:
    """Move on by a sub-step under a motor torque command (N·m); `factor` scales the contact's torque."""
    n, memory, matrix = plant.numbers, plant.memory, plant.matrix
    size, states = int(n[SIZE]), int(n[STATES])
    x, z = HEAD, HEAD + size
    trial, work = z + states, z + 2 * states
    rotor, shaft, disk = int(n[ROTOR]), int(n[SHAFT]), int(n[DISK])
    v0 = memory[x + disk + 1]
    ripple = 1.0
    if n[HARMONICS] > 0.0:
        ripple += harmonics(n, NUMBERS, int(n[HARMONICS]), memory[x + disk] + 0.5 * h * v0)
    cog = 0.0
    if n[COGS] > 0.0:
        cog = harmonics(
            n, NUMBERS + 3 * int(n[HARMONICS]), int(n[COGS]),
            memory[x + rotor] + 0.5 * h * memory[x + rotor + 1],
        )  # fmt: skip
    bearing, begin = 0.0, memory[x + shaft]
    if n[BEARING] > 0.0:
        bearing = rolled(n, memory[BEARING_NOW], 0.5 * h * memory[x + shaft + 1])
    scale = factor * ripple
    width = size + INPUTS
    start = scale * memory[FRICTION]
    for i in range(size):
        row = i * width
        total = 0.0
        for j in range(size):
            total += matrix[row + j] * memory[x + j]
        row += size
        memory[work + i] = (
            total + matrix[row + IN_MOTOR] * drive + matrix[row + IN_COG] * cog
            - matrix[row + IN_BEARING] * bearing - matrix[row + IN_FIRST] * start
        )  # fmt: skip
    gain = scale * matrix[(disk + 1) * width + size + IN_LAST]
    free = memory[work + disk + 1]
    v1 = solve(plant, v0, free, gain, h, z, trial)
    if gain > 0.0:
        # What is left of the unbalance goes to the torque: axis and law have moved alike.
        memory[FRICTION] = (free - v1) / gain
    end = scale * memory[FRICTION]
    for i in range(size):
        memory[x + i] = memory[work + i] - matrix[i * width + size + IN_LAST] * end
    for i in range(states):
        memory[z + i] = memory[trial + i]
    if n[BEARING] > 0.0:
        memory[BEARING_NOW] = rolled(n, memory[BEARING_NOW], memory[x + shaft] - begin)


@kernel(inline=True)
def rolled(n: Any, torque: float, distance: float) -> float:
    """The bearings' Coulomb torque after a displacement in one direction (Dahl 1968, exact)."""
    if distance == 0.0:
        return torque
    goal = math.copysign(n[BEARING], distance)
    return goal + (torque - goal) * math.exp(-n[BEARING_K] * abs(distance) / n[BEARING])


# ---- one sample -----------------------------------------------------------------------------------------------


@kernel()
def sample(plant: Plant, torque: float, measured: Any) -> None:
    """Let a torque command (N·m) act for a sample, and measure."""
    n, memory = plant.numbers, plant.memory
    x, tick = HEAD, memory[TICK]
    demand = converted(torque / n[KT], n[COMMAND_STEP])
    demand = min(max(demand, -n[LIMIT]), n[LIMIT])
    before, memory[PENDING] = memory[PENDING], demand
    noise = n[CURRENT_NOISE] * gaussian(n[SEED], tick, 0) if n[CURRENT_NOISE] > 0.0 else 0.0
    on = n[KT] if memory[TRIPPED] == 0.0 else 0.0
    drive = on * (before + noise)
    count = int(n[SUBSTEPS])
    h = n[SAMPLE] / count
    factor = state_factor(n, tick * n[SAMPLE] + memory[PAUSED], memory[WARMTH])
    disk = int(n[DISK])
    power = 0.0
    late = int(n[DELAY])
    for i in range(count):
        if i == late:
            drive = on * (demand + noise)
        substep(plant, drive, factor, h)
        power += memory[FRICTION] * memory[x + disk + 1]
    if abs(memory[x + int(n[SHAFT]) + 1]) > n[MAX_SPEED] or not math.isfinite(memory[x + disk]):
        memory[TRIPPED] = 1.0
    warm = n[T_AMBIENT] + n[HEATING] * max(factor * power / count, 0.0)
    memory[WARMTH] = warm + (memory[WARMTH] - warm) * n[HEAT_KEPT]
    memory[TICK] = tick + 1.0
    measure(plant, drive, factor, measured)


@kernel(inline=True)
def state_factor(n: Any, time: float, temperature: float) -> float:
    """What drift and temperature make of friction."""
    factor = 1.0
    if n[DRIFT] != 0.0:
        factor -= n[DRIFT] * math.expm1(-max(time - n[DRIFT_BEGIN], 0.0) / n[DRIFT_TIME])
    if n[KAPPA] != 0.0:
        factor *= math.exp(n[KAPPA] * (temperature - n[T_REFERENCE]))
    return factor


@kernel()
def measure(plant: Plant, drive: float, factor: float, measured: Any) -> None:
    """Write time, position, motor torque, sensor torque, temperature and status as the sensors see them now."""
    n, memory = plant.numbers, plant.memory
    x, tick = HEAD, memory[TICK]
    shaft, mode = int(n[SHAFT]), int(n[MODE])
    angle = memory[x + shaft]
    if mode > 0:
        angle += n[MODE_SHARE] * (memory[x + mode] - angle)
    if n[JITTER] > 0.0:
        angle += n[JITTER] * gaussian(n[SEED], tick, 1)
    current = (memory[x + int(n[LAGS])] if n[LAGS] > 0.0 else drive) / n[KT]
    if n[MONITOR_NOISE] > 0.0:
        current += n[MONITOR_NOISE] * gaussian(n[SEED], tick, 2)
    sensor = contact_torque(plant, factor)
    if n[SENSOR_NOISE] > 0.0:
        sensor += n[SENSOR_NOISE] * gaussian(n[SEED], tick, 3)
    measured[0] = tick * n[SAMPLE] + memory[PAUSED]
    measured[1] = converted(angle, n[COUNT])
    measured[2] = n[KT] * converted(current, n[MONITOR_STEP])
    measured[3] = converted(sensor, n[SENSOR_STEP])
    measured[4] = memory[WARMTH]
    measured[5] = OVERSPEED if memory[TRIPPED] != 0.0 else 0.0


@kernel(inline=True)
def contact_torque(plant: Plant, factor: float) -> float:
    """Friction of the contact now, with its ripple and what drift and temperature make of it, N·m."""
    n, memory = plant.numbers, plant.memory
    ripple = 1.0
    if n[HARMONICS] > 0.0:
        ripple += harmonics(n, NUMBERS, int(n[HARMONICS]), memory[HEAD + int(n[DISK])])
    return factor * ripple * memory[FRICTION]


@kernel()
def axis_itself(plant: Plant, out: Any) -> None:
    """Position and velocity at the encoder's inertia, and all friction that acts, as no sensor shows them."""
    n, memory = plant.numbers, plant.memory
    factor = state_factor(n, memory[TICK] * n[SAMPLE] + memory[PAUSED], memory[WARMTH])
    shaft = HEAD + int(n[SHAFT])
    out[0], out[1] = memory[shaft], memory[shaft + 1]
    out[2] = contact_torque(plant, factor) + memory[BEARING_NOW] + n[VISCOUS] * memory[shaft + 1]
