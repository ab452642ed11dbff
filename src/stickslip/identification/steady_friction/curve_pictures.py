"""Pictures of a sliding curve: the points with the curves that fit them, and the residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Picture, Trace
from stickslip.identification.fit.uncertainty import Fit
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.torques import Torques

FAMILY = 40
"""Number of equally good curves that are drawn."""


def law_of(found: Fit) -> Any:
    """Return the fitted law."""
    assert found.vector.base is not None
    return found.vector.base.law


def listed(names: Sequence[str]) -> str:
    """Return names as a list within a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def curve_picture(points: SlidingPoints, found: Fit, settling: float | None) -> Picture:
    """Draw the points, the best curve, and curves that fit equally well (thesis figures 3.7 to 3.9, 4.33).

    Negative velocities are mirrored to the positive side, and the constant torque is subtracted; break-away torques are
    at the left edge.
    """
    fast = np.abs(points.velocity[points.velocity != 0.0])
    edge = 0.4 * float(np.min(fast))
    grid = np.geomspace(edge, 1.02 * float(np.max(fast)), 300)
    sides = {side: Torques(found.vector, side * grid, np.full(grid.size, side)) for side in (1.0, -1.0)}
    constant = found.values["offset"]
    unknown = [e.name for e in found.estimates if not e.identified] if found.noise.known else []
    shown = [s for s in sides if np.any(points.side == s)]
    best = {s: s * (sides[s].at(found.u) - constant) for s in shown}
    same = len(shown) == 2 and bool(np.allclose(best[1.0], best[-1.0], rtol=1e-9))
    traces: list[Trace] = []
    stride = max(1, found.family.shape[0] // FAMILY)
    for u in found.family[::stride] if unknown else ():
        curve = shown[0] * (sides[shown[0]].at(u) - constant)
        if np.all(np.isfinite(curve)):
            traces.append(Trace("" if traces else "equally good", grid, curve, "faint"))
    for s in shown[:1] if same else shown:
        label = "best fit" if same or len(shown) == 1 else f"best fit, v {'>' if s > 0.0 else '<'} 0"
        traces.append(Trace(label, grid, best[s]))
    for s in shown:
        rows = points.side == s
        x = np.maximum(np.abs(points.velocity[rows]), edge)
        label = "measured" if len(shown) == 1 else f"measured, v {'>' if s > 0.0 else '<'} 0"
        torque = s * (points.torque[rows] - constant)
        traces.append(Trace(label, x, torque, "points" if s > 0.0 else "open points"))
    message = "The data determine every parameter of this curve."
    if unknown:
        message = f"Not determined: {listed(unknown)}."
    elif not found.noise.known:
        message = "Noise unknown: no parameter can be reported as identified."
    if settling is not None:
        traces.append(Trace("measure here next", np.array([settling]), np.array([math.nan]), "vertical"))
        message += f" One more point at {settling:.3g} {axis_unit(points.unit[0])} would be most informative."
    if np.any(points.velocity == 0.0):
        message += " The points at the left edge are break-away torques."
    return Picture(
        "sliding", f"Sliding curve: {law_of(found).title}", message, f"velocity ({axis_unit(points.unit[0])})",
        f"friction torque ({axis_unit(points.unit[1])})", tuple(traces), "log",
    )  # fmt: skip


def residual_picture(points: SlidingPoints, found: Fit) -> Picture:
    """Draw the residuals over velocity."""
    rest = found.optimum.residuals / points.weight
    zero = np.array([float(np.min(points.velocity)), float(np.max(points.velocity))])
    traces = (Trace("", zero, 0.0 * zero), Trace("", points.velocity, rest, "points"))
    return Picture(
        "sliding-residuals", "Sliding curve: residuals", f"Root mean square {found.rms:.3g} "
            f"{axis_unit(points.unit[1])}",
        f"velocity ({axis_unit(points.unit[0])})", f"model minus measured ({axis_unit(points.unit[1])})", traces,
    )  # fmt: skip
