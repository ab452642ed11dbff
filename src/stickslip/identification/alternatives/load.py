"""Friction that grows with the load (gear efficiency), or a torque constant that falls with the current."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows
from stickslip.identification.strokes import SlidingRecord

Array = np.ndarray[Any, np.dtype[np.float64]]


def registry_for(model: Array, gravity: tuple[float, float]) -> tuple[Alternative, ...]:
    """Return the alternatives that depend on a first model of the torque.

    Parameters
    ----------
    model : array, shape (4,)
        Inertia, fc, sigma2 and offset of the model.
    gravity : tuple
        Sine and cosine amplitudes of a pendulum's gravity.
    """

    def inner(r: SlidingRecord) -> Array:
        angle = r.position + r.origin
        weight = gravity[0] * np.sin(angle) + gravity[1] * np.cos(angle)
        return model[0] * r.acceleration + model[3] + weight

    def torque(r: SlidingRecord) -> Array:
        return inner(r) + model[1] * r.sign + model[2] * r.velocity

    def saturated(rows: SlidingRows) -> Array:
        largest = max(float(np.max(np.abs(torque(r)))) for r in rows.records)
        return rows.see(lambda r: torque(r) ** 3) / max(largest, 1e-300) ** 2

    return (
        Alternative(
            "torque constant", saturated, "torque", present=(0.1,), of_model=True,
            cause="a torque constant that falls with the current", remedy="record smaller accelerations",
        ),
        Alternative(
            "friction with load", lambda rows: rows.see(lambda r: r.sign * np.abs(inner(r))), "torque", present=(0.2,),
            of_model=True,
            cause="friction that grows with the load", remedy="record decelerations so hard that the drive brakes",
        ),
    )  # fmt: skip
