"""The values that a model with friction per direction takes: what is identified stands, the rest explains the record.

As `stickslip.identify.axis.settled`, with a level and a slope for each direction and without a constant torque.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.identify.axis.above_nothing import above_nothing, likely
from stickslip.identify.axis.gravity import hanging, of_one_weight
from stickslip.identify.axis.settled import GRAVITY, PREFERRED, TURNS, Settling, physical, turned
from stickslip.identify.estimate import Estimate
from stickslip.identify.fit.bounded import within_bounds
from stickslip.identify.regression.inverse import InverseDynamics
from stickslip.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]

LEVELS = {"fc": "fc", "sigma2": "fv"}
"""Level and slope, and their names in the plain inverse dynamics."""
WAYS = {"": 1.0, NEGATIVE: -1.0}
"""What the names of a direction's parameters end with, and its sign."""


@dataclass(frozen=True, eq=False)
class EachWay(Settling):
    """Torque and motion of the record, and a model with friction per direction whose values are looked for."""

    def column(self, name: str) -> Array:
        """Torque per unit of a number, shape (n,)."""
        inverse = self.inverse
        for own, plain in LEVELS.items():
            for way, sign in WAYS.items():
                if name == own + way:
                    column = inverse.matrix[:, inverse.names.index(plain)]
                    return np.where(sign * inverse.velocity > 0.0, column, 0.0)
        return inverse.matrix[:, inverse.names.index(name)]

    def curve(self, values: Mapping[str, float]) -> Array:
        """What friction's curve has beside levels and slopes, N·m (N), shape (n,)."""
        law, v = self.model.law, self.inverse.velocity
        own = {f.name for f in law.fields}
        p = self.model.parameters._replace(**{k: x for k, x in values.items() if k in own})
        out = self.steady.torque(np.array(law.pack(p)))
        for way, sign in WAYS.items():
            level = values["fc" + way] * np.sign(v) + values["sigma2" + way] * v
            out = out - np.where(sign * v > 0.0, level, 0.0)
        return out

    def explained(
        self, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], flat: Sequence[str],
        loose: Sequence[str],
    ) -> tuple[dict[str, float], float]:  # fmt: skip
        """All values, those with bounds solved for, and the RMS torque left, N·m (N).

        `flat`: names of static torques that are their direction's level; `loose`: those that are not below it.
        """
        out, free, names = dict(values), list(bounds), numbers_in(values)
        columns = np.column_stack([np.zeros((self.inverse.torque.size, 0)), *(self.column(n) for n in free)])
        low, high = (np.array([bounds[n][k] for n in free]) for k in (0, 1))
        for _ in range(TURNS):
            out |= {n: out[level_of(n)] for n in flat}
            out |= {n: max(out[n], out[level_of(n)]) for n in loose}
            known = sum((out[n] * self.column(n) for n in names if n not in bounds), self.curve(out))
            if free:
                target = self.inverse.torque - known
                found = within_bounds(columns, target, low, np.maximum(high, np.nextafter(low, np.inf)))
                out |= dict(zip(free, found.tolist(), strict=True))
        out |= {n: out[level_of(n)] for n in flat}
        out |= {n: max(out[n], out[level_of(n)]) for n in loose}
        told = sum((out[n] * self.column(n) for n in names), self.curve(out))
        return out, float(np.sqrt(np.mean((self.inverse.torque - told) ** 2)))


def level_of(name: str) -> str:
    """The name of the level that a direction's static torque falls to."""
    return "fc" + name.removeprefix("fs")


def numbers_in(values: Mapping[str, float]) -> list[str]:
    """Of these names those in which the torque is linear."""
    levels = [name + way for name in LEVELS for way in WAYS]
    return [n for n in ("inertia", *levels, *GRAVITY) if n in values]


def settled_each_way(
    estimates: Sequence[Estimate], model: Model, inverse: InverseDynamics | None, *, falls: bool
) -> tuple[Estimate, ...]:
    """The estimates, what is not identified chosen so that the record's torque is explained best.

    A fall of friction with velocity that is not identified in a direction, and that certain sliding does not show
    (`falls`), stays only where it explains the record better than none.
    """
    estimates = of_one_weight(estimates)
    by_name = {e.name: e for e in estimates}
    needed = {"inertia", *(name + way for name in LEVELS for way in WAYS)}
    if inverse is None or model.law.steady is None or not needed <= by_name.keys():
        return tuple(estimates)
    if not all(inverse.has(n) for n in LEVELS.values()):
        return tuple(estimates)
    own, values = EachWay(inverse, model), {e.name: e.value for e in estimates}
    limits = {n + way: b for n, b in physical(inverse).items() for way in WAYS}
    free = {n: limits[n] for n in needed if not by_name[n].identified}
    free |= turned(by_name, values, inverse)
    rests = [e for way in WAYS if (e := by_name.get(f"fs{way}")) is not None]
    # A level is not above a static torque that is told.
    for e in (e for e in rests if e.identified and level_of(e.name) in free):
        free[level_of(e.name)] = (0.0, e.value)
    loose = [e.name for e in rests if not e.identified]
    chosen, left, level = dict(values), math.inf, list[str]()
    for falling in fewest_first([] if falls else loose):
        flat = [n for n in loose if not falls and n not in falling]
        found, rest = own.explained(values, free, flat, [n for n in loose if n not in flat])
        if left == math.inf or rest <= PREFERRED * left:
            chosen, left, level = found, rest, flat
    torque = float(np.sqrt(np.mean(inverse.torque**2)))
    chosen, _ = above_nothing(
        (chosen, left), likely(estimates), free,
        lambda start, bounds: own.explained(start, bounds, level, [n for n in loose if n not in level]), torque,
    )  # fmt: skip
    if refused(model, chosen):
        return tuple(estimates)
    if "gravity_sin" in chosen and not by_name["gravity"].identified:
        size, angle = hanging(chosen["gravity_sin"], chosen["gravity_cos"], inverse.position)
        chosen |= {"gravity": size, "gravity_angle": angle}
    return tuple(with_value(e, chosen[e.name]) for e in estimates)


def fewest_first(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Every choice among names, the smallest first."""
    return [some for count in range(len(names) + 1) for some in combinations(names, count)]


def refused(model: Model, values: Mapping[str, float]) -> bool:
    """Whether a law has something against these values together."""
    own = {f.name for f in model.law.fields}
    p = model.parameters._replace(**{n: x for n, x in values.items() if n in own})
    return model.law.check is not None and bool(model.law.check(p))


def with_value(e: Estimate, value: float) -> Estimate:
    """The estimate with its value chosen, in an interval that holds it."""
    return replace(e, value=value, lower=min(e.lower, value), upper=max(e.upper, value))
