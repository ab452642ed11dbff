"""The sampled controller (`stickslip.control.sampled`) compiled, with the law of its compensator inside."""

from __future__ import annotations

import functools

from stickslip.control.sampled import Memory, Settings, sampled_by
from stickslip.jit import compiled_sample
from stickslip.spec import Law, Surroundings, fields_of
from stickslip.subset import Layout, law_layouts

__all__ = ["COMPENSATION", "MEMORY", "sampler"]

COMPENSATION, MEMORY = Memory._fields.index("compensation"), len(Memory._fields)
"""Place of the compensating torque in the memory, and its size; the law's state follows the memory."""


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
