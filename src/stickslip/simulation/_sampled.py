"""The sampled controller (`stickslip.control.sampled`) compiled, with the law of its compensator inside."""

from __future__ import annotations

import functools
import math

from stickslip.control.sampled import Memory, Settings, sampled_by
from stickslip.jit import compiled_sample, kernel
from stickslip.spec import Law, Surroundings, fields_of
from stickslip.subset import Layout, law_layouts

__all__ = ["COMPENSATION", "FAULT", "MEMORY", "measured_position", "sampler"]

COMPENSATION, FAULT, MEMORY = *map(Memory._fields.index, ("compensation", "fault")), len(Memory._fields)
"""Places of the compensating torque and of the fault in the memory, and its size; the law's state follows it."""


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
