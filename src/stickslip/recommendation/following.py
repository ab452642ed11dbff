"""Simulate an axis with a controller along a reference, sample by sample: the positions of the axis itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.control.composition import MEMORY
from stickslip.control.controller import Controller
from stickslip.core.spec import Surroundings
from stickslip.jit import call_sample, kernel, pointer, record_at
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.plant import laid_out
from stickslip.simulation.case_arrays import AROUND
from stickslip.simulation.compiled_controller import Sampled, compiled
from stickslip.simulation.machine.layout import stand_at
from stickslip.simulation.machine.plant import CHANNELS, SHOWN, Laid, plant_of
from stickslip.simulation.machine.step import measure, sample

Array = np.ndarray[Any, np.dtype[np.float64]]

OPEN = [f.name for f in MEMORY].index("open")
"""Index in a controller's state: it takes over an axis without torque, as when a drive is switched on."""


def simulated(
    plant: RigidAxis, controller: Controller, reference: Array, start: float = 0.0, push: Array | None = None
) -> Array | None:
    """Return the positions of the axis at every sample along a reference, rad; None if it diverges.

    The axis starts at rest at `start`, rad. `push` is added to the controller's torque, N·m at every sample. The
    reference has one row per sample: position, velocity, acceleration.
    """
    return followed(plant, controller, reference, start, push)[0]


def followed(
    plant: RigidAxis, controller: Controller, reference: Array, start: float = 0.0, push: Array | None = None
) -> tuple[Array | None, Array]:
    """As `simulated`, with the final state of the controller's laws."""
    control = compiled(controller)
    control.memory[OPEN] = 1.0
    laid = laid_out(plant, controller.sample_time, controller.encoder_counts)
    stand_at(laid, start)
    positions = np.empty(len(reference))
    beside = np.zeros(len(reference)) if push is None else push
    done = follow(laid, control, np.ascontiguousarray(reference), beside, np.array(Surroundings()), positions)
    ended = done == len(reference) and bool(np.all(np.isfinite(positions)))
    return positions if ended else None, control.state


@kernel()
def follow(laid: Laid, control: Sampled, path: Any, push: Any, around: Any, positions: Any) -> int:
    """Run controller and machine sample by sample; return the number of samples before one gave no torque."""
    plant, u = plant_of(laid), record_at(pointer(around, 0), AROUND)
    seen = np.zeros(len(CHANNELS))
    shown = record_at(pointer(seen, 0), SHOWN)
    measure(plant, 0.0, 1.0, shown)
    for k in range(path.shape[0]):
        positions[k] = plant.axis[plant.machine.shaft]
        u.temperature, u.time = shown.temperature, shown.time
        torque = call_sample(
            control.address, shown.position, path[k, 0], path[k, 1], path[k, 2], pointer(control.settings, 0),
            pointer(control.memory, 0), pointer(control.state, 0), pointer(control.parameters, 0),
            pointer(around, 0),
        )  # fmt: skip
        if control.memory[control.fault] != 0.0 or not math.isfinite(torque):
            return k
        sample(plant, torque + push[k], shown)
    return path.shape[0]
