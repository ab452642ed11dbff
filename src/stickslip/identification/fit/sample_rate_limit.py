"""The limit that the sample rate sets on a stiff contact: it rings with the mass, and samples must resolve that.

A contact at rest is a spring. A bristle whose inner loops do not close (LuGre; elasto-plastic friction near break-away,
above its z_ba) slips a little with every oscillation; if it rings faster than the samples resolve, unseen vibration
lowers the torque at which it breaks away, as dither does (``armstrong1994``), and biases all estimates from slow
motion. Sliding at speed is unaffected.
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
"""Least samples per period of the contact's vibration."""
REVERSING = 0.05
"""Part of the usual highest speed below which an axis is about to reverse or stop."""
TINY, SOON = 1e-9, 1e-3
"""Displacement that tests a contact's stiffness within a second, rad (m); time within which its damping shows, too,
s."""
SLOWER = 10.0 ** np.arange(-4.0, 0.0, 0.25)
"""Parts of the highest speed at which a parameter's effect on the sliding torque is evaluated."""
NOTHING = 1e-3
"""Greatest remaining effect at the highest speed of a slow-motion parameter, part of its greatest effect."""
EXCHANGED = 1e-3
"""Least part of a parameter's effect on sliding that no others explain, for sliding to determine it."""


def stiffness_at_rest(law: Law, parameters: Any) -> float:
    """Return torque over displacement of a contact at rest, N·m/rad (N/m); 0 for a law without a state."""
    return moved(law, parameters, 1.0) / TINY if law.state_fields else 0.0


def moved(law: Law, parameters: Any, time: float) -> float:
    """Return the torque after a tiny displacement from rest within that time, s."""
    speed = TINY / time
    return abs(law.step(speed, speed, time, law.state(parameters), parameters, Surroundings()))


def contact_frequency(law: Law, parameters: Any, inertia: float) -> float:
    """Return the frequency at which the inertia, kg·m² (kg), rings on the contact at rest, Hz; 0 without ringing."""
    stiffness = stiffness_at_rest(law, parameters)
    if stiffness == 0.0:
        return 0.0
    damping = (moved(law, parameters, SOON) - stiffness * TINY) / (TINY / SOON)
    ratio = damping / (2.0 * math.sqrt(stiffness * inertia))
    return math.sqrt(stiffness / inertia * max(1.0 - ratio**2, 0.0)) / (2.0 * math.pi)


def of_slow_motion(
    law: Law, parameters: Any, name: str, highest: float, free: Iterable[str] | None = None
) -> bool:
    """Return whether only slow motion and rest determine a parameter of the law: ``fs``, ``vs``, ``sigma0``.

    It has no effect at the highest speed, or other free parameters have the same effect on sliding: if the level is a
    product of stiffness and displacement, sliding determines the product.

    Parameters
    ----------
    law : Law
    parameters : NamedTuple
        The law's parameters.
    name : str
    highest : float
        Highest speed in the records, rad/s (m/s).
    free : iterable of str, optional
        Names of the fitted parameters; None for all of the law's.
    """
    own = numbers_of(law, parameters)
    if name not in own or law.steady is None:
        return False
    speeds = highest * np.append(SLOWER, 1.0)
    effect = effect_of(law, parameters, name, speeds)
    if abs(effect[-1]) <= NOTHING * float(np.max(np.abs(effect))):
        return True
    shares = {f.name for f in law.fields if f.par.shares}  # They add up to 1 and do not change the level.
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
    """Return the names of all numbers of a law, ``k[1]`` for one of several."""
    names: list[str] = []
    for f in law.fields:
        count = len(getattr(parameters, f.name)) if f.per_element else 0
        names += [f"{f.name}[{i}]" for i in range(count)] if f.per_element else [f.name]
    return names


def effect_of(law: Law, parameters: Any, name: str, speeds: Array) -> Array:
    """Return the change of the sliding torque at some speeds with one of the law's numbers, shape (n,)."""
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
    """Return a slightly larger value, for a finite difference."""
    return value + 1e-4 * max(abs(value), 1e-3)


def unseen_refused(
    estimates: Sequence[Estimate], law: Law, parameters: Any, inertia: float, highest: float, period: float
) -> tuple[Estimate, ...]:
    """Return the estimates; those of slow motion become not identified if the contact rings too fast for the samples.

    Parameters
    ----------
    estimates : sequence of Estimate
    law : Law
    parameters : NamedTuple
        The law's parameters.
    inertia : float
        kg·m² (kg).
    highest : float
        Highest speed in the records, rad/s (m/s).
    period : float
        Sample period, s.
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
    """Return the estimates; those of pre-sliding become not identified if too few samples resolve it.

    Parameters
    ----------
    estimates : sequence of Estimate
    law : Law
    parameters : NamedTuple
        The law's parameters.
    experiments : sequence of Experiment
    friction : float
        Level of friction, N·m (N): divided by the stiffness at rest it is the pre-sliding travel.
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
    """Return whether a number of the law has no effect on its torque at constant velocity."""
    if law.steady is None or name not in numbers_of(law, parameters):
        return False
    return not np.any(effect_of(law, parameters, name, speeds))


def samples_within(experiment: Experiment, travel: float) -> Array:
    """Return the samples from every reversal or start until the position moved by `travel`, shape (reversals,)."""
    q, speed = experiment.position, np.abs(experiment.velocity())
    fast = float(np.quantile(speed, 0.95))
    slow = speed < REVERSING * fast
    begins = np.flatnonzero(np.diff(slow.astype(np.int8)) == 1) + 1
    out: list[float] = []
    for begin in begins.tolist():
        # From the last sample nearly at rest until it has left.
        rest = slow[begin:]
        leaves = begin + (int(np.argmin(rest)) if not rest.all() else rest.size - 1)
        still = begin + int(np.argmin(speed[begin : leaves + 1]))
        away = np.abs(q[still:] - q[still]) > travel
        if away.any():
            out.append(float(np.argmax(away)))
    return np.array(out)
