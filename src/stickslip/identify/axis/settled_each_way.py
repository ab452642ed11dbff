"""The values that a model with friction per direction takes: what is identified stands, the rest explains the record.

As `stickslip.identify.axis.settled`, with a level and a slope for each direction and without a constant torque.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.identify.axis.gravity import hanging, of_one_weight
from stickslip.identify.axis.settled import GRAVITY, PREFERRED, Settling, physical, turned
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
        self, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
    ) -> tuple[dict[str, float], float]:
        """All values, those with bounds solved for beside the curve's fall as it is, and the RMS torque left, N·m."""
        torque, names = self.inverse.torque, numbers_in(values)
        known = sum((values[n] * self.column(n) for n in names if n not in bounds), self.curve(values))
        out, free = dict(values), list(bounds)
        columns = np.column_stack([np.zeros((torque.size, 0)), *(self.column(n) for n in free)])
        if free:
            low, high = (np.array([bounds[n][k] for n in free]) for k in (0, 1))
            found = within_bounds(columns, torque - known, low, np.maximum(high, np.nextafter(low, np.inf)))
            out |= dict(zip(free, found.tolist(), strict=True))
        left = torque - known - columns @ np.array([out[n] for n in free])
        return out, float(np.sqrt(np.mean(left**2)))


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
    chosen, left = own.explained(values, free)
    for way in WAYS:
        rest = by_name.get(f"fs{way}")
        if falls or rest is None or rest.identified:
            continue
        flat, more = own.explained({**chosen, rest.name: chosen[f"fc{way}"]}, free)
        if not left <= PREFERRED * more:
            chosen, left = {**flat, rest.name: flat[f"fc{way}"]}, more
    if "gravity_sin" in chosen and not by_name["gravity"].identified:
        size, angle = hanging(chosen["gravity_sin"], chosen["gravity_cos"], inverse.position)
        chosen |= {"gravity": size, "gravity_angle": angle}
    return tuple(with_value(e, chosen[e.name]) for e in estimates)


def with_value(e: Estimate, value: float) -> Estimate:
    """The estimate with its value chosen, in an interval that holds it."""
    return replace(e, value=value, lower=min(e.lower, value), upper=max(e.upper, value))
