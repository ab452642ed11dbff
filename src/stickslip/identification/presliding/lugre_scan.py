"""Scan of the misfit over LuGre's sigma0: whether the whole position of an open-loop response determines it.

If friction is not exactly LuGre's, gross sliding dominates the plain misfit of thesis 3.1.3.2.3.1: it has no minimum,
or one far from the stiffness of the sticking parts. The scan and its verdict show which.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.identification.estimate import Picture, Trace
from stickslip.identification.fit.uncertainty import Fit

Array = np.ndarray[Any, np.dtype[np.float64]]

SCAN = np.geomspace(0.02, 50.0, 18)
"""Multiples of the small-signal stiffness at which the plain position misfit is evaluated."""
FLAT = 1.1
"""Ratio of misfits below which they are not distinguished."""


def plain_scan(measured: Array, simulated: Callable[[Array], Array], found: Fit) -> Array:
    """Compute the misfit of the whole position over sigma0.

    Parameters
    ----------
    measured : array, shape (n,)
        Positions, rad.
    simulated : callable
        ``simulated(u)``: the positions at the coordinates u of ``found.vector``, rad, shape (n,).
    found : Fit
        Its sigma0 is multiplied by every factor of `SCAN`.

    Returns
    -------
    array, shape (m, 2)
        sigma0, N·m/rad, and the root mean square position error there, rad.
    """
    rows: list[tuple[float, float]] = []
    for factor in SCAN:
        values = dict(found.values, sigma0=found.values["sigma0"] * float(factor))
        position = simulated(found.vector.coordinates(values))
        rows.append((values["sigma0"], float(np.sqrt(np.mean((position - measured) ** 2)))))
    return np.array(rows)


def plain_verdict(scan: Array, sigma0: float) -> tuple[bool, str]:
    """Return whether the plain misfit has a minimum at the pre-sliding stiffness, and a sentence on it."""
    finite = scan[np.isfinite(scan[:, 1])]
    best = int(np.argmin(finite[:, 1]))
    near = finite[finite[:, 1] <= FLAT * finite[best, 1], 0]
    at_edge = best in (0, finite.shape[0] - 1)
    if at_edge:
        side = "grows" if best else "shrinks"
        return False, (
            "Plain least squares on the position does not determine sigma0 and sigma1: the misfit falls as "
            f"sigma0 {side}, to {finite[best, 1]:.3g} {axis_unit('rad')} at {finite[best, 0]:.3g} "
            f"{axis_unit('N·m/rad')}, the last value "
            "tried. Gross sliding dominates it; sigma0 comes from the pre-sliding parts, weighted for themselves."
        )
    if not (near[0] <= sigma0 <= near[-1]) or near[-1] > 2.0 * near[0]:
        return False, (
            "Plain least squares on the position does not determine sigma0 and sigma1: misfits within 10 % of "
            f"the least reach from sigma0 = {near[0]:.3g} to {near[-1]:.3g} {axis_unit('N·m/rad')}; "
            f"the pre-sliding parts say {sigma0:.3g}."
        )
    return (
        True,
        "Plain least squares on the position has its minimum at the stiffness of the pre-sliding parts too.",
    )


# ---- pictures ------------------------------------------------------------------------------------------------


def response_picture(time: Array, measured: Array, simulated: Array) -> Picture:
    """Draw measured and simulated position (thesis figures 3.12, 4.13, 4.37)."""
    error = float(np.sqrt(np.mean((simulated - measured) ** 2)))
    time, origin = time - time[0], measured[0]
    traces = (Trace("measured", time, measured - origin), Trace("LuGre", time, simulated - origin))
    return Picture(
        "lugre-response", "Open-loop response", f"Root mean square difference {1e3 * error:.3g} "
            f"m{axis_unit('rad')}", "time (s)",
        f"position ({axis_unit('rad')})", traces,
    )  # fmt: skip


def scan_picture(scan: Array, sigma0: float) -> Picture:
    """Draw the plain position misfit over sigma0, and the stiffness of the pre-sliding parts."""
    traces = (
        Trace("position misfit", scan[:, 0], scan[:, 1]),
        Trace("pre-sliding parts", np.array([sigma0]), np.array([math.nan]), "vertical"),
    )
    return Picture(
        "lugre-misfit", "What the whole position says about the stiffness",
        "A curve without a minimum near the vertical line does not determine sigma0",
        f"sigma0 ({axis_unit('N·m/rad')})", f"RMS position misfit ({axis_unit('rad')})", traces, "log",
    )  # fmt: skip
