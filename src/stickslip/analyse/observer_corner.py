"""The largest corner of an observer with which the sampled loop on a sliding axis is stable, exactly.

The loop is linearised from the text that runs (`stickslip.analyse.controller_loop`), with the axis as an inertia whose
torque is held and delayed by whole samples. It is stable if every eigenvalue is inside the unit circle. Delay and an
overestimated inertia reduce stability.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.analyse.controller_loop import linearised
from stickslip.analyse.presliding_loop import Loop
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import Drivetrain

Array = np.ndarray[Any, np.dtype[np.complex128]]
HIGHEST = 6000.0
"""Highest corner that is tried, 1/s."""
LOWEST = 10.0
STEP = 1.25
"""Ratio of successive corners, before the limit between them is found by bisection."""
DAMPING = 0.3
"""Damping ratio of every pole with the default corner."""
UNCERTAIN = (0.8, 1.0, 1.25)
"""Ratios of the inertia to the nominal one for which the default corner has this damping."""


def poles(controller: Controller, inertia: float, delay: int = 0) -> Array:
    """Return the eigenvalues of the loop from sample to sample on a sliding axis without viscous friction.

    Parameters
    ----------
    controller : Controller
    inertia : float
        Of the axis, kg·m².
    delay : int
        Delay of the torque, samples.
    """
    drive = linearised(controller, math.inf, 1.0, float(delay))
    found = np.linalg.eigvals(Loop(Drivetrain((inertia,)), drive).matrix())
    return np.asarray(found, dtype=np.complex128)


def damped(values: Array, damping: float) -> bool:
    """Whether every pole is inside the unit circle and has that damping ratio."""
    sizes = np.abs(values)
    if not float(sizes.max()) < 1.0:
        return False
    logs = np.log(np.where(sizes > 1e-12, values, 1e-12))
    return bool(np.all(-np.real(logs) >= damping * np.abs(logs)))


def largest_corner(
    made: Callable[[float], Controller], inertia: float, delay: int = 0, damping: float = 0.0
) -> float:
    """Return the corner, 1/s, below which every loop is stable, to within 1; `HIGHEST` if all are stable, 0 if none is.

    Parameters
    ----------
    made : callable
        ``made(corner)`` returns the controller.
    inertia : float
        Of the axis, kg·m².
    delay : int
        Delay of the torque, samples.
    damping : float
        Damping ratio that every pole must also have.
    """

    def holds(corner: float) -> bool:
        return damped(poles(made(corner), inertia, delay), damping)

    good, bad = 0.0, LOWEST
    while holds(bad):
        if bad == HIGHEST:
            return HIGHEST
        good, bad = bad, min(bad * STEP, HIGHEST)
    while bad - good > 1.0:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def default_corner(controller: Controller, delay: int = 0) -> float:
    """Return the largest corner of its disturbance observer, 1/s, with which every pole has a damping ratio of
    `DAMPING`.

    This is tested with the nominal inertia 25 % too high and 20 % too low. If the loop has less damping even without an
    observer, half of the stable corner is returned.

    Raises
    ------
    ParameterError
        If the controller has no disturbance observer.
    """
    part = next((p for p, b in controller.blocks.items() if b.law.name == "disturbance_observer"), "")
    if not part:
        raise ParameterError("default_corner: the controller has no disturbance_observer; give it one")
    nominal = controller.blocks[part].parameters.inertia

    def made(corner: float) -> Controller:
        return controller.with_values({f"{part}_corner": corner})

    kept = min(largest_corner(made, nominal * x, delay, DAMPING) for x in UNCERTAIN)
    return kept or 0.5 * min(largest_corner(made, nominal * x, delay) for x in UNCERTAIN)
