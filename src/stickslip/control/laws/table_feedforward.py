"""Table feedforward: a torque over the reference's angle and direction, or over time, as learning leaves it.

Linear between the points. Over the angle the ends are held, for an axis that does not turn round and round
(`position_feedforward` is for whole turns). Over time the table begins at the first sample, and its last point is
held, or the first follows it again; samples that are missing count.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par

TURN = 2.0 * math.pi  # rad


class Params(NamedTuple):
    """How much of the table."""

    gain: Annotated[float, Par("-", "g", "factor on the table", lower=0.0, default=1.0)]


class Angle(NamedTuple):
    """Torques in the middles of equal bins."""

    lower: Annotated[float, Par("rad", "theta_0", "angle where the first bin begins")]
    upper: Annotated[float, Par("rad", "theta_1", "angle where the last bin ends")]
    forward: Annotated[
        tuple[float, ...], Par("N·m", "T_i^+", "torque in a bin, reference velocity at least 0", per="bin")
    ]
    backward: Annotated[tuple[float, ...], Par("N·m", "T_i^-", "the same for velocities below 0", per="bin")]


class Time(NamedTuple):
    """Torques at equal times, the first at 0."""

    step: Annotated[float, Par("s", "", "time between two points", positive=True)]
    table: Annotated[tuple[float, ...], Par("N·m", "T_i", "torque at i times the step", per="point")]


class State(NamedTuple):
    """Internal state."""

    place: Annotated[float, Par("-", "", "points passed since the table began")]


def over_angle(y: Any, z: Any, p: Any) -> float:
    """By the reference's angle and direction, N·m."""
    n = float(len(p.forward))
    share = (TURN * y.turns + (y.position - p.lower) + y.error) / (p.upper - p.lower)
    middle = min(max(n * share - 0.5, 0.0), n - 1.0)
    low = int(middle)
    high = low + 1
    if high >= len(p.forward):
        high = low
    part = middle - math.floor(middle)
    if y.reference_velocity < 0.0:
        return (1.0 - part) * p.backward[low] + part * p.backward[high]
    return (1.0 - part) * p.forward[low] + part * p.forward[high]


def width(p: Any) -> str:
    """The range has a width."""
    if not p.upper > p.lower:
        return f"upper = {p.upper:g} rad must be greater than lower = {p.lower:g} rad"
    return ""


def between(place: float, p: Any) -> float:
    """The torque at a place of the table, in points, N·m; after the last point comes the first."""
    low = int(place)
    if low >= len(p.table):
        low = len(p.table) - 1
    high = low + 1
    if high >= len(p.table):
        high = 0
    part = min(place - float(low), 1.0)
    return (1.0 - part) * p.table[low] + part * p.table[high]


def over_time(y: Any, z: Any, p: Any) -> float:
    """By the time since the first sample, the last point held, N·m."""
    if y.started != 0.0:
        z.place = min(z.place + y.elapsed / p.step, float(len(p.table)) - 1.0)
    return between(z.place, p)


def repeated(y: Any, z: Any, p: Any) -> float:
    """By the time since the table last began, N·m."""
    n = float(len(p.table))
    if y.started != 0.0:
        z.place += y.elapsed / p.step
        z.place -= n * math.floor(z.place / n)
    return between(z.place, p)


OVER = Choice(
    "over",
    "torque_of",
    {
        "angle": Option(
            over_angle,
            Angle,
            example={
                "lower": 0.0,
                "upper": 0.04,
                "forward": [0.2, 0.3, 0.25],
                "backward": [-0.3, -0.2, -0.3],
            },
            check=width,
        ),
        "time": Option(over_time, Time, example={"step": 2e-3, "table": [0.0, 0.2, 0.3, -0.1]}),
        "repeated_time": Option(repeated, Time, example={"step": 2e-3, "table": [0.0, 0.2, 0.3, -0.1]}),
    },
    "angle",
    "what the table is over",
)
torque_of = over_angle


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    return p.gain * torque_of(y, z, p)


CONTROL_LAW = ControlLaw(
    "table_feedforward", Params, sample, "feedforward",
    title="Table feedforward",
    equation=r"T = g\,T_i(\theta_d, \mathrm{sgn}\,\dot\theta_d)\ \text{or}\ T = g\,T_i(t)",
    source=("own",),
    example={},
    State=State,
    choices=(OVER,),
)  # fmt: skip
