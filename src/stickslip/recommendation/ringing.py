"""Find the cause of a linear controller's own oscillation: the encoder's quantisation, or the loop itself.

The same axis is simulated with an exact encoder: an oscillation that remains is not caused by quantisation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.core.messages import name_option
from stickslip.machines.rigid import RigidAxis
from stickslip.recommendation.candidate_run import Drive, Trial, held_between_counts, rings, run
from stickslip.recommendation.swings import between_counts

ASKED = 3
"""Number of axes that are simulated with an exact encoder."""
QUIET = 0.2
"""Share of the friction at rest: a smaller torque per count moves nothing and is inaudible."""


def swing_at_rest(plant: RigidAxis, linear: Controller, drive: Drive, alone: Trial | str) -> float:
    """Return the peak-to-peak motion of the axis at rest, rad; infinite if it diverges."""
    if isinstance(alone, str):
        return np.inf
    found = held_between_counts(plant, linear, drive)
    return max(
        float(np.ptp(alone.late)), *(np.inf if late is None else float(np.ptp(late)) for late in found), 0.0
    )


def within_counts(swing: float, push: float, friction: float, drive: Drive) -> bool:
    """Whether an oscillation at rest is within the unavoidable encoder counts, with an inaudible torque."""
    return swing <= between_counts(drive.encoder_counts) and push < QUIET * friction


def by_counts(plants: Sequence[RigidAxis], linear: Controller, drive: Drive) -> bool:
    """Whether quantisation causes the oscillation of most of these axes: measured exactly, they are calm."""
    if not drive.encoder_counts:
        return False
    if drive.machine is not None:
        return True  # The machine has its own encoder; only the torque per count is known.
    exact, asked = replace(linear, encoder_counts=0.0), plants[:ASKED]
    calm = [not rings(plant, exact, drive, run(plant, exact, drive)) for plant in asked]
    return 2 * sum(calm) > len(asked)


def integral_of(gains: Gains | Cascade) -> tuple[str, float]:
    """Return name and value of the integral gain; 0 without one."""
    return ("kvi", gains.kvi) if isinstance(gains, Cascade) else ("ki", gains.ki)


def hunting(gains: Gains | Cascade, given: bool) -> str:
    """Return cause and remedy of an integral that hunts against friction, in contrast to quantisation."""
    why = "not of the encoder's counts alone, so that a finer one does not end it"
    return f": {why}; {against_friction(gains, given)}"


def against_friction(gains: Gains | Cascade, given: bool) -> str:
    """Return cause and remedy of an integral that hunts against friction."""
    name, value = integral_of(gains)
    less = (
        f"lower {name} ({value:.4g})" if given else f"take a loop without it ({name_option('linear', 'PD')})"
    )
    held = "hold the integral while the error is small"
    return f"the integral part hunts against the friction at rest; {less}, or {held}"
