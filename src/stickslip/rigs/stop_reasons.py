"""What is told of a run that was stopped."""

from __future__ import annotations

import math

from stickslip.errors import DriveFault, InputError, LimitCrossed, RigError
from stickslip.rigs.rig import LIMIT_UNITS, Limits
from stickslip.rigs.safety import REASONS, STATUS

__all__ = ["crossed", "told"]


def crossed(rig: str, limits: Limits, reason: int, value: float, at: float) -> RigError:
    """The error for what the guarded sample itself saw: the limit, the `value` that crossed it, and when."""
    where = f"at t = {at:.3f} s; the torque was ramped to zero"
    name = REASONS[reason]
    if reason == STATUS:
        code = int(value) if math.isfinite(value) else 0
        return DriveFault(f"{rig} reports fault 0x{code:04X} {where}")
    if limit := limits.text(name):
        return LimitCrossed(f"{name} = {value:g} {LIMIT_UNITS[name]} is beyond its limit {limit} {where}")
    if math.isfinite(value):
        return LimitCrossed(f"an input of the controller, or the torque it computed, is {name} {where}")
    return LimitCrossed(f"position or torque is {value:g}, {name}, {where}")


def told(fault: BaseException) -> BaseException:
    """What is raised for an exception that stopped a run: errors of rigs and users, and exits, as they are."""
    if isinstance(fault, (RigError, InputError)) or not isinstance(fault, Exception):
        return fault
    error = RigError(f"{type(fault).__name__} in the loop: {fault}; the torque was ramped to zero")
    error.__cause__ = fault
    return error
