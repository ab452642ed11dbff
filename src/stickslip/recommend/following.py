"""An axis under a controller along a reference, sample by sample: the positions of the axis itself."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.jit import kernel
from stickslip.machines.rigid import RigidAxis
from stickslip.recommend.plant import laid_out
from stickslip.rigs.loop_sample import COLUMNS, Control, control_of, decide, finished
from stickslip.rigs.rig import Limits, setpoints
from stickslip.simulation.machine.layout import look, stand_at
from stickslip.simulation.machine.plant import Laid, plant_of
from stickslip.simulation.machine.step import sample

Array = np.ndarray[Any, np.dtype[np.float64]]

UNLIMITED = Limits(torque=1e300, speed=1e300)


def simulated(
    plant: RigidAxis, controller: Controller, reference: Array, start: float = 0.0, push: Array | None = None
) -> Array | None:
    """Positions of the axis itself at every sample along a reference, rad; None where it diverges.

    The axis starts at rest at `start`, rad. `push` acts beside the controller's torque, N·m at every sample.
    """
    return followed(plant, controller, setpoints_of(reference), start, push)[0]


def setpoints_of(reference: Array) -> Array:
    """Position, velocity and acceleration of a reference for the closed loop."""
    q, v, a = reference.T
    return setpoints(len(reference), position=q, velocity=v, acceleration=a, closed=1.0)


def followed(
    plant: RigidAxis, controller: Controller, path: Array, start: float = 0.0, push: Array | None = None
) -> tuple[Array | None, Array]:
    """As `simulated`, along setpoints, and the state in which it leaves the controller's laws."""
    control = control_of(controller, UNLIMITED, controller.sample_time)
    laid = laid_out(plant, controller.sample_time, controller.encoder_counts)
    stand_at(laid, start)
    look(laid, control.measured)
    positions = np.empty(len(path))
    beside = np.zeros(len(path)) if push is None else push
    done = follow(laid, control, path, beside, np.empty(len(COLUMNS)), positions)
    ended = done == len(path) and bool(np.all(np.isfinite(positions)))
    return positions if ended else None, control.state


@kernel()
def follow(laid: Laid, control: Control, path: Any, push: Any, row: Any, positions: Any) -> int:
    """The loop of `stickslip.rigs.virtual.run_block`, that keeps the axis's own positions; how many samples ran."""
    plant = plant_of(laid)
    for k in range(path.shape[0]):
        positions[k] = plant.axis[plant.machine.shaft]
        torque = decide(control, path[k], row)
        sample(plant, torque + push[k], control.measured)
        if finished(control):
            return k + 1
    return path.shape[0]
