"""Position feedforward: the torque that a drive must give at an angle against cogging, gravity and unbalance.

A map of harmonics or a table over a period (`stickslip.machines.position_map`). What the drive takes to act is looked
ahead by the lead. The measured angle suits an axis that leaves its reference, the reference's angle a quiet one: that
adds no noise and cannot make the loop unstable (a map by the measured angle is a spring whose sign changes over the
angle). Orders are whole numbers a turn, and a turn holds the table's period a whole number of times: whole turns are
left out.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Choice, Option, Par

TURN = 2.0 * math.pi  # rad


class Params(NamedTuple):
    """How much of the map, and when."""

    gain: Annotated[float, Par("-", "g", "factor on the map", lower=0.0, default=1.0)]
    lead: Annotated[float, Par("s", "T_l", "time by which the map is looked ahead", lower=0.0, default=0.0)]


class Harmonics(NamedTuple):
    """Waves over the angle."""

    order: Annotated[tuple[float, ...], Par("1/rad", "n_k", "periods a turn", positive=True, per="harmonic")]
    cosine: Annotated[tuple[float, ...], Par("N·m", "a_k", "of cos(n_k theta)", per="harmonic")]
    sine: Annotated[tuple[float, ...], Par("N·m", "b_k", "of sin(n_k theta)", per="harmonic")]


class Table(NamedTuple):
    """Torques at equal angles, the first at 0; linear between them, and from the last to the first."""

    period: Annotated[
        float, Par("rad", "P", "angle over which the table repeats", positive=True, default=2.0 * math.pi)
    ]
    table: Annotated[tuple[float, ...], Par("N·m", "T_i", "torque at i P / n", per="point")]


def harmonics(angle: float, p: Any) -> float:
    """Sum of a_k cos(n_k theta) + b_k sin(n_k theta), N·m."""
    total = 0.0
    for i in range(len(p.order)):
        total += p.cosine[i] * math.cos(p.order[i] * angle) + p.sine[i] * math.sin(p.order[i] * angle)
    return total


def table(angle: float, p: Any) -> float:
    """Linear between the points, N·m."""
    turns = angle / p.period
    place = len(p.table) * (turns - math.floor(turns))
    low = int(place)
    if low >= len(p.table):
        low = len(p.table) - 1
    high = low + 1
    if high >= len(p.table):
        high = 0
    part = min(place - low, 1.0)
    return (1.0 - part) * p.table[low] + part * p.table[high]


def within_turn(y: Any) -> float:
    """The measured angle without whole turns, rad: in single precision as sharp after a thousand turns."""
    return TURN * (y.turns - math.floor(y.turns)) + y.position


def measured(y: Any, p: Any) -> float:
    """The measured angle, ahead by the lead at the estimated velocity, rad."""
    return within_turn(y) + p.lead * y.velocity


def reference(y: Any, p: Any) -> float:
    """The reference's angle, ahead by the lead, rad."""
    return within_turn(y) + y.error + p.lead * y.reference_velocity


FORM = Choice(
    "form", "over_angle",
    {
        "harmonics": Option(
            harmonics, Harmonics,
            example={"order": [12.0, 24.0], "cosine": [0.01, 0.0], "sine": [-0.02, 0.005]},
        ),
        "table": Option(table, Table, example={"table": [0.0, 0.02, 0.01, -0.03]}),
    },
    "harmonics", "how the map is written",
)  # fmt: skip
ANGLE = Choice(
    "angle",
    "angle_of",
    {"measured": Option(measured), "reference": Option(reference)},
    "measured",
    "by which angle the map is read",
)
over_angle = harmonics
angle_of = measured


def sample(y: Any, z: Any, p: Any, u: Any) -> float:
    """Torque, N·m."""
    return p.gain * over_angle(angle_of(y, p), p)


CONTROL_LAW = ControlLaw(
    "position_feedforward", Params, sample, "feedforward",
    title="Position feedforward",
    equation=r"T = g \sum_k a_k \cos n_k \theta + b_k \sin n_k \theta,\quad \theta = \theta_m + T_l v",
    source=("own",),
    example={},
    choices=(FORM, ANGLE),
)  # fmt: skip
