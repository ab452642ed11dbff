"""What a record can say of a contact that is stiff: it rings with the mass, and samples must show that.

A contact at rest is a spring. A bristle whose inner loops do not close (LuGre) slips a little with every oscillation;
where it rings faster than the samples show, unseen vibration lowers the torque at which it breaks away, as a dither
does (``armstrong1994``), and shifts all that slow motion tells of the law. Sliding at speed is not touched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from stickslip.identify.estimate import Estimate
from stickslip.spec import Law, Surroundings

__all__ = ["contact_frequency", "of_slow_motion", "stiffness_at_rest", "unseen_refused"]

SAMPLES = 3.0
"""Samples that a period of the contact's vibration must have."""
TINY = 1e-9
"""rad (m) by which a contact is moved to feel its stiffness."""
SHIFT, NOTHING = 1e-2, 1e-4
"""Relative change of a parameter, and of the sliding torque that counts as none."""


def stiffness_at_rest(law: Law, parameters: Any) -> float:
    """Torque over displacement of a contact at rest, N·m/rad (N/m); 0 for a law that has no state."""
    if not law.state_fields:
        return 0.0
    force = abs(law.step(TINY, TINY, 1.0, law.state(parameters), parameters, Surroundings()))
    return force / TINY


def contact_frequency(law: Law, parameters: Any, inertia: float) -> float:
    """Frequency at which the inertia, kg·m² (kg), rings on the contact at rest, Hz."""
    return math.sqrt(stiffness_at_rest(law, parameters) / inertia) / (2.0 * math.pi)


def of_slow_motion(law: Law, parameters: Any, name: str, speed: float) -> bool:
    """Whether a parameter of the law leaves the torque at that sliding speed, rad/s, as it is: ``fs``, ``sigma0``."""
    field, bracket, _ = name.partition("[")
    if field not in {f.name for f in law.fields} or law.steady is None:
        return False
    value = getattr(parameters, field)
    moved = [x * (1.0 + SHIFT) for x in value] if bracket else value * (1.0 + SHIFT)
    torque = law.steady(speed, parameters)
    change = law.steady(speed, parameters._replace(**{field: tuple(moved) if bracket else moved})) - torque
    return abs(change) <= NOTHING * SHIFT * abs(torque)


def unseen_refused(
    estimates: Sequence[Estimate], law: Law, parameters: Any, inertia: float, speed: float, period: float
) -> tuple[Estimate, ...]:
    """The estimates, those of slow motion refused where the contact rings faster than the samples show.

    Parameters
    ----------
    estimates : sequence of Estimate
    law : Law
    parameters : NamedTuple
        The law's.
    inertia : float
        kg·m² (kg).
    speed : float
        A usual sliding speed, rad/s (m/s).
    period : float
        Between samples, s.
    """
    ringing = contact_frequency(law, parameters, inertia)
    if law.non_local_memory or ringing * period * SAMPLES <= 1.0:
        return tuple(estimates)
    why = (
        f"the contact would ring at {ringing:.0f} Hz, which {1.0 / period:.0f} samples/s do not show: unseen vibration "
        f"lowers friction in slow motion; sample with {SAMPLES * ringing:.0f} Hz or more"
    )
    return tuple(
        replace(e, identified=False, verdict=why)
        if e.identified and of_slow_motion(law, parameters, e.name, speed) else e
        for e in estimates
    )  # fmt: skip
