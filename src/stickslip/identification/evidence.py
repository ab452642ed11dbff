"""Limits of the evidence in a record: physical bounds of friction, and parameters that act at other speeds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Estimate
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.simulation.prescribed.steady import Steady

Array = np.ndarray[Any, np.dtype[np.float64]]

EXTRAPOLATED = "extrapolated"
"""Start of the verdict on a parameter that acts outside the recorded speeds."""
SHOWN = 0.1
"""Least effect on the sliding torque at a recorded speed, as a part of the parameter's greatest effect."""
DECADES, PER_DECADE = 6, 24
"""Decades below the slowest and above the fastest speed in which effects are searched; speeds per decade."""
SATURATED = 0.05
"""Greatest relative growth of an effect over the last decade of a level; a slope grows by more."""
VELOCITIES = ("rad/s", "m/s")
BELOW, FLATTEST = 1000.0, 0.3
"""Least Stribeck velocity as a divisor of the slowest speed; least shape factor."""
CHANGE = 1e-4
"""Relative change of a parameter that reveals its effect."""


def bend_limits(vector: Vector, speeds: Array) -> dict[str, tuple[float, float]]:
    """Return the search bounds of the parameters that bend the sliding curve: its velocities and its shape factors.

    A Stribeck part that reaches far beyond the fastest speed, or that has a shape factor near 0, is equivalent to a
    level and a slope: fc and sigma2 would then be arbitrary.
    """
    moving = speeds[speeds > 0.0]
    if moving.size == 0:
        return {}
    low, high = float(np.min(moving)) / BELOW, float(np.max(moving))
    limits = {p.name: (low, high) for p in vector.free if p.par.unit in VELOCITIES and p.par.positive}
    shapes = [p for p in vector.free if p.par.unit == "-" and p.par.positive and not p.shares]
    return limits | {p.name: (FLATTEST, p.par.upper) for p in shapes}


def bounded_verdicts(
    estimates: Iterable[Estimate], limits: dict[str, tuple[float, float]], what: str
) -> tuple[Estimate, ...]:
    """Return the estimates; those that only such a bound, named by `what`, limits become not identified."""
    out: list[Estimate] = []
    for e in estimates:
        least, most = limits.get(e.name, (-np.inf, np.inf))
        above = e.upper >= most * (1.0 - 1e-6)
        bound = e.identified and (above or e.lower <= least * (1.0 + 1e-6))
        side, edge = ("above", most) if above else ("below", least)
        why = f"no data limit it from {side} but {what} ({edge:.4g} {axis_unit(e.unit)})"
        out.append(replace(e, identified=False, verdict=why) if bound else e)
    return tuple(out)


def without_inverted_rest(estimates: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """Return the estimates; a break-away torque below the Coulomb torque becomes not identified.

    Break-away requires at least the sliding torque: a curve that rises from rest has another cause.
    """
    levels = {e.name: e for e in estimates}
    out: list[Estimate] = []
    for e in estimates:
        level = levels.get(e.name.replace("fs", "fc", 1)) if e.name.partition("_")[0] == "fs" else None
        if e.identified and level is not None and level.identified and e.value < level.value:
            why = (
                f"it is below {level.name}, {level.value:.4g} {axis_unit(level.unit)}: friction rises with "
                "velocity from rest"
            )
            out.append(replace(e, identified=False, verdict=f"{why}, which is no break-away"))
        else:
            out.append(e)
    return tuple(out)


def within_speeds(
    estimates: Sequence[Estimate], vector: Vector, u: Array, speeds: Array, unit: str = "rad/s"
) -> tuple[Estimate, ...]:
    """Return the estimates; parameters that act outside the recorded speeds become extrapolated.

    Parameters
    ----------
    estimates : sequence of Estimate
    vector : Vector
        The fitted law's vector, with the estimated coordinates `u`.
    speeds : array, shape (n,)
        Recorded speeds, 0 for a break-away torque.
    unit : str
        Unit of the speeds.
    """
    outside = extrapolated(vector, u, speeds)
    moving = speeds[speeds > 0.0]
    slowest, fastest = float(np.min(moving)), float(np.max(moving))
    out: list[Estimate] = []
    for e in estimates:
        where = outside.get(e.name)
        if where is None or not e.identified:
            out.append(e)
            continue
        below = where < slowest
        edge = f"below {slowest:.3g}" if below else f"above {fastest:.3g}"
        word = "slowest" if below else "fastest"
        why = f"{EXTRAPOLATED}: it acts {edge} {unit}, the {word} that was recorded"
        out.append(replace(e, identified=False, verdict=why))
    return tuple(out)


def extrapolated(vector: Vector, u: Array, speeds: Array) -> dict[str, float]:
    """Return the free parameters that act mainly outside the recorded speeds, with the speed of their greatest effect.

    A parameter has evidence if its effect on the sliding torque at a recorded speed is at least a tenth of its effect
    at any speed. A slope, whose effect grows without limit, has its evidence at the fastest speed. A Stribeck velocity
    must itself be within the recorded speeds, and so must the one that belongs to a shape factor.
    """
    assert vector.base is not None
    moving = speeds[speeds > 0.0]
    if moving.size == 0:
        return {}
    low, high = float(np.min(moving)), float(np.max(moving))
    number = DECADES * PER_DECADE
    slower = np.append(0.0, low * np.logspace(-DECADES, 0.0, number, endpoint=False))
    faster = high * np.logspace(0.0, DECADES, number + 1)
    grid = np.concatenate([slower, np.geomspace(low, high, number), faster])
    # In both directions, since some laws have separate parameters for each.
    steady, seen = (
        Steady(vector.base.law, np.append(v, -v), np.repeat([1.0, -1.0], v.size))
        for v in (grid, np.unique(np.concatenate([speeds, moving])))
    )
    values = vector.values(u)
    here, shown = (s.torque(vector.packed_values(values)) for s in (steady, seen))
    bends, out = bends_outside(vector, u, low, high), dict[str, float]()
    for i, p in enumerate(vector.free):
        if p.shares:
            continue
        more = values.copy()
        more[i] += CHANGE * (abs(values[i]) or p.scale)
        effect = np.abs(steady.torque(vector.packed_values(more)) - here).reshape(2, -1).max(axis=0)
        own = np.abs(seen.torque(vector.packed_values(more)) - shown)
        if not np.all(np.isfinite(effect)):
            continue
        slope = effect[-1] > (1.0 + SATURATED) * effect[-1 - PER_DECADE]
        looked = effect[: grid.size - faster.size] if slope else effect
        most = float(grid[int(np.argmax(looked))])
        hardly = p.name in bends or float(np.max(own)) < SHOWN * float(np.max(looked))
        if hardly and not low <= most <= high:
            out[p.name] = most
    return out


def bends_outside(vector: Vector, u: Array, low: float, high: float) -> set[str]:
    """Return the law's velocities outside the recorded ones, and its shape factors if its only velocity is outside."""
    assert vector.base is not None
    law, named = vector.base.law, vector.named(u)
    out = {p.name: named[p.name] for p in vector.free if p.par.unit in VELOCITIES}
    scale = law.velocity_scale(vector.law_parameters(u)) if law.velocity_scale and len(out) == 1 else low
    out |= {p.name: scale for p in vector.free if p.par.unit == "-" and not p.shares}
    return {name for name, v in out.items() if not low <= v <= high}
