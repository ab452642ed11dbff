"""A machine with all its imperfections under a sampled controller along a reference: `simulate` of a `Machine`.

The machine moves as `stickslip.simulation.machine.step` has it, the controller acts on what its encoder shows, once a
sample; a controller in continuous time is sampled too. Metrics are of the axis itself, not of what the sensors show:
between the samples its position is the cubic through positions and velocities of their ends, its torques are linear.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

import stickslip
from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.errors import Divergence, InputError
from stickslip.jit import call_profile, call_sample, compiled_profile, flat, kernel, pointer
from stickslip.machines.machine import Machine
from stickslip.model import Reference
from stickslip.record import Record
from stickslip.simulation._meter import (
    MAX_WINDOW,
    SIGNALS,
    close_standstill,
    meter,
    new_meter,
    turning_points,
)
from stickslip.simulation.case_arrays import COLUMNS as OF_AXES
from stickslip.simulation.case_arrays import UNITS as OF_AXES_UNITS
from stickslip.simulation.case_arrays import ruled, ruled_in, slip_rules
from stickslip.simulation.compiled_controller import Sampled, compiled
from stickslip.simulation.fixed.loop import NUDGE
from stickslip.simulation.machine.layout import TOLERANCE, lay_out_machine, look, stand_at
from stickslip.simulation.machine.plant import Laid, Plant, plant_of
from stickslip.simulation.machine.step import axis_itself, sample
from stickslip.simulation.metrics import metrics, settle_band_of
from stickslip.spec import Surroundings
from stickslip.subset import Layout

__all__ = ["COLUMNS", "UNITS", "sampled_on", "simulate_machine"]

Array = np.ndarray[Any, np.dtype[np.float64]]

UNITS = {
    **OF_AXES_UNITS, "position_measured": "rad", "torque_command": "N·m", "sensor_torque": "N·m", "temperature": "°C",
}  # fmt: skip
COLUMNS = (*OF_AXES, *(name for name in UNITS if name not in OF_AXES))
"""Of a row: what an ideal axis has (position and torques are the axis's own), then what the sensors show."""
REASONS = {
    1: "the drive switched off: faster than its encoder follows, or no longer a number",
    2: "the controller's torque is no number",
}
ON_TIME = 1e-6
"""Samples by which output times may lie beside a sample."""


def simulate_machine(
    machine: Machine,
    controller: Controller,
    reference: Reference,
    duration: float,
    *,
    output: float | Array = 1e-3,
    slip_rule: str | None = None,
    initial: tuple[float, float] = (0.0, 0.0),
    metered: bool = True,
    check: bool = False,
    tolerance: float = TOLERANCE,
) -> Record:
    """Run a machine; arguments, record and errors as of `stickslip.simulate`.

    Parameters
    ----------
    output : float or array
        Spacing of the record's rows, s, a whole number of samples; or times of samples.
    check : bool
        Whether the run is repeated at a hundredth of the tolerance (the noise is the same): ``meta["accuracy"]`` then
        says by how much both differ at most, ``error_rad``.
    tolerance : float
        Error in position that a sub-step may make by the end of its sample, rad.

    Returns
    -------
    Record
        ``meta["machine"]`` says which machine ran, and what was switched off; ``meta["learned"]`` what the controller
        has learned (`stickslip.control.learned`); there is no energy balance.
    """
    own = machine
    if slip_rule is not None:
        friction = ruled(machine.contact.friction, slip_rule)
        own = replace(machine, contact=replace(machine.contact, friction=friction))
    control, told = sampled_on(controller, machine, slip_rule)
    places = rows_at(output, machine.sample_time, duration)
    runs = [_run(own, control, reference, duration, places, initial, tolerance)]
    substeps = int(runs[0].laid.now["taken"])
    if check and runs[0].code == 0:
        runs.append(_run(own, control, reference, duration, places, initial, 0.01 * tolerance))
    meta: dict[str, Any] = {
        "what": "simulation", "version": stickslip.__version__, "integrator": "machine", "slip_rule": slip_rule,
        "slip_rules": slip_rules(friction=own.contact.friction, **told.pop("laws")),
        "tolerance": tolerance, "duration": duration, "ended": runs[0].ended, "inertia": machine.inertia,
        "friction": own.contact.friction.as_dict(), "machine": machine.as_dict(), "reference": reference.as_dict(),
        "sample_time": machine.sample_time, "counts": {"samples": runs[0].samples, "substeps": substeps}, **told,
    }  # fmt: skip
    if learned := after(controller, runs[0].state, machine.sample_time):
        meta["learned"] = learned
    if len(runs) == 2:
        apart = np.abs(runs[0].rows[:, 3] - runs[1].rows[:, 3])
        meta["accuracy"] = {"error_rad": float(np.max(apart, initial=0.0))}
    if metered and runs[0].code == 0:
        turns = turning_points(runs[0].meter, runs[0].turns)
        meta["metrics"] = {k: float(v) for k, v in metrics(runs[0].meter, turns).items()}
    columns = np.ascontiguousarray(runs[0].rows.T)
    channels = {name: columns[i] for i, name in enumerate(COLUMNS) if name != "time"}
    record = Record(columns[0], channels, UNITS, meta)
    if runs[0].code:
        ended = runs[0].ended
        raise Divergence(f"the run ended at {ended:.6g} s: {REASONS[runs[0].code]}", ended, record)
    return record


def sampled_on(
    controller: Controller, machine: Machine, slip_rule: str | None = None
) -> tuple[Sampled, dict[str, Any]]:
    """The controller compiled for a machine's samples, and what a record says of it (``laws``: friction laws in it).

    Raises
    ------
    InputError
        If it is meant for another sample time, or brings an encoder of its own.
    """
    if controller.sample_time not in (0.0, machine.sample_time):
        raise InputError(
            f"controller: sample_time = {controller.sample_time:g} s, that of the machine {machine.name} is "
            f"{machine.sample_time:g} s; give the machine's, or none"
        )
    own = _filtered_as(controller, machine)
    own = replace(ruled_in(own, slip_rule), sample_time=machine.sample_time)
    return compiled(own), {**own.described(), "laws": own.frictions}


def _filtered_as(controller: Controller, machine: Machine) -> Controller:
    """The machine's own low-pass, where the compensator brings none: as a rig of this machine has it."""
    if controller.encoder_counts not in (0.0, machine.encoder.counts):
        raise InputError(
            f"controller: encoder_counts = {controller.encoder_counts:g}, the machine {machine.name} has an encoder of "
            f"its own ({machine.encoder.counts:g}); leave it out"
        )
    compensator = controller.compensator
    if compensator is None:
        return controller
    compensator = replace(compensator, filter_hz=compensator.filter_hz or machine.filter or None)
    return replace(controller, sample_time=machine.sample_time, compensator=compensator)


def rows_at(
    output: float | Array, sample_time: float, duration: float
) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The samples that are rows of the record.

    Raises
    ------
    InputError
        If a time lies between samples.
    """
    last = math.floor(duration / sample_time * (1.0 + 1e-12))
    if isinstance(output, (int, float)):
        every = max(1, round(output / sample_time))
        times = np.arange(0, last + 1, every)
        if abs(every * sample_time - output) > ON_TIME * sample_time and output > sample_time:
            raise InputError(
                f"simulate: output = {output:g} s is no whole number of the machine's samples of {sample_time:g} s; "
                f"give {every * sample_time:g} s"
            )
        return times
    places = np.asarray(output, dtype=np.float64) / sample_time
    whole = np.rint(places)
    if places.size and float(np.max(np.abs(places - whole))) > ON_TIME:
        raise InputError(
            f"simulate: output times must be those of the machine's samples, {sample_time:g} s apart"
        )
    return np.unique(whole.astype(np.int64))


class _Ran:
    """What a run left."""

    def __init__(
        self, laid: Laid, rows: Array, meter: Array, turns: Array, samples: int, code: int, ended: float,
        state: Array,
    ):  # fmt: skip
        self.laid, self.rows, self.meter, self.turns, self.state = laid, rows, meter, turns, state
        self.samples, self.code, self.ended = samples, code, ended


def _run(
    machine: Machine, control: Sampled, reference: Reference, duration: float,
    places: np.ndarray[Any, np.dtype[np.int64]], initial: tuple[float, float], tolerance: float,
) -> _Ran:  # fmt: skip
    """One run from rest in the contact."""
    laid = lay_out_machine(machine, tolerance)
    stand_at(laid, *initial)
    samples = math.floor(duration / machine.sample_time * (1.0 + 1e-12))
    own = control._replace(memory=control.memory.copy(), state=control.state.copy())
    measured = np.zeros(6)
    look(laid, measured)
    rows = np.zeros((places.size, len(COLUMNS)))
    accumulator = new_meter(samples * machine.sample_time, settle_band_of(reference, duration))
    turns, counts = np.zeros((4096, 2)), np.zeros(2, dtype=np.int64)
    around, kind = np.array(Surroundings()), reference.kind
    code = drive(
        laid, own, compiled_profile(kind.name, kind.profile, Layout.of(kind.fields, counted=True)),
        flat(kind.pack(reference.parameters)), around,
        samples, places, measured, rows, accumulator, turns, counts,
    )  # fmt: skip
    done = int(counts[0])
    return _Ran(
        laid,
        rows[: int(counts[1])],
        accumulator,
        turns,
        done,
        int(code),
        done * machine.sample_time,
        own.state,
    )


# ---- the loop ---------------------------------------------------------------------------------------------------

AT, SPEED, FRICTION, MOTOR, COMPENSATING, ENDS = range(6)
"""Of one end of a sample: position, velocity, and the torques of friction, motor and compensator."""
TEMPERATURE, TIME = Surroundings._fields.index("temperature"), Surroundings._fields.index("time")
TRIPPED, NO_NUMBER = 1, 2


@kernel()
def drive(
    laid: Laid, control: Sampled, profile: int, reference: Any, around: Any, samples: int, places: Any,
    measured: Any, rows: Any, accumulator: Any, turns: Any, counts: Any,
) -> int:  # fmt: skip
    """Controller and machine, sample by sample; `counts` gets the samples run and the rows written."""
    plant = plant_of(laid)
    period = plant.machine.sample_time
    begin, end, motion, nodes = np.zeros(ENDS), np.zeros(ENDS), np.zeros(3), np.zeros((SIGNALS, 5))
    now(plant, measured, begin)
    for k in range(samples + 1):
        torque = act(control, measured, k * period, profile, reference, around, motion)
        begin[COMPENSATING] = control.memory[control.compensation]
        if counts[1] < places.size and places[counts[1]] == k:
            row(rows[counts[1]], k * period, motion, begin, measured, torque)
            counts[1] += 1
        if not math.isfinite(torque):
            return NO_NUMBER
        if k == samples:
            break
        sample(plant, torque, measured)
        now(plant, measured, end)
        end[COMPENSATING] = begin[COMPENSATING]
        gather(accumulator, turns, k * period, period, begin, end, profile, reference, motion, nodes)
        begin[:] = end
        counts[0] = k + 1
        if plant.now.tripped != 0:
            return TRIPPED
    close_standstill(accumulator, samples * period)
    return 0


@kernel()
def now(plant: Plant, measured: Any, out: Any) -> None:
    """The axis itself at this moment; the motor's torque is the one that the amplifier reports."""
    axis_itself(plant, out)
    out[MOTOR] = measured[2]


@kernel()
def act(
    control: Sampled, measured: Any, time: float, profile: int, reference: Any, around: Any, motion: Any
) -> float:
    """What the controller commands at a sample, N·m; `motion` gets the reference there."""
    call_profile(profile, time + NUDGE, pointer(reference, 0), pointer(motion, 0))
    motion[0] -= NUDGE * motion[1]
    around[TEMPERATURE], around[TIME] = measured[4], time
    torque = call_sample(
        control.address, measured[1], motion[0], motion[1], motion[2], pointer(control.settings, 0),
        pointer(control.memory, 0), pointer(control.state, 0), pointer(control.parameters, 0), pointer(around, 0),
    )  # fmt: skip
    return math.nan if control.memory[control.fault] != 0.0 else torque


@kernel()
def row(out: Any, time: float, motion: Any, begin: Any, measured: Any, torque: float) -> None:
    """A row of the record, in the order of `COLUMNS`."""
    out[0], out[1], out[2] = time, motion[0], motion[1]
    out[3], out[4], out[5], out[6], out[7], out[8] = (
        begin[AT], begin[SPEED], begin[MOTOR], begin[FRICTION], begin[COMPENSATING], 0.0,
    )  # fmt: skip
    out[9], out[10], out[11], out[12] = measured[1], torque, measured[3], measured[4]


@kernel()
def gather(
    accumulator: Any, turns: Any, t: float, h: float, a: Any, b: Any, profile: int, reference: Any, motion: Any,
    nodes: Any,
) -> None:  # fmt: skip
    """Hand a sample to the meter, in windows of at most its longest."""
    windows = math.ceil(h / MAX_WINDOW * (1.0 - 1e-9))
    for window in range(windows):
        for i in range(5):
            x = (window + 0.25 * i) / windows
            y = 1.0 - x
            inside = min(max(t + x * h, t + NUDGE), t + h - NUDGE)
            call_profile(profile, inside, pointer(reference, 0), pointer(motion, 0))
            at = (
                y * y * (1.0 + 2.0 * x) * a[AT] + x * x * (3.0 - 2.0 * x) * b[AT]
                + x * y * h * (y * a[SPEED] - x * b[SPEED])
            )  # fmt: skip
            speed = a[SPEED] + x * (b[SPEED] - a[SPEED])
            nodes[0, i], nodes[1, i], nodes[2, i], nodes[3, i] = motion[0] - at, motion[1] - speed, at, speed
            nodes[4, i] = motion[1]
            nodes[5, i] = b[MOTOR]
            nodes[6, i] = a[FRICTION] + x * (b[FRICTION] - a[FRICTION])
            nodes[7, i] = b[COMPENSATING]
        meter(accumulator, turns, t + h * window / windows, h / windows, nodes)
