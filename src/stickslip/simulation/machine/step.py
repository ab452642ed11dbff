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

from stickslip.jit import call_mover, kernel, pointer, record_at
from stickslip.simulation.machine.plant import FINEST, QUEUE, SHOWN, Plant
from stickslip.simulation.machine.substep import harmonics

OVERSPEED = 33792.0  # 8400h of CiA 402: velocity speed controller
ITSELF = ("position", "velocity", "friction")
"""What `axis_itself` tells, by the name of the record's number: rad, rad/s, N·m."""


# ---- noise, converters ----------------------------------------------------------------------------------------


@kernel(inline=True)
def mixed(x: Any) -> Any:
    """SplitMix64's finalizer (Steele, Lea and Flood 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel()
def gaussian(seed: int, tick: int, channel: int) -> float:
    """A standard normal number for this sample and channel (Box and Muller 1958)."""
    key = mixed(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15))
    key = mixed(key + np.uint64(tick) * np.uint64(0x9E3779B97F4A7C15))
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
    """Let a torque command (N·m) act for a sample, and measure: `measured` holds a `SHOWN`."""
    n, now = plant.machine, plant.now
    tick, x = now.tick, plant.axis
    demand = converted(torque / n.torque_constant, n.command_step)
    demand = min(max(demand, -n.current_limit), n.current_limit)
    if n.queued > 0:
        demand = due(pointer(now, QUEUE), tick % n.queued, demand)
    before, now.pending = now.pending, demand
    noise = n.current_noise * gaussian(n.seed, tick, 0) if n.current_noise > 0.0 else 0.0
    on = n.torque_constant if now.tripped == 0 else 0.0
    late, old, new = n.delay, on * (before + noise), on * (demand + noise)
    factor = state_factor(n, tick * n.sample_time + now.paused, now.warmth)
    power = call_mover(
        n.mover, pointer(n, 0), pointer(now, 0), plant.waves, plant.matrix, plant.search, x, plant.contact,
        plant.parameters, plant.surroundings, plant.train, old, new, float(late), factor,
    )  # fmt: skip
    if abs(x[n.shaft + 1]) > n.max_speed or not math.isfinite(x[n.disk]):
        now.tripped = 1
    warm = n.ambient + n.heating * max(factor * power, 0.0)
    now.warmth = warm + (now.warmth - warm) * n.heat_kept
    now.tick = tick + 1
    measure(plant, new if late < 1 << FINEST else old, factor, measured)


@kernel(inline=True)
def due(queue: Any, oldest: int, demand: float) -> float:
    """The current that was asked for whole samples ago, A; the new one takes its place."""
    past = queue[oldest]
    queue[oldest] = demand
    return past


@kernel(inline=True)
def state_factor(n: Any, time: float, temperature: float) -> float:
    """What drift and temperature make of friction."""
    factor = 1.0
    if n.drift != 0.0:
        factor -= n.drift * math.expm1(-max(time - n.drift_begin, 0.0) / n.drift_time)
    if n.heat_coefficient != 0.0:
        factor *= math.exp(n.heat_coefficient * (temperature - n.heat_reference))
    return factor


@kernel()
def measure(plant: Plant, drive: float, factor: float, measured: Any) -> None:
    """Write a `SHOWN`: what the sensors see now."""
    n, now = plant.machine, plant.now
    tick, x = now.tick, plant.axis
    angle = x[n.shaft]
    if n.mode > 0:
        angle += n.mode_share * (x[n.mode] - angle)
    if n.encoder_noise > 0.0:
        angle += n.encoder_noise * gaussian(n.seed, tick, 1)
    current = (x[n.lag] if n.lag > 0 else drive) / n.torque_constant
    if n.monitor_noise > 0.0:
        current += n.monitor_noise * gaussian(n.seed, tick, 2)
    sensor = contact_torque(plant, factor)
    if n.sensor_noise > 0.0:
        sensor += n.sensor_noise * gaussian(n.seed, tick, 3)
    shown = record_at(pointer(measured, 0), SHOWN)
    shown.time, shown.temperature = tick * n.sample_time + now.paused, now.warmth
    shown.position = converted(angle, n.count)
    shown.motor_torque = n.torque_constant * converted(current, n.monitor_step)
    shown.sensor_torque = converted(sensor, n.sensor_step)
    shown.status = OVERSPEED if now.tripped != 0 else 0.0


@kernel(inline=True)
def contact_torque(plant: Plant, factor: float) -> float:
    """Friction of the contact now, with its ripple and what drift and temperature make of it, N·m."""
    n, now = plant.machine, plant.now
    ripple = 1.0
    if n.ripples > 0:
        ripple += harmonics(plant.waves, 0, n.ripples, plant.axis[n.disk])
    return factor * ripple * now.friction


@kernel()
def axis_itself(plant: Plant, out: Any) -> None:
    """Position and velocity at the encoder's inertia, and all friction that acts, as no sensor shows them: `ITSELF`."""
    n, now = plant.machine, plant.now
    factor = state_factor(n, now.tick * n.sample_time + now.paused, now.warmth)
    out.position, out.velocity = plant.axis[n.shaft], plant.axis[n.shaft + 1]
    out.friction = contact_torque(plant, factor) + now.bearing + n.viscous * out.velocity
