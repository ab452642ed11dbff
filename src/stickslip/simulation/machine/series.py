"""The motion of an axis over a step of any length, as a series of the part of the step; and its first root."""

from __future__ import annotations

from stickslip.jit import columns_times, kernel, pointer
from stickslip.simulation.machine.held_tables import (
    CURVE,
    PIECE,
    POWERS,
    PULL,
    PUSHED,
    RATES,
    SCRATCH,
    SERIES,
    SHOWN,
    TERMS,
)
from stickslip.simulation.machine.plant import FIRST, GIVEN, LAST, SLOTS, Plant

ROOT_STEPS = 60
CLOSE = 1e-15
"""Of a step, to which a root is found."""


@kernel()
def expanded(plant: Plant, kind: int, h: float) -> None:
    """Make the series of the states over h, s, the contact's torque left out."""
    n, mem = plant.machine, plant.matrix
    count = n.size + GIVEN
    for i in range(SLOTS):
        mem[SERIES + i] = plant.axis[i] if i < count else 0.0
    rates = pointer(mem, RATES + kind * SLOTS * SLOTS)
    for k in range(1, n.terms):
        at = SERIES + k * SLOTS
        columns_times(rates, pointer(mem, at - SLOTS), count, pointer(mem, at))
        for i in range(SLOTS):
            mem[at + i] *= h / k


@kernel()
def piece(plant: Plant, h: float, s: float) -> None:
    """Write the states at the part s of the step over h, s, that was `expanded`, behind those at its start; and what
    the contact's torque takes off them, by its values at both ends."""
    n, mem = plant.machine, plant.matrix
    held, last, power, grown = SCRATCH, SCRATCH + TERMS, SCRATCH + 2 * TERMS, s * h
    part = 1.0
    for k in range(n.terms):
        mem[power + k] = part
        mem[held + k] = grown / (k + 1)
        mem[last + k] = grown / ((k + 1) * (k + 2))
        part *= s
        grown *= s * h / (k + 1)
    first, behind = PIECE + FIRST * SLOTS, PIECE + LAST * SLOTS
    columns_times(pointer(mem, SERIES), pointer(mem, power), n.terms, pointer(plant.axis, SLOTS))
    columns_times(pointer(mem, PUSHED), pointer(mem, held), n.terms, pointer(mem, first))
    columns_times(pointer(mem, PUSHED), pointer(mem, last), n.terms, pointer(mem, behind))
    for i in range(SLOTS):
        mem[first + i] -= mem[behind + i]


@kernel()
def speed_curve(plant: Plant, h: float, start: float, rise: float, late: int) -> None:
    """Write the disk's velocity as a polynomial of the part of the step, the contact's torque being `start`, N·m, and
    from there on rising: evenly, by `rise` in a whole step (`late` 1); or by `rise` up to wherever one asks (`late` 0).
    """
    n, mem = plant.machine, plant.matrix
    turning = n.disk + 1
    for k in range(n.terms + 2):
        mem[CURVE + k] = mem[SERIES + k * SLOTS + turning] if k < n.terms else 0.0
    grown = h
    for k in range(n.terms):
        push = grown * mem[PUSHED + k * SLOTS + turning] / (k + 1)
        mem[CURVE + k + 1] -= start * push
        mem[CURVE + k + 1 + late] -= rise * push / (k + 2)
        grown *= h / (k + 1)


@kernel()
def load_curve(plant: Plant) -> None:
    """Write the torque on the disk held at rest as a polynomial of the part of the step, N·m."""
    n, mem = plant.machine, plant.matrix
    for k in range(n.terms + 2):
        load = 0.0
        for j in range(n.size + GIVEN if k < n.terms else 0):
            load += mem[PULL + j] * mem[SERIES + k * SLOTS + j]
        mem[CURVE + k] = load


@kernel()
def shown_by_curve(plant: Plant, part: float) -> None:
    """Write what the nodes of the first `part` of a step show."""
    n, mem = plant.machine, plant.matrix
    power = 1.0
    for k in range(n.terms + 2):
        mem[SCRATCH + k] = mem[CURVE + k] * power
        power *= part
    columns_times(pointer(mem, POWERS), pointer(mem, SCRATCH), n.terms + 2, pointer(mem, SHOWN))


@kernel()
def curve_at(plant: Plant, s: float) -> float:
    """The polynomial at a part of the step."""
    total = 0.0
    for i in range(plant.machine.terms + 2):
        total = total * s + plant.matrix[CURVE + plant.machine.terms + 1 - i]
    return total


@kernel()
def first_root(plant: Plant, sign: float, level: float, low: float, high: float) -> float:
    """Where between two parts of a step the polynomial, times a sign, comes to a level from below: the end of an
    interval too short to matter."""
    f_low, f_high = sign * curve_at(plant, low) - level, sign * curve_at(plant, high) - level
    kept = 0
    for _ in range(ROOT_STEPS):
        if high - low <= CLOSE or f_high <= 0.0:
            break
        s = high - f_high * (high - low) / (f_high - f_low)
        if not low < s < high:
            s = 0.5 * (low + high)
        f = sign * curve_at(plant, s) - level
        # Illinois: an end that stays counts half (Dowell and Jarratt 1971).
        if f >= 0.0:
            high, f_high = s, f
            f_low = 0.5 * f_low if kept > 0 else f_low
            kept = 1
        else:
            low, f_low = s, f
            f_high = 0.5 * f_high if kept < 0 else f_high
            kept = -1
    return high
