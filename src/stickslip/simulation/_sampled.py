"""Sampled controllers compiled, with their laws inside: `stickslip.control.sampled` and those made of control laws."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.control.composition import MEMORY as MEMORY_FIELDS
from stickslip.control.controller import Controller
from stickslip.control.sampled import Memory, Settings, sampled_by, settings
from stickslip.control.sampled_controller import SampledController
from stickslip.jit import call_sample, compiled_sample, flat, kernel, pointer
from stickslip.simulation._case import Side
from stickslip.spec import Law, Surroundings, fields_of
from stickslip.subset import Layout, law_layouts

__all__ = ["Sampled", "compiled", "measured_position", "replay", "sampled_of", "sampled_with"]

COMPENSATION, FAULT, MEMORY = *map(Memory._fields.index, ("compensation", "fault")), len(Memory._fields)
"""Places of the compensating torque and of the fault in the memory, and its size; the law's state follows it."""
COMPOSED_COMPENSATION, COMPOSED_FAULT = (
    [f.name for f in MEMORY_FIELDS].index(name) for name in ("others", "fault")
)
"""The same places in the memory of a controller made of control laws."""


@kernel()
def measured_position(position: float, counts: float) -> float:
    """The position in whole counts of the encoder, rad; exact where it has none."""
    if counts <= 0.0:
        return position
    count = 2.0 * math.pi / counts
    return count * math.floor(position / count + 0.5)


@functools.cache
def sampler(law: Law | None) -> int:
    """Address of one sample of the controller with this compensator."""
    empty = {"z": Layout(()), "p": Layout(()), "u": Layout(Surroundings._fields)}
    layouts = {
        **(law_layouts(law) if law else empty),
        "n": Layout.of(fields_of(Settings), counted=False),
        "m": Layout.of(fields_of(Memory), counted=False),
    }
    return compiled_sample(f"sampled_{law.name}" if law else "sampled", sampled_by(law), layouts)


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


def sampled_with(controller: Controller, state: Any, parameters: Any) -> Sampled:
    """Compile a controller with gains and a compensator, whose law's state and parameters are given."""
    helper = controller.compensator
    return Sampled(
        sampler(helper.model.law if helper else None),
        np.array(settings(controller)),
        np.zeros(MEMORY),
        flat(state).copy(),
        parameters,
        COMPENSATION,
        FAULT,
    )


def compiled(controller: SampledController) -> Sampled:
    """Compile a controller made of control laws."""
    laws = controller.laws
    if laws not in _compiled:
        _compiled[laws] = compiled_sample("controller", controller.functions["sample"], controller.layouts)
    return Sampled(
        _compiled[laws],
        np.array(controller.settings),
        np.zeros(len(MEMORY_FIELDS)),
        flat(controller.packed_state()),
        flat(controller.packed()),
        COMPOSED_COMPENSATION,
        COMPOSED_FAULT,
    )


_compiled: dict[Any, int] = {}


def sampled_of(controller: Controller | SampledController, compensator: Side) -> Sampled:
    """Compile a controller (one in continuous time is laid out, and never called)."""
    if isinstance(controller, SampledController):
        return compiled(controller)
    return sampled_with(controller, compensator.state, compensator.parameters)


@kernel()
def replay(sampled: Sampled, inputs: Any, surroundings: Any, torque: Any, fault: Any) -> None:
    """Run a controller over recorded samples.

    Each row of `inputs` is measured position, reference position, velocity and acceleration; `torque` (N·m) and `fault`
    get what the controller answers and how many samples in a row were no numbers.
    """
    for i in range(inputs.shape[0]):
        torque[i] = call_sample(
            sampled.address, inputs[i, 0], inputs[i, 1], inputs[i, 2], inputs[i, 3], pointer(sampled.settings, 0),
            pointer(sampled.memory, 0), pointer(sampled.state, 0), pointer(sampled.parameters, 0),
            pointer(surroundings, 0),
        )  # fmt: skip
        fault[i] = sampled.memory[sampled.fault]
