"""Sampled controllers compiled, with their laws inside."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.composition import MEMORY as MEMORY_FIELDS
from stickslip.control.controller import Controller
from stickslip.jit import call_sample, compiled_sample, flat, kernel, pointer

COMPENSATION, FAULT, FEEDFORWARD = (
    [f.name for f in MEMORY_FIELDS].index(name) for name in ("others", "fault", "feedforward")
)
"""Places of the compensating torque, of the fault and of the feedforward in the memory."""


@kernel()
def measured_position(position: float, counts: float) -> float:
    """The position in whole counts of the encoder, rad; exact where it has none."""
    if counts <= 0.0:
        return position
    count = 2.0 * math.pi / counts
    return count * math.floor(position / count + 0.5)


class Sampled(NamedTuple):
    """A sampled controller, compiled, in flat arrays, at its start."""

    address: int
    """of one sample"""
    settings: Any
    memory: Any
    state: Any
    parameters: Any
    compensation: int
    """place of the compensating torque in the memory"""
    fault: int
    """place of the fault in it"""


def compiled(controller: Controller) -> Sampled:
    """Compile a controller as the control laws that it is made of."""
    laws = controller.laws
    if laws not in _compiled:
        _compiled[laws] = compiled_sample("controller", controller.functions["sample"], controller.layouts)
    return Sampled(
        _compiled[laws],
        np.array(controller.settings),
        np.zeros(len(MEMORY_FIELDS)),
        flat(controller.packed_state()),
        flat(controller.packed()),
        COMPENSATION,
        FAULT,
    )


_compiled: dict[Any, int] = {}


@kernel()
def replay(sampled: Sampled, inputs: Any, surroundings: Any, place: int, torque: Any, seen: Any) -> None:
    """Run a controller over recorded samples.

    Each row of `inputs` is measured position, reference position, velocity and acceleration; `torque` (N·m) gets what
    the controller answers, `seen` what then stands at a place of its memory (`COMPENSATION`, `FAULT`, `FEEDFORWARD`).
    """
    for i in range(inputs.shape[0]):
        torque[i] = call_sample(
            sampled.address, inputs[i, 0], inputs[i, 1], inputs[i, 2], inputs[i, 3], pointer(sampled.settings, 0),
            pointer(sampled.memory, 0), pointer(sampled.state, 0), pointer(sampled.parameters, 0),
            pointer(surroundings, 0),
        )  # fmt: skip
        seen[i] = sampled.memory[place]
