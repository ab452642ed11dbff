"""What a record can say of a contact that is stiff: it rings with the mass, and samples must show that.

A contact at rest is a spring. A bristle whose inner loops do not close (LuGre; elasto-plastic friction near break-away,
above its z_ba) slips a little with every oscillation; where it rings faster than the samples show, unseen vibration
lowers the torque at which it breaks away, as a dither does (``armstrong1994``), and shifts all that slow motion tells
of the law. Sliding at speed is not touched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.identify.estimate import Estimate
from stickslip.spec import Law, Surroundings

__all__ = ["contact_frequency", "of_slow_motion", "stiffness_at_rest", "unseen_refused"]

SAMPLES = 3.0
"""Samples that a period of the contact's vibration must have."""
TINY, SOON = 1e-9, 1e-3
"""rad (m) by which a contact is moved to feel its stiffness, in a second; s within which its damping is felt, too."""
SLOWER = 10.0 ** np.arange(-4.0, 0.0, 0.25)
"""Parts of the highest speed at which a parameter's effect on the sliding torque is looked for."""
NOTHING = 1e-3
"""Part of its greatest effect that a parameter of slow motion may have left at the highest speed."""


def stiffness_at_rest(law: Law, parameters: Any) -> float:
    """Torque over displacement of a contact at rest, N·m/rad (N/m); 0 for a law that has no state."""
    return moved(law, parameters, 1.0) / TINY if law.state_fields else 0.0


def moved(law: Law, parameters: Any, time: float) -> float:
    """Torque after a tiny displacement from rest within that time, s."""
    speed = TINY / time
    return abs(law.step(speed, speed, time, law.state(parameters), parameters, Surroundings()))


def contact_frequency(law: Law, parameters: Any, inertia: float) -> float:
    """Frequency at which the inertia, kg·m² (kg), rings on the contact at rest, Hz; 0 where it does not ring."""
    stiffness = stiffness_at_rest(law, parameters)
    if stiffness == 0.0:
        return 0.0
    damping = (moved(law, parameters, SOON) - stiffness * TINY) / (TINY / SOON)
    ratio = damping / (2.0 * math.sqrt(stiffness * inertia))
    return math.sqrt(stiffness / inertia * max(1.0 - ratio**2, 0.0)) / (2.0 * math.pi)


def of_slow_motion(law: Law, parameters: Any, name: str, highest: float) -> bool:
    """Whether a parameter of the law has nothing to say at the highest speed, rad/s: ``fs``, ``vs``, ``sigma0``."""
    field, bracket, _ = name.partition("[")
    if field not in {f.name for f in law.fields} or law.steady is None:
        return False
    value = getattr(parameters, field)
    other = tuple(changed(x) for x in value) if bracket else changed(value)
    more = parameters._replace(**{field: other})
    effects = [abs(law.steady(v, more) - law.steady(v, parameters)) for v in highest * np.append(SLOWER, 1.0)]
    return effects[-1] <= NOTHING * max(effects)


def changed(value: float) -> float:
    """A little more."""
    return value + 1e-4 * max(abs(value), 1e-3)


def unseen_refused(
    estimates: Sequence[Estimate], law: Law, parameters: Any, inertia: float, highest: float, period: float
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
    highest : float
        The highest speed in the records, rad/s (m/s).
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
        if e.identified and of_slow_motion(law, parameters, e.name, highest) else e
        for e in estimates
    )  # fmt: skip
