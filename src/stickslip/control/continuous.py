"""Control laws in continuous time: what the exact, the adaptive and the fixed integrator take.

A law has a continuous form where it declares one (`stickslip.core.control_spec.ControlLaw.continuous`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from stickslip.control.block import ControlBlock
from stickslip.control.linear import Compensation, Gains
from stickslip.core.errors import ParameterError
from stickslip.models.model import Model


class Continuous(NamedTuple):
    """A controller in continuous time: its gains, and the friction law that compensates with how it does."""

    gains: Gains
    compensation: Compensation | None = None
    friction: Model | None = None


def continuous_form(blocks: Mapping[str, ControlBlock]) -> Continuous:
    """The laws in continuous time.

    Parameters
    ----------
    blocks : mapping of str to ControlBlock
        By the names of their parts.

    Raises
    ------
    ParameterError
        If one of the laws acts on samples only.
    """
    forms = {part: _form(part, block) for part, block in blocks.items()}
    loops = [form for form in forms.values() if isinstance(form, Gains)]
    gains = Gains(*map(sum, zip(*loops))) if loops else Gains(0.0)
    compensations = {part: form for part, form in forms.items() if isinstance(form, Compensation)}
    if len(compensations) > 1:
        raise _refused(list(compensations)[1], "in continuous time one law compensates friction")
    for part, form in compensations.items():
        return Continuous(gains, form, blocks[part].friction)
    return Continuous(gains)


def refuse_windup(found: Continuous, torque_limit: float) -> None:
    """Refuse an integral under a torque limit, N·m.

    Raises
    ------
    ParameterError
    """
    if found.gains.ki > 0.0 and math.isfinite(torque_limit):
        raise _refused("loop", "what its integral does at the torque limit acts on samples")


def _form(part: str, block: ControlBlock) -> Any:
    """The continuous form of a law."""
    law = block.law
    if law.continuous is None or (law.place == "loop" and not law.is_linear):
        raise _refused(part, f"control law {law.name!r} acts on samples only")
    form = law.continuous(block.parameters)
    if isinstance(form, str):
        raise _refused(part, form)
    if isinstance(form, float) and math.isfinite(form):
        raise _refused(part, f"the low-pass of {law.name!r} acts on samples only")
    return form


def _refused(part: str, why: str) -> ParameterError:
    return ParameterError(f"controller: {part}: {why}; give a sample_time greater than 0")
