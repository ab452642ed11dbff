"""Sliding curves as tables: the law that a controller makes of a table, and the points that come nearest to a curve."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from stickslip.core.spec import Law, Par, Surroundings
from stickslip.exports.nearest import Curve, Form

Array = np.ndarray[Any, np.dtype[np.float64]]
Finish = Callable[[dict[str, list[float]]], dict[str, list[float]]]


DENSITY = 4
"""Velocities that may become points, and at which the error is looked at, per velocity of other forms."""

TOLERANCE = 1e-2
"""Of the largest torque: what straight lines may differ from a curve that counts as carried."""

# ---- the law of a table ----------------------------------------------------------------------------------------


class Params(NamedTuple):
    """Points; the torques are positive numbers against the motion."""

    velocity: Annotated[
        tuple[float, ...], Par("rad/s", "v_j", "velocity of point j, from 0 up", lower=0.0, per="point")
    ]
    forward: Annotated[
        tuple[float, ...], Par("N·m", "F_j^+", "torque against positive velocity", per="point")
    ]
    backward: Annotated[
        tuple[float, ...], Par("N·m", "F_j^-", "torque against negative velocity", per="point")
    ]


def steady(v: float, p: Any) -> float:
    """Torque at constant velocity, N·m: linear between points, constant beyond the last; 0 at rest."""
    if v == 0.0:
        return 0.0
    x = abs(v)
    last = len(p.velocity) - 1
    share = 1.0
    low = last
    high = last
    for i in range(last):
        if x < p.velocity[i + 1]:
            low = i
            high = i + 1
            share = (x - p.velocity[i]) / (p.velocity[i + 1] - p.velocity[i])
            break
    if v > 0.0:
        return p.forward[low] + share * (p.forward[high] - p.forward[low])
    return -(p.backward[low] + share * (p.backward[high] - p.backward[low]))


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m: a table has no memory."""
    return steady(v1, p)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Torque of the first point, N·m."""
    if direction > 0.0:
        return p.forward[0]
    return p.backward[0]


def check(p: Any) -> str:
    """The velocities ascend from 0."""
    v = p.velocity
    if v[0] != 0.0:
        return f"velocity begins with {v[0]:g} rad/s; give the torque at 0 first"
    for i in range(1, len(v)):
        if v[i] <= v[i - 1]:
            return f"velocity[{i}] = {v[i]:g} rad/s does not lie above the one before; sort the points"
    return ""


TABLE = Law(
    "table",
    Params,
    step,
    title="Table of torque over velocity",
    equation="F = F_j + (v - v_j)(F_{j+1} - F_j)/(v_{j+1} - v_j)",
    source=("stickslip.exports",),
    example={"velocity": [0.0, 1.0], "forward": [0.3, 0.2], "backward": [0.3, 0.2]},
    steady=steady,
    holding=holding,
    check=check,
    odd=False,
    continuous=False,
)


@functools.lru_cache(maxsize=32)
def table_form(count: int, *, both_directions: bool, finish: Finish | None = None) -> Form:
    """A table of at most `count` points, linear between them; `finish` makes of it what a controller can hold."""

    def fit(curve: Curve) -> dict[str, list[float]]:
        velocity, torques = between_points(curve, count, both_directions)
        forward, backward = torques if both_directions else (torques[0], torques[0])
        values = {"velocity": velocity.tolist(), "forward": forward.tolist(), "backward": backward.tolist()}
        return finish(values) if finish else values

    keeps: frozenset[str] = frozenset({"direction"} if both_directions else ())
    return Form(f"a sliding curve in at most {count} points", TABLE, fit, keeps, DENSITY, TOLERANCE)


# ---- which points ----------------------------------------------------------------------------------------------


def between_points(curve: Curve, count: int, both_directions: bool) -> tuple[Array, list[Array]]:
    """The points on a curve between which straight lines err least.

    The largest error over all of the curve's velocities is made as small as the number of points allows.

    Parameters
    ----------
    curve : Curve
    count : int
        At most so many points, 2 or more; the first lies at 0, the last at the top speed.
    both_directions : bool
        Torques forward and backward; otherwise their mean.

    Returns
    -------
    tuple
        Velocities, rad/s, shape (n,), and the torques at them, N·m.
    """
    fine = np.concatenate([[0.0], curve.velocity])
    slow = 1e-3 * fine[1] + 1.05 * curve.slowest
    tables = [np.array([side * curve.torque(side * max(x, slow)) for x in fine]) for side in (1.0, -1.0)]
    if not both_directions:
        tables = [0.5 * (tables[0] + tables[1])]
    chosen = least_error(fine, tables, count)
    return fine[chosen], [t[chosen] for t in tables]


def least_error(v: Array, tables: Sequence[Array], count: int) -> list[int]:
    """Indices of at most `count` points, the first and the last among them, with the least largest error.

    The error that all pieces may have is halved in until the points just suffice (each piece as long as it may be).
    """
    high = max(float(np.ptp(t)) for t in tables)
    low, best = 1e-9 * high, [0, v.size - 1]
    for _ in range(60):
        middle = math.sqrt(low * high)
        found = pieces(v, tables, middle, count)
        if found is None:
            low = middle
        else:
            high, best = middle, found
        if high <= low * 1.001:
            break
    return best


def pieces(v: Array, tables: Sequence[Array], error: float, count: int) -> list[int] | None:
    """Points between which no line errs by more than `error`; None where more than `count` are needed."""
    out = [0]
    while out[-1] < v.size - 1:
        if len(out) == count:
            return None
        first, fits, reach = out[-1], 1, 2
        while first + reach < v.size and holds(v, tables, first, first + reach, error):
            fits, reach = reach, 2 * reach
        low, high = fits, min(reach, v.size - first)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if holds(v, tables, first, first + middle, error) else (low, middle)
        out.append(first + low)
    return out


def holds(v: Array, tables: Sequence[Array], first: int, last: int, error: float) -> bool:
    """Whether straight lines between two points err by at most `error`."""
    inside = slice(first + 1, last)
    return all(off_the_line(v, t, first, last, inside) <= error for t in tables)


def off_the_line(v: Array, torque: Array, first: int, last: int, inside: slice) -> float:
    """Largest distance of a curve from the straight line between two of its points, N·m."""
    slope = (torque[last] - torque[first]) / (v[last] - v[first])
    return float(np.max(np.abs(torque[first] + slope * (v[inside] - v[first]) - torque[inside]), initial=0.0))


def stiffness(curve: Curve) -> float:
    """Torque per displacement of a contact at rest, N·m/rad; infinite for a law without memory."""
    law, p = curve.model.law, curve.model.parameters
    if not law.state_fields:
        return float("inf")
    z = law.state(p)
    way = 1e-9
    return abs(law.step(way, way, 1.0, z, p, Surroundings())) / way
