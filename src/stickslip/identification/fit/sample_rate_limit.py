"""What a record can say of a contact that is stiff: it rings with the mass, and samples must show that.

A contact at rest is a spring. A bristle whose inner loops do not close (LuGre; elasto-plastic friction near break-away,
above its z_ba) slips a little with every oscillation; where it rings faster than the samples show, unseen vibration
lowers the torque at which it breaks away, as a dither does (``armstrong1994``), and shifts all that slow motion tells
of the law. Sliding at speed is not touched.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.spec import Law, Surroundings
from stickslip.identification.estimate import Estimate
from stickslip.identification.experiment import Experiment

Array = np.ndarray[Any, np.dtype[np.float64]]

SAMPLES = 3.0
"""Samples that a period of the contact's vibration must have."""
REVERSING = 0.05
"""Part of the usual highest speed below which an axis is about to reverse or stop."""
TINY, SOON = 1e-9, 1e-3
"""rad (m) by which a contact is moved to feel its stiffness, in a second; s within which its damping is felt, too."""
SLOWER = 10.0 ** np.arange(-4.0, 0.0, 0.25)
"""Parts of the highest speed at which a parameter's effect on the sliding torque is looked for."""
NOTHING = 1e-3
"""Part of its greatest effect that a parameter of slow motion may have left at the highest speed."""
EXCHANGED = 1e-3
"""Part of its effect on sliding that must be its own for sliding to tell a parameter."""


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


def of_slow_motion(
    law: Law, parameters: Any, name: str, highest: float, free: Iterable[str] | None = None
) -> bool:
    """Whether only slow motion and rest tell a parameter of the law: ``fs``, ``vs``, ``sigma0``.

    It has nothing to say at the highest speed; or what it says of sliding other free parameters say as well, as where
    the level is a product of stiffness and displacement: sliding then tells the product.

    Parameters
    ----------
    law : Law
    parameters : NamedTuple
        The law's.
    name : str
    highest : float
        Speed in the records, rad/s (m/s).
    free : iterable of str, optional
        Names of what is fitted beside it; all of the law's where not given.
    """
    own = numbers_of(law, parameters)
    if name not in own or law.steady is None:
        return False
    speeds = highest * np.append(SLOWER, 1.0)
    effect = effect_of(law, parameters, name, speeds)
    if abs(effect[-1]) <= NOTHING * float(np.max(np.abs(effect))):
        return True
    shares = {f.name for f in law.fields if f.par.shares}  # they add up to 1, and change no level
    beside = [
        n
        for n in (own if free is None else free)
        if n in own and n != name and n.partition("[")[0] not in shares
    ]
    if not beside:
        return False
    others = np.column_stack([effect_of(law, parameters, n, speeds) for n in beside])
    size = np.linalg.norm(others, axis=0)
    others = others[:, size > 0.0] / size[size > 0.0]
    solver: Any = np.linalg.lstsq
    solved: Array = np.asarray(solver(others, effect, rcond=None)[0], dtype=np.float64)
    rest: Array = effect - others @ solved
    return float(np.linalg.norm(rest)) <= EXCHANGED * float(np.linalg.norm(effect))


def numbers_of(law: Law, parameters: Any) -> list[str]:
    """Names of all numbers of a law, ``k[1]`` for one of several."""
    names: list[str] = []
    for f in law.fields:
        count = len(getattr(parameters, f.name)) if f.per_element else 0
        names += [f"{f.name}[{i}]" for i in range(count)] if f.per_element else [f.name]
    return names


def effect_of(law: Law, parameters: Any, name: str, speeds: Array) -> Array:
    """Change of the sliding torque at some speeds with one of the law's numbers, shape (n,)."""
    assert law.steady is not None
    field, _, place = name.partition("[")
    value = getattr(parameters, field)
    if place:
        at = int(place.rstrip("]"))
        other: Any = tuple(changed(x) if i == at else x for i, x in enumerate(value))
    else:
        other = changed(value)
    more = parameters._replace(**{field: other})
    return np.array([law.steady(v, more) - law.steady(v, parameters) for v in speeds.tolist()])


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
        f"the contact would oscillate at {ringing:.0f} Hz, which {1.0 / period:.0f} samples/s do not show: "
        "unseen vibration "
        f"lowers friction in slow motion; sample with {SAMPLES * ringing:.0f} Hz or more"
    )
    names = [e.name for e in estimates]
    return tuple(
        replace(e, identified=False, verdict=why)
        if e.identified and of_slow_motion(law, parameters, e.name, highest, names) else e
        for e in estimates
    )  # fmt: skip


def unresolved_refused(
    estimates: Sequence[Estimate],
    law: Law,
    parameters: Any,
    experiments: Sequence[Experiment],
    friction: float,
) -> tuple[Estimate, ...]:
    """The estimates, those of pre-sliding refused where the contact passes its pre-sliding travel within few samples.

    Parameters
    ----------
    estimates : sequence of Estimate
    law : Law
    parameters : NamedTuple
        The law's.
    experiments : sequence of Experiment
    friction : float
        Level of friction, N·m (N): over the stiffness at rest it is the pre-sliding travel.
    """
    stiffness = stiffness_at_rest(law, parameters)
    if stiffness == 0.0:
        return tuple(estimates)
    travel = friction / stiffness
    rows = np.concatenate([samples_within(t, travel) for t in experiments])
    typical = float(np.median(rows)) if rows.size else 0.0
    if typical >= SAMPLES:
        return tuple(estimates)
    why = (
        f"the contact passes its pre-sliding travel, {travel:.2g}, within {typical:.2g} samples of a reversal; record "
        f"slower reversals, or sample faster, for {SAMPLES:g} or more"
    )
    speeds = np.geomspace(1e-3, 1e3, 20)
    return tuple(
        replace(e, identified=False, verdict=why)
        if e.identified and of_presliding(law, parameters, e.name, speeds) else e for e in estimates
    )  # fmt: skip


def of_presliding(law: Law, parameters: Any, name: str, speeds: Array) -> bool:
    """Whether a number of the law has no effect on its torque at constant velocity."""
    if law.steady is None or name not in numbers_of(law, parameters):
        return False
    return not np.any(effect_of(law, parameters, name, speeds))


def samples_within(experiment: Experiment, travel: float) -> Array:
    """Samples behind every reversal or start until the position is farther than `travel`, shape (reversals,)."""
    q, speed = experiment.position, np.abs(experiment.velocity())
    fast = float(np.quantile(speed, 0.95))
    slow = speed < REVERSING * fast
    begins = np.flatnonzero(np.diff(slow.astype(np.int8)) == 1) + 1
    out: list[float] = []
    for begin in begins.tolist():
        # From the last sample at which it is as good as at rest until it has left.
        rest = slow[begin:]
        leaves = begin + (int(np.argmin(rest)) if not rest.all() else rest.size - 1)
        still = begin + int(np.argmin(speed[begin : leaves + 1]))
        away = np.abs(q[still:] - q[still]) > travel
        if away.any():
            out.append(float(np.argmax(away)))
    return np.array(out)
