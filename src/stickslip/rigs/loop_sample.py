"""One sample of the loop, compiled: what `Loop` calls from Python and block rigs call from their own kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.composed import composed_of
from stickslip.control.composition import MEMORY
from stickslip.control.controller import Controller
from stickslip.control.learned import after
from stickslip.control.linear import Gains
from stickslip.control.sampled_controller import SampledController
from stickslip.errors import InputError
from stickslip.jit import call_guarded, compiled_guarded, flat, kernel, pointer, pointer_at
from stickslip.rigs.rig import Limits, Measurement, Setpoint
from stickslip.rigs.safety import ENDED, STOPPED, Safety, bounds, guarded_by
from stickslip.rigs.safety import Bounds as BoundNames
from stickslip.spec import Surroundings, fields_of
from stickslip.subset import Layout

__all__ = [
    "COLUMNS",
    "NAMES",
    "UNITS",
    "Control",
    "addresses",
    "begin_learned",
    "control_of",
    "decide",
    "decide_at",
    "end_learned",
    "finished",
    "nothing_at",
]

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

STATE, REASON, VELOCITY = (Safety._fields.index(name) for name in ("state", "reason", "velocity"))


class Control(NamedTuple):
    """What one sample reads and writes; every array is one-dimensional and lives as long as this tuple."""

    address: int
    """of the compiled `stickslip.rigs.safety.guarded`"""
    measured: Any
    """The newest `Measurement`: the rig writes it"""
    bounds: Any
    safety: Any
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    surroundings: Any
    compensation: int
    """Place of the compensating torque in the memory"""


def control_of(
    controller: Controller | SampledController | None,
    limits: Limits,
    sample_time: float,
    travel: float = math.inf,
) -> Control:
    """Lay out and compile the sample of a controller (None: torques alone) under limits.

    Parameters
    ----------
    controller : Controller, SampledController or None
        Sampled at the rig's sample time; one in continuous time (``sample_time`` 0) is sampled too.
    limits : Limits
    sample_time : float
        The rig's, s.
    travel : float
        Displacement from where the segment begins that ends it without a fault, rad.

    Raises
    ------
    InputError
        If the controller is meant for another sample time.
    """
    if controller is not None and controller.sample_time not in (0.0, sample_time):
        raise InputError(
            f"controller: sample_time = {controller.sample_time:g} s, the rig's is {sample_time:g} s; give the rig's"
        )
    chosen = composed_of(replace(controller or NOTHING, sample_time=sample_time))
    # The setpoints' torques alone are given as they are.
    numbers = chosen.settings if controller else chosen.settings._replace(fade=0.0)
    memory = np.zeros(len(NAMES))
    memory[NAMES.index("open")] = 1.0
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
        NAMES.index("others"),
    )


def begin_learned(control: Control, controller: Any, learned: Mapping[str, Any] | None) -> None:
    """Let a controller begin with what it has learned before."""
    if isinstance(controller, SampledController) and learned:
        control.state[:] = flat(controller.packed_state(controller.state(learned)))


def end_learned(
    control: Control,
    controller: Any,
    learned: dict[str, Any] | None,
    sample_time: float,
    meta: dict[str, Any],
) -> None:
    """`learned` gets what a controller has learned as it keeps it, a record's `meta` what there is to say of it."""
    if not isinstance(controller, SampledController):
        return
    if learned is not None:
        learned.update(controller.learned(controller.unpacked_state(control.state.tolist())))
    if found := after(controller, control.state, sample_time):
        meta["learned"] = found


_compiled: dict[Any, int] = {}


def sampler(controller: SampledController) -> int:
    """Address of one guarded sample of a controller."""
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
"""Layouts of what the guard reads and writes."""


@kernel(inline=True)
def step(
    address: int, y: Any, w: Any, b: Any, s: Any, n: Any, m: Any, z: Any, p: Any, u: Any, row: Any, place: int
) -> float:
    """One guarded sample through pointers; `row` gets what the record keeps."""
    torque = call_guarded(address, y, w, b, s, n, m, z, p, u)
    row[0], row[1], row[2], row[3], row[4] = y[0], y[1], s[VELOCITY], y[2], torque
    row[5], row[6], row[7], row[8], row[9] = y[3], y[4], w[0], w[1], w[2]
    row[10], row[11], row[12], row[13], row[14] = m[place], w[3], y[5], s[STATE], s[REASON]
    return torque


@kernel()
def decide(control: Control, setpoint: Any, row: Any) -> float:
    """The torque for the next sample, N·m, from ``control.measured``; `row` gets what the record keeps."""
    return step(
        control.address, pointer(control.measured, 0), pointer(setpoint, 0), pointer(control.bounds, 0),
        pointer(control.safety, 0), pointer(control.settings, 0), pointer(control.memory, 0),
        pointer(control.state, 0), pointer(control.parameters, 0), pointer(control.surroundings, 0),
        pointer(row, 0), control.compensation,
    )  # fmt: skip


@kernel()
def decide_at(a: Any) -> float:
    """`decide` by addresses: the function's, those of its arrays in its order, the row's; then the place of the
    compensation."""
    return step(
        a[0], pointer_at(a[1]), pointer_at(a[2]), pointer_at(a[3]), pointer_at(a[4]), pointer_at(a[5]),
        pointer_at(a[6]), pointer_at(a[7]), pointer_at(a[8]), pointer_at(a[9]), pointer_at(a[10]), a[11],
    )  # fmt: skip


@kernel()
def nothing_at(_: Any) -> float:
    """What `decide_at` takes for being called."""
    return 0.0


SETPOINT, ROW = 2, 10  # places in the addresses that change from sample to sample


def addresses(control: Control) -> Any:
    """What `decide_at` reads but for setpoint and row; `control` must outlive it."""
    arrays = (
        control.measured, None, control.bounds, control.safety, control.settings, control.memory,
        control.state, control.parameters, control.surroundings, None,
    )  # fmt: skip
    at = (0 if x is None else x.ctypes.data for x in arrays)
    return np.array([control.address, *at, control.compensation], dtype=np.int64)


@kernel()
def finished(control: Control) -> bool:
    """Whether the loop ends after this sample: the torque is ramped to zero, or the segment's travel is reached."""
    return control.safety[STATE] == STOPPED or control.safety[STATE] == ENDED
