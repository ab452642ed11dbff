"""One compiled sample of the loop, called by `Loop` from Python and by block rigs from their kernels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.composition import MEMORY
from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.control.linear import Gains
from stickslip.control.sample_time import sampled_by
from stickslip.core.spec import Surroundings, fields_of
from stickslip.jit import call_guarded, compiled_guarded, flat, kernel, pointer, pointer_at, record_at
from stickslip.rigs.rig import Limits, Measurement, Setpoint
from stickslip.rigs.safety import STOPPED, Safety, bounds, guarded_by
from stickslip.rigs.safety import Bounds as BoundNames
from stickslip.subset import Layout

UNITS = {
    "time": "s", "position": "rad", "velocity": "rad/s", "motor_torque": "N·m", "torque_command": "N·m",
    "sensor_torque": "N·m", "temperature": "°C", "position_reference": "rad", "velocity_reference": "rad/s",
    "torque_setpoint": "N·m", "compensation_torque": "N·m", "closed": "-", "status": "-", "state": "-",
    "reason": "-",
}  # fmt: skip
"""A row of a record: its columns and their units, in order."""
COLUMNS = tuple(UNITS)

NAMES = tuple(f.name for f in MEMORY)
"""The fields of a controller's memory."""
NOTHING = Controller(Gains(0.0))


def record_of(names: Iterable[str]) -> np.dtype[Any]:
    """Return a structured type with named fields for the elements of arrays."""
    return np.dtype([(name, np.float64) for name in names])


MEASURED, REFERENCE, BOUNDS, SAFETY, REMEMBERED, ROW = map(
    record_of, (Measurement._fields, Setpoint._fields, BoundNames._fields, Safety._fields, NAMES, COLUMNS)
)
"""Arguments of a sample, by name; the last two are the controller's state and a row of the record."""


class Control(NamedTuple):
    """The data of one sample; every array is one-dimensional and lives as long as this tuple."""

    address: int
    """of the compiled `stickslip.rigs.safety.guarded`"""
    measured: Any
    """The latest `Measurement`, written by the rig"""
    bounds: Any
    safety: Any
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    surroundings: Any


def control_of(
    controller: Controller | None,
    limits: Limits,
    sample_time: float,
    travel: float = math.inf,
) -> Control:
    """Compile the sample of a controller (None: torques alone) with limits.

    Parameters
    ----------
    controller : Controller or None
        Sampled at the rig's sample time; one in continuous time (``sample_time`` 0) is sampled too.
    limits : Limits
    sample_time : float
        The rig's, s.
    travel : float
        Displacement that ends the segment without a fault, rad.

    Raises
    ------
    InputError
        If the controller has another sample time.
    """
    chosen = sampled_by(controller or NOTHING, sample_time, "rig")
    # Without a controller the torques of the setpoints are applied unchanged.
    numbers = chosen.settings if controller else chosen.settings._replace(fade=0.0)
    memory = np.zeros(len(NAMES))
    memory.view(REMEMBERED)["open"] = 1.0
    return Control(
        sampler(chosen),
        np.zeros(len(Measurement._fields)),
        np.array(bounds(limits, sample_time, travel)),
        np.zeros(len(Safety._fields)),
        np.array(numbers),
        memory,
        flat(chosen.packed_state()),
        flat(chosen.packed()),
        np.array(Surroundings()),
    )


def begin_learned(control: Control, controller: Controller | None, learned: Mapping[str, Any] | None) -> None:
    """Initialise a controller with what it has learned before."""
    if controller and learned:
        control.state[:] = flat(controller.packed_state(controller.state(learned)))


def end_learned(
    control: Control,
    controller: Controller | None,
    learned: dict[str, Any] | None,
    sample_time: float,
    meta: dict[str, Any],
) -> None:
    """Store what a controller has learned in `learned`, and a description of it in the record's `meta`."""
    if controller is None:
        return
    if learned is not None:
        learned.update(controller.learned(controller.unpacked_state(control.state.tolist())))
    if found := after(controller, control.state, sample_time):
        meta["learned"] = found


_compiled: dict[Any, int] = {}


def sampler(controller: Controller) -> int:
    """Return the address of one guarded sample of a controller."""
    laws = controller.laws
    if laws not in _compiled:
        function = guarded_by(controller.functions)
        _compiled[laws] = compiled_guarded("guarded_controller", function, {**controller.layouts, **GUARD})
    return _compiled[laws]


GUARD = {
    "y": Layout(Measurement._fields),
    "w": Layout(Setpoint._fields),
    "b": Layout.of(fields_of(BoundNames), counted=False),
    "s": Layout.of(fields_of(Safety), counted=False),
}
"""Layouts of the data of the guard."""


class Sample(NamedTuple):
    """Addresses of the arguments of one sample, in the order of its function, and of the recorded row."""

    address: int
    measured: Any
    setpoint: Any
    bounds: Any
    safety: Any
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    surroundings: Any
    row: Any


@kernel(inline=True)
def step(at: Sample) -> float:
    """Run one guarded sample; ``row`` gets the values to record."""
    torque = call_guarded(
        at.address, at.measured, at.setpoint, at.bounds, at.safety, at.settings, at.memory, at.state, at.parameters,
        at.surroundings,
    )  # fmt: skip
    y, w, s = (
        record_at(at.measured, MEASURED),
        record_at(at.setpoint, REFERENCE),
        record_at(at.safety, SAFETY),
    )
    row = record_at(at.row, ROW)
    row.time, row.position, row.velocity, row.motor_torque = s.time, y.position, s.velocity, y.torque
    row.torque_command, row.sensor_torque, row.temperature = torque, y.sensor, y.temperature
    row.position_reference, row.velocity_reference, row.torque_setpoint = w.position, w.velocity, w.torque
    row.compensation_torque, row.closed = record_at(at.memory, REMEMBERED).others, w.closed
    row.status, row.state, row.reason = y.status, s.state, s.reason
    return torque


@kernel()
def decide(control: Control, setpoint: Any, row: Any) -> float:
    """Return the torque for the next sample, N·m, from ``control.measured``; `row` gets the values to record."""
    return step(
        Sample(
            control.address, pointer(control.measured, 0), pointer(setpoint, 0), pointer(control.bounds, 0),
            pointer(control.safety, 0), pointer(control.settings, 0), pointer(control.memory, 0),
            pointer(control.state, 0), pointer(control.parameters, 0), pointer(control.surroundings, 0),
            pointer(row, 0),
        )
    )  # fmt: skip


ADDRESSES = np.dtype([(name, np.int64) for name in Sample._fields])
"""A `Sample` as integers, which Python can write."""


@kernel()
def decide_at(addresses: Any) -> float:
    """Call `decide` by `ADDRESSES`."""
    a = record_at(pointer(addresses, 0), ADDRESSES)
    return step(
        Sample(
            a.address, pointer_at(a.measured), pointer_at(a.setpoint), pointer_at(a.bounds), pointer_at(a.safety),
            pointer_at(a.settings), pointer_at(a.memory), pointer_at(a.state), pointer_at(a.parameters),
            pointer_at(a.surroundings), pointer_at(a.row),
        )
    )  # fmt: skip


@kernel()
def nothing_at(_: Any) -> float:
    """Do nothing, to measure the time of a call of `decide_at`."""
    return 0.0


def addresses(control: Control) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the `ADDRESSES` of a control, which must outlive them; those of setpoint and row are 0."""
    out = np.zeros(1, ADDRESSES)
    out["address"] = control.address
    for name in control._fields[1:]:
        out[name] = getattr(control, name).ctypes.data
    return out.view(np.int64)


@kernel()
def finished(control: Control) -> bool:
    """Whether the loop ends after this sample: the torque is ramped to zero, or the segment's travel is reached."""
    return record_at(pointer(control.safety, 0), SAFETY).state >= STOPPED
