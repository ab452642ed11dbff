"""Points of a sliding curve from a coasting axis: with the torque off, friction decelerates its inertia.

At every instant F(v) = -J dv/dt. Velocity and acceleration come from one smooth window inside gross sliding, in the
weak form: only the window is differentiated (`stickslip.identification.windows`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.identification.experiment import TORQUES, Experiment
from stickslip.identification.rows import sliding_rows
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.machines.servo import ServoAxis

APART = 3
"""Rows between points: half a window, beyond which the noise of neighbours is hardly correlated."""


def coasting_points(records: Sequence[Record], inertia: float) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Return velocity and friction torque along coast-downs, and a note.

    Parameters
    ----------
    records : sequence of Record
        With positions; a torque, if present, is 0 throughout.
    inertia : float
        Inertia, kg·m² (kg).

    Raises
    ------
    InputError
        If the inertia is not positive, a torque acts, or the axis hardly slides.
    """
    if not 0.0 < inertia < math.inf:
        raise InputError(
            f"{name_option('inertia', f'{inertia:g}')} must be greater than 0 and finite, in kg·m² (kg)"
        )
    for record in records:
        for channel in TORQUES:
            if channel in record.channels and np.any(record[channel] != 0.0):
                raise InputError(
                    f"{name_option('method', 'sliding')} {name_option('inertia')} is for an axis that coasts, "
                    f"and {channel} is not 0 throughout; select "
                    f"the coasting with {name_option('start')} and {name_option('end')}, or identify the axis "
                    f"with {name_option('method', 'axis')} {name_option('inertia')}"
                )
    points = reduce(add, (_points_of(record, inertia) for record in records))
    unit = "m/s" if records[0].units["position"] == "m" else "rad/s"
    speeds = np.abs(points.velocity)
    note = (
        f"{len(points)} points of the deceleration of a coasting axis, {np.min(speeds):.3g} to {np.max(speeds):.3g} "
        f"{unit}, with the given inertia."
    )
    return points, (note,)


def _points_of(record: Record, inertia: float) -> SlidingPoints:
    axis = ServoAxis(motion="linear" if record.units["position"] == "m" else "rotary")
    rows = sliding_rows(
        [Experiment("coasting", record.time, record["position"], np.zeros(len(record)))], axis
    )
    narrow = rows.block == 0
    velocity, acceleration, stroke = rows.velocity[narrow], rows.acceleration[narrow], rows.stroke[narrow]
    _, first, number = np.unique(stroke, return_index=True, return_inverse=True)
    chosen = (np.arange(stroke.size) - first[number]) % APART == 0
    return SlidingPoints(velocity[chosen], -inertia * acceleration[chosen], offset=None)
