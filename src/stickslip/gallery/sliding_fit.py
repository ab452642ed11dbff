"""Sliding curve fitted to torques at constant velocity.

Thesis 3.1.3.1: the friction of Table 1 at the twelve velocities of eq. 3.18, and the curve of eq. 2.6 fitted to it. All
twelve points together give Table 1 back. Without the second one, at 25 mrad/s, no point is on the downward bend, and
F_S, v_s and delta_s replace each other: many curves go through the eleven points. Their spread between the points is
what the thesis shows by fits from several initial guesses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip import Model
from stickslip.identification.estimate import Identification
from stickslip.identification.steady_friction.curve import identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

Array = np.ndarray[Any, np.dtype[np.float64]]

TABLE_1: dict[str, Any] = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
PLANT = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **TABLE_1)
GUESS = Model("stribeck_plain", fs=0.5, fc=0.1, vs=0.05, delta_s=1.0, sigma2=0.005)
VELOCITIES = np.array([0.001, 0.025, 0.03, 0.04, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0])  # rad/s, eq. 3.18
FEWER = np.delete(VELOCITIES, 1)
NOISE = 1e-6  # N·m, of a point: as exact as a simulation prints it
SHOWN = 12  # curves that fit equally well
GRID = np.geomspace(5e-4, 1.2, 400)
DATA, FIT = Style("#000000", "", 1.2), Style("#0072B2", "-", 1.4)
TRUE, OTHER = Style("#000000", (0, (4, 1.2)), 1.2), Style("#E69F00", "-", 0.8)


def fitted(velocities: Array = VELOCITIES) -> Identification:
    """Fit eq. 2.6 to the plant's torque at constant velocities, rad/s."""
    points = SlidingPoints(velocities, PLANT.sliding_torque(velocities))
    return identify_sliding(points, GUESS, noise=NOISE)


def without_bend() -> Identification:
    """Fit the points without the second one."""
    return fitted(FEWER)


def equally_good(found: Identification) -> list[Model]:
    """Curves with other values of what the points do not determine."""
    family: Array = found.details["family"]
    assert found.model is not None
    names = [e.name for e in found.estimates if e.name in TABLE_1]
    rows = family[np.argsort(family[:, names.index("fs")])]
    rows = rows[np.linspace(0, len(rows) - 1, SHOWN).astype(int)]
    return [Model("stribeck_plain", **dict(zip(names, row))) for row in rows]


def picture() -> Drawn:
    """Draw the points and the curve fitted to all of them (thesis figure 3.7)."""
    found = fitted()
    values = ", ".join(f"{name} {found[name].value:.4g}" for name in TABLE_1)
    assert found.model is not None
    curve = Curve(GRID, found.model.sliding_torque(GRID), "fitted curve", FIT)
    return "Friction at constant velocity and the curve fitted to it", values, [_panel([curve])], 2.6


def picture_without_bend() -> Drawn:
    """Draw curves that fit eleven of the points equally well (thesis figure 3.8)."""
    found = without_bend()
    curves = [
        Curve(GRID, model.sliding_torque(GRID), "" if i else "fit the points equally well", OTHER)
        for i, model in enumerate(equally_good(found))
    ]
    curves.append(Curve(GRID, PLANT.sliding_torque(GRID), "true curve", TRUE))
    message = f"Without the point at 25 mrad/s {', '.join(found.not_identified)} are not determined"
    return "Inaccurate curves through points that miss the bend", message, [_panel(curves, FEWER)], 2.6


def _panel(curves: list[Curve], velocities: Array = VELOCITIES) -> Panel:
    points = Curve(velocities, PLANT.sliding_torque(velocities), "plant at constant velocity", DATA, "points")
    return Panel(
        [*curves, points], "friction torque (N·m)", "velocity (rad/s)", (GRID[0], GRID[-1]), x_scale="log"
    )
