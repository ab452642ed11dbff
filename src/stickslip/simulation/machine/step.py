"""One sample of a virtual machine: what a torque command does until the next measurement, compiled.

The motion between the samples is `stickslip.simulation.machine.substep`'s; here are the amplifier before it, and the
sensors after it.

Noise is drawn from a counter, not from a sequence: a sample's noise depends on the seed, the sample's number and the
channel alone, so that blocks and single samples agree, and switching one imperfection off leaves the others' noise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel
from stickslip.simulation.machine.places import (
    BEARING_NOW,
    COMMAND_STEP,
    COUNT,
    CURRENT_NOISE,
    DELAY,
    DISK,
    DRIFT,
    DRIFT_BEGIN,
    DRIFT_TIME,
    FINEST,
    FRICTION,
    HARMONICS,
    HEAD,
    HEAT_KEPT,
    HEATING,
    JITTER,
    KAPPA,
    KT,
    LAGS,
    LIMIT,
    MAX_SPEED,
    MODE,
    MODE_SHARE,
    MONITOR_NOISE,
    MONITOR_STEP,
    NUMBERS,
    PAUSED,
    PENDING,
    SAMPLE,
    SEED,
    SENSOR_NOISE,
    SENSOR_STEP,
    SHAFT,
    T_AMBIENT,
    T_REFERENCE,
    TICK,
    TRIPPED,
    VISCOUS,
    WARMTH,
    Plant,
)
from stickslip.simulation.machine.substep import cross, harmonics

OVERSPEED = 33792.0  # 8400h of CiA 402: velocity speed controller


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
    late, old, new = int(n[DELAY]), on * (before + noise), on * (demand + noise)
    factor = state_factor(n, tick * n[SAMPLE] + memory[PAUSED], memory[WARMTH])
    power = cross(plant, old, new, late, factor)
    if abs(memory[x + int(n[SHAFT]) + 1]) > n[MAX_SPEED] or not math.isfinite(memory[x + int(n[DISK])]):
        memory[TRIPPED] = 1.0
    warm = n[T_AMBIENT] + n[HEATING] * max(factor * power, 0.0)
    memory[WARMTH] = warm + (memory[WARMTH] - warm) * n[HEAT_KEPT]
    memory[TICK] = tick + 1.0
    measure(plant, new if late < 1 << FINEST else old, factor, measured)


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
