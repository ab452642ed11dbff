"""The compiled loop of a machine under a sampled controller: sample by sample, onto rows and meter."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import call_profile, call_sample, kernel, pointer, record_at, spliced
from stickslip.simulation._meter import MAX_WINDOW, Turns, add_stretch, close_standstill, meter_of, turns_of
from stickslip.simulation._nodes import (
    AT,
    COMPENSATING,
    ERROR,
    ERROR_RATE,
    FRICTION,
    MOTOR,
    REFERENCE_SPEED,
    SPEED,
)
from stickslip.simulation.case_arrays import AROUND, BOUNDS, MOTION
from stickslip.simulation.case_arrays import COLUMNS as OF_AXES
from stickslip.simulation.case_arrays import UNITS as OF_AXES_UNITS
from stickslip.simulation.compiled_controller import Sampled
from stickslip.simulation.fixed.loop import NUDGE
from stickslip.simulation.machine.plant import CHANNELS, SHOWN, Laid, Plant, plant_of
from stickslip.simulation.machine.step import ITSELF, axis_itself, measure, sample

OF_DRIVETRAINS = ("motor_position", "load_position")
"""Channels of a machine with springs: its first and its last inertia."""
UNITS = {
    **OF_AXES_UNITS, "position_measured": "rad", "torque_command": "N·m", "sensor_torque": "N·m", "temperature": "°C",
    **dict.fromkeys(OF_DRIVETRAINS, "rad"),
}  # fmt: skip
COLUMNS = (*OF_AXES, *(name for name in UNITS if name not in OF_AXES))
"""Of a row: what an ideal axis has (position and torques are the axis's own), then what the sensors show, then
`OF_DRIVETRAINS`."""
ROW = np.dtype([(name, np.float64) for name in COLUMNS])
"""A row of the record."""
END = np.dtype([(name, np.float64) for name in (*ITSELF, "motor", "compensating")])
"""One end of a sample: the axis itself, and the torques of motor and compensator, N·m."""
ENDS = len(END.names or ())
TRIPPED, NO_NUMBER, LEFT = 1, 2, 3
"""How a run ends early: the drive switches off, the controller gives no number, or the axis leaves every bound."""
FARTHEST, FASTEST = BOUNDS


class Loop(NamedTuple):
    """A machine under a controller along a reference.

    Attributes
    ----------
    laid : Laid
    control : Sampled
    profile : int
        Address of the reference's compiled profile.
    reference, around, motion : array
        Its parameters; the surroundings of the controller's laws; the reference at the time last asked for (`MOTION`).
    """

    laid: Laid
    control: Sampled
    profile: int
    reference: Any
    around: Any
    motion: Any


class Output(NamedTuple):
    """What a run writes.

    Attributes
    ----------
    places, rows : array
        The samples that are rows of the record, and these (`ROW`).
    acc, turns, nodes : array
        The meter's (`stickslip.simulation._meter`).
    counts : array of int, shape (2,)
        Samples run, rows written.
    metered : bool
        Whether the meter is handed the samples.
    """

    places: Any
    rows: Any
    acc: Any
    turns: Any
    nodes: Any
    counts: Any
    metered: bool


class Asked(NamedTuple):
    """The controller and its reference: a `Loop` by its addresses."""

    control: int
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    compensation: int
    fault: int
    around: Any
    profile: int
    reference: Any
    motion: Any


class Metered(NamedTuple):
    """The meter of an `Output` by its addresses."""

    so_far: Any
    turns: Turns
    nodes: Any


@spliced
def asked_of(loop: Loop) -> Asked:
    """The addresses of arrays that outlive the call: handed on, arrays count references."""
    c = loop.control
    return Asked(
        c.address, pointer(c.settings, 0), pointer(c.memory, 0), pointer(c.state, 0), pointer(c.parameters, 0),
        c.compensation, c.fault, record_at(pointer(loop.around, 0), AROUND), loop.profile, pointer(loop.reference, 0),
        record_at(pointer(loop.motion, 0), MOTION),
    )  # fmt: skip


@kernel()
def drive(loop: Loop, samples: int, output: Output) -> int:
    """Controller and machine, sample by sample."""
    plant, asked = plant_of(loop.laid), asked_of(loop)
    metered = Metered(meter_of(output.acc), turns_of(output.turns), pointer(output.nodes, 0))
    places, counts, period = output.places, output.counts, plant.machine.sample_time
    seen, ends = np.zeros(len(CHANNELS)), np.zeros(2 * ENDS)
    shown = record_at(pointer(seen, 0), SHOWN)
    begin, end = record_at(pointer(ends, 0), END), record_at(pointer(ends, ENDS), END)
    measure(plant, 0.0, 1.0, shown)
    now(plant, shown, begin)
    for k in range(samples + 1):
        torque = act(asked, shown, k * period)
        begin.compensating = asked.memory[asked.compensation]
        if counts[1] < places.size and places[counts[1]] == k:
            row = record_at(pointer(output.rows[counts[1]], 0), ROW)
            write(row, asked.motion, begin, shown, torque)
            axis, n = plant.axis, plant.machine
            row.motor_position, row.load_position = axis[n.rotor], axis[n.disk]
            counts[1] += 1
        if not math.isfinite(torque):
            return NO_NUMBER
        if k == samples:
            break
        sample(plant, torque, shown)
        now(plant, shown, end)
        end.compensating = begin.compensating
        if output.metered:
            gather(asked, metered, k * period, period, begin, end)
        for i in range(ENDS):
            ends[i] = ends[ENDS + i]
        counts[0] = k + 1
        if plant.now.tripped != 0:
            return TRIPPED
        if abs(end.position) > FARTHEST or abs(end.velocity) > FASTEST:
            return LEFT
    close_standstill(output.acc, samples * period)
    return 0


@kernel()
def now(plant: Plant, shown: Any, out: Any) -> None:
    """The axis itself at this moment; the motor's torque is the one that the amplifier reports."""
    axis_itself(plant, out)
    out.motor = shown.motor_torque


@kernel()
def act(asked: Asked, shown: Any, time: float) -> float:
    """What the controller commands at a sample, N·m; the motion is the reference there, as
    `Reference.sample` gives it: at a jump what comes behind."""
    motion = asked.motion
    call_profile(asked.profile, time, asked.reference, pointer(motion, 0))
    asked.around.temperature, asked.around.time = shown.temperature, time
    torque = call_sample(
        asked.control, shown.position, motion.position, motion.velocity, motion.acceleration, asked.settings,
        asked.memory, asked.state, asked.parameters, pointer(asked.around, 0),
    )  # fmt: skip
    return math.nan if asked.memory[asked.fault] != 0.0 else torque


@kernel()
def write(row: Any, motion: Any, begin: Any, shown: Any, torque: float) -> None:
    """A row of the record; what an axis has as an event stays 0."""
    row.time, row.position_reference, row.velocity_reference = shown.time, motion.position, motion.velocity
    row.position, row.velocity = begin.position, begin.velocity
    row.motor_torque, row.friction_torque, row.compensation_torque = (
        begin.motor,
        begin.friction,
        begin.compensating,
    )
    row.position_measured, row.torque_command = shown.position, torque
    row.sensor_torque, row.temperature = shown.sensor_torque, shown.temperature


@kernel()
def gather(asked: Asked, metered: Metered, t: float, h: float, a: Any, b: Any) -> None:
    """Hand a sample to the meter, in windows of at most its longest."""
    nodes, motion = metered.nodes, asked.motion
    windows = math.ceil(h / MAX_WINDOW * (1.0 - 1e-9))
    for window in range(windows):
        for i in range(5):
            x = (window + 0.25 * i) / windows
            y = 1.0 - x
            inside = min(max(t + x * h, t + NUDGE), t + h - NUDGE)
            call_profile(asked.profile, inside, asked.reference, pointer(motion, 0))
            at = (
                y * y * (1.0 + 2.0 * x) * a.position + x * x * (3.0 - 2.0 * x) * b.position
                + x * y * h * (y * a.velocity - x * b.velocity)
            )  # fmt: skip
            speed = a.velocity + x * (b.velocity - a.velocity)
            nodes[ERROR + i], nodes[ERROR_RATE + i] = motion.position - at, motion.velocity - speed
            nodes[AT + i], nodes[SPEED + i], nodes[REFERENCE_SPEED + i] = at, speed, motion.velocity
            nodes[MOTOR + i], nodes[COMPENSATING + i] = b.motor, b.compensating
            nodes[FRICTION + i] = a.friction + x * (b.friction - a.friction)
        add_stretch(metered.so_far, metered.turns, t + h * window / windows, h / windows, nodes)
