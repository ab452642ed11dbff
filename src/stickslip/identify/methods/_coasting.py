"""Points of a sliding curve from an axis that coasts: with the torque off, friction is what decelerates its inertia.

At every instant F(v) = -J dv/dt. Velocity and acceleration are seen through one smooth window inside gross sliding, in
the weak form: nothing is differentiated but the window (`stickslip.identify.fit.smooth`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from stickslip.errors import InputError
from stickslip.identify.experiment import TORQUES, Experiment
from stickslip.identify.fit.smooth import Window
from stickslip.identify.regression.sliding_rows import (
    WIDEST,
    Signals,
    TooLittleSliding,
    narrowest_width,
    signals_of,
    sliding_rows,
)
from stickslip.identify.sliding.points import SlidingPoints
from stickslip.machines.servo import ServoAxis
from stickslip.record import Record

APART = 3.0
"""Window widths from point to point: the noise of neighbours then correlates by exp(-9/4) = 0.1."""


def coasting_points(records: Sequence[Record], inertia: float) -> tuple[SlidingPoints, tuple[str, ...]]:
    """Return velocity and friction torque along coast-downs, and a note.

    Parameters
    ----------
    records : sequence of Record
        With positions; a torque, if there is one, is 0 throughout.
    inertia : float
        kg·m² (kg)

    Raises
    ------
    InputError
        If the inertia is not positive, a torque acts, or the axis hardly slides.
    """
    if not 0.0 < inertia < math.inf:
        raise InputError(f"--inertia {inertia:g} must be greater than 0 and finite, in kg·m² (kg)")
    for record in records:
        for channel in TORQUES:
            if channel in record.channels and np.any(record[channel] != 0.0):
                raise InputError(
                    f"--method sliding --inertia is for an axis that coasts, and {channel} is not 0 throughout; select "
                    "the coasting with --from and --to, or identify the axis with --method axis --inertia"
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
    off = np.zeros(len(record))
    signals = signals_of(Experiment("coasting", record.time, record["position"], off), axis)
    window = _window_for(signals)
    rows = sliding_rows(signals, window)
    step = math.ceil(APART * window.width / rows.spacing)
    _, place = np.unique(rows.stroke, return_index=True)
    chosen = (np.arange(rows.speed.size) - place[rows.stroke]) % step == 0
    friction = -inertia * rows.fixed[:, 0]
    return SlidingPoints(rows.speed[chosen], friction[chosen], offset=None)


def _window_for(signals: Signals) -> Window:
    """Return the narrowest window that sees the acceleration apart from noise; a steady one needs the widest."""
    try:
        width = narrowest_width(signals)
    except TooLittleSliding:
        width = WIDEST * signals.time.size * signals.period
    return Window(width, signals.period)
