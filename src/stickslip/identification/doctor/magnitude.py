"""A torque without its sign: drives can trace the magnitude, too, as torque or utilisation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_option
from stickslip.identification.doctor.physics import line_of, usable
from stickslip.identification.doctor.view import Smooth, View

BOTH = 0.1
"""Least share of the moving rows in either direction, and with either sign of acceleration, that is motion both
ways."""
TURNED, ROUNDS = 0.5, 4
"""Greatest residual, relative to that of the recorded torque, once each row has the sign that its motion requires;
number of iterations of these signs."""
REACHES, UNEXPLAINED = 0.02, 0.5
"""Part of the largest torque to which a magnitude falls when its torque changes sign; and part of the torque that a
line then explains at most: a weight that exceeds friction and acceleration is explained by more."""


def unsigned(view: View) -> Iterator[Finding]:
    """Yield a finding if the torque is never negative while the axis moves and accelerates in both directions."""
    smooth = usable(view)
    if smooth is None or view.torque_channel != "motor_torque":
        return
    torque = view.values("motor_torque")
    moving = smooth.moving
    both = (smooth.velocity[moving] > 0.0, smooth.acceleration[moving] > 0.0)
    if np.min(torque) < 0.0 or not all(BOTH < float(np.mean(way)) < 1.0 - BOTH for way in both):
        return
    plain, least = line_of(smooth), _least_rest(smooth)
    reaches = float(np.percentile(torque, 1.0)) < REACHES * float(np.max(torque))
    sure = least < TURNED * plain.rest
    if not sure and not (reaches and plain.explained < UNEXPLAINED):
        return
    name, unit = (
        view.name("current" if view.from_current else "motor_torque"),
        view.record.units["motor_torque"],
    )
    message = (
        f"{name!r} is never below 0 (0 to {np.max(torque):.4g} {unit}), though the axis moves and accelerates both "
        "ways: the magnitude, without the sign"
    )
    remedy = (
        "log the signed torque or current of the drive (its other trace, or a column that is not cut to a magnitude); "
        f"what is recorded cannot be turned into it; {name_option('accept', 'torque-magnitude')} if it has its sign"
    )
    yield Finding("error" if sure else "warning", "torque-magnitude", message, remedy=remedy)


def _least_rest(smooth: Smooth) -> float:
    """Return the residual of the torque once every row has the sign that inertia and friction require."""
    sign, least = np.sign(smooth.velocity), math.inf
    for _ in range(ROUNDS):
        signed = replace(smooth, torque=sign * smooth.torque)
        fit = line_of(signed)
        least = min(least, fit.rest)
        inertia, coulomb, viscous, offset = fit.values[:4]
        model = (
            inertia * smooth.acceleration
            + coulomb * np.sign(smooth.velocity)
            + viscous * smooth.velocity
            + offset
        )
        sign = np.where(model < 0.0, -1.0, 1.0)
    return least
